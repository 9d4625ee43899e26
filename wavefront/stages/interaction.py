"""The surface geometry at hits, and the origins of rays that leave surfaces."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ..accel import Intersections
from ..arrays.state import Hits, Rays, SurfaceInteraction
from ..arrays.vec import (
    ALL,
    Doubles,
    Floats,
    Ints,
    Lanes,
    dot,
    f4,
    highest,
    interpolate,
    normalize,
    signs,
    take,
)
from ..compile.scene import CompiledScene
from ..shapes.attributes import ATTRIBUTES, Corners

# o + t·d has at most three rounding errors of half an ulp (2⁻²⁴) of its terms; this is five times as much.
POINT_ERROR = f4(2**-21)
MIN_COS = f4(1e-3)  # the least cosine between wo and the shading normal
LIFT = f4(0.01)  # directions below the surface are raised to this cosine with `ng`


class Surfaces:
    """The surfaces that rays have hit. Features with a subclass change their data."""

    __slots__ = ("column", "hits", "rays", "scene")

    def __init__(self, scene: CompiledScene, rays: Rays, hits: Hits) -> None:
        self.scene, self.rays, self.hits = scene, rays, hits
        self.column: Ints | None = None  # (n,) of the `InstanceTable`; None where nothing is instanced

    @classmethod
    def hits_of(cls, scene: CompiledScene, intersections: Intersections) -> Hits:
        """Return the hits that an accelerator has found."""
        return Hits(intersections.t, intersections.prim, None, None)

    @classmethod
    def moment(cls, rays: Rays) -> tuple[Doubles, ...]:
        """Return the further arguments of an accelerator for rays, such as times: none."""
        return ()

    @classmethod
    def material_rows(cls, scene: CompiledScene, hits: Hits, lanes: Lanes) -> Ints:
        """Return the rows (k,) of the material table at some lanes of hits."""
        return scene.material_of.take(take(hits.prim, lanes))

    def interaction(self) -> SurfaceInteraction:
        """Return their geometry."""
        scene, rays, hits = self.scene, self.rays, self.hits
        point = rays.origin + rays.direction * hits.t
        error: Floats = POINT_ERROR * (highest(np.abs(point)) + hits.t)
        wo = -rays.direction
        ng, error = self.normals(point, error)
        facing = dot(ng, wo)
        side, back_facing = signs(facing), np.signbit(facing)
        front = ng * side
        ns = self.shading_normals(ng, front, side, point)
        rows = self.material_rows(scene, hits, ALL)
        surface = SurfaceInteraction(point, error, front, ns, wo, self.prims(), rows, back_facing)
        for name, corners in scene.attributes.items():
            values = self.attribute(name, corners, self.own_points(point))
            setattr(surface, name, self.vectors(values) if ATTRIBUTES[name].vectors else values)
        return surface

    def prims(self) -> Ints:
        """Return primitive ids, (n,)."""
        return self.hits.prim

    def normals(self, point: Floats, error: Floats) -> tuple[Floats, Floats]:
        """Return unit normals (3, n) of the front side, and error bounds (n,) of points (3, n).

        Points of curved primitives are moved onto the surface in place.
        """
        return normals(self.scene, self.hits.prim, point, error), error

    def shading_normals(self, ng: Floats, front: Floats, side: Floats, point: Floats) -> Floats:
        """Return shading normals (3, n) on the side of wo.

        Parameters
        ----------
        ng, front
            Normals of the surface on its front side, and on the side of wo: times `side` (n,).
        """
        return front

    def attribute(self, name: str, table: Corners, point: Floats) -> Floats:
        """Return an attribute, (c, n): interpolated on triangles, computed on curved primitives.

        Parameters
        ----------
        table
            Its values at the corners of all triangles.
        point
            (3, n) in the coordinates of curved primitives in the scene's tables.
        """
        scene, hits = self.scene, self.hits
        if scene.triangles:
            values = interpolated(self.corner_values(name, at_corners(table, hits, scene.triangles)), hits)
        else:
            values = np.empty((len(table[0]), len(hits.prim)), f4)
        round_ = np.flatnonzero(hits.prim >= scene.triangles)
        if round_.size:
            prim = hits.prim.take(round_) - scene.triangles
            values[:, round_] = ATTRIBUTES[name].on_curved(scene.curved, prim, point.take(round_, 1))
        return values

    def corner_values(self, name: str, corners: list[Floats]) -> list[Floats]:
        """Return the values of an attribute at the corners of triangles, 3 × (c, n)."""
        return corners

    def corner_normals(self, corners: list[Floats]) -> list[Floats]:
        """Return normals of vertices, 3 × (3, n), in the coordinates of the scene."""
        return corners

    def curved_normals(self, lanes: Ints, point: Floats, ng: Floats) -> Floats:
        """Return the shading normals (3, k) of lanes (k,) on curved primitives.

        Parameters
        ----------
        lanes
            Rising.
        point, ng
            (3, n) points of all lanes, and normals of the surface.
        """
        prim = self.hits.prim.take(lanes) - self.scene.triangles
        return self.scene.curved.shading(prim, self.own_points(point).take(lanes, 1), ng.take(lanes, 1))

    def own_points(self, point: Floats) -> Floats:
        """Return points (3, n) in the coordinates in which curved primitives are in the scene's tables."""
        return point

    def vectors(self, values: Floats) -> Floats:
        """Return vectors along the surfaces in the coordinates of the scene."""
        return values


@cache
def surface_kind(parts: tuple[type[Surfaces], ...]) -> type[Surfaces]:
    """Return surfaces that are all of these, the first outermost."""
    return type("Surfaces", (*parts, Surfaces), {"__slots__": ()}) if parts else Surfaces


def query(scene: CompiledScene, rays: Rays) -> tuple[Any, ...]:
    """Return the arguments of an accelerator for the nearest hits of rays."""
    moment = surface_kind(scene.program.surfaces).moment(rays)
    return rays.origin, rays.direction, rays.exclude_prim, *moment


def shadow_query(scene: CompiledScene, rays: Rays, length: Floats) -> tuple[Any, ...]:
    """Return the arguments of an accelerator for whether anything blocks rays over some lengths (n,)."""
    moment = surface_kind(scene.program.surfaces).moment(rays)
    return rays.origin, rays.direction, length, rays.exclude_prim, *moment


def interaction(scene: CompiledScene, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Return the surface geometry at hits; every ray must have hit a surface, or be scattered by a medium."""
    return surface_kind(scene.program.surfaces)(scene, rays, hits).interaction()


def material_rows(scene: CompiledScene, hits: Hits, lanes: Lanes) -> Ints:
    """Return the rows (k,) of the material table at some lanes of the hits."""
    return surface_kind(scene.program.surfaces).material_rows(scene, hits, lanes)


def normals(scene: CompiledScene, prim: Ints, point: Floats, error: Floats) -> Floats:
    """Return the unit geometric normals (3, n) of the front side at points on primitives.

    Points of curved primitives are moved onto the surface, and their error bounds (n,) corrected, in place.
    """
    if not scene.curved.kinds:
        return scene.normals.take(prim, 1)
    if not scene.triangles:
        return scene.curved.surface(prim, point, error)
    ng = scene.normals.take(np.minimum(prim, scene.triangles - 1), 1)
    round_ = np.flatnonzero(prim >= scene.triangles)
    if round_.size:
        on, bound = point.take(round_, 1), error.take(round_)
        ng[:, round_] = scene.curved.surface(prim.take(round_) - scene.triangles, on, bound)
        point[:, round_], error[round_] = on, bound
    return ng


def origin_above(surface: SurfaceInteraction) -> Floats:
    """Return the origins (3, n) of rays that leave a surface on the side of wo."""
    return surface.point + surface.ng * surface.error


def offset_origin(surface: SurfaceInteraction, cos: Floats) -> Floats:
    """Return the origins (3, n) of rays that leave a surface.

    Points are moved off the surface by their error bounds, to the side that the sign of `cos` (n,) gives,
    the cosine between the rays and `ng`.
    """
    return surface.point + surface.ng * (surface.error * signs(cos))


def face_viewer(wo: Floats, ns: Floats) -> Floats:
    """Bend shading normals (3, n) that face away from wo, in place, to a positive cosine with wo."""
    cos = dot(ns, wo)
    away = np.flatnonzero(cos < MIN_COS)
    if away.size:
        ns[:, away] = normalize(ns.take(away, 1) + wo.take(away, 1) * (MIN_COS - cos.take(away)))
        ns[:, away] = normalize(ns.take(away, 1) + wo.take(away, 1) * MIN_COS)
    return ns


def at_corners(table: Corners, hits: Hits, triangles: int) -> list[Floats]:
    """Return the values at the corners of hit triangles, 3 × (c, n); those of any triangle for others."""
    prim = np.minimum(hits.prim, triangles - 1)
    return [corner.take(prim, 1) for corner in table]


def interpolated(corners: list[Floats], hits: Hits) -> Floats:
    """Return values (c, n) on triangles, given those at their corners, 3 × (c, n)."""
    a, b, c = corners
    assert hits.b1 is not None
    assert hits.b2 is not None
    return interpolate(a, b, c, hits.b1, hits.b2)

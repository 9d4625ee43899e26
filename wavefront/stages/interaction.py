"""The surface geometry at hits, and the origins of rays that leave surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays.state import Hits, Paths, Rays, SurfaceInteraction
from ..arrays.vec import (
    ALL,
    Floats,
    Ints,
    Lanes,
    dot,
    f4,
    highest,
    interpolate,
    length,
    normalize,
    signs,
    take,
)
from ..compile.instances import InstanceTable
from ..compile.scene import CompiledScene
from ..shapes.attributes import ATTRIBUTES, Corners

# o + t·d has at most three rounding errors of half an ulp (2⁻²⁴) of its terms; this is five times as much.
POINT_ERROR = f4(2**-21)
MIN_COS = f4(1e-3)  # the least cosine between wo and the shading normal
LIFT = f4(0.01)  # directions below the surface are raised to this cosine with `ng`


def interaction(scene: CompiledScene, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Return the surface geometry at hits; every ray must have hit a surface, or be scattered by a medium.

    In a medium the normal is the direction that the light leaves in, and there is no primitive.
    """
    if scene.media is None:
        return _on_surfaces(scene, rays, hits)
    surface = _on_surfaces(scene, rays, replace(hits, prim=np.maximum(hits.prim, 0)))
    lanes = np.flatnonzero(hits.prim < 0)
    if lanes.size:
        wo = take(surface.wo, lanes)
        surface.point[:, lanes] = take(rays.origin, lanes) - wo * hits.t.take(lanes)
        surface.error[lanes], surface.back_facing[lanes] = 0, False
        surface.ng[:, lanes] = surface.ns[:, lanes] = wo
        surface.prim[lanes], surface.material[lanes] = -1, material_rows(scene, hits, lanes)
    return surface


def _on_surfaces(scene: CompiledScene, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Return the surface geometry at hits on surfaces."""
    point = rays.origin + rays.direction * hits.t
    instances = _instances_of(scene, hits)
    error: Floats = POINT_ERROR * (highest(np.abs(point)) + hits.t)
    wo = -rays.direction
    ng = normals(scene, hits.prim, point, error)
    if instances is not None:
        ng, error = _normals_to_scene(instances, hits, ng, error)
    ns = _shading_normals(scene, hits, instances, ng, point)
    facing = dot(ng, wo)
    side, back_facing = signs(facing), np.signbit(facing)
    ng = ng * side
    ns = ng if ns is None else face_viewer(wo, ns * side)
    prim = hits.prim if instances is None else hits.prim + instances.shift
    surface = SurfaceInteraction(point, error, ng, ns, wo, prim, material_rows(scene, hits, ALL), back_facing)
    if scene.materials.dispersive and isinstance(rays, Paths):
        surface.throughput = rays.throughput
    for name, corners in scene.attributes.items():
        values = _attribute(scene, name, corners, hits, point)
        if instances is not None and ATTRIBUTES[name].vectors:
            values = instances.vectors_to_scene(values)
        setattr(surface, name, values)
    return surface


def _instances_of(scene: CompiledScene, hits: Hits) -> InstanceTable | None:
    """Return the instance data of each hit; None in a scene without instances."""
    if scene.instances is None or hits.instance is None:
        return None
    return scene.instances.take(hits.instance)


def _normals_to_scene(
    instances: InstanceTable, hits: Hits, ng: Floats, error: Floats
) -> tuple[Floats, Floats]:
    """Transform unit normals of meshes to the scene, and enlarge the errors (n,) of hit points.

    The ray of an instance was rounded once more, in the mesh's coordinates: its direction, and its origin,
    whose distance there is at most t and the mesh's radius together. Division by the length of the
    transformed normal converts a length along the normal from these coordinates to the scene.
    """
    ng = instances.normals_to_scene(ng)
    size = length(ng)
    size = np.where(size > 0, size, f4(1))
    return ng / size, error + POINT_ERROR * (instances.radius + hits.t) / size


def material_rows(scene: CompiledScene, hits: Hits, lanes: Lanes) -> Ints:
    """Return the rows (k,) of the material table at some lanes of the hits."""
    material = scene.material_of.take(take(hits.prim, lanes))
    if scene.instances is None or scene.instances.material is None or hits.instance is None:
        return material
    replaced = scene.instances.material.take(take(hits.instance, lanes))
    return np.where(replaced >= 0, replaced, material)


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


def _shading_normals(
    scene: CompiledScene, hits: Hits, instances: InstanceTable | None, ng: Floats, point: Floats
) -> Floats | None:
    """Return the shading normals, (3, n); None where they are those of the surface in all of the scene."""
    if not scene.shading_normals:
        return None
    ns = _interpolated_normals(scene, hits, instances, ng)
    round_ = np.flatnonzero(hits.prim >= scene.triangles)
    if scene.curved.shading_normals and round_.size:
        prim = hits.prim.take(round_) - scene.triangles
        ns[:, round_] = scene.curved.shading(prim, point.take(round_, 1), ng.take(round_, 1))
    return ns


def _interpolated_normals(
    scene: CompiledScene, hits: Hits, instances: InstanceTable | None, ng: Floats
) -> Floats:
    """Return the interpolated vertex normals, (3, n), and `ng` where there are none."""
    if scene.corner_normals is None:
        return ng.copy()
    corners = _at_corners(scene.corner_normals, hits, scene.triangles)
    if instances is not None:
        # Each is normalized, as in a mesh of its own: a skewed transform changes their lengths.
        corners = [normalize(instances.normals_to_scene(corner)) for corner in corners]
    ns = normalize(_interpolate(corners, hits))
    flat = (hits.prim >= scene.triangles) | ~(dot(ns, ng) > 0)
    np.copyto(ns, ng, where=flat)
    return ns


def _attribute(scene: CompiledScene, name: str, corners: Corners, hits: Hits, point: Floats) -> Floats:
    """Return an attribute at hits, (c, n): interpolated on triangles, computed on curved primitives."""
    if scene.triangles:
        values = _interpolate(_at_corners(corners, hits, scene.triangles), hits)
    else:
        values = np.empty((len(corners[0]), len(hits.prim)), f4)
    round_ = np.flatnonzero(hits.prim >= scene.triangles)
    if round_.size:
        prim = hits.prim.take(round_) - scene.triangles
        values[:, round_] = ATTRIBUTES[name].on_curved(scene.curved, prim, point.take(round_, 1))
    return values


def _at_corners(table: Corners, hits: Hits, triangles: int) -> list[Floats]:
    """Return the values at the corners of hit triangles, 3 × (c, n); those of any triangle for others."""
    prim = np.minimum(hits.prim, triangles - 1)
    return [corner.take(prim, 1) for corner in table]


def _interpolate(corners: list[Floats], hits: Hits) -> Floats:
    a, b, c = corners
    assert hits.b1 is not None
    assert hits.b2 is not None
    return interpolate(a, b, c, hits.b1, hits.b2)

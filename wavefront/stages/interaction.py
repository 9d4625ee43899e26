"""From a hit to the geometry of the surface there, and off it again."""

from __future__ import annotations

import numpy as np

from ..compile.instances import InstanceTable
from ..compile.scene import CompiledScene
from ..shapes.attributes import ATTRIBUTES, Corners
from ..state import Hits, Rays, SurfaceInteraction
from ..vec import ALL, Floats, Ints, Lanes, dot, f4, highest, interpolate, length, normalize, signs, take

# o + t·d carries at most three roundings of half an ulp (2⁻²⁴) of its terms; this is five times that.
POINT_ERROR = f4(2**-21)
MIN_COS = f4(1e-3)  # the least cosine between wo and the shading normal
LIFT = f4(0.01)  # the cosine against `ng` to which directions that lead below the surface are raised


def interaction(scene: CompiledScene, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Gather the geometry at hits; every ray must have one."""
    point = rays.origin + rays.direction * hits.t
    placed = _places(scene, hits)
    error: Floats = POINT_ERROR * (highest(np.abs(point)) + hits.t)
    wo = -rays.direction
    ng = normals(scene, hits.prim, point)
    if placed is not None:
        ng, error = _turned(placed, hits, ng, error)
    ns = _shading_normals(scene, hits, placed, ng)
    facing = dot(ng, wo)
    side, back_facing = signs(facing), np.signbit(facing)
    ng = ng * side
    ns = ng if ns is None else towards(wo, ns * side)
    prim = hits.prim if placed is None else hits.prim + placed.shift
    surface = SurfaceInteraction(point, error, ng, ns, wo, prim, material_rows(scene, hits, ALL), back_facing)
    for name, corners in scene.attributes.items():
        values = _attribute(scene, name, corners, hits, point)
        if placed is not None and ATTRIBUTES[name].vectors:
            values = placed.stretch(values)
        setattr(surface, name, values)
    return surface


def _places(scene: CompiledScene, hits: Hits) -> InstanceTable | None:
    """Where the hit meshes stand, a column per hit; None in a scene without instances."""
    if scene.instances is None or hits.instance is None:
        return None
    return scene.instances.take(hits.instance)


def _turned(placed: InstanceTable, hits: Hits, ng: Floats, error: Floats) -> tuple[Floats, Floats]:
    """Turn unit normals of meshes into the scene's, and enlarge the errors (n,) of hit points.

    On an instance the ray was rounded once more, in the mesh's frame: its origin, which is no further
    away there than the mesh reaches and t together, and its direction. Lengths along a normal come
    from that frame into the scene by division by the length of the turned normal.
    """
    ng = placed.turn(ng)
    size = length(ng)
    size = np.where(size > 0, size, f4(1))
    return ng / size, error + POINT_ERROR * (placed.reach + hits.t) / size


def material_rows(scene: CompiledScene, hits: Hits, lanes: Lanes) -> Ints:
    """Rows (k,) of the material table that some lanes of the hits have."""
    material = scene.material_of.take(take(hits.prim, lanes))
    if scene.instances is None or scene.instances.material is None or hits.instance is None:
        return material
    replaced = scene.instances.material.take(take(hits.instance, lanes))
    return np.where(replaced >= 0, replaced, material)


def normals(scene: CompiledScene, prim: Ints, point: Floats) -> Floats:
    """Unit geometric normals (3, n) of the front side at points on primitives.

    Points on spheres are moved onto the sphere, in place.
    """
    if not len(scene.sphere_radii):
        return scene.normals.take(prim, 1)
    if not scene.triangles:
        return _onto_sphere(scene, prim, point)
    ng = scene.normals.take(np.minimum(prim, scene.triangles - 1), 1)
    round_ = np.flatnonzero(prim >= scene.triangles)
    if round_.size:
        on = point.take(round_, 1)
        ng[:, round_] = _onto_sphere(scene, prim.take(round_) - scene.triangles, on)
        point[:, round_] = on
    return ng


def above(surface: SurfaceInteraction) -> Floats:
    """Origins (3, n) of rays that leave a surface to the side of wo."""
    return surface.point + surface.ng * surface.error


def leave(surface: SurfaceInteraction, cos: Floats) -> Floats:
    """Origins (3, n) of rays that leave a surface: moved off it, to a side, by the points' errors.

    `cos` (n,) is the cosine between the rays and `ng`.
    """
    return surface.point + surface.ng * (surface.error * signs(cos))


def towards(wo: Floats, ns: Floats) -> Floats:
    """Bend shading normals that look away from wo until they make a small positive cosine with it."""
    cos = dot(ns, wo)
    away = np.flatnonzero(cos < MIN_COS)
    if away.size:
        ns[:, away] = normalize(ns.take(away, 1) + wo.take(away, 1) * (MIN_COS - cos.take(away)))
        ns[:, away] = normalize(ns.take(away, 1) + wo.take(away, 1) * MIN_COS)
    return ns


def _onto_sphere(scene: CompiledScene, sphere: Ints, point: Floats) -> Floats:
    center = scene.sphere_centers.take(sphere, 1)
    normal = normalize(point - center)
    np.add(center, normal * scene.sphere_radii.take(sphere), out=point)
    return normal


def _shading_normals(
    scene: CompiledScene, hits: Hits, placed: InstanceTable | None, ng: Floats
) -> Floats | None:
    """Interpolate the corners' normals, (3, n); None when the scene has only flat facets."""
    if scene.corner_normals is None:
        return None
    corners = _at_corners(scene.corner_normals, hits, scene.triangles)
    if placed is not None:
        # each by itself, as a mesh of its own would have them: a skewed transform changes their lengths
        corners = [normalize(placed.turn(corner)) for corner in corners]
    ns = normalize(_interpolate(corners, hits))
    flat = (hits.prim >= scene.triangles) | ~(dot(ns, ng) > 0)
    np.copyto(ns, ng, where=flat)
    return ns


def _attribute(scene: CompiledScene, name: str, corners: Corners, hits: Hits, point: Floats) -> Floats:
    """Return what varies over shapes at hits: interpolated on triangles, computed on spheres."""
    if scene.triangles:
        values = _interpolate(_at_corners(corners, hits, scene.triangles), hits)
    else:
        values = np.empty((len(corners[0]), len(hits.prim)), f4)
    round_ = np.flatnonzero(hits.prim >= scene.triangles)
    if round_.size:
        sphere = hits.prim.take(round_) - scene.triangles
        normal = normalize(point.take(round_, 1) - scene.sphere_centers.take(sphere, 1))
        values[:, round_] = ATTRIBUTES[name].on_spheres(normal, scene.sphere_radii.take(sphere))
    return values


def _at_corners(table: Corners, hits: Hits, triangles: int) -> list[Floats]:
    """Gather the values at the corners of the triangles hit, 3 × (c, n); any triangle's on spheres."""
    prim = np.minimum(hits.prim, triangles - 1)
    return [corner.take(prim, 1) for corner in table]


def _interpolate(corners: list[Floats], hits: Hits) -> Floats:
    a, b, c = corners
    assert hits.b1 is not None
    assert hits.b2 is not None
    return interpolate(a, b, c, hits.b1, hits.b2)

"""From a hit to the geometry of the surface there, and off it again."""

from __future__ import annotations

import numpy as np

from ..scene import CompiledScene
from ..shapes.attributes import ATTRIBUTES, Corners
from ..state import Hits, Rays, Surface
from ..vec import Floats, Ints, dot, f4, normalize

# o + t·d carries at most three roundings of half an ulp (2⁻²⁴) of its terms; this is five times that.
POINT_ERROR = f4(2**-21)
MIN_COS = f4(1e-3)  # the least cosine between wo and the shading normal


def interact(scene: CompiledScene, rays: Rays, hits: Hits) -> Surface:
    """Gather the geometry at hits; every ray must have one."""
    point = rays.origin + rays.direction * hits.t
    error = POINT_ERROR * (np.abs(point).max(0) + hits.t)
    wo = -rays.direction
    ng = normals(scene, hits.prim, point)
    ns = _shading_normals(scene, hits, ng)
    facing = dot(ng, wo)
    inside = facing < 0
    side = np.where(inside, f4(-1), f4(1))
    ng = ng * side
    ns = ng if ns is None else towards(wo, ns * side)
    material = scene.material_of.take(hits.prim)
    surface = Surface(point, error, ng, ns, wo, hits.prim, material, inside)
    for name, corners in scene.attributes.items():
        setattr(surface, name, _attribute(scene, name, corners, hits, point))
    return surface


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


def leave(point: Floats, error: Floats, ng: Floats, wi: Floats) -> Floats:
    """Origins (3, n) of rays that leave a surface along wi: moved off it by the point's error (n,)."""
    return point + ng * np.copysign(error, dot(ng, wi))


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


def _shading_normals(scene: CompiledScene, hits: Hits, ng: Floats) -> Floats | None:
    """Interpolate the corners' normals, (3, n); None when the scene has only flat facets."""
    if scene.corner_normals is None:
        return None
    ns = normalize(_interpolate(scene.corner_normals, hits, scene.triangles))
    flat = (hits.prim >= scene.triangles) | ~(dot(ns, ng) > 0)
    np.copyto(ns, ng, where=flat)
    return ns


def _attribute(scene: CompiledScene, name: str, corners: Corners, hits: Hits, point: Floats) -> Floats:
    """Return what varies over shapes at hits: interpolated on triangles, computed on spheres."""
    if scene.triangles:
        values = _interpolate(corners, hits, scene.triangles)
    else:
        values = np.empty((len(corners[0]), len(hits.prim)), f4)
    round_ = np.flatnonzero(hits.prim >= scene.triangles)
    if round_.size:
        sphere = hits.prim.take(round_) - scene.triangles
        normal = normalize(point.take(round_, 1) - scene.sphere_centers.take(sphere, 1))
        values[:, round_] = ATTRIBUTES[name].on_spheres(normal, scene.sphere_radii.take(sphere))
    return values


def _interpolate(corners: Corners, hits: Hits, triangles: int) -> Floats:
    prim = np.minimum(hits.prim, triangles - 1)
    a, b, c = (corner.take(prim, 1) for corner in corners)
    return a * (f4(1) - hits.b1 - hits.b2) + b * hits.b1 + c * hits.b2

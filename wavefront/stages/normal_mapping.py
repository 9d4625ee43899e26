"""Shading normals perturbed by normal maps and bump maps, and scattering around them.

A BSDF around a perturbed normal scatters light to below the surface. There it is folded: mirrored at the
surface, as if it met a mirror that lies flat. So no light is lost. With M the mirror image at the surface,
and for wi that is on the same side of the surface as of the perturbed normal,

    f'(wo, wi) cos(wi) = f(wo, wi) cos(wi) + f(wo, M wi) cos(M wi)

where the second term counts if M wi is on the wrong side of the surface; and the density likewise. M keeps
solid angles, so that f' scatters as much to the right side as f does to both.
"""

from __future__ import annotations

import numpy as np

from ..arrays.frame import Frame
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import TINY, Floats, Ints, dot, f4, normalize, take
from ..compile.scene import CompiledScene
from .interaction import LIFT, face_viewer

SHALLOWER = f4(0.9)  # reflected directions are raised to at most this part of wo's cosine with `ng`


def perturb_normals(scene: CompiledScene, surface: SurfaceInteraction) -> None:
    """Apply, in place, the normal maps and bump maps of materials to the shading normals."""
    materials = scene.materials
    if any(normal_map.shadows_grazing for normal_map in materials.normal_maps):
        surface.unmapped = surface.ns
    surface.ns = surface.ns.copy()  # it may be ng itself
    if any(normal_map.folds_light for normal_map in materials.normal_maps):
        surface.folds = np.zeros(len(surface), np.bool_)
    normal_map_of = materials.normal_map_of.take(surface.material)
    for number, normal_map in enumerate(materials.normal_maps):
        lanes = np.flatnonzero(normal_map_of == number)
        if not lanes.size:
            continue
        points = surface.take(lanes)
        side = np.where(points.back_facing, f4(-1), f4(1))
        which, normal = normal_map.perturbed(points, points.ns * side)
        normal *= side.take(which)
        wo, ng, smooth = (v.take(which, 1) for v in (points.wo, points.ng, points.ns))
        if normal_map.mirrors_hidden:
            valid = mirror_hidden(wo, smooth, normal)
        else:
            valid = ensure_valid_reflection(wo, ng, smooth, normal)
        if normal_map.folds_light and surface.folds is not None:
            surface.folds[lanes.take(which)] = True
        surface.ns[:, lanes.take(which)] = valid
        if surface.unmapped is not None and not normal_map.shadows_grazing:
            surface.unmapped = surface.unmapped.copy()
            surface.unmapped[:, lanes] = surface.ns[:, lanes]


def mirror_hidden(wo: Floats, smooth: Floats, perturbed: Floats) -> Floats:
    """Return perturbed normals (3, n), turned by half a turn about `smooth` where they face away from wo.

    As `flip_invalid_normals` of Mitsuba 3 does.
    """
    away = np.flatnonzero(dot(wo, perturbed) <= 0)
    normal, axis = perturbed.take(away, 1), smooth.take(away, 1)
    perturbed[:, away] = axis * (f4(2) * dot(normal, axis)) - normal
    return face_viewer(wo, perturbed)


def ensure_valid_reflection(wo: Floats, ng: Floats, smooth: Floats, perturbed: Floats) -> Floats:
    """Return perturbed normals (3, n) about which wo is reflected to above the geometric surface.

    Where the cosine of the reflected direction with `ng` would be below `LIFT`, the direction is raised to
    that cosine, and the half vector of it and wo becomes the normal: a mirror has no black facets, and rough
    reflection loses little energy. The cosine is not raised above that of a reflection about `smooth`, the
    normal without the map, so that a weak map changes little. Other directions below the surface are folded.

    Source: A. Keller et al. 2017, "The Iray Light Transport Simulation and Rendering System",
    arXiv:1705.01263, appendix A.3. Here directions are raised along the geometric normal, because the
    perturbed one may point below the surface, and to the cosine that Blender's Cycles uses.
    """
    perturbed = face_viewer(wo, perturbed)
    wo_cos = dot(wo, ng)
    unmapped = f4(2) * dot(smooth, wo) * dot(smooth, ng) - wo_cos
    least = np.minimum(np.minimum(SHALLOWER * wo_cos, LIFT), unmapped)
    mirrored = perturbed * (f4(2) * dot(perturbed, wo)) - wo
    missing = least - dot(mirrored, ng)
    low = np.flatnonzero(missing > 0)
    if low.size:
        raised = normalize(mirrored.take(low, 1) + ng.take(low, 1) * missing.take(low))
        perturbed[:, low] = normalize(raised + wo.take(low, 1))
    return face_viewer(wo, perturbed)  # against rounding errors where wo grazes the surface


def mirrored_at_surface(ng: Floats, wi: Floats) -> Floats:
    """Return the mirror images (3, n) of directions at surfaces with unit normals ng (3, n)."""
    return wi - ng * (f4(2) * dot(ng, wi))


def folded_onto(surface: SurfaceInteraction, frame: Frame, wi: Floats) -> tuple[Ints, Floats]:
    """Return the lanes (k,) where another local direction is folded onto wi (3, n), and which: (3, k).

    Both are then on the same side of the perturbed normal, and `wi` makes the larger cosine with it.
    """
    assert surface.folds is not None
    ng = frame.to_local(surface.ng)
    other, side = mirrored_at_surface(ng, wi), dot(ng, wi)
    lanes = np.flatnonzero(surface.folds & (wi[2] * side > 0) & (other[2] * side > 0))
    return lanes, take(other, lanes)


def unshadowed(surface: SurfaceInteraction, world: Floats) -> Floats:
    """Return the part (n,) of light along world directions (3, n) that tilted normals do not shadow.

    It is the shadowing of GGX facets with α² = tan²θ/8, at most 1, of normals tilted by θ.

    Source: A. Conty Estevez, P. Lecocq and C. Stein, "A Microfacet-Based Shadowing Function to Solve the Bump
    Terminator Problem", Ray Tracing Gems, 2019, chapter 12, with the constants of Mitsuba 3.
    """
    assert surface.unmapped is not None
    alpha2 = np.minimum(f4(0.125) * _squared_tangent(dot(surface.unmapped, surface.ns)), f4(1))
    return f4(2) / (f4(1) + np.sqrt(f4(1) + alpha2 * _squared_tangent(dot(surface.unmapped, world))))


def _squared_tangent(cos: Floats) -> Floats:
    cos2 = cos * cos
    return np.maximum(f4(1) - cos2, f4(0)) / np.maximum(cos2, TINY)

"""Ray queries of the stages: nearest hits and shadow rays."""

from __future__ import annotations

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays, SurfaceInteraction
from ..arrays.vec import Bools, Floats, Ints, f4, positive, take
from ..compile.scene import CompiledScene
from ..lights import LightSample
from ..sampling.steps import StepNumbers
from .interaction import query, shadow_query, surface_kind

TARGET_ERROR = f4(2**-20)  # rounding of a sampled point on a light, relative to its distance


@soa
class ShadowRays(Rays):
    """Rays from points towards sampled points on lights."""

    error: Floats  # (n,) bound on the rounding error of the points that they start from, scene units
    distance: Floats  # (n,) to the sampled point, scene units; inf for a light at infinity
    cos_light: Floats  # (n,) cosine between the ray and the light's normal; 1 where it has none
    steps: StepNumbers | None = None  # for media that need them
    goal: Ints | None = None  # (n,) medium in which the light is, -1 for none; None where none is in one


def intersect(scene: CompiledScene, rays: Rays) -> Hits:
    """Return the nearest hit of each ray."""
    intersections = scene.accelerator.closest(*query(scene, rays))
    return surface_kind(scene.program.surfaces).hits_of(scene, intersections)


def shadow_rays(surface: SurfaceInteraction, origin: Floats, light: LightSample, lanes: Ints) -> ShadowRays:
    """Return rays from some points to the sampled points on their lights.

    Parameters
    ----------
    surface, origin, light
        n points, the origins (3, n) of rays that leave them, and a light sample for each point.
    lanes
        (k,) the columns that get a ray.
    """
    return ShadowRays(
        origin=take(origin, lanes),
        direction=take(light.wi, lanes),
        exclude_prim=take(surface.prim, lanes),
        error=take(surface.error, lanes),
        distance=take(light.distance, lanes),
        cos_light=take(light.cos_light, lanes),
    )


def visible(scene: CompiledScene, rays: ShadowRays) -> Bools:
    """Return a mask (k,) of the shadow rays that nothing blocks."""
    return ~scene.accelerator.occluded(*shadow_query(scene, rays, shadow_ray_length(rays)))


def shadow_ray_length(rays: ShadowRays) -> Floats:
    """Return the lengths (n,) of shadow rays, which end just before the light.

    The error bounds of both end points are subtracted, divided by the cosine between the ray and the
    light's normal.
    """
    grazing = f4(1) / np.clip(rays.cos_light, f4(2) * TARGET_ERROR, f4(1))
    return positive(rays.distance * (f4(1) - TARGET_ERROR * grazing) - f4(2) * rays.error * grazing)

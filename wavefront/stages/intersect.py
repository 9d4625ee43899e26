"""Where rays meet surfaces."""

from __future__ import annotations

import numpy as np

from ..compile.scene import CompiledScene
from ..lights import LightSample
from ..record import record
from ..state import Hits, Rays, SurfaceInteraction
from ..vec import Bools, Floats, Ints, f4, positive, take

TARGET_ERROR = f4(2**-20)  # rounding of a sampled point on a light, relative to its distance


@record
class ShadowRays(Rays):
    """Rays from points towards sampled points on lights."""

    error: Floats  # (n,) bound on the rounding error of where they start, scene units
    distance: Floats  # (n,) to the sampled point, scene units; inf for a light at infinity
    cos_light: Floats  # (n,) cosine between the ray and the light's normal; 1 where it has none


def intersect(scene: CompiledScene, rays: Rays) -> Hits:
    """Find what each ray meets first."""
    found = scene.accelerator.closest(rays.origin, rays.direction, rays.exclude_prim)
    hits = Hits(found.t, found.prim, None, None)
    if scene.interpolates:
        hits.b1, hits.b2 = found.b1, found.b2
    if scene.instances is not None:
        hits.prim, hits.instance = scene.instances.locate(found.prim)
    return hits


def shadow_rays(surface: SurfaceInteraction, origin: Floats, light: LightSample, lanes: Ints) -> ShadowRays:
    """Return rays from some points to the sampled points on their lights.

    Parameters
    ----------
    surface, origin, light
        n points, where rays from there start, (3, n), and the samples drawn at the points.
    lanes
        (k,) columns of these that get a ray.
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
    """Tell whether nothing stands between points and the sampled points on their lights, (k,)."""
    return ~scene.accelerator.occluded(rays.origin, rays.direction, reach(rays), rays.exclude_prim)


def reach(rays: ShadowRays) -> Floats:
    """Length (n,) of shadow rays, which end just before the light.

    Both ends are off by a known error; along a ray that meets the light's surface under a small
    cosine an error is 1/cosine times as long.
    """
    grazing = f4(1) / np.clip(rays.cos_light, f4(2) * TARGET_ERROR, f4(1))
    return positive(rays.distance * (f4(1) - TARGET_ERROR * grazing) - f4(2) * rays.error * grazing)

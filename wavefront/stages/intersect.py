"""Where rays meet surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..lights import LightSample
from ..scene import CompiledScene
from ..state import Hits, Rays, Surface
from ..vec import Bools, Floats, Ints, f4, positive
from .surface import leave

TARGET_ERROR = f4(2**-20)  # rounding of a sampled point on a light, relative to its distance


@dataclass(slots=True)
class ShadowRays(Rays):
    """Rays from points towards sampled points on lights."""

    error: Floats  # (n,) bound on the rounding error of where they start, scene units
    distance: Floats  # (n,) to the sampled point, scene units; inf for a light at infinity
    cos_light: Floats  # (n,) cosine between the ray and the light's normal; 1 where it has none


def intersect(scene: CompiledScene, rays: Rays) -> Hits:
    """Find what each ray meets first."""
    found = scene.accelerator.closest(rays.origin, rays.direction, rays.leaving)
    if scene.instances is None:
        return Hits(found.t, found.prim, found.b1, found.b2)
    row, place = scene.instances.locate(found.prim)
    return Hits(found.t, row, found.b1, found.b2, place)


def shadow_rays(surface: Surface, start: Floats, lanes: Ints, light: LightSample, cos: Floats) -> ShadowRays:
    """Return rays from points to the sampled points on their lights.

    Parameters
    ----------
    surface, start
        n points, and where rays start that leave them to the side of wo, (3, n).
    lanes
        (k,) columns of these that the k columns of `light` belong to.
    cos
        (k,) cosines between the rays and the surfaces' geometric normals.
    """
    origin = start.take(lanes, 1)
    through = np.flatnonzero(cos < 0)
    if through.size:
        origin[:, through] = leave(surface.take(lanes.take(through)), cos.take(through))
    leaving, error = surface.prim.take(lanes), surface.error.take(lanes)
    return ShadowRays(origin, light.wi, leaving, error, light.distance, light.cos_light)


def visible(scene: CompiledScene, rays: ShadowRays) -> Bools:
    """Tell whether nothing stands between points and the sampled points on their lights, (k,)."""
    return ~scene.accelerator.occluded(rays.origin, rays.direction, reach(rays), rays.leaving)


def reach(rays: ShadowRays) -> Floats:
    """Length (n,) of shadow rays, which end just before the light.

    Both ends are off by a known error; along a ray that meets the light's surface under a small
    cosine an error is 1/cosine times as long.
    """
    grazing = f4(1) / np.clip(rays.cos_light, f4(2) * TARGET_ERROR, f4(1))
    return positive(rays.distance * (f4(1) - TARGET_ERROR * grazing) - f4(2) * rays.error * grazing)

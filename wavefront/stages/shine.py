"""What surfaces that do not shine evenly send: from points that rays meet, and from sampled points."""

from __future__ import annotations

import numpy as np

from ..lights import TriangleLights
from ..scene import CompiledScene
from ..state import Hits, Rays
from ..vec import Floats, Ints
from .intersect import ShadowRays
from .surface import interact


def shine_at_hits(scene: CompiledScene, rays: Rays, hits: Hits, light: Ints, radiance: Floats) -> None:
    """Set the radiance (3, n) of hits on lights numbered `light` (n,), in place, where it varies."""
    assert scene.uneven is not None
    lanes = np.flatnonzero(scene.uneven.triangle.take(light) >= 0)
    if lanes.size:
        surface = interact(scene, rays.take(lanes), hits.take(lanes))
        radiance[:, lanes] = scene.uneven.radiance(light.take(lanes), surface)


def shine_at_samples(
    scene: CompiledScene, rays: ShadowRays, light: Ints, u: Floats, radiance: Floats
) -> Floats:
    """Return the radiance (3, n) of sampled points on lights numbered `light` (n,), changed where it varies.

    A light that is only partly there sends as much less: paths meet it less often.

    Parameters
    ----------
    rays
        From points to the sampled points.
    u
        (2, n) the random numbers that the points were sampled with.
    """
    assert scene.uneven is not None
    triangle = scene.uneven.triangle.take(light)
    lanes = np.flatnonzero(triangle >= 0)
    if lanes.size:
        radiance = radiance.copy()
        some, number = rays.take(lanes), light.take(lanes)
        b1, b2 = TriangleLights.weights(u.take(lanes, 1))
        surface = interact(scene, some, Hits(some.distance, triangle.take(lanes), b1, b2))
        radiance[:, lanes] = scene.uneven.radiance(number, surface)
        if scene.opacities is not None:
            radiance[:, lanes] *= scene.opacities.at(surface)
    return radiance

"""What surfaces that do not shine evenly send: from points that rays meet, and from sampled points."""

from __future__ import annotations

import numpy as np

from ..compile.scene import CompiledScene
from ..lights import TriangleLights
from ..state import Hits, Rays
from ..vec import Floats, Ints
from .interaction import interaction
from .intersect import ShadowRays


def emission_at_hits(scene: CompiledScene, rays: Rays, hits: Hits, light: Ints, radiance: Floats) -> None:
    """Set the radiance (3, n) of hits on lights numbered `light` (n,), in place, where it varies."""
    assert scene.textured_emission is not None
    lanes = np.flatnonzero(scene.textured_emission.triangle.take(light) >= 0)
    if lanes.size:
        surface = interaction(scene, rays.take(lanes), hits.take(lanes))
        radiance[:, lanes] = scene.textured_emission.radiance(light.take(lanes), surface)


def emission_at_samples(
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
    assert scene.textured_emission is not None
    triangle = scene.textured_emission.triangle.take(light)
    lanes = np.flatnonzero(triangle >= 0)
    if lanes.size:
        radiance = radiance.copy()
        some, number = rays.take(lanes), light.take(lanes)
        b1, b2 = TriangleLights.weights(u.take(lanes, 1))
        surface = interaction(scene, some, Hits(some.distance, triangle.take(lanes), b1, b2))
        radiance[:, lanes] = scene.textured_emission.radiance(number, surface)
        if scene.opacities is not None:
            radiance[:, lanes] *= scene.opacities.at(surface)
    return radiance

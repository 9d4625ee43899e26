"""What surfaces that do not shine evenly send from sampled points."""

from __future__ import annotations

import numpy as np

from ..lights import TriangleLights
from ..scene import CompiledScene
from ..state import Hits
from ..vec import Floats, Ints, f4
from .intersect import ShadowRays
from .surface import interact


def shine(scene: CompiledScene, rays: ShadowRays, light: Ints, u: Floats) -> Floats:
    """Return the factor (n,) by which the radiance at sampled points differs from that of their lights.

    A light that is only partly there sends its opacity's part: paths meet it that often.

    Parameters
    ----------
    rays
        From points to the sampled points.
    light
        (n,) numbers of the lights.
    u
        (2, n) the random numbers that the points were sampled with.
    """
    assert scene.uneven is not None
    assert scene.opacities is not None
    factor = np.ones(len(light), f4)
    prim = scene.uneven.take(light)
    lanes = np.flatnonzero(prim >= 0)
    if lanes.size:
        b1, b2 = TriangleLights.weights(u.take(lanes, 1))
        some = rays.take(lanes)
        surface = interact(scene, some, Hits(some.distance, prim.take(lanes), b1, b2))
        factor[lanes] = scene.opacities.at(surface)
    return factor

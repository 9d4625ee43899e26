"""Where rays meet surfaces."""

from __future__ import annotations

import numpy as np

from ..lights import LightSample
from ..scene import CompiledScene
from ..state import Hits, Paths, Surface
from ..vec import Bools, Floats, Ints, f4
from .surface import leave

TARGET_ERROR = f4(2**-20)  # rounding of a sampled point on a light, relative to its distance


def intersect(scene: CompiledScene, paths: Paths) -> Hits:
    """Find what each path's ray meets first."""
    found = scene.accelerator.closest(paths.origin, paths.direction, paths.leaving)
    return Hits(found.t, found.prim, found.b1, found.b2)


def visible(scene: CompiledScene, surface: Surface, lanes: Ints, light: LightSample) -> Bools:
    """Tell whether nothing stands between points and the sampled points on their lights, (k,).

    `lanes` (k,) are the columns of `surface` that the columns of `light` belong to.
    """
    point, error = surface.point.take(lanes, 1), surface.error.take(lanes)
    origin = leave(point, error, surface.ng.take(lanes, 1), light.wi)
    return ~scene.accelerator.occluded(origin, light.wi, _reach(error, light), surface.prim.take(lanes))


def _reach(error: Floats, light: LightSample) -> Floats:
    """Length (n,) of shadow rays, which end just before the light.

    Both ends are off by a known error; along a ray that meets the light's surface under a small
    cosine an error is 1/cosine times as long.
    """
    grazing = f4(1) / np.maximum(light.cos_light, f4(2) * TARGET_ERROR)
    shortened = light.distance * (f4(1) - TARGET_ERROR * grazing) - f4(2) * error * grazing
    return np.maximum(shortened, f4(0))

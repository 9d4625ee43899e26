"""Reconstruction filters, by filter importance sampling.

A sample counts only for its own pixel and with weight 1; the distribution of its position is the filter.
So pixels share no samples, and no filter has negative lobes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ..arrays.vec import Floats, f4
from ..core.registry import Registry
from . import warp

Filter: TypeAlias = Callable[[Floats], Floats]

TENT_RADIUS = 1.0  # pixels from the center to where the tent ends
GAUSSIAN_SIGMA = 0.5  # pixels
GAUSSIAN_RADIUS = 1.5  # pixels from the center to where the Gaussian is cut off


def box(u: Floats) -> Floats:
    """Distribute uniformly: u (2, n) in [0, 1)² is the position from the pixel's corner, in pixels."""
    return u


def tent(u: Floats) -> Floats:
    """Fall linearly from the pixel's center to nothing at `TENT_RADIUS`, in both directions."""
    return np.stack([f4(0.5) + warp.tent(row, TENT_RADIUS) for row in u])


def gaussian(u: Floats) -> Floats:
    """Follow a normal distribution of `GAUSSIAN_SIGMA` around the center, cut at `GAUSSIAN_RADIUS`."""
    return np.stack([f4(0.5) + warp.gaussian(row, GAUSSIAN_SIGMA, GAUSSIAN_RADIUS) for row in u])


FILTERS: Registry[Filter] = Registry(
    "filter", "a function of u (2, n)", {"box": box, "tent": tent, "gaussian": gaussian}
)

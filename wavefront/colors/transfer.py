"""The transfer function of sRGB, both ways."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats


def srgb_to_linear(values: Floats) -> Floats:
    """Return the linear values of sRGB values in [0, 1], any shape (IEC 61966-2-1)."""
    values = np.asarray(values, np.float64)  # rounded at the end: float32 powers differ between machines
    low = values / 12.92
    high = ((values + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high).astype(np.float32)


def linear_to_srgb(values: Floats) -> Floats:
    """Return linear values in [0, 1] as sRGB values, any shape (IEC 61966-2-1)."""
    values = np.asarray(values, np.float64)
    high = 1.055 * np.maximum(values, 0) ** (1 / 2.4) - 0.055
    return np.where(values <= 0.0031308, values * 12.92, high).astype(np.float32)

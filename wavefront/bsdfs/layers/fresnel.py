"""Schlick's approximation of Fresnel's equations (C. Schlick 1994, "An Inexpensive BRDF Model", eq. 15)."""

from __future__ import annotations

import numpy as np

from ...arrays.vec import Floats, f4


def fifth(cos: Floats) -> Floats:
    """Return (1 − cosθ)⁵, (n,)."""
    away = np.maximum(f4(1) - cos, f4(0))
    square = away * away
    return square * square * away


def schlick(f0: float, cos: Floats) -> Floats:
    """Return the reflectance (n,) of a surface that reflects f0 along the normal."""
    return f4(f0) + f4(1 - f0) * fifth(cos)

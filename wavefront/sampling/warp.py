"""Maps from the unit square to shapes, in threes: sample, pdf, inverse."""

from __future__ import annotations

import numpy as np

from ..vec import Floats, f4

TWO_PI = f4(2 * np.pi)
INV_PI = f4(1 / np.pi)


def cosine_hemisphere(u: Floats) -> Floats:
    """Directions (3, n) around +z with density cosθ/π, from u (2, n).

    Source: P. Dutré, Global Illumination Compendium, eq. 35:
    x = cos(2πr₁)√(1−r₂), y = sin(2πr₁)√(1−r₂), z = √r₂.
    """
    phi = TWO_PI * u[0]
    radius = np.sqrt(f4(1) - u[1])
    out = np.empty((3, u.shape[1]), f4)
    np.multiply(np.cos(phi), radius, out=out[0])
    np.multiply(np.sin(phi), radius, out=out[1])
    np.sqrt(u[1], out=out[2])
    return out


def cosine_hemisphere_pdf(w: Floats) -> Floats:
    """Density of `cosine_hemisphere` at unit directions w (3, n), 1/sr."""
    return np.maximum(w[2], f4(0)) * INV_PI

"""The standard skies by their closed formula, and a quadrature of the sky, beside what `wf.Sky` has."""

from functools import cache

import numpy as np

# ISO 15469:2004, table 1
TABLE = {
    1: (4, -0.7, 0, -1, 0),
    2: (4, -0.7, 2, -1.5, 0.15),
    3: (1.1, -0.8, 0, -1, 0),
    4: (1.1, -0.8, 2, -1.5, 0.15),
    5: (0, -1, 0, -1, 0),
    6: (0, -1, 2, -1.5, 0.15),
    7: (0, -1, 5, -2.5, 0.3),
    8: (0, -1, 10, -3, 0.45),
    9: (-1, -0.55, 2, -1.5, 0.15),
    10: (-1, -0.55, 5, -2.5, 0.3),
    11: (-1, -0.55, 10, -3, 0.45),
    12: (-1, -0.32, 10, -3, 0.45),
    13: (-1, -0.32, 16, -3, 0.3),
    14: (-1, -0.15, 16, -3, 0.3),
    15: (-1, -0.15, 24, -2.8, 0.15),
}


def standard(type: int, sun: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Relative luminance (...) of directions (..., 3), in float64, with NumPy's functions."""
    cos_z, cos_chi = directions[..., 1], np.clip(directions @ sun, -1, 1)
    if type == 16:
        return (1 + 2 * cos_z) / 3
    a, b, c, d, e = TABLE[type]
    chi = np.arccos(cos_chi)
    scattered = 1 + c * (np.exp(d * chi) - np.exp(d * np.pi / 2)) + e * cos_chi**2
    return (1 + a * np.exp(b / cos_z)) * scattered


@cache
def gauss_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss's rule on [-1, 1]."""
    return np.polynomial.legendre.leggauss(count)


def dome(rows: int = 96, columns: int = 192) -> tuple[np.ndarray, np.ndarray]:
    """Directions (rows, columns, 3), and their cos·dω: Gauss's rule in sin²Z."""
    x, w = gauss_rule(rows)
    sin2 = (x + 1) / 2  # cos Z·sin Z·dZ = d(sin²Z)/2
    azimuth = (np.arange(columns) + 0.5) / columns * 2 * np.pi
    level = np.sqrt(sin2)[:, None]
    parts = level * np.sin(azimuth), np.broadcast_to(np.sqrt(1 - sin2)[:, None], (rows, columns))
    around = np.stack([*parts, level * np.cos(azimuth)], -1)
    return around, np.broadcast_to(w[:, None] * np.pi / 2 / columns, (rows, columns))

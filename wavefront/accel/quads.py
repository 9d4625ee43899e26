"""Find pairs of triangles that are flat convex quadrilaterals, which one test serves.

Walls, boxes and all that was modeled as quadrilaterals comes as such pairs: a fan (a, b, c), (a, c, d).
"""

from __future__ import annotations

import numpy as np

from ..vec import Bools, Floats, Ints
from .triangle import ROUNDOFF, Doubles

FLATNESS = 2 * ROUNDOFF  # distance of the diagonals, relative to the coordinates


def find_quads(triangles: Floats) -> Ints:
    """Return the first of each pair of consecutive triangles (m, 3, 3) that make a quadrilateral, (k,).

    No triangle is in two pairs. All have an area, and their corners are off one plane by no more than
    half a unit in the last place of the coordinates, which is what rounding does to them.
    """
    corner = corners(triangles, np.arange(len(triangles) - 1))
    a, b, c, d = corner.astype(np.float64)
    fan = (triangles[1:, 0] == triangles[:-1, 0]).all(1) & (triangles[1:, 1] == triangles[:-1, 2]).all(1)
    normal = np.cross(c - a, d - b)
    size = np.linalg.norm(normal, axis=1)
    convex = np.isfinite(size) & (size > 0)
    for before, at, after in ((a, b, c), (b, c, d), (c, d, a), (d, a, b)):
        convex &= (np.cross(at - before, after - at) * normal).sum(1) > 0
    apart = np.abs((normal * (b - a)).sum(1))
    flat = apart <= FLATNESS * np.abs(corner).max((0, 2)) * size
    found = np.flatnonzero(fan & convex & flat)
    # Of pairs that overlap, every other one stands.
    place = np.arange(found.size)
    starts = np.append(True, np.diff(found) > 1)[: found.size]
    return found[(place - np.maximum.accumulate(np.where(starts, place, 0))) % 2 == 0]


def corners(triangles: Floats, first: Ints) -> Floats:
    """Return the corners (4, k, 3) of quadrilaterals, in order round them."""
    one, other = triangles.take(first, 0), triangles.take(first + 1, 0)
    return np.stack([one[:, 0], one[:, 1], one[:, 2], other[:, 2]])


def are_parallelograms(corner: Floats, radius: float) -> Bools:
    """Tell which quadrilaterals (4, k, 3) in a ball are parallelograms, but for rounding.

    Opposite edge functions of a line that meets the ball then add up to d·n within the area |n|; see
    `triangle.pairs_of_one_sign`.
    """
    a, b, c, d = corner.astype(np.float64)
    skew = np.linalg.norm(a - b + c - d, axis=1)
    return skew * (8 * radius) < np.linalg.norm(np.cross(c - a, d - b), axis=1) / 2


def planes(corner: Floats) -> Doubles:
    """Return planes (4, k) midway between the diagonals of quadrilaterals (4, k, 3): normal n, and n·p."""
    a, b, c, d = corner.astype(np.float64)
    normal = np.cross(c - a, d - b)
    return np.concatenate([normal.T, ((normal * (a + b)).sum(1) / 2)[None]])


def diagonal_planes(corner: Floats) -> Doubles:
    """Return planes (4, k) through a and c of quadrilaterals (4, k, 3), with d on the positive side."""
    a, b, c, d = corner.astype(np.float64)
    along = c - a
    normal = np.cross(np.cross(along, d - b), along)
    normal *= np.sign((normal * (d - a)).sum(1))[:, None]
    return np.concatenate([normal.T, -(normal * a).sum(1)[None]])

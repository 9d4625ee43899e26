"""Find pairs of triangles that form flat convex quadrilaterals, so that one test serves both.

Meshes that were modeled as quadrilaterals, such as walls and boxes, have such pairs: (a, b, c), (a, c, d).
"""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints
from ..shapes.fans import are_fans, disjoint_pairs
from .triangle import ROUNDOFF

FLATNESS = 2 * ROUNDOFF  # largest distance between the diagonals, relative to the coordinates


def find_quads(triangles: Floats) -> Ints:
    """Return the first of each pair of consecutive triangles (m, 3, 3) that form a quadrilateral, (k,).

    No triangle is in two pairs. The corners are coplanar within the rounding of their coordinates, and no
    triangle is degenerate.
    """
    corner = corners(triangles, np.arange(len(triangles) - 1))
    a, b, c, d = corner.astype(np.float64)
    normal = np.cross(c - a, d - b)
    size = np.linalg.norm(normal, axis=1)
    convex = np.isfinite(size) & (size > 0)
    for before, at, after in ((a, b, c), (b, c, d), (c, d, a), (d, a, b)):
        convex &= (np.cross(at - before, after - at) * normal).sum(1) > 0
    apart = np.abs((normal * (b - a)).sum(1))
    flat = apart <= FLATNESS * np.abs(corner).max((0, 2)) * size
    return disjoint_pairs(np.flatnonzero(are_fans(triangles) & convex & flat))


def corners(triangles: Floats, first: Ints) -> Floats:
    """Return the corners (4, k, 3) of quadrilaterals, in order around them."""
    one, other = triangles.take(first, 0), triangles.take(first + 1, 0)
    return np.stack([one[:, 0], one[:, 1], one[:, 2], other[:, 2]])


def are_parallelograms(corner: Floats, radius: float) -> Bools:
    """Return a mask of the quadrilaterals (4, k, 3) that are parallelograms, within the rounding error.

    `radius` is that of a ball around them. For a line that meets the ball, opposite edge functions of a
    parallelogram then add up to d·n, with an error below the area |n|: see
    `triangle.least_opposite_product`.
    """
    a, b, c, d = corner.astype(np.float64)
    skew = np.linalg.norm(a - b + c - d, axis=1)
    return skew * (8 * radius) < np.linalg.norm(np.cross(c - a, d - b), axis=1) / 2


def planes(corner: Floats) -> Doubles:
    """Return planes (4, k), n and n·p, midway between the diagonals of quadrilaterals (4, k, 3)."""
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

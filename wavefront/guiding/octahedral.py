"""Directions as points of a square, by the octahedral map, and square bins of directions.

Source: Z. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", Journal of
Computer Graphics Techniques 3(2), 2014: a direction is projected onto the octahedron |x| + |y| + |z| = 1,
whose lower half is unfolded around the upper one.
"""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles, Floats, Ints, dot, f4

PARTS = 8  # along each side of a bin, for its solid angle


def bins_of(w: Floats, side: int) -> tuple[Ints, Floats]:
    """Return the bins of unit directions.

    Parameters
    ----------
    w
        (3, n) unit directions.
    side
        Bins along each side of the square.

    Returns
    -------
    bins
        (n,) row-major numbers of bins.
    size
        (n,) |x| + |y| + |z|. A density over the square [-1, 1]², divided by its cube, is the density in
        solid angle.
    """
    size = np.abs(w[0]) + np.abs(w[1]) + np.abs(w[2])
    half = f4(side / 2)
    scale = half / size
    x, y = w[0] * scale, w[1] * scale
    down = np.flatnonzero(w[2] < 0)
    if down.size:
        before = x.take(down), y.take(down)
        x[down] = np.copysign(half - np.abs(before[1]), before[0])
        y[down] = np.copysign(half - np.abs(before[0]), before[1])
    last = f4(side - 0.5)
    column = (x + half).clip(f4(0), last).astype(np.intp)
    row = (y + half).clip(f4(0), last).astype(np.intp)
    return row * side + column, size


def directions_at(x: Floats, y: Floats) -> Floats:
    """Return the unit directions (3, n) at points of the square, x and y (n,) in [-1, 1]."""
    z = f4(1) - np.abs(x) - np.abs(y)
    fold = (-z).clip(f4(0), f4(1))
    w = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z])
    return w / np.sqrt(dot(w, w))


def solid_angles(side: int) -> Doubles:
    """Return the solid angle of each bin, (side²,), sr, by the midpoint rule over `PARTS`² parts of it."""
    parts = side * PARTS
    x, y = np.meshgrid(*[(np.arange(parts) + 0.5) / parts * 2 - 1] * 2)
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    squared = (np.abs(x) - fold) ** 2 + (np.abs(y) - fold) ** 2 + z**2
    area = (squared * np.sqrt(squared)) ** -1.0
    area = area.reshape(side, PARTS, side, PARTS).sum((1, 3))
    return np.asarray((area * (4 * np.pi / area.sum())).ravel())


def neighbors(side: int) -> Ints:
    """Return the eight bins around each bin, (8, side²), also across the edges of the square."""
    row, column = np.divmod(np.arange(side * side), side)
    steps = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if down or right]
    return np.array([_across_edges(row + down, column + right, side) for down, right in steps])


def _across_edges(row: Ints, column: Ints, side: int) -> Ints:
    """Return the bins at rows and columns (n,) that may be one bin beyond an edge.

    The edge of the square is folded in its middle: both halves of an edge are the same directions.
    """
    beyond = (column < 0) | (column >= side)
    row, column = np.where(beyond, side - 1 - row, row), column.clip(0, side - 1)
    beyond = (row < 0) | (row >= side)
    row, column = row.clip(0, side - 1), np.where(beyond, side - 1 - column, column)
    return row * side + column.clip(0, side - 1)

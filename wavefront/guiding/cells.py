"""Cells of space and orientation, in which surfaces are taken to receive the same light."""

from __future__ import annotations

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Floats, Ints, f4

OUTLYING = 0.002  # part of the points, along each axis and side, that the grid leaves outside
MARGIN = 0.01  # of the grid's extent, on each side


@soa
class GuideCells:
    """A cubic grid times the six axes, of which a normal belongs to the nearest.

    Points outside the grid belong to the nearest cell.
    """

    low: Floats  # (3,) corner of the grid, relative to the scene's center
    per_unit: np.float32  # cells per scene unit
    levels: int  # the grid has 2^levels cells along each axis

    @classmethod
    def around(cls, points: Floats, levels: int) -> GuideCells:
        """Return a grid over most of some points (3, n)."""
        low, high = np.quantile(points, (OUTLYING, 1 - OUTLYING), axis=1)
        extent = max(float((high - low).max()), 1e-20)
        low = low - MARGIN * extent
        return cls(low.astype(f4), f4((1 << levels) / (extent * (1 + 2 * MARGIN))), levels)

    def __len__(self) -> int:
        """Return the number of cells."""
        return 6 << 3 * self.levels

    def of(self, point: Floats, normal: Floats) -> Ints:
        """Return the cells (n,) of points (3, n) with unit normals (3, n)."""
        cell = _axis(normal)
        last = f4((1 << self.levels) - 0.5)
        for row, low in zip(point, self.low, strict=True):
            cell <<= self.levels
            cell += ((row - low) * self.per_unit).clip(f4(0), last).astype(np.intp)
        return cell

    def coarser(self, cell: Ints, level: int) -> Ints:
        """Return the cells (n,), in the grid of a lower level, that hold some cells (n,) of this one."""
        bits, dropped = self.levels, self.levels - level
        out = cell >> 3 * bits
        for axis in (2, 1, 0):
            out = (out << level) | ((cell >> axis * bits & (1 << bits) - 1) >> dropped)
        return out


def _axis(normal: Floats) -> Ints:
    """Return which of the axes +x, -x, +y, -y, +z and -z is nearest to each normal, (n,)."""
    x, y, z = np.abs(normal)
    number = (y > x).astype(np.intp)
    number[z > np.maximum(x, y)] = 2
    along = np.choose(number, normal)
    return 2 * number + (along < 0)

"""Grids of values between which is interpolated, and bounds of them on coarser grids."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Floats, Ints, f4, take

MARGIN = 1e-3  # voxels by which bounds reach farther, for rounding


@soa
class Voxels(SoA):
    """The values of k grids in the unit cube, trilinear between the centers of voxels and constant beyond.

    Voxel (z, y, x) of (d, h, w) is centered at ((x + ½)/w, (y + ½)/h, (z + ½)/d).
    """

    values: Floats  # (c, m) of all grids, one after the other, x the fastest
    first: Ints  # (k,) column of `values` where each grid begins
    size: Ints  # (3, k) voxels along x, y and z

    @classmethod
    def of(cls, grid: Floats) -> Self:
        """Return one grid (z, y, x) or (z, y, x, c)."""
        depth, height, width = grid.shape[:3]
        values = np.ascontiguousarray(grid.reshape(depth * height * width, -1).T)
        return cls(values, np.zeros(1, np.intp), np.array([[width], [height], [depth]], np.intp))

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return the grids of several records."""
        ends = np.cumsum([0, *(record.values.shape[1] for record in records)])
        first = [record.first + end for record, end in zip(records, ends[:-1], strict=True)]
        channels = max(record.values.shape[0] for record in records)
        values = [np.broadcast_to(record.values, (channels, record.values.shape[1])) for record in records]
        size = np.concatenate([record.size for record in records], -1)
        return cls(np.concatenate(values, -1), np.concatenate(first), size)

    def at(self, number: Ints, point: Floats) -> Floats:
        """Return the values (c, n) of grids (n,) at points (3, n) of the unit cube."""
        if self.values.shape[1] == self.first.size:  # of one voxel each
            return take(self.values, number)
        size = take(self.size, number)
        whole = size.astype(f4)
        x = np.minimum(np.maximum(point * whole - f4(0.5), f4(0)), whole - f4(1))
        low = x.astype(np.intp)
        fraction = x - low
        row, layer = size[0], size[0] * size[1]
        corner = self.first.take(number) + low[0] + row * low[1] + layer * low[2]
        inner = low + 1 < size  # at the last voxel there is no next one, and it has no part
        along = inner[0], row * inner[1], layer * inner[2]
        lines = []
        for at in (corner, corner + along[1], corner + along[2], corner + along[1] + along[2]):
            near = take(self.values, at)
            lines.append(near + (take(self.values, at + along[0]) - near) * fraction[0])
        near = lines[0] + (lines[1] - lines[0]) * fraction[1]
        return near + (lines[2] + (lines[3] - lines[2]) * fraction[1] - near) * fraction[2]

    def cell_at(self, number: Ints, point: Floats) -> Floats:
        """Return the value (n,) of the one channel in the voxels with points (3, n), not interpolated."""
        size = take(self.size, number)
        cell = np.minimum(np.maximum(point * size.astype(f4), f4(0)).astype(np.intp), size - 1)
        return self.values[0].take(
            self.first.take(number) + cell[0] + size[0] * (cell[1] + size[1] * cell[2])
        )


def bounds_in_cells(grid: NDArray[Any], cells: tuple[int, int, int], extreme: np.ufunc) -> NDArray[Any]:
    """Return the greatest or least value (d, h, w) that interpolation reaches in each of a cube's cells.

    With `np.add` it is the sum of the voxels that matter there.

    Parameters
    ----------
    grid
        (z, y, x).
    cells
        (d, h, w): along z, y and x.
    extreme
        `np.maximum`, `np.minimum` or `np.add`.
    """
    for axis, (count, size) in enumerate(zip(cells, grid.shape, strict=True)):
        edges = np.arange(count + 1) * (size / count) - 0.5
        first = np.clip(np.floor(edges[:-1] - MARGIN), 0, size - 1).astype(int)
        last = np.clip(np.floor(edges[1:] + MARGIN) + 1, 0, size - 1).astype(int)
        parts = [
            extreme.reduce(grid.take(range(a, b + 1), axis), axis) for a, b in zip(first, last, strict=True)
        ]
        grid = np.stack(parts, axis)
    return grid

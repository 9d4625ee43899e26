"""Tables of directions: for each cell a density over the sphere that can be sampled."""

from __future__ import annotations

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints, f4
from .cells import GuideCells
from .octahedral import bins_of, directions_at

INSIDE = f4(1e-5)  # the least distance of a sampled direction from the edges of its bin, of the bin's side


@soa
class GuideTable:
    """Densities over directions, piecewise constant over bins of the octahedral square.

    A row is one density. Each cell has a row; cells with few records share that of a larger cell.
    """

    cells: GuideCells
    side: int  # bins along each side of the square, a power of two
    row_of: Ints  # (cells,) row of each cell
    density: Floats  # (rows · side²,) over the square [0, 1]²
    edges_y: Floats  # (rows · (side + 1),) cumulative over rows of bins, 0 to 1
    edges_x: Floats  # (rows · side · (side + 1),) cumulative within each row of bins, 0 to 1
    share: Floats  # (rows,) probability with which a direction is drawn from the table, not from the BSDF

    @classmethod
    def of_bins(cls, cells: GuideCells, row_of: Ints, contents: Doubles, share: Floats) -> GuideTable:
        """Return tables of rows of probabilities of bins, (rows, side²), each with the sum 1."""
        side = int(np.sqrt(contents.shape[1]))
        bins = contents.reshape(-1, side, side)
        edges_x = np.linspace(0, 1, side + 1) + np.zeros((len(bins), side, 1))  # of empty rows
        total = bins.sum(2)
        full = total > 0
        edges_x[full, 1:] = np.cumsum(bins[full], 1) / total[full][:, None]
        edges_y = np.zeros((len(bins), side + 1))
        edges_y[:, 1:] = np.cumsum(total, 1)
        edges_y /= edges_y[:, -1:]
        return cls(
            cells,
            side,
            row_of.astype(np.int32),
            (bins * side**2).astype(f4).ravel(),
            edges_y.astype(f4).ravel(),
            edges_x.astype(f4).ravel(),
            share.astype(f4),
        )

    def rows(self, point: Floats, normal: Floats) -> Ints:
        """Return the rows (n,) for points (3, n), relative to the scene's center, with normals (3, n)."""
        return self.row_of.take(self.cells.of(point, normal)).astype(np.intp)

    def pdf(self, row: Ints, w: Floats) -> Floats:
        """Return the densities (n,), 1/sr, of unit directions (3, n) by rows (n,)."""
        bins, size = bins_of(w, self.side)
        return self.density.take(row * self.side**2 + bins) / (f4(4) * size * size * size)

    def sample(self, row: Ints, u: Floats) -> Floats:
        """Return unit directions (3, n) for numbers u (2, n) in [0, 1)."""
        y, in_y = _inverted(self.edges_y, row * (self.side + 1), u[1], self.side)
        x, in_x = _inverted(self.edges_x, (row * self.side + y) * (self.side + 1), u[0], self.side)
        scale = f4(2 / self.side)
        return directions_at((x + in_x) * scale - f4(1), (y + in_y) * scale - f4(1))


def _inverted(edges: Floats, start: Ints, u: Floats, items: int) -> tuple[Ints, Floats]:
    """Return the item whose part of [0, 1) holds each u (n,), and the position of u in this part, (n,)."""
    at, step = start.copy(), items // 2
    while step:  # bisection: `items` is a power of two
        at += (u >= edges.take(at + step)) * np.intp(step)
        step //= 2
    low = edges.take(at)
    width = edges.take(at + 1) - low
    rest = (u - low) / np.maximum(width, f4(1e-12))
    return at - start, rest.clip(INSIDE, f4(1) - INSIDE)

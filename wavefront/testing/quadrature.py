"""Integrals of a density over the cells of a histogram."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints
from .charts import Chart

ROWS, COLUMNS = 20, 40


@dataclass(slots=True)
class Cells:
    """A grid on the unit square: rows of the first coordinate, each with its own columns."""

    rows: Doubles  # (ROWS + 1,) edges
    columns: Doubles  # (ROWS, COLUMNS + 1) edges within each row

    @classmethod
    def around(cls, pilot: Doubles, seams: Sequence[float]) -> Cells:
        """Return cells by the quantiles of an equal mixture of a uniform density and the pilot (2, m).

        Smooth densities get nearly uniform cells; sharp lobes get small ones.
        """
        per_band = ROWS // (len(seams) - 1)
        bands = [
            _quantiles(pilot[0][(pilot[0] >= a) & (pilot[0] < b)], a, b, per_band)[:-1]
            for a, b in pairwise(seams)
        ]
        rows = np.append(np.concatenate(bands), seams[-1])
        where = np.clip(np.searchsorted(rows, pilot[0], "right") - 1, 0, ROWS - 1)
        columns = [_quantiles(pilot[1][where == r], 0.0, 1.0, COLUMNS) for r in range(ROWS)]
        return cls(rows, np.stack(columns))

    def find(self, p: Doubles) -> Ints:
        """Return the cell of each point (2, n), (n,)."""
        row = np.clip(np.searchsorted(self.rows, p[0], "right") - 1, 0, ROWS - 1)
        edges = (np.arange(ROWS)[:, None] + self.columns[:, :-1]).ravel()
        return np.searchsorted(edges, row + np.minimum(p[1], np.nextafter(1.0, 0.0)), "right") - 1

    def rectangles(self) -> Doubles:
        """Return the corners (a0, a1, b0, b1) of all cells, (4, ROWS·COLUMNS)."""
        a0 = np.repeat(self.rows[:-1], COLUMNS)
        a1 = np.repeat(self.rows[1:], COLUMNS)
        return np.stack([a0, a1, self.columns[:, :-1].ravel(), self.columns[:, 1:].ravel()])


def _quantiles(x: Doubles, low: float, high: float, parts: int) -> Doubles:
    """Split [low, high] by the quantiles of an equal mixture of a uniform density and the values x."""
    x = np.unique(np.clip(x, low, high))
    x = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    cdf = 0.5 * (x - low) / (high - low) + 0.5 * np.linspace(0, 1, len(x))
    return np.interp(np.linspace(0, 1, parts + 1), cdf, x)


# Five points near those of Gauss and Lobatto, the outer ones just inside the ends: they detect an edge that
# crosses only a corner of a box, and no point lies on the horizon. Weights are exact for degree 5.
NODES = np.array([0.003, 0.175, 0.5, 0.825, 0.997])
WEIGHTS = np.linalg.solve(NODES ** np.arange(5)[:, None], 1 / np.arange(1, 6))


@dataclass(slots=True)
class DensityIntegrator:
    """Adaptive integrals of a density over boxes of the unit square.

    Samples guide the refinement: if the density at a sample is far above that at all nodes of its box, the
    nodes have missed a peak, and the box is split. The integral does not depend on their number.
    """

    density: Callable[[Floats], Floats]
    chart: Chart
    guide: Doubles  # (2, g) samples on the unit square
    height: Doubles  # (g,) the density there

    def cells(self, cells: Cells, tolerance: float = 1e-5) -> tuple[Doubles, float]:
        """Return the integral over each cell, (ROWS·COLUMNS,), and the error left in their sum."""
        cell = cells.find(self.guide)
        boxes, owner = self._around_samples(cells.rectangles(), cell)
        home = self._locate(boxes, owner, cell)
        total = np.zeros(ROWS * COLUMNS)
        coarse, _, across, _ = self._quadrature(boxes)
        unresolved = 0.0
        for level in range(60):
            halves = _halves(boxes, across)
            parts, peak, turned, edges = self._quadrature(halves)
            parts, peak = parts.reshape(2, -1), peak.reshape(2, -1).max(0)
            fine = parts.sum(0)
            error, edge = np.abs(fine - coarse), edges.reshape(2, -1).sum(0)
            keep = _least(error, tolerance / 5) | (error <= 2e-5 * fine)
            area = np.maximum((boxes[1] - boxes[0]) * (boxes[3] - boxes[2]) * self.chart.area, 1e-300)
            highest = self._highest(home, len(fine))
            missed = highest > 3 * peak
            # Two coarse integrals may agree by chance if a lobe fills a small part of a box.
            split = missed | (highest > 9 * fine / area) | ~keep | ~_least(edge, tolerance)
            if level == 59 or np.count_nonzero(split) > 30_000:
                unresolved, split = float((error + edge)[split].sum()), np.zeros_like(split)
            np.add.at(total, owner[~split], fine[~split])
            if not split.any():
                break
            home = self._descend(home, boxes, across, split)
            both = np.tile(split, 2)
            turned = np.where(np.tile(missed, 2), level % 2 == 0, turned)  # all nodes missed the peak
            boxes, across = halves[:, both], turned[both]
            coarse = parts[:, split].ravel()
            owner = np.tile(owner[split], 2)
        return total, unresolved

    def _quadrature(self, boxes: Doubles) -> tuple[Doubles, Doubles, Bools, Doubles]:
        """Integrate over boxes (4, m) by 5×5 points.

        Returns the integrals, the largest values, whether the density varies more along the first
        coordinate than along the second, and an error for boxes that an edge of the density
        crosses, where two coarse integrals may agree by chance; each (m,).
        """
        a0, a1, b0, b1 = boxes
        out, peak = np.empty(boxes.shape[1]), np.empty(boxes.shape[1])
        across, edge = np.empty(boxes.shape[1], np.bool_), np.zeros(boxes.shape[1])
        for start in range(0, len(out), 4096):
            span = slice(start, start + 4096)
            a = a0[span, None] + (a1 - a0)[span, None] * NODES
            b = b0[span, None] + (b1 - b0)[span, None] * NODES
            p = np.stack([np.repeat(a, 5, 1).ravel(), np.tile(b, 5).ravel()])
            values = self.density(self.chart.to_points(p)).astype(np.float64).reshape(-1, 5, 5)
            area = ((a1 - a0) * (b1 - b0))[span] * self.chart.area
            out[span] = ((values @ WEIGHTS) @ WEIGHTS) * area
            peak[span] = values.max((1, 2))
            along_a, along_b = (np.abs(np.diff(values, axis=k)).sum((1, 2)) for k in (1, 2))
            across[span] = along_a >= along_b
            beyond = (values <= 1e-3 * peak[span, None, None]).any((1, 2))  # a broad lobe may be there, too
            edge[span] = np.where(beyond, 0.02 * peak[span] * area, 0)
        return out, peak, across, edge

    def _highest(self, home: Ints, boxes: int) -> Doubles:
        """Return the largest density among the samples of each box, (boxes,)."""
        highest = np.zeros(boxes)
        inside = home >= 0
        np.maximum.at(highest, home[inside], self.height[inside])
        return highest

    def _descend(self, home: Ints, boxes: Doubles, across: Bools, split: Bools) -> Ints:
        """Return the box of each sample after the split; −1 in boxes that are finished."""
        unfinished = (home >= 0) & split[home]
        rank = np.cumsum(split) - 1
        box = home[unfinished]
        a0, a1, b0, b1 = boxes[:, box]
        upper_a = self.guide[0, unfinished] >= (a0 + a1) / 2
        upper_b = self.guide[1, unfinished] >= (b0 + b1) / 2
        below = np.full_like(home, -1)
        below[unfinished] = np.where(across[box], upper_a, upper_b) * np.count_nonzero(split) + rank[box]
        return below

    def _around_samples(self, boxes: Doubles, cell: Ints) -> tuple[Doubles, Ints]:
        """Split cells that samples fill only in part, so that nodes do not miss that part.

        Returns boxes (4, m), and the cell that each belongs to, (m,).
        """
        low, high = np.full((2, boxes.shape[1]), np.inf), np.full((2, boxes.shape[1]), -np.inf)
        for k in range(2):
            np.minimum.at(low[k], cell, self.guide[k])
            np.maximum.at(high[k], cell, self.guide[k])
        margin = np.maximum(high - low, 0) / 4
        low, high = np.maximum(low - margin, boxes[::2]), np.minimum(high + margin, boxes[1::2])
        whole = boxes[1::2] - boxes[::2]
        cut = np.flatnonzero((high > low).all(0) & ((high - low).prod(0) < 0.7 * whole.prod(0)))
        edges = [np.stack([boxes[2 * k], low[k], high[k], boxes[2 * k + 1]])[:, cut] for k in range(2)]
        pieces = [
            np.stack([edges[0][i], edges[0][i + 1], edges[1][j], edges[1][j + 1]])
            for i in range(3)
            for j in range(3)
        ]
        rest = np.delete(np.arange(boxes.shape[1]), cut)
        return np.concatenate([boxes[:, rest], *pieces], axis=1), np.concatenate([rest, np.tile(cut, 9)])

    def _locate(self, boxes: Doubles, owner: Ints, cell: Ints) -> Ints:
        """Return the box of each sample, among those of its cell."""
        middle = np.empty(ROWS * COLUMNS, np.intp)
        count = np.bincount(owner, minlength=ROWS * COLUMNS)
        first = np.flatnonzero(count[owner] == 1)
        middle[owner[first]] = first
        cut = np.count_nonzero(count == 9)
        start = len(first) + 4 * cut  # the fifth of nine pieces
        middle[owner[start : start + cut]] = np.arange(start, start + cut)
        return middle[cell]


def _least(error: Doubles, tolerance: float) -> Bools:
    """Return a mask of the least errors whose sum is less than the tolerance."""
    order = np.argsort(error)
    keep = np.empty(len(error), np.bool_)
    keep[order] = np.cumsum(error[order]) < tolerance
    return keep


def _halves(boxes: Doubles, across: Bools) -> Doubles:
    """Halve each box (4, m) along its first coordinate where `across` is true, else its second: (4, 2m)."""
    a0, a1, b0, b1 = boxes
    a, b = (a0 + a1) / 2, (b0 + b1) / 2
    first = np.stack([a0, np.where(across, a, a1), b0, np.where(across, b1, b)])
    second = np.stack([np.where(across, a, a0), a1, np.where(across, b0, b), b1])
    return np.concatenate([first, second], axis=1)

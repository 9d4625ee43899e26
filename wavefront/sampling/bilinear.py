"""Tables over the unit square, linear between their nodes, and densities that they give.

Each table has several slices, for values of parameters; at a point some of them are mixed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats, Ints, f4
from ..core.errors import SceneError

Mix: TypeAlias = Sequence[tuple[Ints, Floats]]  # slices (n,) and their weights (n,), which sum to 1
ALONE: Mix = ((np.zeros(1, np.intp), np.ones(1, f4)),)  # of a table of one slice


def between(nodes: Floats, x: Floats) -> Mix:
    """Return the two of rising nodes (k,) around each x (n,), the last or the first one for x beyond them."""
    if len(nodes) == 1:
        return ALONE
    low = np.clip(np.searchsorted(nodes, x) - 1, 0, len(nodes) - 2)
    start = nodes.take(low)
    fraction = np.clip((x - start) / (nodes.take(low + 1) - start), f4(0), f4(1))
    return (low, f4(1) - fraction), (low + 1, fraction)


def product(slow: Mix, fast: Mix, count: int) -> Mix:
    """Return the mix of slices that are numbered by two parameters, of which the fast one has `count`."""
    return [(a * count + b, v * w) for a, v in slow for b, w in fast]


class Bilinear:
    """Values at the nodes of the unit square, (..., slices, rows, columns), bilinear in between.

    x runs along columns, y along rows.
    """

    def __init__(self, values: NDArray[np.floating]) -> None:
        *channels, self.slices, self.rows, self.columns = values.shape
        self._values: Floats = values.reshape(*channels, -1).astype(f4)

    def node(self, at: Ints, mix: Mix) -> Floats:
        """Return the values (..., n) at nodes `at` (n,), which count row by row."""
        size = self.rows * self.columns
        total = self._values.take(mix[0][0] * size + at, -1) * mix[0][1]
        for number, weight in mix[1:]:
            total += self._values.take(number * size + at, -1) * weight
        return total

    def cell(self, p: Floats) -> tuple[Ints, Floats, Ints, Floats]:
        """Return the columns and rows (n,) of the cells of points p (2, n), and the places in them."""
        x, y = (
            np.clip(p[axis], f4(0), f4(1)) * f4(count - 1)
            for axis, count in enumerate((self.columns, self.rows))
        )
        column = np.minimum(x.astype(np.intp), self.columns - 2)
        row = np.minimum(y.astype(np.intp), self.rows - 2)
        return column, x - column.astype(f4), row, y - row.astype(f4)

    def at(self, p: Floats, mix: Mix = ALONE) -> Floats:
        """Return the values (..., n) at points p (2, n); beyond the square those at its edge."""
        column, x, row, y = self.cell(p)
        left, right = self.edges(row * self.columns + column, y, mix)
        return left + (right - left) * x

    def edges(self, node: Ints, y: Floats, mix: Mix) -> tuple[Floats, Floats]:
        """Return the values (..., n) at the left and the right edge of cells, at heights y in [0, 1]."""
        left, right = self.node(node, mix), self.node(node + 1, mix)
        left += (self.node(node + self.columns, mix) - left) * y
        right += (self.node(node + self.columns + 1, mix) - right) * y
        return left, right


class BilinearDensity:
    """Densities over the unit square, in proportion to values (slices, rows, columns) at nodes.

    A row is chosen first, then a place in it, by the inverses of cumulative sums. As all slices are
    normalized, a mix of them is a density, too.

    Source: J. Dupuy and W. Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
    Rendering", section 4.

    Raises
    ------
    SceneError
        If a slice is 0 everywhere.
    """

    def __init__(self, values: NDArray[np.floating]) -> None:
        table = np.asarray(values, np.float64)
        upto = _sums(table)
        below = _sums(upto[..., -1])
        total = below[:, -1]
        if not (total > 0).all():
            raise SceneError(f"slice {int(np.argmin(total > 0))} is 0 everywhere; it must be a density")
        self.values = Bilinear(table / total[:, None, None])
        self._upto = Bilinear(upto / total[:, None, None])  # the integrals along rows, from the left
        self._below = Bilinear((below / total[:, None])[:, None])  # the integrals over rows, from the lowest

    def sample(self, u: Floats, mix: Mix) -> Floats:
        """Return points (2, n) for numbers u (2, n) in [0, 1)."""
        rows, columns = self.values.rows, self.values.columns
        row = _last(lambda at: self._below.node(at, mix), u[1], rows - 1)
        first = row * columns
        low, high = (self._upto.node(first + k * columns - 1, mix) for k in (1, 2))
        y = _position((u[1] - self._below.node(row, mix)) * f4(rows - 1), low, high)
        target = u[0] * (low + (high - low) * y)

        def upto(column: Ints) -> Floats:
            low = self._upto.node(first + column, mix)
            return low + (self._upto.node(first + column + columns, mix) - low) * y

        column = _last(upto, target, columns - 1)
        edges = self.values.edges(first + column, y, mix)
        x = _position((target - upto(column)) * f4(columns - 1), *edges)
        return np.stack([(column.astype(f4) + x) / f4(columns - 1), (row.astype(f4) + y) / f4(rows - 1)])

    def inverse(self, p: Floats, mix: Mix) -> tuple[Floats, Floats]:
        """Return the numbers (2, n) that `sample` takes to points p (2, n), and the density (n,) there."""
        rows, columns = self.values.rows, self.values.columns
        column, x, row, y = self.values.cell(p)
        first = row * columns
        left, right = self.values.edges(first + column, y, mix)
        before, _ = self._upto.edges(first + column, y, mix)
        low, high = (self._upto.node(first + k * columns - 1, mix) for k in (1, 2))
        whole = low + (high - low) * y
        across = before + _integral(x, left, right) * f4(1 / (columns - 1))
        across /= np.where(whole > 0, whole, f4(1))
        along = self._below.node(row, mix) + _integral(y, low, high) * f4(1 / (rows - 1))
        return np.stack([across, along]), left + (right - left) * x


def _sums(values: Doubles) -> Doubles:
    """Return the integrals along the last axis, of length 1, up to each node."""
    out = np.zeros_like(values)
    np.cumsum(
        (values[..., 1:] + values[..., :-1]) * (0.5 / (values.shape[-1] - 1)), axis=-1, out=out[..., 1:]
    )
    return out


def _last(edge: Callable[[Ints], Floats], target: Floats, cells: int) -> Ints:
    """Return the last of `cells` cells whose first edge is not above the targets (n,), by bisection."""
    cell = np.zeros(len(target), np.intp)
    for bit in range(cells.bit_length() - 1, -1, -1):
        tried = cell + (1 << bit)
        inside = np.minimum(tried, cells - 1)
        cell = np.where((tried < cells) & (edge(inside) <= target), inside, cell)
    return cell


def _position(integral: Floats, low: Floats, high: Floats) -> Floats:
    """Return x in [0, 1] up to which a density that runs from `low` to `high` has this integral."""
    root = low + np.sqrt(np.maximum(low * low + f4(2) * integral * (high - low), f4(0)))
    return np.clip(f4(2) * integral / np.where(root > 0, root, f4(1)), f4(0), f4(1))


def _integral(x: Floats, low: Floats, high: Floats) -> Floats:
    """Return the integral up to x of a density that runs from `low` to `high`."""
    return x * (low + f4(0.5) * x * (high - low))

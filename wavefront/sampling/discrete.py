"""Distributions given by tables of weights, sampled by inverting the cumulative sum.

Inversion is monotone in u, so stratified numbers stay stratified.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import BELOW_ONE, Doubles, Floats, Ints, f4, take
from ..core.errors import SceneError
from ..core.plural import plural

_LARGE = 1 << 19  # tables of more items get fewer cells per item, to save memory
_PART = 1 << 14  # items that are summed at a time, so that sums take little memory, and no fresh one


def _checked(name: str, weights: ArrayLike, ndim: int) -> Doubles:
    """Return weights as float64, or raise SceneError naming the first that is out of range."""
    array = np.asarray(weights, np.float64)
    if array.ndim != ndim or not array.size:
        raise SceneError(
            f"{name} must have {plural(ndim, 'dimension')} and at least one item, got shape {array.shape}"
        )
    if not (array.min() >= 0 and np.isfinite(array.max())):
        bad = np.argwhere(~(np.isfinite(array) & (array >= 0)))
        where = "".join(f"[{i}]" for i in bad[0])
        raise SceneError(f"{name}{where} is {array[tuple(bad[0])]}; it must be finite and at least 0")
    if not array.any():
        raise SceneError(f"{name} are all 0; at least one must be positive")
    return array


class Inversion:
    """Finds the item whose interval of [0, 1) contains u, in one of several rows of k items.

    A guide table gives the item at which the search starts, for each of a power of two of cells of
    [0, 1), so that most lanes need no search.

    Source: H.-C. Chen and Y. Asau, On Generating Random Variates from an Empirical Distribution,
    1974 (guide tables).

    Parameters
    ----------
    weights
        (rows, k), at least 0, in proportion to the probabilities within each row. Rows of zeros are never
        searched.
    cells_per_item
        Cells of the guide table for each item; by default 8, and 1 in large tables.
    """

    def __init__(self, weights: NDArray[np.floating], cells_per_item: int | None = None) -> None:
        rows, self.items = weights.shape
        if cells_per_item is None:
            cells_per_item = 8 if weights.size <= _LARGE else 1
        self._cells = 1 << (cells_per_item * self.items - 1).bit_length()
        edge = np.zeros((rows, self.items + 1), f4)  # where items begin and end
        first = np.empty((rows, self._cells), np.min_scalar_type(self.items - 1))
        step = max(1, _PART // self.items)
        for span in (slice(start, start + step) for start in range(0, rows, step)):
            upto = np.cumsum(weights[span], axis=1, dtype=np.float64)
            upto /= np.where(upto[:, -1:] > 0, upto[:, -1:], 1)
            # A float32 edge that is rounded up separates float32 numbers exactly as the float64 sum does.
            edge[span, 1:] = _rounded_up(upto)
            first[span] = _first_items(edge[span, 1:], self._cells)
        self._edge, self._first = edge.ravel(), first.ravel()

    def find(self, u: Floats, row: Ints | None = None) -> tuple[Ints, Floats]:
        """Return the items for u (n,) in [0, 1), of rows `row` (n,), by default of the first row.

        Returns
        -------
        flat
            (n,) intp: row·k + item.
        rest
            (n,) position of u within the item's interval, in [0, 1).
        """
        cell = (u * f4(self._cells)).astype(np.intp)
        if row is None:
            at = take(self._first, cell).astype(np.intp)
        else:
            cell += row * self._cells
            at = take(self._first, cell) + row * (self.items + 1)
        ends = self._edge[1:]
        short = np.flatnonzero(take(ends, at) <= u)
        for _ in range(2):  # most lanes end after one or two steps
            further = at[short] + 1
            at[short] = further
            short = short[ends.take(further) <= u[short]]
        if len(short):
            at[short] = self._searched(ends, at[short], u[short])
        start, length = take(self._edge, at), take(ends, at)
        length -= start
        rest = u - start
        rest /= length
        if row is not None:
            at -= row
        return at, np.minimum(rest, BELOW_ONE, out=rest)

    def _searched(self, ends: Floats, low: Ints, u: Floats) -> Ints:
        """Return the items (n,) for u (n,) by bisection, from items `low` (n,) of the same rows on."""
        high = low + (self.items - 1 - low % (self.items + 1))
        for _ in range(self.items.bit_length()):
            middle = (low + high) // 2
            beyond = ends.take(middle) <= u
            low, high = np.where(beyond, middle + 1, low), np.where(beyond, high, middle)
        return high


def _rounded_up(x: Doubles) -> Floats:
    """Return the smallest float32 that is not below x, which is at most 1."""
    near = x.astype(f4)
    np.nextafter(near, f4(2), out=near, where=near < x)
    return near


def _first_items(edge: Floats, cells: int) -> Ints:
    """Return the number (rows, cells) of the first item that ends beyond c/cells, for each row and cell c."""
    rows = len(edge)
    ends = np.ceil(edge * f4(cells)).astype(np.intp)  # exact: cells is a power of two
    ends += np.arange(rows)[:, None] * (cells + 1)
    counts = np.bincount(ends.ravel(), minlength=rows * (cells + 1)).reshape(rows, cells + 1)
    return np.cumsum(counts, axis=1)[:, :cells]


class Discrete:
    """A discrete distribution of k items with probabilities proportional to `weights` (k,).

    Raises
    ------
    SceneError
        If a weight is negative or not finite, or all are 0.
    """

    def __init__(self, weights: ArrayLike) -> None:
        array = _checked("weights", weights, 1)
        array = array / array.max()  # against overflow and underflow of the sum
        self.probability: Doubles = array / array.sum()
        self._inversion = Inversion(self.probability[None])
        self._pmf = self.probability.astype(f4)

    def __len__(self) -> int:
        """Return the number of items."""
        return len(self._pmf)

    def pmf(self, index: Ints) -> Floats:
        """Return the probabilities (n,) of items `index` (n,)."""
        return self._pmf.take(index)

    def sample(self, u: Floats) -> tuple[Ints, Floats, Floats]:
        """Return an item for each number u (n,) in [0, 1).

        Returns
        -------
        index
            (n,) intp, monotone in u; never an item of weight 0.
        pmf
            (n,) probability of the item.
        rest
            (n,) position of u within the item's interval, again uniform in [0, 1).
        """
        if len(self) == 1:
            return np.zeros(u.shape, np.intp), np.ones(u.shape, f4), u
        index, rest = self._inversion.find(u)
        return index, self._pmf.take(index), rest


class Distribution2D:
    """Density over the unit square, constant within each cell of a grid of weights (rows, columns).

    x runs along columns, y along rows. A row is chosen first, then a column within it. Tables for samples are
    made for the first of them: densities alone take 4 bytes for each cell.

    Raises
    ------
    SceneError
        If a weight is negative or not finite, or all are 0.
    """

    def __init__(self, weights: ArrayLike) -> None:
        array = _checked("weights", weights, 2)
        self.shape = array.shape
        density = array / array.max()
        density /= density.mean()
        self._density = density.astype(f4).ravel()

    @cached_property
    def _rows(self) -> Discrete:
        return Discrete(self.weights().sum(axis=1, dtype=np.float64))

    @cached_property
    def _columns(self) -> Inversion:
        return Inversion(self.weights())

    def sample(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points for u (2, n): u[0] selects x, u[1] selects y.

        Returns
        -------
        x, y
            (n,) in [0, 1).
        pdf
            (n,) density over the unit square.
        """
        height, width = self.shape
        row, _, rest_y = self._rows.sample(u[1])
        flat, rest_x = self._columns.find(u[0], row)
        x = within_cell(flat - row * width, rest_x, width)
        y = within_cell(row, rest_y, height)
        return x, y, self._density.take(flat)

    def weights(self) -> Floats:
        """Return the density of each cell over the unit square, (rows, columns); their mean is 1."""
        return self._density.reshape(self.shape)

    def pdf(self, x: Floats, y: Floats) -> Floats:
        """Return the density over the unit square, (n,), at x, y (n,) in [0, 1]."""
        height, width = self.shape
        column = np.clip((x * f4(width)).astype(np.intp), 0, width - 1)
        row = np.clip((y * f4(height)).astype(np.intp), 0, height - 1)
        return self._density.take(row * width + column)


def within_cell(cell: Ints, rest: Floats, cells: int) -> Floats:
    """Return the coordinate (n,) in [0, 1) at the relative position `rest` (n,) within `cell` (n,).

    It stays further from the cell's border than rounding errors, so that `pdf` finds the same cell: the next
    cell may have weight 0.
    """
    margin = cells * 2.0**-22
    return ((cell + np.clip(rest, margin, 1 - margin, dtype=np.float64)) / cells).astype(f4)

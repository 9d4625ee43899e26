"""Distributions given by tables of weights, sampled by inverting the cumulative sum.

Inversion is monotone in u, so stratified numbers stay stratified.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..vec import Floats, Ints, f4

_BELOW_ONE = f4(1 - 2.0**-24)


def _checked(name: str, weights: ArrayLike, ndim: int) -> NDArray[np.float64]:
    """Return weights as float64, or raise SceneError naming the first that is out of range."""
    array = np.asarray(weights, np.float64)
    if array.ndim != ndim or not array.size:
        raise SceneError(
            f"{name} must have {ndim} dimension(s) and at least one item, got shape {array.shape}"
        )
    bad = np.argwhere(~(np.isfinite(array) & (array >= 0)))
    if len(bad):
        where = "".join(f"[{i}]" for i in bad[0])
        raise SceneError(f"{name}{where} is {array[tuple(bad[0])]}; it must be finite and at least 0")
    if not array.any():
        raise SceneError(f"{name} are all 0; at least one must be positive")
    return array


class Discrete:
    """A choice among k items with probabilities proportional to `weights` (k,).

    Raises
    ------
    SceneError
        If a weight is negative or not finite, or all are 0.
    """

    def __init__(self, weights: ArrayLike) -> None:
        array = _checked("weights", weights, 1)
        array = array / array.max()  # keeps the sum of huge or tiny weights in range
        self.probability: NDArray[np.float64] = array / array.sum()
        self._cdf = np.cumsum(self.probability)
        self._cdf[np.flatnonzero(array)[-1] :] = 1.0  # no u below 1 passes the last item with weight
        self._pmf = self.probability.astype(f4)

    def __len__(self) -> int:
        """Return the number of items."""
        return len(self._pmf)

    def pmf(self, index: Ints) -> Floats:
        """Probability of items `index` (n,), (n,)."""
        return self._pmf.take(index)

    def sample(self, u: Floats) -> tuple[Ints, Floats, Floats]:
        """Choose an item per number u (n,) in [0, 1).

        Returns
        -------
        index
            (n,) intp, monotone in u; never an item of weight 0.
        pmf
            (n,) probability of the item.
        rest
            (n,) u stretched over the item's share, again uniform in [0, 1).
        """
        if len(self) == 1:
            return np.zeros(u.shape, np.intp), np.ones(u.shape, f4), u
        index = np.searchsorted(self._cdf, u, side="right")
        start = self._cdf.take(index) - self.probability.take(index)
        rest = ((u - start) / self.probability.take(index)).astype(f4)
        return index, self._pmf.take(index), np.clip(rest, f4(0), _BELOW_ONE)


class Distribution2D:
    """Density over the unit square, constant within each cell of a grid of weights (rows, columns).

    x runs along columns, y along rows. A row is chosen first, then a column within it.

    Raises
    ------
    SceneError
        If a weight is negative or not finite, or all are 0.
    """

    def __init__(self, weights: ArrayLike) -> None:
        array = _checked("weights", weights, 2)
        array = array / array.max()
        self.shape = array.shape
        self._rows = Discrete(array.sum(axis=1))
        # One flat cumulative sum with row r in (r, r + 1]: a single sorted table serves all rows.
        total = array.sum(axis=1, keepdims=True)
        self._share = np.divide(array, total, out=np.zeros_like(array), where=total > 0)
        # Rounding leaves a row's last sum within 1e-11 of r + 1, and a float32 u is 6e-8 below 1.
        within = np.cumsum(self._share, axis=1)
        self._cdf = (within + np.arange(array.shape[0])[:, None]).ravel()
        self._density = (array / array.mean()).astype(f4).ravel()

    def sample(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Points from u (2, n): u[0] chooses x, u[1] chooses y.

        Returns
        -------
        x, y
            (n,) in [0, 1).
        pdf
            (n,) density over the unit square.
        """
        height, width = self.shape
        row, _, rest_y = self._rows.sample(u[1])
        flat = np.searchsorted(self._cdf, row + u[0].astype(np.float64), side="right")
        column = flat - row * width
        share = self._share.ravel().take(flat)
        start = self._cdf.take(flat) - row - share
        x = _within_cell(column, (u[0] - start) / share, width)
        y = _within_cell(row, rest_y, height)
        return x, y, self._density.take(flat)

    def pdf(self, x: Floats, y: Floats) -> Floats:
        """Density over the unit square at x, y (n,) in [0, 1], (n,)."""
        height, width = self.shape
        column = np.clip((x * f4(width)).astype(np.intp), 0, width - 1)
        row = np.clip((y * f4(height)).astype(np.intp), 0, height - 1)
        return self._density.take(row * width + column)


def _within_cell(cell: Ints, rest: NDArray[np.floating], cells: int) -> Floats:
    """Coordinate (n,) in [0, 1) at `rest` (n,) of the way through `cell` (n,).

    Kept off the border by more than rounding, so that the coordinate is in the cell for `pdf` too,
    whose neighbour may have no weight.
    """
    margin = cells * 2.0**-22
    return ((cell + np.clip(rest, margin, 1 - margin, dtype=np.float64)) / cells).astype(f4)

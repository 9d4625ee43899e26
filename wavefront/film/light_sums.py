"""Sums of the light that paths from lights add to pixels.

Paths from lights reach any pixel, any number of times. The sums are exact, so that they do not depend on the
order in which paths are traced.
"""

from __future__ import annotations

import numpy as np

from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, Ints
from .exact_sum import ExactSums
from .sums import Sums

BATCHES = 4  # sample s belongs to the batch s mod 4
MORE_TERMS = 64  # a pixel has 2^32 splats at most: those of all pixels may fall on one
AT_ONCE = 1 << 16  # sums of one size that are added to together, times the terms of each


class LightSums(Sums):
    """Sums over paths from lights, for each pixel.

    The paths from lights of one sample of all pixels are stratified together, so their scatter does not give
    the error of their mean. Samples are independent of each other: each belongs to one of `BATCHES` batches,
    and the scatter of the batches' means gives the error.

    Memory is 192 bytes per pixel.

    Parameters
    ----------
    pixels
        How many there are.

    Attributes
    ----------
    paths
        How many paths from lights were traced of each batch, (BATCHES,).
    batches
        The sums of each batch, by its number as text.
    """

    paths: Ints
    batches: dict[str, ExactSums]

    def __init__(self, pixels: int) -> None:
        self.paths = np.zeros(BATCHES, np.int64)
        self.batches = {str(batch): ExactSums((3, pixels), MORE_TERMS) for batch in range(BATCHES)}

    def add(self, sample: int, paths: int, pixel: Words, radiance: Floats) -> None:
        """Add the light that some more paths from lights of a sample bring to pixels.

        Parameters
        ----------
        sample
            Its index.
        paths
            How many paths these are, with those that bring nothing.
        pixel
            (k,) row-major indices, which may repeat.
        radiance
            (3, k) finite.
        """
        batch = sample % BATCHES
        self.paths[batch] += paths
        terms = radiance.astype(np.float64)
        order = np.argsort(pixel, kind="stable")
        targets, first, count = _groups(pixel.take(order).astype(np.intp))
        for size in 1 << np.arange(int(count.max(initial=0)).bit_length() + 1):
            groups = np.flatnonzero((count > size // 2) & (count <= size))
            for lanes in np.array_split(groups, -(-groups.size * int(size) // AT_ONCE) or 1):
                if lanes.size:
                    number = np.arange(size)[:, None]
                    real = number < count.take(lanes)
                    at = order.take(first.take(lanes) + np.where(real, number, 0))
                    self.batches[str(batch)].add(targets.take(lanes), terms[:, at] * real)

    def mean(self, span: slice = slice(None)) -> Doubles:
        """Return the light that paths from lights bring to pixels, (3, k)."""
        total = sum(sums.value(span) for sums in self.batches.values())
        return np.asarray(total / max(int(self.paths.sum()), 1))

    def squared_error(self, span: slice = slice(None)) -> Doubles:
        """Estimate the variance of `mean`, (3, k), from the scatter of batches; NaN if there is only one."""
        mean, total = self.mean(span), int(self.paths.sum())
        used = np.flatnonzero(self.paths)
        if used.size == 1:
            return np.full_like(mean, np.nan)
        scatter = np.zeros_like(mean)
        for batch in used:
            paths = float(self.paths[batch])
            scatter += np.square(self.batches[str(batch)].value(span) / paths - mean) * (paths / total)
        return scatter / max(used.size - 1, 1)

    def halves(self, span: slice = slice(None)) -> Doubles:
        """Return half the difference of the means of two halves of batches, (3, k); NaN if one is empty."""
        halves = [[batch for batch in range(BATCHES) if batch % 2 == half] for half in range(2)]
        paths = [int(self.paths[half].sum()) for half in halves]
        if not all(paths):
            return np.full_like(self.mean(span), np.nan)
        first, second = (
            sum(self.batches[str(batch)].value(span) for batch in half) / number
            for half, number in zip(halves, paths, strict=True)
        )
        return np.asarray((first - second) * (np.sqrt(float(paths[0]) * paths[1]) / sum(paths)))


def _groups(ordered: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the distinct values (d,) of rising numbers, where each begins, and how often it occurs."""
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    return ordered.take(first), first, np.diff(first, append=ordered.size)

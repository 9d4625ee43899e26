"""Sums of what light paths add to pixels, and of its squares.

Light paths reach any pixel, any number of times. The sums are exact, so that they do not depend on the order
in which paths are traced.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .exact_sum import ExactSums
from .state import Words
from .vec import FLOAT32_MAX, Doubles, Floats, Ints

MORE_TERMS = 64  # a pixel has 2^32 splats at most: those of all pixels may fall on one
AT_ONCE = 1 << 16  # sums of one size that are added to together, times the terms of each


class LightSums:
    """Sums over light paths, for each pixel.

    Parameters
    ----------
    pixels
        How many there are.

    Attributes
    ----------
    paths
        How many light paths were traced.
    """

    def __init__(self, pixels: int) -> None:
        self.paths = 0
        self.sums, self.squares = (ExactSums((3, pixels), MORE_TERMS) for _ in range(2))

    def add(self, paths: int, pixel: Words, radiance: Floats) -> None:
        """Add what some more light paths bring to pixels.

        Parameters
        ----------
        paths
            How many paths these are, with those that bring nothing.
        pixel
            (k,) row-major indices, which may repeat.
        radiance
            (3, k) finite.
        """
        self.paths += paths
        terms = radiance.astype(np.float64)
        squares = np.minimum(np.square(terms), FLOAT32_MAX).astype(np.float32).astype(np.float64)
        order = np.argsort(pixel, kind="stable")
        found, first, count = _groups(pixel.take(order).astype(np.intp))
        for size in 1 << np.arange(int(count.max(initial=0)).bit_length() + 1):
            some = np.flatnonzero((count > size // 2) & (count <= size))
            for lanes in np.array_split(some, -(-some.size * int(size) // AT_ONCE) or 1):
                if lanes.size:
                    number = np.arange(size)[:, None]
                    real = number < count.take(lanes)
                    at = order.take(first.take(lanes) + np.where(real, number, 0))
                    for sums, values in ((self.sums, terms), (self.squares, squares)):
                        sums.add(found.take(lanes), values[:, at] * real)

    def mean(self, span: slice = slice(None)) -> Doubles:
        """Return what light paths bring to pixels, (3, k)."""
        return self.sums.value(span) / max(self.paths, 1)

    def squared_error(self, span: slice = slice(None)) -> Doubles:
        """Estimate the variance of `mean`, (3, k), as if light paths were independent."""
        paths = max(self.paths, 1)
        return np.maximum(self.squares.value(span) / paths - np.square(self.mean(span)), 0) / paths

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all sums as arrays by name."""
        return {
            "paths": np.array([self.paths]),
            **{f"sums.{name}": array for name, array in self.sums.arrays().items()},
            **{f"squares.{name}": array for name, array in self.squares.arrays().items()},
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Become the sums of which `arrays` returned these; they are not copied."""
        self.paths = int(arrays["paths"][0])
        self.sums.restore({name: arrays[f"sums.{name}"] for name in self.sums.arrays()})
        self.squares.restore({name: arrays[f"squares.{name}"] for name in self.squares.arrays()})

    def merge(self, other: LightSums) -> None:
        """Add the sums of other light paths; the result is that of all of them at once."""
        self.paths += other.paths
        self.sums.merge(other.sums)
        self.squares.merge(other.squares)


def _groups(ordered: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the distinct values (d,) of rising numbers, where each begins, and how often it occurs."""
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    return ordered.take(first), first, np.diff(first, append=ordered.size)

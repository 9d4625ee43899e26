"""Reproducible sums of float32 numbers: the bits do not depend on order or grouping of the terms.

A float64 sum rounds at every step, so its last bits depend on the order. Here every term is rounded
once, to a multiple of a unit that depends only on the largest term, and sums of these multiples are exact.
So the sum of two partial sums equals the sum of all terms, bit for bit.

Source: J. Demmel and H. D. Nguyen, "Parallel Reproducible Summation", IEEE Transactions on Computers
64(7), 2015, with bins of `WIDTH` bits and two levels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .vec import Doubles, Lanes

WIDTH = 26  # bits of a bin
MAX_TERMS = 1 << (53 - WIDTH)  # a sum of more terms may need more than the 53 bits of a float64
LOWEST, HIGHEST = -6, 4  # bins that hold all float32 numbers

_BINS = np.arange(LOWEST, HIGHEST + 1)
# The largest term of each bin: half a unit of the next bin, where it is rounded to 0.
_LIMITS = np.ldexp(1.0, WIDTH * (_BINS + 1) - 1)
# Adding and subtracting this rounds a term to a multiple of 2^(WIDTH · bin).
_ROUNDERS = np.ldexp(1.5, 52 + WIDTH * _BINS)
_LIMIT_TO_ROUNDER = 1.5 * 2.0**27
_TO_NEXT = np.ldexp(1.0, -WIDTH)


class ExactSums:
    """Sums (c, n), one for each channel and pixel, that start at 0.

    The terms of a sum are multiples of 2^(WIDTH · (bin - 1)), where the bin follows from the largest
    term: the rounding error of a term is at most 2^-26 times the largest. `high` holds the terms rounded to
    multiples of 2^(WIDTH · bin), `low` the rest. Memory is 17 bytes for each sum.

    Parameters
    ----------
    shape
        (c, n).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.high = np.zeros(shape)
        self.low = np.zeros(shape)
        self.bins = np.zeros(shape, np.int8)  # counted from LOWEST

    def value(self, lanes: Lanes = slice(None)) -> Doubles:
        """Return the sums of some columns, (c, k), rounded to float64."""
        return np.asarray(self.high[:, lanes] + self.low[:, lanes])

    def add(self, lanes: Lanes, terms: Doubles) -> None:
        """Add terms (c, m, k) to k distinct columns `lanes`.

        The terms are finite float32 values in a float64 array, which is overwritten.
        """
        rounder = self._rounder(lanes, terms)[:, None]
        high = terms + rounder
        high -= rounder
        rest = np.subtract(terms, high, out=terms)
        rounder = rounder * _TO_NEXT
        rest += rounder
        rest -= rounder
        # Sums of multiples of one unit are exact in any order.
        self.high[:, lanes] += _total(high)
        self.low[:, lanes] += _total(rest)

    def merge(self, other: ExactSums) -> None:
        """Add the sums of other terms; the result is as if those terms had been added here."""
        bins = np.maximum(self.bins, other.bins)
        self.high, self.low = _raised(self.high, self.low, bins - self.bins)
        high, low = _raised(other.high, other.low, bins - other.bins)
        self.high += high
        self.low += low
        self.bins = bins

    def _rounder(self, lanes: Lanes, terms: Doubles) -> Doubles:
        """Raise the bins (c, k) to hold the terms; return the numbers that round terms to these bins."""
        largest = np.abs(terms).max(1) if terms.shape[1] > 1 or terms.min() < 0 else terms[:, 0]
        bins = self.bins[:, lanes]
        rounder = _ROUNDERS.take(bins, mode="wrap")
        beyond = largest * _LIMIT_TO_ROUNDER > rounder
        if beyond.any():
            channel, column = np.nonzero(beyond)
            sums = channel, column + (lanes.start or 0) if isinstance(lanes, slice) else lanes[column]
            needed = np.searchsorted(_LIMITS, largest[beyond]).astype(np.int8)
            self.high[sums], self.low[sums] = _raised(self.high[sums], self.low[sums], needed - bins[beyond])
            self.bins[sums] = needed
            rounder[beyond] = _ROUNDERS.take(needed)
        return rounder


def _total(terms: Doubles) -> Doubles:
    """Return sums of terms (c, m, k) over m."""
    return terms[:, 0] if terms.shape[1] == 1 else np.asarray(terms.sum(1))


def _raised(high: Doubles, low: Doubles, steps: NDArray[np.int8]) -> tuple[Doubles, Doubles]:
    """Return the two levels of sums (c, k) after raising the bins by `steps` (c, k); low parts become 0."""
    return np.where(steps == 0, high, 0), np.where(steps == 0, low, np.where(steps == 1, high, 0))

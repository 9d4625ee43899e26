"""Reproducible sums of float32 numbers: the bits do not depend on order or grouping of the terms.

A float64 sum rounds at every step, so its last bits depend on the order. Here every term is rounded
once, to a multiple of a unit that depends only on the largest term, and sums of these multiples are exact.
So the sum of two partial sums equals the sum of all terms, bit for bit.

Source: J. Demmel and H. D. Nguyen, "Parallel Reproducible Summation", IEEE Transactions on Computers
64(7), 2015, with bins of `WIDTH` bits and two levels.
"""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles, Lanes
from .sums import Sums

WIDTH = 26  # bits of a bin
MAX_TERMS = 1 << 26  # the sum of more terms may leave the binade of its bin
_UNITS = np.ldexp(1.0, WIDTH * np.arange(-5, 6) - 12)  # of the bins, from below the least float32 number
_LIMITS = _UNITS * 2.0**25  # of the terms of each bin: half a unit of the next bin
_ZEROS = _UNITS * (1.5 * 2.0**52)  # one unit is the last bit of float64 numbers from 2/3 to 4/3 of these
_BIN = 2.0**WIDTH  # ratio of the units of two neighboring bins
_TERM_TO_ZERO = 2.0**28  # a term times this exceeds a sum of its bin if the term reaches the limit
_LAST_BIT = np.int64(1)
_EXPONENT, _HALF = np.int64(0x7FF << 52), np.int64(1 << 51)  # fields of a float64


class ExactSums(Sums):
    """Sums (c, n), one for each channel and pixel, that start at 0.

    The terms of a sum are rounded to multiples of a unit of a bin, and the bin follows from the largest
    term. `high` sums these multiples, and `low` the rest, rounded to multiples of the unit of the bin
    below: the rounding error of a term is at most 2^-26 times the largest. Both are offset by a zero of
    1.5 · 2^52 units, so that an addition rounds a term by itself. Memory is 16 bytes for each sum.

    Parameters
    ----------
    shape
        (c, n).
    more_terms
        A power of two: how many times `MAX_TERMS` a sum may have. Terms are rounded as many times more.
    """

    high: Doubles  # (c, n)
    low: Doubles  # (c, n)

    def __init__(self, shape: tuple[int, int], more_terms: int = 1) -> None:
        self._more_terms = more_terms
        self.high = np.full(shape, _ZEROS[0])
        self.low = self.high / _BIN

    def value(self, lanes: Lanes = slice(None)) -> Doubles:
        """Return the sums of some columns, (c, k), rounded to float64."""
        _, high, low = _without_offset(self.high[:, lanes], self.low[:, lanes])
        return np.asarray(high + low)

    def add(self, lanes: Lanes, terms: Doubles) -> None:
        """Add terms (c, m, k) to k distinct columns `lanes`.

        The terms are finite float32 values in a float64 array, which is overwritten.
        """
        self._raise_bins(lanes, terms)
        rest = terms
        # With its last bit set, a term is never halfway between two multiples, where the direction of
        # rounding would depend on the sum before it.
        bits = rest.view(np.int64)
        bits |= _LAST_BIT
        for sums in (self.high, self.low):
            before = sums[:, None, lanes]
            rounded = rest + before
            rounded -= before
            rest -= rounded
            sums[:, lanes] += _total(rounded)  # exact in any order: all are multiples of one unit

    def merge(self, other: ExactSums) -> None:
        """Add the sums of other terms; the result is as if those terms had been added here."""
        zero, *parts = _without_offset(self.high, self.low)
        other_zero, *other_parts = _without_offset(other.high, other.low)
        common = np.maximum(zero, other_zero)
        high, low = _raised(zero, common, *parts)
        other_high, other_low = _raised(other_zero, common, *other_parts)
        self.high, self.low = high + other_high + common, low + other_low + common / _BIN

    def _raise_bins(self, lanes: Lanes, terms: Doubles) -> None:
        """Raise the bins of those columns where a term reaches the limit."""
        largest = np.abs(terms).max(1) if terms.shape[1] > 1 or terms.min() < 0 else terms[:, 0]
        beyond = largest * (_TERM_TO_ZERO * self._more_terms) > self.high[:, lanes]
        if not beyond.any():
            return
        channel, column = np.nonzero(beyond)
        sums = channel, column + (lanes.start or 0) if isinstance(lanes, slice) else lanes[column]
        zero, high, low = _without_offset(self.high[sums], self.low[sums])
        reach = largest[beyond] * self._more_terms
        new_zero = np.maximum(zero, _ZEROS.take(_LIMITS.searchsorted(reach, side="right")))
        high, low = _raised(zero, new_zero, high, low)
        self.high[sums], self.low[sums] = high + new_zero, low + new_zero / _BIN


def _total(terms: Doubles) -> Doubles:
    """Return sums of terms (c, m, k) over m."""
    return terms[:, 0] if terms.shape[1] == 1 else np.asarray(terms.sum(1))


def _without_offset(high: Doubles, low: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    """Return the zeros of sums, which tell their bins, and the two levels without them."""
    zero = (high.view(np.int64) & _EXPONENT | _HALF).view(np.float64)
    return zero, high - zero, low - zero / _BIN


def _raised(zero: Doubles, new_zero: Doubles, high: Doubles, low: Doubles) -> tuple[Doubles, Doubles]:
    """Return the two levels of sums after raising their bins; the parts below the new low level become 0."""
    same = zero == new_zero
    return np.where(same, high, 0), np.where(same, low, np.where(zero * _BIN == new_zero, high, 0))

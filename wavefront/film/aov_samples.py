"""The sampled AOVs of one wave, as its worker returns them.

AOVs with values in [-1, 1] are rounded to multiples of 2^-24, so that their sums are exact in any order,
and the worker adds up the samples of each pixel. AOVs of radiance are returned sample by sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Floats, Ints, f4

FRACTION_BITS = 24  # of fixed-point numbers
ONE = f4(2**FRACTION_BITS)
NARROW_TERMS = 127  # so many fixed-point numbers from -1 to 1 can be summed as int32
COUNTED = ("coverage",)  # layers whose samples are 0 or 1
BOUNDED = ("alpha", "albedo", "denoising_albedo", "denoising_normal")  # layers whose samples are in [-1, 1]

FixedPoint = NDArray[np.int32] | NDArray[np.int64]


@soa
class FixedPointSamples:
    """Sums over some samples of each pixel."""

    sums: FixedPoint  # (c, k) multiples of 2^-24
    squares: FixedPoint  # (c, k) of the squared samples, each rounded down to a multiple of 2^-24


@soa
class AovSamples:
    """The sampled AOVs of a wave: samples of k pixels."""

    counts: dict[str, Ints]  # (k,) how many samples of each pixel are 1: "coverage.NAME"
    bounded: dict[str, FixedPointSamples]
    radiance: dict[str, Floats]  # (3, samples, k): "direct", and "light_groups.NAME"
    narrow: Floats | None = None  # (samples, k): "narrow_lobes"


def fixed_point(values: Floats, samples: int, dropped: Ints) -> FixedPointSamples:
    """Return sums of samples in [-1, 1].

    Parameters
    ----------
    values
        (c, samples · k) float32, which is overwritten.
    samples
        Of each of k pixels.
    dropped
        Columns that count as 0.
    """
    values *= ONE
    np.rint(values, out=values)
    values[:, dropped] = 0
    fixed = values.astype(np.int32).reshape(len(values), samples, -1)
    squares = fixed.astype(np.int64)
    squares *= squares
    squares >>= FRACTION_BITS
    dtype = np.int32 if samples <= NARROW_TERMS else np.int64
    return FixedPointSamples(fixed.sum(1, dtype=dtype), squares.sum(1, dtype=dtype))

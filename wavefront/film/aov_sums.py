"""Sums of the sampled AOVs of a picture, and the estimates from them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, Ints, Lanes, f4
from .aov_names import MEASURED_AOVS, NARROW, aov_of
from .aov_samples import (
    BOUNDED,
    COUNTED,
    FRACTION_BITS,
    NARROW_TERMS,
    AovSamples,
    FixedPoint,
    FixedPointSamples,
)
from .exact_sum import ExactSums
from .film import CHUNK, NONE, Film, add_in_order, chunks, pixel_span
from .narrow_sums import NarrowSums
from .sums import Sums

UNIT = 2.0**-FRACTION_BITS
LARGEST_NARROW = NARROW_TERMS << FRACTION_BITS


@soa
class AovEstimate:
    """The mean of the samples of an AOV, and its error."""

    mean: Floats  # (pixels, c)
    standard_error: Floats | None  # (pixels, c) of `mean`; NaN for fewer than two samples; None: it has none
    variance: Floats | None = None  # (pixels, c) of one sample, of AOVs of measurements


class CountSums(Sums):
    """Numbers of samples of n pixels that have a property. Memory is 4 bytes for each pixel."""

    counts: NDArray[np.int32]  # (1, n)

    def __init__(self, pixels: int) -> None:
        self.counts = np.zeros((1, pixels), np.int32)

    def add(self, lanes: Lanes, counts: Ints) -> None:
        """Add numbers (k,) of other samples."""
        self.counts[0, lanes] += counts

    def totals(self, span: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (1, k): a sample is 0 or 1."""
        counts = self.counts[:, span].astype(np.float64)
        return counts, counts


class FixedPointSums(Sums):
    """Sums, and sums of squares, of values in [-1, 1], in units of 2^-24, for c channels of n pixels.

    They are exact, so their bits depend neither on the order of the samples nor on partial sums. Memory is
    8 bytes for each channel and pixel up to 127 samples, and 16 after that.
    """

    sums: FixedPoint  # (c, n)
    squares: FixedPoint  # (c, n)

    def __init__(self, shape: tuple[int, int]) -> None:
        self.sums = np.zeros(shape, np.int32)
        self.squares = np.zeros(shape, np.int32)

    def _widen(self) -> None:
        self.sums, self.squares = self.sums.astype(np.int64), self.squares.astype(np.int64)

    def add(self, lanes: Lanes, samples: FixedPointSamples, most: int) -> None:
        """Add sums over samples of some pixels, of which none then has more than `most` samples."""
        if most > NARROW_TERMS and self.sums.dtype == np.int32:
            self._widen()
        self.sums[:, lanes] += samples.sums
        self.squares[:, lanes] += samples.squares

    def merge(self, other: FixedPointSums) -> None:
        """Add the sums of other samples."""
        self._widen()
        super().merge(other)
        if max(np.abs(sums).max(initial=0) for sums in (self.sums, self.squares)) <= LARGEST_NARROW:
            self.sums, self.squares = self.sums.astype(np.int32), self.squares.astype(np.int32)

    def totals(self, span: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (c, k)."""
        sums, squares = self.sums[:, span].astype(np.float64), self.squares[:, span].astype(np.float64)
        return sums * UNIT, squares * UNIT


class SquareSums(Sums):
    """Sums of squares of radiance, (3, n), added in the order of the samples; 12 bytes for each pixel.

    The last bits of merged ones depend on which samples are in which part.
    """

    squares: Floats  # (3, n)

    def __init__(self, pixels: int) -> None:
        self.squares = np.zeros((3, pixels), f4)

    def add(self, lanes: Lanes, radiance: Floats) -> None:
        """Add samples (3, samples, k)."""
        squares = self.squares[:, lanes]  # a view of a slice, else a copy
        with np.errstate(over="ignore"):
            add_in_order(squares, np.square(radiance))
        if not isinstance(lanes, slice):
            self.squares[:, lanes] = squares


class RadianceSums(SquareSums):
    """Exact sums of radiance, and sums of squares; 60 bytes for each pixel."""

    sums: ExactSums

    def __init__(self, pixels: int) -> None:
        super().__init__(pixels)
        self.sums = ExactSums((3, pixels))

    def add(self, lanes: Lanes, radiance: Floats) -> None:
        """Add samples (3, samples, k)."""
        radiance = without_zeros(radiance)
        if radiance.size:
            self.sums.add(lanes, radiance.astype(np.float64))
            super().add(lanes, radiance)

    def totals(self, span: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (3, k)."""
        return self.sums.value(span), self.squares[:, span].astype(np.float64)


def without_zeros(radiance: Floats) -> Floats:
    """Return samples (3, samples, k) in order, without zeros where there are many: sums keep their bits.

    Of many groups of lights, most samples of each are 0.
    """
    lit = np.asarray(radiance.any(0))
    most = int(lit.sum(0).max(initial=0))
    if 2 * most > len(lit):
        return radiance
    column, sample = np.nonzero(lit.T)
    rank = np.arange(column.size) - column.searchsorted(column)
    out = np.zeros((3, most, radiance.shape[2]), f4)
    out[:, rank, column] = radiance[:, sample, column]
    return out


class AovSums(Sums):
    """Sums of the samples of some AOVs.

    Like those of the `Film` they do not depend on the division of a render into jobs. The means do not
    depend on the division of samples between two sums that are merged either; errors of AOVs of radiance
    may then differ by their rounding.

    Parameters
    ----------
    names
        Sampled AOVs, those with a key by it, such as "light_groups.sun".
    pixels
        Their number.
    """

    counts: dict[str, CountSums]
    bounded: dict[str, FixedPointSums]
    radiance: dict[str, RadianceSums]
    measured: dict[str, Film]
    indirect: SquareSums | None  # its sums are those of the picture less those of "direct"
    narrow: NarrowSums | None

    def __init__(self, names: Iterable[str], pixels: int) -> None:
        self.names = tuple(names)
        self._pixels = pixels
        self.counts, self.bounded, self.radiance, self.measured = {}, {}, {}, {}
        self.indirect = SquareSums(pixels) if "indirect" in self.names else None
        self.narrow = NarrowSums(pixels) if NARROW in self.names else None
        for name in self.names:
            kind = name.partition(".")[0]
            if kind in COUNTED:
                self.counts[name] = CountSums(pixels)
            elif kind in BOUNDED:
                self.bounded[name] = FixedPointSums((aov_of(name).channels, pixels))
            elif kind in MEASURED_AOVS:
                self.measured[name] = Film(pixels, 1)
            elif kind not in ("indirect", NARROW):
                self.radiance[name] = RadianceSums(pixels)
        if self.indirect is not None and "direct" not in self.radiance:
            self.radiance["direct"] = RadianceSums(pixels)

    def add(
        self, pixels: Words, samples: AovSamples, radiance: Floats, most: int, dropped: Ints = NONE
    ) -> None:
        """Add samples.

        Parameters
        ----------
        pixels
            (k,) row-major indices in rising order.
        samples, radiance
            The next samples of each pixel, and their radiance (3, samples, k).
        most
            No pixel has more samples than this afterwards.
        dropped
            As for `Film.add`.
        """
        lanes = pixel_span(pixels)
        for name, counts in self.counts.items():
            counts.add(lanes, samples.counts[name])
        for name, bounded in self.bounded.items():
            bounded.add(lanes, samples.bounded[name], most)
        for name, film in self.measured.items():
            film.add(pixels, samples.radiance[name], dropped)
        if self.narrow is not None and samples.narrow is not None:
            self.narrow.add(lanes, samples.narrow)
        for start in range(0, pixels.size, CHUNK):
            chunk = slice(start, start + CHUNK)
            lanes = pixel_span(pixels[chunk])
            for name, sums in self.radiance.items():
                sums.add(lanes, samples.radiance[name][:, :, chunk])
            if self.indirect is not None:
                self.indirect.add(lanes, radiance[:, :, chunk] - samples.radiance["direct"][:, :, chunk])

    def estimate(self, name: str, picture: ExactSums, count: Ints) -> AovEstimate:
        """Return an AOV from its sums, those of the picture, and the samples of each pixel (pixels,)."""
        if name in self.measured:
            estimates = self.measured[name].estimates()
            return AovEstimate(estimates.mean, estimates.standard_error, estimates.variance)
        if name == NARROW:
            assert self.narrow is not None
            return AovEstimate(self.narrow.typical()[:, None], None)
        shape = self._pixels, aov_of(name).channels
        means, errors = np.empty(shape, f4), np.empty(shape, f4)
        for span in chunks(self._pixels):
            sums, squares = self._totals(name, picture, span)
            n = np.maximum(count[span], 1)
            mean = sums / n
            spread = np.maximum(squares - n * np.square(mean), 0)
            variance = np.where(count[span] > 1, spread, np.nan) / np.maximum(n - 1, 1)
            with np.errstate(over="ignore"):
                means[span], errors[span] = mean.T, np.sqrt(variance / n).T
        return AovEstimate(means, errors)

    def _totals(self, name: str, picture: ExactSums, span: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples of an AOV and of their squares, each (c, k)."""
        if name == "indirect":
            assert self.indirect is not None
            direct, _ = self.radiance["direct"].totals(span)
            return picture.value(span) - direct, self.indirect.squares[:, span].astype(np.float64)
        if name in self.counts:
            return self.counts[name].totals(span)
        return self.bounded[name].totals(span) if name in self.bounded else self.radiance[name].totals(span)

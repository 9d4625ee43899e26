"""Sums of the sampled layers of a picture, and what they come to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.record import record
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, Ints, Lanes, f4
from .aov_names import layer_of
from .aov_samples import (
    BOUNDED,
    COUNTED,
    FRACTION_BITS,
    NARROW_TERMS,
    FixedPoint,
    FixedPointSamples,
    LayerSamples,
)
from .exact_sum import ExactSums
from .film import CHUNK, add_in_order, chunks, pixel_span

UNIT = 2.0**-FRACTION_BITS
LARGEST_NARROW = NARROW_TERMS << FRACTION_BITS


@record
class LayerEstimate:
    """What the samples of a layer come to."""

    mean: Floats  # (pixels, c)
    standard_error: Floats  # (pixels, c) of `mean`; NaN for fewer than two samples


def layer_bytes(name: str) -> int:
    """Return the bytes that a sampled layer takes for each pixel, its mean and error included.

    They are those of up to 127 samples.
    """
    kind, channels = name.partition(".")[0], layer_of(name).channels
    sums = 4 if kind in COUNTED else 8 if kind in BOUNDED else 4 if kind == "indirect" else 20
    return channels * (sums + 8)


class CountSums:
    """Numbers of samples of n pixels that have a property. Memory is 4 bytes for each pixel."""

    def __init__(self, pixels: int) -> None:
        self._counts = np.zeros((1, pixels), np.int32)

    def add(self, lanes: Lanes, counts: Ints) -> None:
        """Add numbers (k,) of other samples."""
        self._counts[0, lanes] += counts

    def merge(self, other: CountSums) -> None:
        """Add the numbers of other samples."""
        self._counts += other._counts

    def totals(self, part: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (1, k): a sample is 0 or 1."""
        counts = self._counts[:, part].astype(np.float64)
        return counts, counts

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        return {"counts": self._counts}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over arrays that `arrays` returned."""
        self._counts = arrays["counts"]


class FixedPointSums:
    """Sums, and sums of squares, of values in [-1, 1], in units of 2^-24, for c channels of n pixels.

    They are exact, so their bits depend neither on the order of the samples nor on partial sums. Memory is
    8 bytes for each channel and pixel up to 127 samples, and 16 after that.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._sums: FixedPoint = np.zeros(shape, np.int32)
        self._squares: FixedPoint = np.zeros(shape, np.int32)

    def add(self, lanes: Lanes, samples: FixedPointSamples, most: int) -> None:
        """Add sums over samples of some pixels, of which none then has more than `most` samples."""
        if most > NARROW_TERMS and self._sums.dtype == np.int32:
            self._sums, self._squares = self._sums.astype(np.int64), self._squares.astype(np.int64)
        self._sums[:, lanes] += samples.sums
        self._squares[:, lanes] += samples.squares

    def merge(self, other: FixedPointSums) -> None:
        """Add the sums of other samples."""
        both = self._sums.astype(np.int64) + other._sums, self._squares.astype(np.int64) + other._squares
        wide = any(np.abs(sums).max(initial=0) > LARGEST_NARROW for sums in both)
        self._sums, self._squares = both if wide else (sums.astype(np.int32) for sums in both)

    def totals(self, part: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (c, k)."""
        sums, squares = self._sums[:, part].astype(np.float64), self._squares[:, part].astype(np.float64)
        return sums * UNIT, squares * UNIT

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        return {"sums": self._sums, "squares": self._squares}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over arrays that `arrays` returned."""
        self._sums, self._squares = arrays["sums"], arrays["squares"]


class SquareSums:
    """Sums of squares of radiance, (3, n), added in the order of the samples; 12 bytes for each pixel."""

    def __init__(self, pixels: int) -> None:
        self._squares = np.zeros((3, pixels), f4)

    def add(self, lanes: Lanes, radiance: Floats) -> None:
        """Add samples (3, samples, k)."""
        squares = self._squares[:, lanes]  # a view of a slice, else a copy
        with np.errstate(over="ignore"):
            add_in_order(squares, np.square(radiance))
        if not isinstance(lanes, slice):
            self._squares[:, lanes] = squares

    def merge(self, other: SquareSums) -> None:
        """Add the sums of other samples; the last bits depend on which samples are in which part."""
        self._squares += other._squares

    def total(self, part: slice) -> Doubles:
        """Return the sums, (3, k)."""
        return self._squares[:, part].astype(np.float64)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the array by name."""
        return {"squares": self._squares}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over the array that `arrays` returned."""
        self._squares = arrays["squares"]


class RadianceSums:
    """Exact sums of radiance, and sums of squares; 60 bytes for each pixel."""

    def __init__(self, pixels: int) -> None:
        self._sums, self._squares = ExactSums((3, pixels)), SquareSums(pixels)

    def add(self, lanes: Lanes, radiance: Floats) -> None:
        """Add samples (3, samples, k)."""
        self._sums.add(lanes, radiance.astype(np.float64))
        self._squares.add(lanes, radiance)

    def merge(self, other: RadianceSums) -> None:
        """Add the sums of other samples."""
        self._sums.merge(other._sums)
        self._squares.merge(other._squares)

    def totals(self, part: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples and of their squares, each (3, k)."""
        return self._sums.value(part), self._squares.total(part)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        return {**self._sums.arrays(), **self._squares.arrays()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over arrays that `arrays` returned."""
        self._sums.restore(arrays)
        self._squares.restore(arrays)


class LayerSums:
    """Sums of the samples of some layers.

    Like those of the `Film` they do not depend on the division of a render into jobs. The means do not
    depend on the division of samples between two sums that are merged either; errors of layers of radiance
    may then differ by their rounding.

    Parameters
    ----------
    names
        Sampled layers, those with a key by it, such as "light_groups.sun".
    pixels
        Their number.
    """

    def __init__(self, names: Iterable[str], pixels: int) -> None:
        self._names = tuple(names)
        self._pixels = pixels
        self._counts: dict[str, CountSums] = {}
        self._bounded: dict[str, FixedPointSums] = {}
        self._radiance: dict[str, RadianceSums] = {}
        self._indirect = SquareSums(pixels) if "indirect" in self._names else None
        for name in self._names:
            kind = name.partition(".")[0]
            if kind in COUNTED:
                self._counts[name] = CountSums(pixels)
            elif kind in BOUNDED:
                self._bounded[name] = FixedPointSums((layer_of(name).channels, pixels))
            elif kind != "indirect":
                self._radiance[name] = RadianceSums(pixels)
        if self._indirect is not None and "direct" not in self._radiance:
            self._radiance["direct"] = RadianceSums(pixels)

    def add(self, pixels: Words, samples: LayerSamples, radiance: Floats, most: int) -> None:
        """Add samples.

        Parameters
        ----------
        pixels
            (k,) row-major indices in rising order.
        samples, radiance
            The next samples of each pixel, and their radiance (3, samples, k).
        most
            No pixel has more samples than this afterwards.
        """
        lanes = pixel_span(pixels)
        for name, counts in self._counts.items():
            counts.add(lanes, samples.counts[name])
        for name, bounded in self._bounded.items():
            bounded.add(lanes, samples.bounded[name], most)
        for start in range(0, pixels.size, CHUNK):
            part = slice(start, start + CHUNK)
            lanes = pixel_span(pixels[part])
            for name, sums in self._radiance.items():
                sums.add(lanes, samples.radiance[name][:, :, part])
            if self._indirect is not None:
                self._indirect.add(lanes, radiance[:, :, part] - samples.radiance["direct"][:, :, part])

    def merge(self, other: LayerSums) -> None:
        """Add the sums of other samples of the same layers."""
        for name, part in self._parts().items():
            part.merge(other._parts()[name])

    def estimate(self, name: str, picture: ExactSums, count: Ints) -> LayerEstimate:
        """Return a layer from its sums, those of the picture, and the samples of each pixel (pixels,)."""
        shape = self._pixels, layer_of(name).channels
        out = LayerEstimate(np.empty(shape, f4), np.empty(shape, f4))
        for part in chunks(self._pixels):
            sums, squares = self._totals(name, picture, part)
            n = np.maximum(count[part], 1)
            mean = sums / n
            spread = np.maximum(squares - n * np.square(mean), 0)
            variance = np.where(count[part] > 1, spread, np.nan) / np.maximum(n - 1, 1)
            with np.errstate(over="ignore"):
                out.mean[part] = mean.T
                out.standard_error[part] = np.sqrt(variance / n).T
        return out

    def _totals(self, name: str, picture: ExactSums, part: slice) -> tuple[Doubles, Doubles]:
        """Return the sums of the samples of a layer and of their squares, each (c, k)."""
        if name == "indirect":
            assert self._indirect is not None
            return picture.value(part) - self._radiance["direct"].totals(part)[0], self._indirect.total(part)
        if name in self._counts:
            return self._counts[name].totals(part)
        return (
            self._bounded[name].totals(part) if name in self._bounded else self._radiance[name].totals(part)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The layers."""
        return self._names

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all sums as arrays by name, such as "albedo.squares"."""
        return {
            f"{name}.{kind}": array
            for name, part in self._parts().items()
            for kind, array in part.arrays().items()
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over arrays that `arrays` of sums of the same layers and pixels returned."""
        for name, part in self._parts().items():
            part.restore({kind: arrays[f"{name}.{kind}"] for kind in part.arrays()})

    def _parts(self) -> dict[str, Any]:
        """Return all sums by the name of their layer."""
        indirect = {} if self._indirect is None else {"indirect": self._indirect}
        return {**self._counts, **self._bounded, **self._radiance, **indirect}

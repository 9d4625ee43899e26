"""The film: sums of samples for each pixel, and estimates of their error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import ALL, Doubles, Floats, Ints, Lanes, distinct, take
from .exact_sum import ExactSums
from .light_sums import LightSums
from .sums import Sums

BATCHES = 8  # at most
WHOLE_BATCH = 4  # samples; batches are at least this long if a pixel has two of them
EPSILON = 1e-2  # relative to the squared mean of a picture; added to the squares by which errors are divided
LEAST_FOR_RARE = 16  # samples of every pixel, so that it has four batches
MUCH_RARE = 0.6  # part of the squared error that rests on few samples, from where on it is too small
OUTLIERS = 1e-3  # fraction of the pixels whose error is limited to that of the worst other pixel
NONE = np.zeros(0, np.intp)
TINY = 1e-180  # its power of 1.5 is above 0
CHUNK = 8192  # pixels, or samples, that are added together: few enough for the cache


class Film(Sums):
    """Sums of samples per pixel, and the sums that the error estimate needs.

    The sums are exact (`ExactSums`), so the picture depends neither on the division of a render
    into jobs nor on the division of samples between two films that are merged.

    The samples of a stratified sampler depend on each other, so their scatter does not give the error of
    their mean. Consecutive samples therefore form batches of `batch_size`, a power of two that doubles with
    the number of samples, so that 4 to 8 batches are full from the sixteenth sample on. Aligned blocks of
    Sobol points are stratified like the first block, so the scatter of the batches' means includes the gain
    within a batch. It does not include the gain between batches: for stratified points the error is
    over-estimated, by 20 to 40 % where they gain most, and that of a mean over many pixels by up to 2.6.
    `halves` is for such means. Independent samples have no such bias.

    Samples that are not finite are dropped: they are counted, and the mean is that of the others.

    Memory is 176 bytes per pixel, whatever the number of samples, and 4 more when one was dropped. Light
    paths take 192 more.

    Parameters
    ----------
    width, height
        Of the picture, pixels.
    light_tracing
        Whether there is light tracing, too, whose light adds to the mean.

    Attributes
    ----------
    count
        Samples of each pixel, (pixels,), with those that were dropped.
    dropped
        How many of them were dropped, (pixels,); empty as long as none was.
    light
        Sums over paths from lights; None where there are none.
    """

    JOINED = ("batches", "lengths")
    count: Ints
    dropped: Ints
    sums: ExactSums  # of samples
    squares: Doubles  # (3, pixels) sum of squared samples
    batches: Floats  # (BATCHES, 3, pixels) sums of full batches
    lengths: Ints  # (BATCHES,) samples of each batch; all 0: they are `batch_size`, as those of one render
    light: LightSums | None

    def __init__(self, width: int, height: int, light_tracing: bool = False) -> None:
        pixels = width * height
        self.size = width, height
        self.count = np.zeros(pixels, np.int64)
        self.dropped = np.zeros(0, np.int32)
        self.sums = ExactSums((3, pixels))
        self.squares = np.zeros((3, pixels))
        self.batches = np.zeros((BATCHES, 3, pixels), np.float32)
        self.batches.fill(0)  # takes the memory now, so that a render that lacks it does not fail late
        self.light = LightSums(pixels) if light_tracing else None
        self.lengths = np.zeros(BATCHES, np.int64)

    def release_errors(self) -> None:
        """Free the sums of variances and errors, 120 bytes per pixel; nothing can be added after that."""
        self.squares, self.batches = np.zeros((3, 0)), np.zeros((BATCHES, 3, 0), np.float32)

    def add(self, pixels: Words, radiance: Floats, dropped: Ints = NONE) -> None:
        """Add samples.

        Parameters
        ----------
        pixels
            (k,) row-major indices in rising order, of pixels with equally many samples so far.
        radiance
            (3, samples, k): the next samples of each pixel.
        dropped
            Numbers of those, in [0, samples · k), that are dropped; they are 0 in `radiance`.
        """
        if dropped.size:
            self._drop(pixels[dropped % pixels.size])
        for start in range(0, pixels.size, CHUNK):
            chunk = slice(start, start + CHUNK)
            self._add(pixel_span(pixels[chunk]), radiance[:, :, chunk])

    def _add(self, lanes: Lanes, radiance: Floats) -> None:
        """Add samples (3, samples, k) of at most `CHUNK` pixels."""
        at_once = max(1, CHUNK // radiance.shape[2])
        squares = self.squares[:, lanes]  # a view of a span, else a copy
        count, samples = int(self.count[lanes][0]), radiance.shape[1]
        start = 0
        while start < samples:
            size = batch_size(count + 1)
            if count and size > batch_size(count):
                self._pair_batches(lanes)
            stop = min(samples, start + at_once, start + size - count % size)
            rows = radiance[:, start:stop].astype(np.float64)
            add_in_order(squares, np.square(rows))
            self.sums.add(lanes, rows)
            count += stop - start
            start = stop
            if count % size == 0:
                self._close_batch(lanes, count // size - 1)
        if not isinstance(lanes, slice):
            self.squares[:, lanes] = squares
        self.count[lanes] = count

    def _drop(self, pixels: Words) -> None:
        """Count dropped samples of pixels, which may repeat."""
        if not self.dropped.size:
            self.dropped = np.zeros(self.count.size, np.int32)
        np.add.at(self.dropped, pixels, 1)

    def used(self, span: slice = slice(None)) -> Ints:
        """Return the number of samples of each pixel that were not dropped, (k,)."""
        return self.count[span] - self.dropped[span] if self.dropped.size else self.count[span]

    def _close_batch(self, lanes: Lanes, number: int) -> None:
        """Store the sum of a full batch: the sums less all batches before it.

        Rounding errors of batches do not accumulate, since each batch corrects those before it.
        """
        before = np.zeros_like(self.squares[:, lanes])
        for batch in self.batches[:number]:
            before += batch[:, lanes]
        self.batches[number][:, lanes] = self.sums.value(lanes) - before

    def _pair_batches(self, lanes: Lanes) -> None:
        """Add pairs of batches, so that half as many batches are twice as long."""
        for half in range(BATCHES // 2):
            pair = self.batches[2 * half : 2 * half + 2, :, lanes]
            self.batches[half][:, lanes] = pair[0] + pair[1]

    def restore(self, arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> None:
        """Take the sums from the result of `arrays`, under names that begin with `prefix`, without a copy."""
        dropped = arrays.get(f"{prefix}dropped", NONE)
        self.dropped = np.zeros(self.count.size if dropped.size else 0, np.int32)
        super().restore(arrays, prefix)

    def merge(self, other: Film) -> None:
        """Add the samples of another film.

        On each of the films all pixels have equally many samples. The sums, and so the picture, are those of
        one film with all samples, bit for bit. `squares` are rounded in another order. Batches are
        joined, in order, until they are as long as those of one film; where they do not end at the same
        samples, they have different lengths, which the error estimate allows for.
        """
        count = int(self.count[0] + other.count[0])
        size = batch_size(count)
        joined = _joined([*self._all_batches(), *other._all_batches()], size)
        super().merge(other)
        self.batches, self.lengths = np.zeros_like(self.batches), np.zeros_like(self.lengths)
        for number, (batch, _) in enumerate(joined):
            self.batches[number] = batch
        lengths = [length for _, length in joined]
        if lengths != [size] * (count // size):
            self.lengths[: len(lengths)] = lengths

    def _all_batches(self) -> Iterator[tuple[Doubles, int]]:
        """Yield the sums (3, pixels) and lengths of consecutive batches, which hold all samples."""
        count = int(self.count[0])
        size = batch_size(count)
        lengths = self.lengths[self.lengths > 0].tolist() or [size] * (count // size)
        rest = self.sums.value()
        for batch, length in zip(self.batches, lengths, strict=False):
            rest -= batch
            yield batch.astype(np.float64), length
        if sum(lengths) < count:
            yield rest, count - sum(lengths)

    def mean(self, span: slice = slice(None)) -> Doubles:
        """Return the means of pixels, (3, k): of samples, plus light tracing; 0 without samples."""
        mean = self._mean_of_samples(span)
        return mean if self.light is None else mean + self.light.mean(span)

    def _mean_of_samples(self, span: slice) -> Doubles:
        return self.sums.value(span) / np.maximum(self.used(span), 1)

    def variance(self, span: slice = slice(None)) -> Doubles:
        """Estimate the variance of one sample of each pixel, (3, k); NaN for fewer than two.

        With light tracing it is that of as many samples, each with its part of the paths from lights.
        """
        variance = self._variance_of_samples(span)
        return variance if self.light is None else variance + self.light.squared_error(span) * self.used(span)

    def _variance_of_samples(self, span: slice) -> Doubles:
        count = self.used(span)
        spread = self.squares[:, span] - count * np.square(self._mean_of_samples(span))
        return np.where(count > 1, np.maximum(spread, 0), np.nan) / np.maximum(count - 1, 1)

    def squared_error(self, span: slice = slice(None)) -> Doubles:
        """Estimate the variance of `mean` from batches, (3, k); NaN for fewer than two samples.

        Where samples were dropped, which batches hold as 0, it is that of as many independent samples.
        """
        error = self._scatter_of_batches(span)
        if self.dropped.size:
            lanes = np.flatnonzero(self.dropped[span])
            error[:, lanes] = (self._variance_of_samples(span) / np.maximum(self.used(span), 1))[:, lanes]
        return error if self.light is None else error + self.light.squared_error(span)

    def _scatter_of_batches(self, span: slice) -> Doubles:
        """Estimate the variance of the mean of all samples, (3, k)."""
        lengths = self.lengths[self.lengths > 0]
        if lengths.size:
            return _unequal_error(self.batches[: lengths.size, :, span], lengths, self.count[0])
        counts = self.count[span]
        error = np.full((3, counts.size), np.nan)
        for count in distinct(counts[counts > 1]):
            same = counts == count
            lanes = ALL if same.all() else np.flatnonzero(same)
            size = batch_size(count)
            used = count // size
            batch_means = take(self.batches[:used, :, span], lanes) / np.float64(size)
            error[:, lanes] = batch_means.var(0, ddof=1) * (size / count)
        return error

    def deviations(self, span: slice = slice(None)) -> Doubles:
        """Return the deviations of batches from the mean, (batches, 3, k); pixels have two samples at least.

        They are scaled so that their squares add up to `_scatter_of_batches`. Batches that a pixel does not
        have, and all of a pixel of which samples were dropped, are 0.
        """
        lengths = self.lengths[self.lengths > 0]
        if lengths.size:
            samples = lengths.astype(np.float64)[:, None, None]
            means = self.batches[: lengths.size, :, span] / samples
            mean = (means * samples).sum(0) / samples.sum()
            scaled = (means - mean) * np.sqrt(samples / ((samples.size - 1) * self.count[0]))
        else:
            counts, most = self.count[span], max(count // batch_size(count) for count in distinct(self.count))
            scaled = np.zeros((most, 3, counts.size))
            for count in distinct(counts):
                lanes, size = np.flatnonzero(counts == count), batch_size(count)
                used = count // size
                means = take(self.batches[:used, :, span], lanes) / np.float64(size)
                scaled[:used, :, lanes] = (means - means.mean(0)) * np.sqrt(size / (count * (used - 1)))
        if self.dropped.size:
            scaled[:, :, self.dropped[span] > 0] = 0
        return scaled

    def halves(self, span: slice = slice(None)) -> Doubles:
        """Return half the difference of the means of two halves of the samples, (3, k).

        Its square is an estimate of the variance of `mean` that includes what a stratified sampler gains
        within half of the samples, so nearly all. It is of one degree of freedom: only sums over many pixels
        tell something. The halves are those of the batches; where these are odd in number, of different
        lengths, or without the last samples, the difference is scaled accordingly. NaN for fewer than two
        samples.
        """
        half_differences = np.full((3, self.count[span].size), np.nan)
        lengths = self.lengths[self.lengths > 0]
        for count in distinct(self.count[span]):
            if count > 1:
                lanes = np.flatnonzero(self.count[span] == count)
                sizes = lengths if lengths.size else np.full(count // batch_size(count), batch_size(count))
                difference = _half_difference(take(self.batches[: sizes.size, :, span], lanes), sizes)
                half_differences[:, lanes] = difference * np.sqrt(sizes.sum() / count)
        if self.dropped.size:
            lanes = np.flatnonzero(self.dropped[span])
            alone = self._variance_of_samples(span) / np.maximum(self.used(span), 1)
            half_differences[:, lanes] = np.copysign(np.sqrt(alone), half_differences)[:, lanes]
        return half_differences if self.light is None else half_differences + self.light.halves(span)

    def relative_variance(self, outliers: float = OUTLIERS) -> Doubles:
        """Estimate the squared relative error of each pixel, the mean of its channels, (pixels,).

        It is relative to the square of the channel plus `EPSILON` times the picture's squared mean, which
        limits the weight of black pixels. The error of the worst `outliers` of the pixels is limited to that
        of the worst other pixel, so that fireflies do not dominate the picture.
        """
        floor = self._floor()
        out = np.empty(self.count.size)
        for span in chunks(self.count.size):
            out[span] = self._relative(self.squared_error(span), span, floor)
        return _without_outliers(out, outliers)

    def rare_part(self, relative: Doubles) -> float | None:
        """Estimate the part of the squared error that rests on few samples; None below `LEAST_FOR_RARE`.

        Where one sample of a pixel brings most of its light, one batch is far above the others: the skewness
        of b batches is then (b − 2)/√(b (b − 1)), the greatest that so many numbers can have. It is about 0
        where many samples of either sign make up the error. The part is the mean of skewness over its
        greatest value, over pixels by their squared error.

        Parameters
        ----------
        relative
            (pixels,) squared relative errors, as `relative_variance` returns them.
        """
        if self.count.min() < LEAST_FOR_RARE or not relative.sum() > 0:
            return None
        skewed = np.empty(relative.size)
        for span in chunks(relative.size):
            deviations = self.deviations(span)
            batches = (deviations != 0).any(1).sum(0).clip(3)
            squares = np.square(deviations)
            square, cube = squares.sum(0), np.multiply(squares, deviations, out=squares).sum(0)
            square = np.maximum(square, TINY)
            skewness = (cube / (square * np.sqrt(square))).mean(0)
            skewed[span] = skewness * np.sqrt(batches * (batches - 1.0)) / (batches - 2)
        return float(max(0.0, (skewed * relative).sum() / relative.sum()))

    def noise(self) -> float:
        """Estimate the relative error of the picture, which `render(noise=...)` limits."""
        return float(np.sqrt(self.relative_variance().mean()))

    def _relative(self, squared_error: Doubles, span: slice, floor: float) -> Doubles:
        """Return squared errors (3, k) of some pixels relative to their brightness, (k,)."""
        return np.asarray((squared_error / (np.square(self.mean(span)) + floor)).mean(0))

    def _floor(self) -> float:
        return EPSILON * (self._overall_mean() ** 2) or 1.0

    def _overall_mean(self) -> float:
        return float(sum(self.mean(span).sum() for span in chunks(self.count.size)) / (3 * self.count.size))

    def estimates(self) -> Estimates:
        """Estimate the picture and its errors; a pixel without samples is black."""
        pixels = self.count.size
        mean, variance, error, halves = (np.empty((pixels, 3), np.float32) for _ in range(4))
        relative, floor = np.empty(pixels), self._floor()
        for span in chunks(self.count.size):
            squared_error = self.squared_error(span)
            with np.errstate(over="ignore"):  # values beyond float32 become infinite
                mean[span] = self.mean(span).T
                variance[span] = self.variance(span).T
                error[span] = np.sqrt(squared_error).T
                halves[span] = self.halves(span).T
            relative[span] = self._relative(squared_error, span, floor)
        worst, relative = float(np.sqrt(relative.max())), _without_outliers(relative)
        noise = float(np.sqrt(relative.mean()))
        return Estimates(mean, variance, error, halves, noise, worst, self.rare_part(relative))


@soa
class Estimates:
    """The means of the samples on a film, and their errors."""

    mean: Floats  # (pixels, 3)
    variance: Floats  # (pixels, 3) of one sample; NaN for fewer than two
    standard_error: Floats  # (pixels, 3) of `mean`; NaN for fewer than two samples
    halves: Floats  # (pixels, 3) half the difference of the means of two halves of the samples; likewise
    noise: float  # relative error of the picture
    worst: float  # of its pixels
    rare: float | None  # part of its square that rests on few samples; None if that is not known


def _without_outliers(relative: Doubles, outliers: float = OUTLIERS) -> Doubles:
    """Limit the worst `outliers` of the pixels to the worst of the others."""
    worst = relative.size - 1 - int(outliers * relative.size)
    return np.minimum(relative, np.partition(relative, worst)[worst])


def _joined(batches: list[tuple[Doubles, int]], size: int) -> list[tuple[Doubles, int]]:
    """Add up neighbors until each batch has `size` samples or more; a last one with fewer is dropped."""
    joined: list[tuple[Doubles, int]] = []
    for batch, length in batches:
        if joined and joined[-1][1] < size:
            before, samples = joined.pop()
            joined.append((before + batch, samples + length))
        else:
            joined.append((batch, length))
    return joined[:-1] if len(joined) > 2 and joined[-1][1] < size else joined


def _unequal_error(batches: Floats, lengths: Ints, count: int) -> Doubles:
    """Estimate the variance of the mean of `count` samples, (3, k), from batches (b, 3, k) of `lengths` (b,).

    The mean of a batch of n samples is taken to have 1/n of the variance of a sample. With equal lengths
    this is the estimate from the scatter of the batches' means.
    """
    samples = lengths.astype(np.float64)[:, None, None]
    means = batches / samples
    mean = (means * samples).sum(0) / samples.sum()
    scatter = (samples * np.square(means - mean)).sum(0) / (lengths.size - 1)
    return np.asarray(scatter / count)


def _half_difference(batches: Floats, lengths: Ints) -> Doubles:
    """Return half the difference of the means (3, k) of two halves of batches (b, 3, k) of `lengths` (b,).

    Halves of different lengths have a difference that is scaled to the variance of one of equal halves.
    """
    middle = lengths.size // 2
    first, second = int(lengths[:middle].sum()), int(lengths[middle:].sum())
    difference = batches[:middle].sum(0, dtype=np.float64) / first
    difference -= batches[middle:].sum(0, dtype=np.float64) / second
    return np.asarray(difference * (np.sqrt(first * second) / (first + second)))


def batch_size(count: int) -> int:
    """Return the samples per batch of a pixel with `count` samples: a power of two."""
    power = 1 << (count - 1).bit_length()
    return max(1, min(WHOLE_BATCH, power // 4), power // BATCHES)


def chunks(pixels: int) -> Iterator[slice]:
    """Yield spans of so many pixels, so that temporary arrays stay small."""
    for start in range(0, pixels, CHUNK):
        yield slice(start, min(start + CHUNK, pixels))


def pixel_span(pixels: Words) -> Lanes:
    """Return rising indices as a slice if they have no gaps, which is much faster to add to."""
    first, last = int(pixels[0]), int(pixels[-1])
    return slice(first, last + 1) if last - first + 1 == pixels.size else pixels.astype(np.intp)


def add_in_order(sums: Floats, rows: Floats) -> None:
    """Add rows (c, n, k) to sums (c, k), strictly in order.

    `sum` along the axis would group terms by the layout of the array, and so round differently.
    """
    if rows.shape[1] < rows.shape[2]:
        for row in rows.swapaxes(0, 1):
            sums += row
    else:
        terms = np.concatenate([sums[:, None], rows], axis=1)
        sums[:] = np.cumsum(terms, axis=1)[:, -1]

"""The mean of a region of a picture, and its error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats
from ..core.errors import SceneError, number
from ..core.suggestions import suggests_keywords
from .scatter import Scatter, sums_by_label
from .student_t import t_quantile

FEW = 8.0  # pixels, or tiles, for which the scatter of batches counts as much as the differences of halves
LEAST_EXTRAPOLATED = 12  # samples from which on halves of them show the gain of stratification


@dataclass(frozen=True, slots=True)
class RegionMean:
    """The mean of the pixels of a region, from `Image.mean`.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1), wf.PointLight((3, 3, 3), 90)], spp=16, size=(24, 24))
    >>> middle = image.mean((slice(8, 16), slice(8, 16)))
    >>> isinstance(middle, wf.RegionMean), middle.pixels
    (True, 64)
    >>> low, high = middle.interval(0.95)
    >>> bool((low < middle.value).all() and (middle.value < high).all())
    True
    """

    value: Doubles  # (3,) mean of each channel, linear radiance
    standard_error: Doubles | None  # (3,) of `value`; None where it is not known
    freedom: Doubles | None  # (3,) degrees of freedom with which `standard_error` is known
    pixels: int  # in the region
    error_absent: str = ""  # the reason why there is no standard error
    before_denoising: bool = False  # whether the picture was denoised, and this is of its samples

    @suggests_keywords
    def interval(self, confidence: float = 0.95) -> tuple[Doubles, Doubles]:
        """Return the confidence interval of the converged mean: lower and upper limit, (3,) each.

        It is that of Student's t distribution.

        Parameters
        ----------
        confidence
            The probability that it contains the converged mean, above 0 and below 1.

        Raises
        ------
        SceneError
            If the confidence is out of range, or the standard error is not known.
        """
        confidence = number("interval: confidence", confidence, lambda x: 0 < x < 1, "above 0 and below 1")
        if self.standard_error is None or self.freedom is None:
            raise SceneError(f"interval: the error is not known: {self.error_absent}")
        away = t_quantile(confidence, self.freedom) * self.standard_error
        return self.value - away, self.value + away


@soa
class PixelErrors:
    """The errors of the pixels of a picture."""

    standard_error: Floats | None  # (H, W, 3) from the scatter of batches
    freedom: Doubles  # (H, W) its degrees of freedom
    scatter: Sequence[Scatter] = ()  # of the picture, for each part of it that shares paths
    alone: Doubles | None = None  # (H, W, 3) squared errors as of independent samples
    halves: Floats | None = None  # (H, W, 3) half the differences of the means of two halves of the samples


def region_mean(
    rgb: Floats, region: Bools, errors: PixelErrors, samples: int, error_absent: str
) -> RegionMean:
    """Return the mean of the pixels `region` (H, W) of a picture (H, W, 3).

    Parameters
    ----------
    samples
        The most that a pixel of the region has.
    error_absent
        The reason why the error is not known, or nothing.
    """
    pixels = int(np.count_nonzero(region))
    value = rgb[region].mean(0, dtype=np.float64)
    if error_absent or errors.standard_error is None:
        return RegionMean(value, None, None, pixels, error_absent)
    label = np.where(region, 0, -1)
    (variance,), (spread,) = sums_by_label(errors.standard_error, errors.freedom, errors.scatter, label, 1)
    known, least = spread > 0, float(errors.freedom[region].min())
    freedom = np.maximum(np.square(variance) / np.where(known, spread, 1), 1)
    error = np.sqrt(_by_halves(variance, region, errors, samples)) / pixels
    return RegionMean(value, error, np.where(known, freedom, least), pixels)


def _by_halves(variance: Doubles, region: Bools, errors: PixelErrors, samples: int) -> Doubles:
    """Return the variance (3,) of the sum over a region, given that by the scatter of batches.

    Batches are short, so their scatter does not show all that stratified samples gain. The squared
    differences of halves show nearly all of it, but are of one degree of freedom for each pixel; where these
    are few, the scatter counts, too. From half of the samples to all of them the gain is extrapolated.
    """
    tile = _common_tile(errors.scatter)
    if errors.halves is None or (errors.scatter and tile is None):
        return variance
    halves = errors.halves[region].astype(np.float64)
    sums = halves if tile is None else sums_of_tiles(halves, tile[region])
    estimate = (np.square(sums).sum(0) + FEW / len(sums) * variance) / (1 + FEW / len(sums))
    if errors.alone is None or samples < LEAST_EXTRAPOLATED:
        return np.asarray(estimate)
    assert errors.standard_error is not None
    batches = np.square(errors.standard_error[region], dtype=np.float64).sum(0)
    few, alone = FEW / len(halves), errors.alone[region].sum(0)
    half_variance = (np.square(halves).sum(0) + few * batches) / (1 + few)
    gain = np.minimum(half_variance / np.where(alone > 0, alone, 1), 1)
    return np.asarray(estimate * gain ** (_steps_of_gain(samples) / (1 + few)))


def _steps_of_gain(samples: int) -> float:
    """Return the power of the gain of half of the samples that is the further gain of all of them.

    The part of the variance that is left falls as a power of the number of stratified samples, so the step
    from half of them to all is one of as many as there are doublings. It is one and a half where most of a
    net in base 4 is complete, as was found with three scenes (docs/convergence.md).
    """
    net = 4 ** ((samples - 1).bit_length() + 1 >> 1)  # the smallest one that holds so many samples
    return (1.5 if samples >= 0.75 * net else 1.0) / math.log2(samples / 2)


def _common_tile(scatter: Sequence[Scatter]) -> NDArray[np.int32] | None:
    """Return the tiles (H, W) that share paths, if those of all parts of a picture are the same."""
    tiles = [group.tile for group in scatter]
    return tiles[0] if tiles and all((tile == tiles[0]).all() for tile in tiles) else None


def sums_of_tiles(values: Doubles, tile: NDArray[np.int32]) -> Doubles:
    """Return the sums (tiles, 3) of values (k, 3) over the pixels of each tile, given their tiles (k,)."""
    order = np.argsort(tile, kind="stable")
    return np.add.reduceat(values[order], np.flatnonzero(np.diff(tile[order], prepend=-1)), axis=0)

"""Significance tests: whether two noisy pictures show the same picture.

Each channel of each pixel, of each block of pixels and of the whole picture is tested by itself. The
smallest p-value of a level is corrected for the number of tests by Šidák's inequality (Z. Šidák,
Rectangular Confidence Regions for the Means of Multivariate Normal Distributions, 1967), which also holds
for channels that depend on each other.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Ints, distinct
from ..film.film import EPSILON
from .limits import UNSEEN
from .region import sums_of_tiles
from .scatter import Scatter, sums_by_label
from .student_t import log_gamma, t_tail

BLOCKS = (8, 32)  # pixels along the sides of blocks
ROUNDING = 1e-5  # relative difference of two means that is left to float32
LEAST_SAMPLES = 32  # pixels or tiles that take the place of samples in a t test
WINDOW = 5  # pixels along the sides of a window around a pixel, which estimates its noise
TINY = 1e-300


@soa
class Estimate:
    """Means with their errors."""

    mean: Doubles  # (..., 3)
    squared_error: Doubles  # (..., 3) estimated variance of `mean`
    freedom: Doubles  # (..., 3) degrees of freedom of `squared_error`
    samples: Doubles  # (..., 1) number of samples
    variance: Doubles  # (..., 3) estimated variance of one sample; 0 where it is not known
    scatter: tuple[Scatter, ...] = ()  # of pixels that depend on each other, where it is known
    sharing: int = 1  # where it is not: pixels in a group whose errors may depend on each other


@soa
class Significance:
    """p-values: the chances of a difference as large as that of two pictures by noise alone."""

    pixels: float
    blocks: float
    mean: float

    @property
    def all_levels(self) -> float:
        """The p-value of the three levels together."""
        return sidak(min(self.pixels, self.blocks, self.mean), 3)


def significance(a: Estimate, b: Estimate, independent: bool = True) -> Significance:
    """Test whether two pictures, estimates (H, W, 3), have the same mean at each of three levels.

    Pictures that are not independent are tested by the errors of the estimates alone.
    """
    blocks = [p_values(_averaged(a, side), _averaged(b, side)) for side in BLOCKS]
    return Significance(
        corrected(p_values(_cautious(a), _cautious(b))),
        corrected(np.concatenate([p.ravel() for p in blocks])),
        corrected(_p_of_mean(a, b, independent)),
    )


def _p_of_mean(a: Estimate, b: Estimate, independent: bool = True) -> Doubles:
    """Return the p-values (k, 3) of the difference of the means of whole pictures, of k tests.

    Pixels are the samples: their differences are independent, and the mean of each is 0 if the pictures are
    the same, so Student's t test needs no errors of pixels. Those are too large for few samples, since they
    leave out the gain of stratification between batches, which are as short as one sample. Where pixels share
    paths, tiles are the samples. With about as many samples in both pictures the differences are nearly
    symmetric, and the test is a cautious one however much their variances differ (Y. Benjamini, Is the t Test
    Really Conservative when the Parent Distribution is Long-Tailed?, 1983).

    A second test is of weighted differences, since a few pixels are often much noisier than all others. The
    weight of each pixel comes from the variances of those around it: it is independent of the pixel's own
    difference, so the mean of their product is 0 likewise, for pictures of whatever noise.
    """
    if not (independent and _are_alike(a, b)):
        side = max(a.mean.shape[:2])
        return p_values(_averaged(a, side), _averaged(b, side))
    tile = _common_tiles(a, b)
    weight = _quietness(a, b)
    return np.stack([_p_of_sums(a.mean * factor, b.mean * factor, tile) for factor in (np.ones(1), weight)])


def _p_of_sums(first: Doubles, second: Doubles, tile: NDArray[np.int32] | None) -> Doubles:
    """Return the p-values (3,) of the difference of the sums of pictures (H, W, 3), with tiles as samples."""
    first, second = first.reshape(-1, 3), second.reshape(-1, 3)
    if tile is not None:
        first, second = (sums_of_tiles(picture, tile.ravel()) for picture in (first, second))
    apart, count = first - second, len(first)
    rounding = ROUNDING * np.maximum(np.abs(first.mean(0)), np.abs(second.mean(0)))
    off = np.maximum(np.abs(apart.mean(0)) - rounding, 0)
    p = _two_sided(off, apart.var(0, ddof=1) / count, np.full(3, count - 1.0))
    return np.where(off > 0, p, 1.0)


def _quietness(a: Estimate, b: Estimate) -> Doubles:
    """Return weights (H, W, 3): the inverse of the variance of the pixels around each, their geometric mean.

    Unlike the arithmetic mean it says little of rare, bright samples. Pixels without any variance, as those
    of a background, do not count. To the others comes that of a sample which was not seen, as of values not
    much below the picture's mean.
    """
    alone = _alone(a) + _alone(b)
    mean, samples = (a.mean + b.mean) / 2, np.minimum(a.samples, b.samples)
    squared = np.square(mean) + EPSILON * np.square(mean.mean((0, 1)))
    noisy = alone > 0
    logarithm = np.log(np.where(noisy, alone + 2 * squared * np.square(UNSEEN / samples), 1))
    total, count = (_around(image) for image in (logarithm, noisy.astype(np.float64)))
    quiet = np.where(count > 0, np.exp(-total / np.maximum(count, 1)), 0)
    most = quiet.max((0, 1))
    return np.asarray(quiet / np.where(most > 0, most, 1))


def _around(values: Doubles) -> Doubles:
    """Return the sums of values (H, W, 3) over the windows around pixels, without the pixels themselves."""
    sums = values
    for axis in (0, 1):
        length = values.shape[axis]
        total = np.concatenate([np.zeros_like(sums.take([0], axis)), sums.cumsum(axis)], axis)
        at = np.arange(length)
        last = np.minimum(at + WINDOW // 2 + 1, length)
        sums = total.take(last, axis) - total.take(np.maximum(at - WINDOW // 2, 0), axis)
    return sums - values


def _alone(picture: Estimate) -> Doubles:
    """Return squared errors as of independent samples, or those that are known."""
    known = picture.variance.any()
    return picture.variance / picture.samples if known else picture.squared_error


def _are_alike(a: Estimate, b: Estimate) -> bool:
    """Return whether pixels, or tiles, can be the samples of a t test of two pictures.

    They cannot if they are few, if it is not known which pixels share paths, or if one of the pictures has
    more than twice as many samples as the other.
    """
    fewer, more = sorted(float(picture.samples.sum()) for picture in (a, b))
    tiles = [group.tile for picture in (a, b) for group in picture.scatter]
    unknown = any(picture.sharing > 1 and not picture.scatter for picture in (a, b))
    if unknown or more > 2 * fewer or any((tile != tiles[0]).any() for tile in tiles):
        return False
    samples = len(distinct(tiles[0].ravel().astype(np.intp))) if tiles else a.mean[..., 0].size
    return samples >= LEAST_SAMPLES


def _common_tiles(a: Estimate, b: Estimate) -> NDArray[np.int32] | None:
    """Return the tiles (H, W) of which the pixels of both pictures are independent; None: pixels are."""
    return next((group.tile for picture in (a, b) for group in picture.scatter), None)


def _cautious(picture: Estimate) -> Estimate:
    """Return an estimate with errors no less than those of independent samples.

    The few batches of a pixel may happen to be alike, as where each has one bright sample. Over a block that
    does not matter.
    """
    alone = picture.variance / picture.samples
    return replace(picture, squared_error=np.maximum(picture.squared_error, alone))


def corrected(p: Doubles) -> float:
    """Return the p-value of the smallest of some p-values."""
    return sidak(float(p.min()), p.size)


def sidak(p: float, tests: int) -> float:
    """Return 1 − (1 − p)^tests."""
    return -math.expm1(tests * math.log1p(-p)) if p < 1 else 1.0


def p_values(a: Estimate, b: Estimate) -> Doubles:
    """Return the two-sided p-value of the difference of each pair of means.

    It is the larger one of three:

    - Welch's t test (B. L. Welch, The Generalization of "Student's" Problem when Several Different
      Population Variances are Involved, 1947), for samples of different variance;
    - Student's t test with a pooled variance. It protects few samples, which may have missed rare events
      and bright and so look less noisy than they are, beside many;
    - the least p-value of the exact permutation test with as many samples, 2/C(m + n, m) (E. J. G. Pitman,
      Significance Tests which may be Applied to Samples from any Populations, 1937), for pixels whose
      few samples happen to be all equal.

    Differences that rounding explains have the p-value 1.
    """
    off = np.maximum(np.abs(a.mean - b.mean) - ROUNDING * np.maximum(np.abs(a.mean), np.abs(b.mean)), 0)
    p = np.maximum(_welch(off, a, b), _student(off, a, b))
    p = np.maximum(p, np.minimum(1, 2 / _combinations(a.samples, b.samples)))
    return np.where(off > 0, p, 1.0)


def _welch(off: Doubles, a: Estimate, b: Estimate) -> Doubles:
    """Return p-values by Welch's test, with the degrees of freedom of Satterthwaite's approximation."""
    variance = a.squared_error + b.squared_error
    spread = a.squared_error**2 / a.freedom + b.squared_error**2 / b.freedom
    return _two_sided(off, variance, np.where(spread > 0, variance**2 / np.maximum(spread, TINY), a.freedom))


def _student(off: Doubles, a: Estimate, b: Estimate) -> Doubles:
    """Return p-values by Student's test, with the pooled variance of one sample."""
    freedom = a.freedom + b.freedom
    sample_variance = (
        a.freedom * a.squared_error * a.samples + b.freedom * b.squared_error * b.samples
    ) / freedom
    return _two_sided(off, sample_variance * (1 / a.samples + 1 / b.samples), freedom)


def _two_sided(off: Doubles, variance: Doubles, freedom: Doubles) -> Doubles:
    return t_tail((off / np.sqrt(np.maximum(variance, TINY))).ravel(), freedom.ravel()).reshape(off.shape)


def _combinations(m: Doubles, n: Doubles) -> Doubles:
    """Return C(m + n, m); infinite where it is beyond float64."""
    logarithm = log_gamma(m + n + 1) - log_gamma(m + 1) - log_gamma(n + 1)
    return np.exp(np.minimum(logarithm, 1000), out=np.full_like(logarithm, np.inf), where=logarithm < 700)


def _averaged(picture: Estimate, side: int) -> Estimate:
    """Return the means over blocks of pixels; those at the right and lower edge may be smaller.

    The errors of pixels are independent, or depend on each other as their `scatter` tells. Where it is not
    known, those of groups of `sharing` pixels are taken to be all the same, which is the worst case (by the
    inequality of Cauchy and Schwarz). The degrees of freedom are those of Satterthwaite's approximation
    (F. E. Satterthwaite, An Approximate Distribution of Estimates of Variance Components, 1946).
    """
    pixels = _block_sums(np.ones((*picture.mean.shape[:2], 1)), side)
    if picture.scatter:
        label = _block_numbers(picture.mean.shape[0], picture.mean.shape[1], side)
        error = np.sqrt(picture.squared_error)
        estimates = sums_by_label(error, picture.freedom[..., 0], picture.scatter, label, pixels.size)
        variance, spread = (sums.reshape(*pixels.shape[:2], 3) for sums in estimates)
    else:
        variance = picture.sharing * _block_sums(picture.squared_error, side)
        spread = picture.sharing**3 * _block_sums(picture.squared_error**2 / picture.freedom, side)
    freedom = _block_sums(picture.freedom, side) / picture.sharing
    return Estimate(
        _block_sums(picture.mean, side) / pixels,
        variance / pixels**2,
        np.where(spread > 0, variance**2 / np.maximum(spread, TINY), freedom),
        _block_sums(picture.samples, side),
        _block_sums(picture.variance, side) / pixels,
    )


def _block_sums(values: Doubles, side: int) -> Doubles:
    """Return the sums of values (H, W, c) over blocks of side × side pixels."""
    for axis in (0, 1):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], side), axis=axis)
    return values


def _block_numbers(height: int, width: int, side: int) -> Ints:
    """Return the number of the block of each pixel, (H, W), row by row."""
    across = -(-width // side)
    return np.add.outer(np.arange(height) // side * across, np.arange(width) // side)


def estimate(
    mean: Doubles,
    squared_error: Doubles,
    variance: Doubles | None,
    batches: Ints,
    samples: Ints,
    scatter: tuple[Scatter, ...] = (),
    sharing: int = 1,
) -> Estimate:
    """Return the estimate of a picture.

    Parameters
    ----------
    mean, squared_error
        (H, W, 3); `squared_error` from the scatter of batches of samples.
    variance
        (H, W, 3) of one sample; None if it is not known.
    batches, samples
        (H, W) numbers of each pixel, at least 2.
    scatter
        Of a picture whose pixels share paths, where it is known.
    sharing
        Pixels in a group whose errors may depend on each other, where it is not.
    """
    freedom = np.broadcast_to((batches - 1.0)[..., None], mean.shape)
    variance = np.zeros_like(mean) if variance is None else variance
    number = samples[..., None].astype(np.float64)
    return Estimate(mean, squared_error, freedom, number, variance, scatter, sharing)

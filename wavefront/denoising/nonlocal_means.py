"""Denoising by non-local means that follow the picture and its guides, in two passes.

Each pixel becomes a weighted mean of the pixels about it. Those whose surroundings and whose guides differ
from its own by no more than their noise weigh most. The second pass compares pixels of the result of the
first, where less noise hides the edges. Sources: F. Rousselle, C. Knaus and M. Zwicker, Adaptive Rendering
with Non-Local Means Filtering, 2012, for the distances that allow for noise, and F. Rousselle, M. Manzi and
M. Zwicker, Robust Denoising using Feature and Color Information, 2013, for the guides. Colors are divided by
the albedo first, so that textures do not blur (S. Bako et al., Kernel-Predicting Convolutional Networks for
Denoising Monte Carlo Renderings, 2017, section 5).

Two pixels are compared once, for the weight of each in the mean of the other. The picture is filtered in
tiles that stay in the processor's cache, on all cores. The sums of a pixel are added in the same order in any
tile: they do not depend on tiles and cores.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Floats
from ..core.cores import core_count
from .noisy import Guide, NoisyPicture

REACH, SECOND_REACH = 5, 7  # pixels from the middle of the window to its sides, of both passes
PATCH = 1  # pixels from the middle of a patch to its sides; colors are compared over patches
DAMPING, SECOND_DAMPING = 0.6, 1.0  # standard deviations of noise that count as a difference of 1
LEFT = 0.03  # of a pixel's variance, at least that which the first pass leaves; weights follow the noise
GUIDE_REACH, GUIDE_PATCH, GUIDE_DAMPING = 3, 2, 1.0  # of the filter of the guides themselves
ALBEDO_SCALE, NORMAL_SCALE = 3e-3, 0.015  # squared differences of guides that are always allowed
MOST_NOISE, LEAST_TRUST = 4.0, 1e-6  # variances over the usual one that count in full; of a pixel's weight
VISIBLE = 0.01  # of a pixel's value: noise of which half is removed
LEAST_ALBEDO = 0.02  # added to the albedo that colors are divided by
LEAST_VARIANCE = 1e-10
FARTHEST = 8  # the distance from which on a weight is 0
TILE = (128, 512)  # rows and columns that are filtered together: few for the cache, many for threads

Window: TypeAlias = tuple[slice, slice]  # rows and columns


def nonlocal_means(picture: NoisyPicture) -> Floats:
    """Return the picture without most of its noise, (H, W, 3)."""
    rgb, variance = _planes(picture.rgb), _planes(picture.squared_error)
    albedo, normal = (None if g is None else _filtered(g) for g in (picture.albedo, picture.normal))
    divisor = np.ones_like(rgb) if albedo is None else np.maximum(albedo.mean, 0) + np.float32(LEAST_ALBEDO)
    guides = [
        _Limit(guide, scale)
        for guide, scale in ((albedo, ALBEDO_SCALE), (normal, NORMAL_SCALE))
        if guide is not None
    ]
    noisy = _Noisy(rgb / divisor, _blurred((variance / divisor**2).sum(0)))
    trust = _trust(noisy.variance)
    first = _weighted_means(noisy, trust, _Likeness.of(noisy, DAMPING, PATCH, guides), REACH)
    pilot = _Noisy(first.mean, _blurred(first.variance) + np.float32(LEFT) * noisy.variance)
    second = _weighted_means(noisy, trust, _Likeness.of(pilot, SECOND_DAMPING, PATCH, guides), SECOND_REACH)
    clean = noisy.mean + _visible(noisy.variance, second.mean) * (second.mean - noisy.mean)
    return np.ascontiguousarray(np.moveaxis(clean * divisor, 0, 2))


@soa
class _Noisy:
    """Values with their variance."""

    mean: Floats  # (3, h, w)
    variance: Floats  # (h, w), the sum of that of the channels


@soa
class _Limit:
    """A guide across whose edges nothing is averaged."""

    guide: _Noisy
    scale: float  # squared differences, summed over channels, that are always allowed

    def closeness(self, here: Window, there: Window) -> Floats:
        """Return 1 less the distances of pixels, in units of the farthest."""
        square = _squared_difference(self.guide.mean, here, there)
        unit = self.guide.variance[here] + self.guide.variance[there]
        np.maximum(unit, np.float32(self.scale), out=unit)
        unit *= np.float32(FARTHEST)
        square /= unit
        return np.subtract(np.float32(1), square, out=square)


@soa
class _Likeness:
    """How alike pixels are, by patches about them and by guides."""

    compared: _Noisy  # with a margin of a patch
    damping: float
    patch: int
    guides: list[_Limit]

    @classmethod
    def of(cls, compared: _Noisy, damping: float, patch: int, guides: list[_Limit]) -> _Likeness:
        """Return the likeness by a picture and its guides, without a margin."""
        variance = compared.variance + np.float32(LEAST_VARIANCE)
        wide = _Noisy(_mirrored(compared.mean, patch), _mirrored(variance, patch))
        return cls(wide, damping, patch, guides)

    def weights(self, here: Window, there: Window) -> tuple[Floats, Floats]:
        """Return the weights of `there` in the means of `here`, and of `here` in those of `there`.

        The distance is the squared difference less the part that noise explains, in units of the noise (2012,
        equation 3): (d² − v − min(v, w)) / (k²·(v + w)) with the variance v of the pixel whose mean is taken,
        and w. For the other pixel v and w change places, and with them v/(v + w) and 1 − v/(v + w).
        """
        own, other = _grown(here, self.patch), _grown(there, self.patch)
        v, w = self.compared.variance[own], self.compared.variance[other]
        total = v + w
        rest = _squared_difference(self.compared.mean, own, other)
        rest -= np.minimum(v, w)
        rest /= total
        ratio = np.divide(v, total, out=total)
        unit = 1 / (FARTHEST * self.damping**2)
        rest, ratio = (_patch_means(image, self.patch, unit) for image in (rest, ratio))
        closeness = np.subtract(np.float32(1), rest, out=rest)
        limit = self._limit(here, there)
        first = _weight(closeness + ratio, limit)
        closeness += np.float32(unit)
        closeness -= ratio
        return first, _weight(closeness, limit)

    def _limit(self, here: Window, there: Window) -> Floats | np.float32:
        """Return the limit of closeness by the guides."""
        limit: Floats | np.float32 = np.float32(1)
        for guide in self.guides:
            limit = np.minimum(guide.closeness(here, there), limit)
        return limit


def _weight(closeness: Floats, limit: Floats | np.float32) -> Floats:
    """Return (1 − d/8)⁸, about exp(−d), of a closeness 1 − d/8 between 0 and its limit."""
    np.minimum(closeness, limit, out=closeness)
    np.maximum(closeness, np.float32(0), out=closeness)
    for _ in range(3):
        closeness *= closeness
    return closeness


def _filtered(guide: Guide) -> _Noisy:
    """Return a guide without most of its noise."""
    noisy = _Noisy(_planes(guide.values), _blurred(_planes(guide.squared_error).sum(0)))
    likeness = _Likeness.of(noisy, GUIDE_DAMPING, GUIDE_PATCH, [])
    return _weighted_means(noisy, np.ones_like(noisy.variance), likeness, GUIDE_REACH)


def _visible(variance: Floats, mean: Floats) -> Floats:
    """Return the part of the noise (h, w) to remove: little where nobody sees it, as that costs detail."""
    seen = np.square(np.float32(VISIBLE) * mean).sum(0)
    return variance / (variance + seen + np.float32(LEAST_VARIANCE))


def _trust(variance: Floats) -> Floats:
    """Return the weights of pixels (h, w): less than 1 where far more noise is than about them.

    Such pixels have a rare bright sample, which the mean over a window would show as a bright square.
    """
    variance = variance + np.float32(LEAST_VARIANCE)
    usual = np.square(_patch_means(_mirrored(np.sqrt(variance), SECOND_REACH), SECOND_REACH))
    return np.clip(np.float32(MOST_NOISE) * usual / variance, np.float32(LEAST_TRUST), np.float32(1))


def _weighted_means(averaged: _Noisy, trust: Floats, likeness: _Likeness, reach: int) -> _Noisy:
    """Return the weighted means over windows that reach so far, and their variances."""
    means = _Noisy(np.empty_like(averaged.mean), np.empty_like(averaged.variance))

    def fill(tile: Window) -> None:
        means.mean[:, *tile], means.variance[tile] = _means_of_tile(averaged, trust, likeness, reach, tile)

    with ThreadPoolExecutor(core_count()) as threads:
        list(threads.map(fill, _tiles(*averaged.variance.shape)))
    return means


def _means_of_tile(
    averaged: _Noisy, trust: Floats, likeness: _Likeness, reach: int, tile: Window
) -> tuple[Floats, Floats]:
    """Return the weighted means (3, h, w) of a tile, and their variances (h, w)."""
    total = trust[tile].copy()
    values, spread = averaged.mean[:, *tile] * total, averaged.variance[tile] * total**2
    for here, there in _pairs(tile, trust.shape, reach):
        weights = likeness.weights(here, there)
        for weight, pixels, others in zip(weights, (here, there), (there, here), strict=True):
            inside = _common(pixels, tile)
            weight = weight[_from(inside, pixels)]
            place, near = _from(inside, tile), _moved(inside, pixels, others)
            weight *= trust[near]
            total[place] += weight
            for channel, value in zip(values, averaged.mean, strict=True):
                channel[place] += weight * value[near]
            weight *= weight
            weight *= averaged.variance[near]
            spread[place] += weight
    return values / total, spread / total**2


def _tiles(height: int, width: int) -> Iterator[Window]:
    """Yield the parts of a picture."""
    for top in range(0, height, TILE[0]):
        for left in range(0, width, TILE[1]):
            yield slice(top, min(top + TILE[0], height)), slice(left, min(left + TILE[1], width))


def _pairs(tile: Window, size: tuple[int, ...], reach: int) -> Iterator[tuple[Window, Window]]:
    """Yield pixels of a picture, and those at the same distance from them, each pair of pixels once.

    One or both of a pair lie in the tile.
    """
    for down in range(reach + 1):
        for right in range(-reach if down else 1, reach + 1):
            shift = down, right
            here = tuple(
                slice(max(t.start - max(by, 0), -by, 0), min(t.stop - min(by, 0), n - max(by, 0)))
                for t, by, n in zip(tile, shift, size, strict=True)
            )
            if all(side.start < side.stop for side in here):
                rows, columns = here
                yield (
                    (rows, columns),
                    (_shifted(rows, down), _shifted(columns, right)),
                )


def _shifted(span: slice, by: int) -> slice:
    return slice(span.start + by, span.stop + by)


def _grown(window: Window, margin: int) -> Window:
    """Return where a window with a margin is in an array with that margin."""
    rows, columns = (slice(side.start, side.stop + 2 * margin) for side in window)
    return rows, columns


def _common(a: Window, b: Window) -> Window:
    """Return the part of the picture in both."""
    first = [max(i.start, j.start) for i, j in zip(a, b, strict=True)]
    rows, columns = (
        slice(begin, max(begin, min(i.stop, j.stop))) for begin, i, j in zip(first, a, b, strict=True)
    )
    return rows, columns


def _from(window: Window, origin: Window) -> Window:
    """Return where a window is in an array that begins with another."""
    rows, columns = (_shifted(i, -j.start) for i, j in zip(window, origin, strict=True))
    return rows, columns


def _moved(window: Window, origin: Window, target: Window) -> Window:
    """Return a window as far on as the target is from the origin."""
    rows, columns = (_shifted(i, k.start - j.start) for i, j, k in zip(window, origin, target, strict=True))
    return rows, columns


def _squared_difference(values: Floats, here: Window, there: Window) -> Floats:
    """Return the sums over channels of squared differences of values (3, h, w)."""
    total: Floats | None = None
    for channel in values:
        square = channel[here] - channel[there]
        square *= square
        total = square if total is None else np.add(total, square, out=total)
    assert total is not None
    return total


def _planes(values: Floats) -> Floats:
    """Return values (H, W, 3) as (3, H, W), where arithmetic is much faster."""
    return np.ascontiguousarray(np.moveaxis(values, 2, 0), np.float32)


def _mirrored(values: Floats, margin: int) -> Floats:
    """Return values (..., h, w) with a margin that mirrors them."""
    margins = ((0, 0),) * (values.ndim - 2) + ((margin, margin),) * 2
    return np.pad(values, margins, mode="symmetric")


def _blurred(values: Floats) -> Floats:
    """Return means over 3 × 3 pixels: the variance of a pixel, from few samples, is noisy itself."""
    return _patch_means(_mirrored(values, 1), 1)


def _patch_means(values: Floats, patch: int, factor: float = 1.0) -> Floats:
    """Return means over squares of 2·patch + 1 pixels times a factor, for pixels whose square lies inside."""
    height, width = values.shape[0] - 2 * patch, values.shape[1] - 2 * patch
    rows = values[:height] + values[1 : height + 1]
    for i in range(2, 2 * patch + 1):
        rows += values[i : i + height]
    means = rows[:, :width] + rows[:, 1 : width + 1]
    for i in range(2, 2 * patch + 1):
        means += rows[:, i : i + width]
    means *= np.float32(factor / (2 * patch + 1) ** 2)
    return means

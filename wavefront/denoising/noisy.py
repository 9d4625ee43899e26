"""The input of denoisers: a noisy picture and its guides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats
from ..film.aov_names import GUIDES

UNSEEN = np.float32(1e-3)  # noise relative to the brightest channel: about a tenth of a code of 8 bits
AGREE = 5  # pixels of 3 × 3: of few samples, the estimated error of a noisy pixel is small by chance


@soa
class Guide:
    """A layer that shows the edges of the picture, with less noise."""

    values: Floats  # (H, W, 3), finite
    error: Floats | None  # (H, W, 3) standard error; None or not finite where not known

    @property
    def squared_error(self) -> Floats:
        """Return estimated variances (H, W, 3)."""
        return _squared_error(self.values, self.error)


@soa
class NoisyPicture:
    """A picture and its guides."""

    rgb: Floats  # (H, W, 3), finite
    error: Floats | None  # (H, W, 3) standard error; None or not finite where not known
    albedo: Guide | None
    normal: Guide | None
    spp: int = 0  # samples per pixel; 0 if not known

    @property
    def squared_error(self) -> Floats:
        """Return estimated variances of `rgb`, (H, W, 3)."""
        return _squared_error(self.rgb, self.error)

    @property
    def clean(self) -> Bools:
        """Return which pixels (H, W) have an error that nobody sees, or none, and most pixels about them too.

        A few samples of a pixel may agree by chance. Black pixels are not among them: samples that have met
        no light do not tell whether there is some.
        """
        if self.error is None:
            return np.zeros(self.rgb.shape[:2], np.bool_)
        brightest, error = _greatest(self.rgb), _greatest(self.error)  # NaN is not small
        small = (brightest > 0) & (error <= UNSEEN * brightest)
        wide = np.pad(small, 1, mode="symmetric").astype(np.uint8)
        rows = wide[:-2] + wide[1:-1] + wide[2:]
        return small & (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] >= AGREE)


def _greatest(values: Floats) -> Floats:
    """Return the greatest channel (H, W) of values (H, W, 3)."""
    return np.maximum(np.maximum(values[..., 0], values[..., 1]), values[..., 2])


def noisy_picture(
    rgb: Floats,
    standard_error: Floats | None,
    layers: Mapping[str, NDArray[Any]],
    errors: Mapping[str, Floats],
    spp: int = 0,
) -> NoisyPicture:
    """Return the input of denoisers: a picture (H, W, 3), its error, layers, their errors and samples.

    Values that are not finite are replaced by those of pixels about them. An error that is not known is
    estimated from the picture itself.
    """
    albedo, normal = (
        Guide(without_holes(layers[name]), errors.get(name)) if name in layers else None for name in GUIDES
    )
    return NoisyPicture(without_holes(rgb), standard_error, albedo, normal, spp)


def _squared_error(values: Floats, error: Floats | None) -> Floats:
    """Return squared errors of values (H, W, 3), finite ones."""
    if error is not None and np.isfinite(error).all():
        return np.square(error)
    scatter = scatter_of_neighbors(values)
    return scatter if error is None else np.where(np.isfinite(error), np.square(error), scatter)


def without_holes(values: Floats) -> Floats:
    """Return values (H, W, c) with the mean of the nearest finite pixels where one is not finite.

    It is that of a square about the pixel that doubles until it has a finite one; 0 if there is none.
    """
    good = np.asarray(np.isfinite(values).all(2))
    if good.all():
        return values
    filled = np.where(good[..., None], values, 0).astype(np.float64)
    reach = 1
    while good.any() and not good.all():
        near = _square_sums(good[..., None].astype(np.float64), reach)
        mean = _square_sums(filled, reach) / np.maximum(near, 1)
        filled = np.where(good[..., None], filled, mean)
        good = near[..., 0] > 0.5
        reach *= 2
    return filled.astype(np.float32)


def _square_sums(values: Doubles, reach: int) -> Doubles:
    """Return sums of values (H, W, c) over the squares that reach so far from each pixel."""
    for axis in (0, 1):
        n = values.shape[axis]
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), np.cumsum(values, axis)], axis)
        at = np.arange(n)
        values = sums.take(np.minimum(at + reach + 1, n), axis) - sums.take(np.maximum(at - reach, 0), axis)
    return values


def scatter_of_neighbors(values: Floats) -> Floats:
    """Estimate the variance of each pixel of (H, W, c) from the scatter of pixels about each.

    It is taken to be proportional to the square of the mean of 3 × 3 pixels. The factor is the median over
    the picture, since most pixels are not at an edge.
    """
    rows = np.pad(values.astype(np.float64), ((1, 1), (1, 1), (0, 0)), mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(rows, (3, 3), (0, 1))
    square = np.square(windows.mean((-1, -2)))
    lit = square > 0
    factor = np.median(windows.var((-1, -2), ddof=1)[lit] / square[lit]) if lit.any() else 0.0
    return (factor * square).astype(np.float32)

"""Denoising by non-local means that follow the picture and its guides.

Each pixel becomes a weighted mean of the pixels about it. Those whose surroundings and whose guides differ
from its own by no more than their noise weigh most. Sources: F. Rousselle, C. Knaus and M. Zwicker, Adaptive
Rendering with Non-Local Means Filtering, 2012, for the distances that allow for noise, and F. Rousselle,
M. Manzi and M. Zwicker, Robust Denoising using Feature and Color Information, 2013, for the guides. Colors
are divided by the albedo first, so that textures do not blur (S. Bako et al., Kernel-Predicting
Convolutional Networks for Denoising Monte Carlo Renderings, 2017, section 5).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays.elementary import exp
from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats
from .noisy import Guide, NoisyPicture

REACH = 7  # pixels from the middle of the window to its sides
PATCH = 1  # pixels from the middle of a patch to its sides; colors are compared over patches
DAMPING = 0.6  # standard deviations of noise that count as a difference of 1
GUIDE_REACH, GUIDE_PATCH, GUIDE_DAMPING = 3, 2, 1.0  # of the filter of the guides themselves
ALBEDO_SCALE, NORMAL_SCALE = 3e-3, 0.1  # squared differences of guides that are always allowed
LEAST_ALBEDO = 0.02  # added to the albedo that colors are divided by
LEAST_VARIANCE = 1e-10
ROWS = 64  # that are filtered together: few enough for the cache


def nonlocal_means(picture: NoisyPicture) -> Floats:
    """Return the picture without most of its noise, (H, W, 3)."""
    rgb, variance = _planes(picture.rgb), _planes(picture.squared_error)
    albedo, normal = (None if g is None else _filtered(g) for g in (picture.albedo, picture.normal))
    divisor = np.ones_like(rgb) if albedo is None else np.maximum(albedo.mean, 0) + LEAST_ALBEDO
    color = _Noisy(rgb / divisor, _blurred(variance / divisor**2))
    guides = []
    if albedo is not None:
        guides.append((albedo, ALBEDO_SCALE))
    if normal is not None:
        guides.append((normal, NORMAL_SCALE))
    denoised = _weighted_mean(color, DAMPING, REACH, PATCH, guides).mean * divisor
    return np.ascontiguousarray(np.moveaxis(denoised, 0, 2), np.float32)


@soa
class _Noisy:
    """Values with their variance."""

    mean: Doubles  # (3, h, w)
    variance: Doubles  # (3, h, w)

    def padded(self, margin: int) -> _Noisy:
        """Return the values with a margin that mirrors them."""
        return _Noisy(_mirrored(self.mean, margin), _mirrored(self.variance, margin))

    def window(self, top: int, left: int, height: int, width: int) -> _Noisy:
        """Return some rows and columns."""
        part = slice(None), slice(top, top + height), slice(left, left + width)
        return _Noisy(self.mean[part], self.variance[part])


def _filtered(guide: Guide) -> _Noisy:
    """Return a guide without most of its noise."""
    values = _Noisy(_planes(guide.values), _blurred(_planes(guide.squared_error)))
    return _weighted_mean(values, GUIDE_DAMPING, GUIDE_REACH, GUIDE_PATCH, [])


def _planes(values: Floats) -> Doubles:
    """Return values (H, W, 3) as (3, H, W), where arithmetic is much faster."""
    return np.ascontiguousarray(np.moveaxis(values, 2, 0), np.float64)


def _mirrored(values: Doubles, margin: int) -> Doubles:
    return np.pad(values, ((0, 0), (margin, margin), (margin, margin)), mode="symmetric")


def _blurred(values: Doubles) -> Doubles:
    """Return means over 3 × 3 pixels: the variance of a pixel, from few samples, is noisy itself."""
    return _patch_means(_mirrored(values, 1), 1)


def _weighted_mean(
    picture: _Noisy, damping: float, reach: int, patch: int, guides: list[tuple[_Noisy, float]]
) -> _Noisy:
    """Return the weighted means over windows, and their variances.

    `guides` come with the squared differences that they always allow.
    """
    channels, height, width = picture.mean.shape
    margin = reach + patch
    padded = picture.padded(margin)
    padded_guides = [(guide.padded(margin), scale) for guide, scale in guides]
    mean, variance = np.empty((2, channels, height, width))
    for top in range(0, height, ROWS):
        rows = min(ROWS, height - top)
        total = np.zeros((rows, width))
        value, spread = np.zeros((2, channels, rows, width))
        for down, right in _shifts(reach):
            difference = _squared_difference(
                padded.window(top + reach, reach, rows + 2 * patch, width + 2 * patch),
                padded.window(top + down, right, rows + 2 * patch, width + 2 * patch),
                damping,
                LEAST_VARIANCE,
            )
            distance = _patch_means(difference.mean(0), patch)
            for guide, scale in padded_guides:
                here = guide.window(top + margin, margin, rows, width)
                there = guide.window(top + down + patch, right + patch, rows, width)
                found = _squared_difference(here, there, 1.0, scale)
                distance = np.maximum(distance, found.max(0))
            weight = exp(-np.maximum(distance, 0).astype(np.float32))
            near = padded.window(top + down + patch, right + patch, rows, width)
            total += weight
            value += weight * near.mean
            spread += weight**2 * near.variance
        mean[:, top : top + rows] = value / total
        variance[:, top : top + rows] = spread / total**2
    return _Noisy(mean, variance)


def _shifts(reach: int) -> Iterator[tuple[int, int]]:
    """Yield the places of a window's pixels, from its corner."""
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            yield down, right


def _squared_difference(a: _Noisy, b: _Noisy, damping: float, least: float) -> Doubles:
    """Return squared differences less those that noise explains, in units of the noise (2012, equation 3)."""
    explained = a.variance + np.minimum(a.variance, b.variance)
    unit = np.maximum(a.variance + b.variance, least)
    return (np.square(a.mean - b.mean) - explained) / (damping**2 * unit)


def _patch_means(values: Doubles, patch: int) -> Doubles:
    """Return means over squares of 2·patch + 1 pixels, for pixels whose square lies inside."""
    side = 2 * patch + 1
    height, width = values.shape[-2] - 2 * patch, values.shape[-1] - 2 * patch
    rows = np.zeros((*values.shape[:-2], height, values.shape[-1]))
    for i in range(side):
        rows += values[..., i : i + height, :]
    means = np.zeros((*values.shape[:-2], height, width))
    for i in range(side):
        means += rows[..., i : i + width]
    return means / side**2

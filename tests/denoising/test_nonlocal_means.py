"""The filter of `nonlocal_means`, against loops over pixels that are written from its sources.

Every constant of the filter stands here once more, so none can change unnoticed.
"""

import numpy as np
import pytest

from wavefront.denoising.noisy import Guide, NoisyPicture
from wavefront.denoising.nonlocal_means import nonlocal_means

SIZE = (9, 11)


def picture(albedo: bool, normal: bool, noise: float = 0.1) -> NoisyPicture:
    """An edge across a gradient, with noise of different strength."""
    rng, (h, w) = np.random.default_rng(3), SIZE
    x = np.arange(w)[None, :, None] / w
    exact = np.where(x > 0.5, (0.9, 0.4, 0.2), (0.2, 0.3, 0.6)) * (1 + x) * np.ones((h, 1, 1))
    error = rng.uniform(0.02, noise, (h, w, 3))

    def guide(values, amount):
        return Guide(
            (values + rng.normal(0, amount, (h, w, 3))).astype(np.float32),
            np.full((h, w, 3), amount, np.float32),
        )

    tint = np.where(x > 0.5, (0.8, 0.5, 0.3), (0.75, 0.5, 0.35)) * np.ones((h, 1, 1))
    up = np.where(x > 0.7, (0.0, 1, 0), (0.3, 0.95, 0.1)) * np.ones((h, 1, 1))
    rgb = exact + rng.normal(size=(h, w, 3)) * error
    rgb[2, 3] = 0.5  # without any noise, beside others
    error[2, 3] = 0
    return NoisyPicture(
        rgb.astype(np.float32),
        error.astype(np.float32),
        guide(tint, 0.02) if albedo else None,
        guide(up, 0.05) if normal else None,
    )


def mirrored(values: np.ndarray, margin: int) -> np.ndarray:
    """The picture with a margin in which it is mirrored."""
    return np.pad(values, ((margin, margin), (margin, margin), (0, 0)), mode="symmetric")


def blurred(values: np.ndarray) -> np.ndarray:
    """Means over 3 × 3 pixels."""
    wide, out = mirrored(values, 1), np.empty_like(values)
    for y, x in np.ndindex(values.shape[:2]):
        out[y, x] = wide[y : y + 3, x : x + 3].mean((0, 1))
    return out


def squared_difference(a, va, b, vb, damping, least):
    """F. Rousselle, C. Knaus and M. Zwicker 2012, equation 3."""
    return (np.square(a - b) - (va + np.minimum(va, vb))) / (damping**2 * np.maximum(va + vb, least))


def weighted_means(mean, variance, damping, reach, patch, guides):
    """Each pixel as the mean of those about it, by colors over patches and by guides."""
    out, spread = np.empty_like(mean), np.empty_like(mean)
    margin, side = reach + patch, 2 * patch + 1
    wide, noise = mirrored(mean, margin), mirrored(variance, margin)
    guides = [
        (values, error, mirrored(values, margin), mirrored(error, margin), scale)
        for values, error, scale in guides
    ]
    for y, x in np.ndindex(mean.shape[:2]):
        weights, values, variances = [], [], []
        here = slice(y + reach, y + reach + side), slice(x + reach, x + reach + side)
        for i in range(2 * reach + 1):
            for j in range(2 * reach + 1):
                there = slice(y + i, y + i + side), slice(x + j, x + j + side)
                middle = y + i + patch, x + j + patch
                found = squared_difference(wide[here], noise[here], wide[there], noise[there], damping, 1e-10)
                distance = np.mean(found)
                for guide, error, guide_near, error_near, scale in guides:
                    each = squared_difference(
                        guide[y, x], error[y, x], guide_near[middle], error_near[middle], 1.0, scale
                    )
                    distance = max(distance, each.max())
                weights.append(np.exp(-max(distance, 0)))
                values.append(wide[middle])
                variances.append(noise[middle])
        weights = np.array(weights)
        out[y, x] = weights @ np.array(values) / weights.sum()
        spread[y, x] = weights**2 @ np.array(variances) / weights.sum() ** 2
    return out, spread


def filtered(noisy: NoisyPicture) -> np.ndarray:
    """The whole filter."""
    guides, divisor = [], 1.0
    for guide, scale in ((noisy.albedo, 3e-3), (noisy.normal, 0.1)):
        if guide is not None:
            values, error = (np.asarray(each, float) for each in (guide.values, guide.squared_error))
            guides.append((*weighted_means(values, blurred(error), 1.0, 3, 2, []), scale))
    if noisy.albedo is not None:
        divisor = np.maximum(guides[0][0], 0) + 0.02
    mean = np.asarray(noisy.rgb, float) / divisor
    variance = blurred(np.asarray(noisy.squared_error, float) / divisor**2)
    return weighted_means(mean, variance, 0.6, 7, 1, guides)[0] * divisor


@pytest.mark.parametrize(("albedo", "normal"), [(False, False), (True, True)])
def test_filter(albedo: bool, normal: bool) -> None:
    noisy = picture(albedo, normal)
    np.testing.assert_allclose(nonlocal_means(noisy), filtered(noisy), rtol=2e-5)


def test_pictures_of_exact_values_stay() -> None:
    """Differences without any noise count in full: 1e-5 is already an edge."""
    rgb = np.zeros((*SIZE, 3), np.float32) + 0.5
    rgb[:, 5:] += np.float32(1e-4)
    found = nonlocal_means(NoisyPicture(rgb, np.zeros_like(rgb), None, None))
    np.testing.assert_allclose(found, rgb, atol=2e-6)

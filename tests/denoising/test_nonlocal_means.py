"""The filter of `nonlocal_means`, against loops over pixels that are written from its sources.

Every constant of the filter stands here once more, so none can change unnoticed.
"""

import numpy as np
import pytest
from inside import Guide, NoisyPicture
from inside import denoising_nonlocal_means as module
from inside import nonlocal_means_nonlocal_means as nonlocal_means

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
    rgb[6, 8], error[6, 8] = 5, 5  # of a rare bright sample
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


def square(values: np.ndarray) -> np.ndarray:
    """Squares, summed over channels."""
    return np.square(values).sum(-1)


def trusted(variance: np.ndarray) -> np.ndarray:
    """What pixels count for: less than 1 where the noise is far more than about them."""
    variance = variance + 1e-10
    wide, out = mirrored(np.sqrt(variance)[..., None], 7), np.empty_like(variance)
    for y, x in np.ndindex(variance.shape):
        out[y, x] = np.clip(4 * np.square(wide[y : y + 15, x : x + 15].mean()) / variance[y, x], 1e-6, 1)
    return out


def weighted_means(trust, averaged, spread, compared, variance, damping, reach, patch, guides):
    """Each pixel as the mean of those about it, by colors over patches and by guides; and its variance.

    Distances are those of F. Rousselle, C. Knaus and M. Zwicker 2012, equation 3, of sums over channels.
    """
    h, w = variance.shape
    out, noise = np.empty_like(averaged), np.empty_like(spread)
    side = 2 * patch + 1
    wide, errors = mirrored(compared, patch), mirrored(variance[..., None], patch)[..., 0] + 1e-10
    for y, x in np.ndindex(h, w):
        weights = np.zeros((h, w))
        own = slice(y, y + side), slice(x, x + side)
        for i in range(max(y - reach, 0), min(y + reach + 1, h)):
            for j in range(max(x - reach, 0), min(x + reach + 1, w)):
                other = slice(i, i + side), slice(j, j + side)
                va, vb = errors[own], errors[other]
                explained = va + np.minimum(va, vb)
                distance = ((square(wide[own] - wide[other]) - explained) / (va + vb)).mean() / damping**2
                for guide, error, scale in guides:
                    unit = max(error[y, x] + error[i, j], scale)
                    distance = max(distance, square(guide[y, x] - guide[i, j]) / unit)
                weights[i, j] = trust[i, j] * max(1 - max(distance, 0) / 8, 0) ** 8
        out[y, x] = np.tensordot(weights, averaged) / weights.sum()
        noise[y, x] = (weights**2 * spread).sum() / weights.sum() ** 2
    return out, noise


def filtered(noisy: NoisyPicture) -> np.ndarray:
    """The whole filter."""
    guides, divisor = [], 1.0
    for guide, scale in ((noisy.albedo, 3e-3), (noisy.normal, 0.015)):
        if guide is not None:
            values, error = (np.asarray(each, float) for each in (guide.values, guide.squared_error))
            error = blurred(error).sum(-1)
            guides.append(
                (*weighted_means(np.ones(SIZE), values, error, values, error, 1.0, 3, 2, []), scale)
            )
    if noisy.albedo is not None:
        divisor = np.maximum(guides[0][0], 0) + 0.02
    mean = np.asarray(noisy.rgb, float) / divisor
    variance = blurred(np.asarray(noisy.squared_error, float) / divisor**2).sum(-1)
    trust = trusted(variance)
    first, left = weighted_means(trust, mean, variance, mean, variance, 0.6, 5, 1, guides)
    left = blurred(left[..., None])[..., 0] + 0.03 * variance
    second = weighted_means(trust, mean, variance, first, left, 1.0, 7, 1, guides)[0]
    seen = variance / (variance + square(0.01 * second) + 1e-10)
    return (mean + seen[..., None] * (second - mean)) * divisor


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


def box(noise: float, seed: int = 0) -> tuple[NoisyPicture, np.ndarray]:
    """Two walls that differ in albedo and normal, and by 10 % in light; and the exact picture."""
    rng = np.random.default_rng(seed)
    right = np.arange(40)[None, :, None] >= 20
    albedo = np.where(right, (0.6, 0.5, 0.4), (0.4, 0.5, 0.6)) * np.ones((30, 1, 1))
    normal = np.where(right, (1.0, 0, 0), (0, 0, 1.0)) * np.ones((30, 1, 1))
    exact = albedo * np.where(right, 0.9, 1.0)
    error = noise * exact
    guides = (Guide(each.astype(np.float32), np.zeros((30, 40, 3), np.float32)) for each in (albedo, normal))
    rgb = (exact + rng.normal(size=exact.shape) * error).astype(np.float32)
    return NoisyPicture(rgb, error.astype(np.float32), *guides), exact


def test_edges_of_guides_stay() -> None:
    """Where the noise hides them: the light left and right differs by 10 %, the noise is 30 %."""
    noisy, exact = box(0.3)
    found = nonlocal_means(noisy)
    assert np.square(found - exact).mean() < 0.02 * np.square(noisy.rgb - exact).mean()
    light = (found / exact * np.where(np.arange(40)[:, None] < 20, 1.0, 0.9)).mean((0, 2))
    assert light[17:20].mean() - light[20:23].mean() == pytest.approx(0.1, abs=0.03)


def test_a_picture_of_little_noise_does_not_get_worse() -> None:
    for noise in (0.01, 0.001):
        noisy, exact = box(noise)
        noisy.albedo = noisy.normal = None
        assert np.square(nonlocal_means(noisy) - exact).mean() < np.square(noisy.rgb - exact).mean()


def test_lone_bright_pixels_are_removed() -> None:
    """A pixel of one bright sample has an error as large as itself; it does not spread."""
    noisy, exact = box(0.05)
    noisy.rgb[15, 10] = 40
    noisy.error[15, 10] = 40
    found = nonlocal_means(noisy)
    assert found[15, 10].max() < 3
    others = np.abs(found - exact).max(-1)
    others[13:18, 8:13] = 0
    assert others.max() < 0.1


@pytest.mark.parametrize(("tile", "cores"), [((5, 4), 1), ((3, 64), 3)])
def test_tiles_and_cores_do_not_change_bits(tile, cores, monkeypatch) -> None:
    noisy = picture(True, True)
    whole = nonlocal_means(noisy)
    monkeypatch.setattr(module, "TILE", tile)
    monkeypatch.setattr(module, "core_count", lambda: cores)
    assert nonlocal_means(noisy).tobytes() == whole.tobytes()

"""Errors of means over pixels, from halves of the samples: across seeds, and of pictures made of others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scenes
from inside import Film, _steps_of_gain, batch_size

import wavefront as wf

QUIET: dict[str, Any] = {"progress": False, "workers": 1, "branches": 1}


def filled(samples: np.ndarray) -> Film:
    film = Film(samples.shape[2], 1)
    film.add(np.arange(samples.shape[2], dtype=np.uint32), samples.astype(np.float32))
    return film


@pytest.mark.parametrize("count", [2, 3, 16, 20, 24, 40, 64])
def test_halves_are_those_of_whole_batches(count: int) -> None:
    """Of an odd number of batches the difference is scaled to the variance of one of equal halves."""
    samples = np.random.default_rng(count).lognormal(0, 1, (3, count, 5)).astype(np.float32)
    size = batch_size(count)
    number = count // size
    middle = number // 2 * size
    first, second = (samples[:, a:b].mean(1, dtype=float) for a, b in ((0, middle), (middle, number * size)))
    scale = np.sqrt(middle * (number * size - middle) / (number * size * count))
    assert filled(samples).halves() == pytest.approx((first - second) * scale, rel=1e-4, abs=1e-6)


def test_halves_have_the_variance_of_the_mean() -> None:
    """Of independent samples; with an odd number of batches and of merged parts, too."""
    samples = np.random.default_rng(0).normal(0, 1, (3, 60, 4000))
    for first in (60, 40, 20):
        film = filled(samples[:, :first])
        if first < 60:
            film.merge(filled(samples[:, first:]))
        assert np.square(film.halves()).mean() == pytest.approx(1 / 60, rel=0.06)
    assert np.isnan(filled(samples[:, :1]).halves()).all()


def test_halves_of_pixels_with_dropped_samples_are_their_errors() -> None:
    samples = np.random.default_rng(1).lognormal(0, 1, (3, 16, 6)).astype(np.float32)
    samples[:, 3, 2] = 0
    film = Film(6, 1)
    film.add(np.arange(6, dtype=np.uint32), samples, dropped=np.array([3 * 6 + 2]))
    assert np.abs(film.halves()[:, 2]) == pytest.approx(np.sqrt(film.variance()[:, 2] / 15))


def lit(size: int = 16) -> wf.Scene:
    """A panel lamp whose edges many pixels see, over a floor and a ball."""
    eye = wf.Camera.look_at((0, 1.3, 4.5), (0, 0.9, 0), fov=42, size=(size, size))
    lamp = wf.Rectangle((-0.6, 2.0, -0.6), (1.2, 0, 0), (0, 0, 1.2), material=wf.Diffuse(0), emission=10)
    return wf.Scene([scenes.floor(), lamp, wf.Sphere((0, 0.5, 0), 0.5)], [wf.Environment(0.05)], eye)


@pytest.mark.parametrize(
    ("spp", "reuse"),
    [
        (16, False),
        pytest.param(16, True, marks=pytest.mark.slow),
        pytest.param(64, False, marks=pytest.mark.slow),
    ],
)
def test_the_error_of_the_mean_is_its_scatter(spp: int, reuse: bool) -> None:
    """Across seeds. By the scatter of batches it is 1.9 times as large at 16 samples, 2.6 times at 64."""
    images = [wf.render(lit(), spp, seed=seed, reuse=reuse, **QUIET) for seed in range(24)]
    means = [image.mean() for image in images]
    scatter = np.std([mean.value for mean in means], 0, ddof=1)
    error = np.sqrt(np.mean([mean.standard_error**2 for mean in means], 0))
    assert (error / scatter > 0.75).all()
    assert (error / scatter < 1.5).all()


def test_few_pixels_count_on_batches() -> None:
    """The difference of two halves alone would be 0 where these happen to be alike."""
    image = wf.render(lit(), 16, seed=3, **QUIET)
    image.halves[...] = 0
    one = image.mean((slice(9, 10), slice(7, 8)))
    assert (one.standard_error > 0.5 * image.standard_error[9, 7]).all()
    by_batches = np.sqrt(np.square(image.standard_error, dtype=float).sum((0, 1))) / 256
    assert (image.mean().standard_error < 0.2 * by_batches).all()


def test_pictures_made_of_others_have_their_halves(tmp_path: Any) -> None:
    a, b = (wf.render(lit(), 16, seed=seed, **QUIET) for seed in (1, 2))
    half = (-2.0 * a).mean()
    assert half.standard_error == pytest.approx(2 * a.mean().standard_error, rel=1e-5)
    apart = (a - b).mean().standard_error
    assert apart == pytest.approx(np.hypot(a.mean().standard_error, b.mean().standard_error), rel=0.35)
    for name in ("a.npz", "a.exr"):
        a.save(tmp_path / name)
        again = wf.Image.load(tmp_path / name)
        assert again.halves.tobytes() == a.halves.tobytes()
        assert (again.mean().standard_error == a.mean().standard_error).all()
    parts = [wf.render(lit(), samples=each, seed=1, **QUIET) for each in (range(8), range(8, 16))]
    merged = parts[0].merge(parts[1])
    np.testing.assert_allclose(merged.halves, a.halves, atol=1e-6)


def test_pictures_without_halves_have_the_errors_of_batches() -> None:
    """As in files of earlier versions."""
    image = wf.render(lit(), 16, seed=1, **QUIET)
    image.halves = None
    due = np.sqrt(np.square(image.standard_error, dtype=float).sum((0, 1))) / 256
    assert image.mean().standard_error == pytest.approx(due, rel=1e-5)


def test_the_gain_that_is_extrapolated() -> None:
    """One step of log2(n/2); one and a half where three quarters of a net of 4^k samples are there."""
    found = [_steps_of_gain(n) for n in (12, 16, 17, 32, 47, 48, 64, 65, 256)]
    doublings = np.log2(np.array([12, 16, 17, 32, 47, 48, 64, 65, 256]) / 2)
    assert found * doublings == pytest.approx([1.5, 1.5, 1, 1, 1, 1.5, 1.5, 1, 1.5])

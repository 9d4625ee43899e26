"""Error estimates: exact sums, bits that depend on nothing else, and truth across seeds."""

from collections.abc import Callable

import numpy as np
import pytest
import scenes
from hypothesis import given
from hypothesis import strategies as st
from inside import FILM_OUTLIERS as OUTLIERS
from inside import Film, Pass, PictureSums, batch_size, f4, film_image, passes
from significance import render

import wavefront as wf


def pixels(*indices: int) -> np.ndarray:
    """Row-major indices."""
    return np.array(indices, np.uint32)


def filled(samples: np.ndarray) -> Film:
    """A film one pixel high with samples (3, n, k)."""
    film = Film(samples.shape[2], 1)
    film.add(np.arange(samples.shape[2], dtype=np.uint32), samples.astype(f4))
    return film


@pytest.mark.parametrize("count", [2, 3, 8, 9, 31, 33, 100])
def test_sums_are_exact(count: int) -> None:
    """Variance of single samples and of batch means, as NumPy has them."""
    samples = np.random.default_rng(count).lognormal(0, 1, (3, count, 5)).astype(f4)
    film, wide = filled(samples), samples.astype(np.float64)
    assert film.mean() == pytest.approx(wide.mean(1))
    assert film.variance() == pytest.approx(wide.var(1, ddof=1))
    size = batch_size(count)
    used = count // size
    means = wide[:, : used * size].reshape(3, used, size, 5).mean(2)
    assert film.squared_error() == pytest.approx(means.var(1, ddof=1) * size / count, rel=1e-5)


def test_batches_are_few_and_not_too_few() -> None:
    """Powers of two: 2 to 8 from the second sample on, 4 to 8 from the sixteenth."""
    for count in range(2, 3000):
        size = batch_size(count)
        assert size & (size - 1) == 0
        assert (4 if count >= 16 else 2) <= count // size <= 8
        assert batch_size(count + 1) in (size, 2 * size)
    assert [batch_size(n) for n in (1, 4, 8, 16, 32, 64, 256)] == [1, 1, 2, 4, 4, 8, 32]


@pytest.mark.slow
@given(st.integers(1, 70), st.data())
def test_cutting_changes_no_bit(count: int, data) -> None:
    samples = np.random.default_rng(count).lognormal(0, 3, (3, count, 6)).astype(f4)
    whole, pieces = filled(samples), Film(6, 1)
    groups = data.draw(st.sampled_from([((0, 2, 5), (1, 3, 4)), ((0, 1, 2), (3, 4, 5)), (range(6),)]))
    done = 0
    while done < count:
        step = data.draw(st.integers(1, count - done))
        for group in groups:
            part = samples[:, done : done + step][:, :, list(group)]
            pieces.add(pixels(*group), part)
        done += step
    for name in ("mean", "variance", "squared_error"):
        assert getattr(whole, name)().tobytes() == getattr(pieces, name)().tobytes(), name


def test_no_scatter_is_no_error() -> None:
    film = filled(np.full((3, 100, 4), 0.1))
    assert (film.variance() < 1e-15).all()
    assert not film.squared_error().any()
    assert film.noise() == 0
    lone = filled(np.ones((3, 1, 4)))
    image = film_image(PictureSums(lone, None, {}), {}, keep_sums=False)
    assert np.isnan(image.variance).all()
    assert np.isnan(image.standard_error).all()
    assert np.isnan(lone.noise())
    assert filled(np.zeros((3, 9, 4))).noise() == 0


def test_pixels_have_their_own_counts() -> None:
    """Each is estimated from its own samples; one that has none is unknown."""
    samples = np.random.default_rng(0).exponential(1, (3, 64, 4)).astype(f4)
    film = Film(2, 2)
    film.add(pixels(0, 1, 2), samples[:, :16, :3])
    film.add(pixels(0, 2), samples[:, 16:, [0, 2]])
    image = film_image(PictureSums(film, None, {}), {}, keep_sums=False)
    assert image.counts.tolist() == [[64, 16], [64, 0]]
    assert image.spp == 36
    assert image.rgb[1, 1].tolist() == [0, 0, 0]
    assert np.isnan(image.standard_error[1, 1]).all()
    for k, count in ((0, 64), (1, 16), (2, 64)):
        alone = film_image(PictureSums(filled(samples[:, :count, k : k + 1]), None, {}), {}, keep_sums=False)
        assert (image.standard_error.reshape(-1, 3)[k] == alone.standard_error).all()
        assert (image.variance.reshape(-1, 3)[k] == alone.variance).all()


def test_one_firefly_does_not_decide() -> None:
    """The worst thousandth of the pixels counts as the worst of the others does."""
    samples = np.random.default_rng(0).uniform(0.9, 1.1, (3, 32, 2000))
    calm = filled(samples).noise()
    samples[:, 7, 100] = 1000
    assert int(OUTLIERS * 2000) == 2
    assert filled(samples).noise() == pytest.approx(calm, rel=0.5)
    samples[:, 7, 200:210] = 1000
    assert filled(samples).noise() > 5 * calm


def lit() -> wf.Scene:
    """A ball on a floor under a panel: soft shadows and little else, where stratification helps most."""
    panel = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), emission=3.0)
    camera = wf.Camera.look_at((0, 2, 4), (0, 0.4, 0), size=(16, 12))
    return wf.Scene([scenes.floor(), panel, wf.Sphere((0, 0.5, 0), 0.5)], camera=camera)


@pytest.mark.parametrize(
    ("sampler", "spp", "low", "high"),
    [
        ("independent", 16, 0.93, 1.07),
        pytest.param("sobol", 64, 0.97, 1.4, marks=pytest.mark.slow),
        pytest.param("bluenoise", 16, 0.97, 1.4, marks=pytest.mark.slow),
        pytest.param("independent", 256, 0.93, 1.07, marks=pytest.mark.slow),
        pytest.param("sobol", 256, 0.95, 1.4, marks=pytest.mark.slow),
    ],
)
def test_standard_error_is_the_scatter_across_seeds(sampler: str, spp: int, low: float, high: float) -> None:
    """On average over pixels, relative to their brightness.

    Stratified ones are over-estimated: what stratification gains between batches is not seen.
    """
    images = [render(lit(), spp, sampler=sampler, seed=seed, max_bounces=3) for seed in range(24)]
    runs = np.stack([image.rgb for image in images]).astype(np.float64)
    weight = 1 / (runs.mean(0) ** 2 + 0.01 * runs.mean() ** 2)
    true = (runs.var(0, ddof=1) * weight).mean()
    estimate = np.mean([(image.standard_error.astype(np.float64) ** 2 * weight).mean() for image in images])
    assert low < (estimate / true) ** 0.5 < high
    noise = np.mean([image.metadata["noise"] ** 2 for image in images]) ** 0.5
    assert noise == pytest.approx(estimate**0.5, rel=0.15)
    if sampler == "independent":
        variance = np.mean([(image.variance * weight).mean() for image in images]) / spp
        assert (variance / true) ** 0.5 == pytest.approx(1, abs=0.07)


def test_metadata_says_what_was_done() -> None:
    image = render(lit(), 3, max_bounces=0, seed=5)
    found = image.metadata
    assert (found["spp"], found["samples"], found["rays"]) == (3, 3 * 192, 3 * 192)
    assert (found["seed"], found["accelerator"], found["filter"]) == (5, "numpy", "box")
    assert found["seconds"] > 0
    assert found["numpy"] == np.__version__
    assert found["version"]
    light = wf.Scene([scenes.floor()], [wf.PointLight((0, 2, 0), 1)], scenes.probe((0, 0, 0), (0.1, 1, 0)))
    for integrator, each in (("direct_simple", 2), ("full", 3)):  # the camera's, to the light, onwards
        assert render(light, 3, integrator=integrator, max_bounces=1).metadata["rays"] == each * 3 * 64
    rays = [render(lit(), 4, **cut).metadata["rays"] for cut in ({}, {"wave_size": 50, "workers": 2})]
    assert rays[0] == rays[1]


# --- Few samples that bring most of the light -----------------------------------------------------


def sums(draw: Callable[[np.random.Generator, tuple[int, ...]], np.ndarray], spp: int = 64) -> Film:
    """A film of 32 x 32 pixels of drawn samples."""
    film = Film(32, 32)
    samples = draw(np.random.default_rng(3), (3, spp, 1024)).astype(np.float32)
    film.add(np.arange(1024, dtype=np.uint32), samples)
    return film


def rare(chance: float, spp: int = 64) -> Film:
    """A film whose samples are 1, but 100 by a small chance."""
    return sums(
        lambda rng, shape: np.broadcast_to(np.where(rng.random(shape[1:]) < chance, 100, 1), shape), spp
    )


def test_the_part_of_rare_samples() -> None:
    """Is small where many samples make up the error, and nearly 1 where one does."""

    def part(film: Film) -> float | None:
        return film.rare_part(film.relative_variance())

    assert part(sums(lambda rng, shape: rng.normal(3, 1, shape))) < 0.1
    assert part(rare(0.5)) < 0.1
    assert 0.1 < part(rare(0.05)) < 0.6
    assert part(rare(0.001)) > 0.9
    assert part(rare(0.001, 15)) is None
    assert part(sums(lambda rng, shape: np.ones(shape))) is None


def test_noise_goes_on_where_rare_samples_bring_the_light() -> None:
    """Although the estimated error is what was asked for; not where many samples make it up."""
    square_of = np.zeros(1024, np.intp)
    for film, goes_on in ((rare(0.001), True), (rare(0.5), False)):
        asked = 1.01 * film.noise()
        steps = passes(film, 1 << 20, asked, square_of, Pass(np.arange(1024, dtype=np.uint32), 48, 64))
        next(steps)
        assert (next(steps, None) is not None) is goes_on


def test_a_picture_tells_of_rare_samples() -> None:
    scene = scenes.room((24, 24))
    assert render(scene, 8).metadata["rare"] is None
    assert 0 <= render(scene, 16).metadata["rare"] <= 1

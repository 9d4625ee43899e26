"""Merging: pictures of different samples of one scene become the picture of all samples, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wavefront as wf
from wavefront.film import Film
from wavefront.vec import f4


def film_of(samples: np.ndarray) -> Film:
    """Return a film of 3 × 2 pixels with samples (3, n, 6)."""
    film = Film(3, 2)
    film.add(np.arange(6, dtype=np.uint32), samples)
    return film


def lognormal(spp: int) -> np.ndarray:
    """Samples (3, spp, 6) of very different sizes."""
    return np.random.default_rng(spp).lognormal(0, 3, (3, spp, 6)).astype(f4)


@given(st.integers(2, 200), st.data())
def test_films_of_any_parts_merge_to_the_film_of_all(spp: int, data: st.DataObject) -> None:
    """The picture has the same bits; estimates of its error agree."""
    samples, cuts = lognormal(spp), sorted(data.draw(st.sets(st.integers(1, spp - 1), max_size=5)))
    whole = film_of(samples)
    first, *others = [film_of(part) for part in np.split(samples, cuts, axis=1)]
    for other in others:
        first.merge(other)
    assert first.mean().tobytes() == whole.mean().tobytes()
    assert first.estimates().mean.tobytes() == whole.estimates().mean.tobytes()
    assert (first.count == spp).all()
    np.testing.assert_allclose(first.variance(), whole.variance(), rtol=1e-6)
    assert np.isfinite(first.squared_error()).all()


@pytest.mark.parametrize("parts", [(64, 64), (32, 32, 32, 32), (96, 32), (16, 16)])
def test_films_of_aligned_parts_have_the_same_batches(parts: tuple[int, ...]) -> None:
    """Batches of parts end where those of the whole film do; so the errors are the same but for rounding."""
    samples = lognormal(sum(parts))
    whole = film_of(samples)
    first, *others = [film_of(part) for part in np.split(samples, np.cumsum(parts)[:-1], axis=1)]
    for other in others:
        first.merge(other)
    assert first.lengths is None
    np.testing.assert_allclose(first.squared_error(), whole.squared_error(), rtol=1e-4)


def test_errors_of_parts_that_are_not_aligned_are_those_of_the_mean() -> None:
    """Of independent samples of known variance: the mean over many pixels within 3 %."""
    rng, pixels = np.random.default_rng(3), 20_000
    samples = rng.normal(5, 2, (3, 100, pixels)).astype(f4)
    films = []
    for part in np.split(samples, [37, 50], axis=1):
        film = Film(pixels, 1)
        film.add(np.arange(pixels, dtype=np.uint32), part)
        films.append(film)
    first, *others = films
    for other in others:
        first.merge(other)
    assert first.lengths is not None
    assert first.squared_error().mean() == pytest.approx(4 / 100, rel=0.03)


def test_a_film_is_restored_from_its_arrays() -> None:
    """It goes on as if nothing had been."""
    samples = lognormal(50)
    whole, copy = film_of(samples), Film(3, 2)
    copy.restore({name: array.copy() for name, array in film_of(samples[:, :21]).arrays().items()})
    copy.add(np.arange(6, dtype=np.uint32), samples[:, 21:])
    for name, array in whole.arrays().items():
        assert copy.arrays()[name].tobytes() == array.tobytes(), name


CAMERA = wf.Camera.look_at((0, 1, 4), (0, 0, 0), size=(16, 12))
SCENE = wf.Scene(
    [wf.Sphere((0, 0, 0), 1)], [wf.Environment((0.2, 0.5, 1.0)), wf.PointLight((3, 3, 3), 20)], CAMERA
)


def test_the_first_samples_are_those_of_a_render_of_as_many() -> None:
    """Bit for bit, with any waves."""
    whole = wf.render(SCENE, 8)
    part = wf.render(SCENE, samples=range(8), wave_size=50, workers=2, executor="threads")
    assert part.rgb.tobytes() == whole.rgb.tobytes()
    assert whole.metadata["sample_ranges"] == part.metadata["sample_ranges"] == [[0, 8]]
    assert (part.spp, part.metadata["spp"]) == (8, 8.0)


def test_later_samples_are_the_others_of_a_longer_render() -> None:
    """Here the means of two halves are rounded to float32 once more."""
    parts = [wf.render(SCENE, samples=range(first, first + 8)) for first in (0, 8)]
    assert parts[1].metadata["sample_ranges"] == [[8, 16]]
    assert parts[0].rgb.tobytes() != parts[1].rgb.tobytes()
    whole = wf.render(SCENE, 16)
    np.testing.assert_allclose((parts[0].rgb + parts[1].rgb) / 2, whole.rgb, rtol=3e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 64}, r"samples is 64; it must be a range of consecutive samples, such as range\(64, 1"),
        ({"samples": range(0, 8, 2)}, r"samples is range\(0, 8, 2\)"),
        ({"samples": range(4, 4)}, r"samples is range\(4, 4\)"),
        ({"samples": range(-1, 4)}, r"samples is range\(-1, 4\)"),
        ({"samples": range(4), "spp": 4}, r"samples is range\(0, 4\); then spp must not be given"),
        ({"samples": range(4), "noise": 0.1}, "then noise must not be given"),
        ({"samples": range(4), "seconds": 1}, "then seconds must not be given"),
        ({"samples": range(2**32)}, f"it must end at {2**26} at most"),
    ],
)
def test_ranges_that_make_no_picture_are_errors(options: dict[str, Any], message: str) -> None:
    """Before any work."""
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **options)

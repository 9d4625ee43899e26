"""Merging: pictures of different samples of one scene become the picture of all samples, bit for bit."""

from __future__ import annotations

from functools import reduce
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import Film, Sensors, f4, main

import wavefront as wf


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
    assert not first.lengths.any()
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
    assert first.lengths.any()
    assert first.squared_error().mean() == pytest.approx(4 / 100, rel=0.03)


CAMERA = wf.Camera.look_at((0, 1, 4), (0, 0, 0), size=(16, 12))
SCENE = wf.Scene(
    [wf.Sphere((0, 0, 0), 1)], [wf.Environment((0.2, 0.5, 1.0)), wf.PointLight((3, 3, 3), 20)], CAMERA
)


def test_the_first_samples_are_those_of_a_render_of_as_many() -> None:
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
        (
            {"samples": 6.4},
            r"samples is 6.4; it must be a range of consecutive samples, such as range\(64, 1",
        ),
        ({"samples": range(0, 8, 2)}, r"samples is range\(0, 8, 2\)"),
        ({"samples": range(4, 4)}, r"samples is range\(4, 4\)"),
        ({"samples": range(-1, 4)}, r"samples is range\(-1, 4\)"),
        ({"samples": range(4), "spp": 4}, r"samples=range\(0, 4\) does not go with spp=4: samples"),
        ({"samples": range(4), "noise": 0.1}, "does not go with noise=0.1: samples"),
        ({"samples": range(4), "seconds": 1}, "does not go with seconds=1.0: samples"),
        ({"samples": range(2**32)}, f"it must end at {2**26} at most"),
    ],
)
def test_ranges_that_make_no_picture_are_errors(options: dict[str, Any], message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **options)


# --- Pictures -----------------------------------------------------------------------------------------

AOVS = ("alpha", "albedo", "direct", "indirect", "light_groups", "coverage", "depth")


@pytest.mark.parametrize("view", ["picture", "sensors"])
@pytest.mark.parametrize("cuts", [(3, 4, 13), (1,), (8,), (5, 11), (2, 4, 6, 8, 10, 12, 14)])
@pytest.mark.first(4)
def test_pictures_of_any_parts_merge_to_one_render(cuts: tuple[int, ...], view: str) -> None:
    settings: dict[str, Any] = {"aovs": AOVS}
    if view == "sensors":
        points = np.random.default_rng(0).uniform(-2, 2, (50, 3))
        settings = {"aovs": AOVS[2:5], "camera": Sensors(points, points)}
    whole = wf.render(SCENE, 16, **settings)
    parts = [
        wf.render(SCENE, samples=range(first, end), wave_size=70 + first, **settings)
        for first, end in pairwise((0, *cuts, 16))
    ]
    merged = reduce(wf.Image.merge, parts)
    backward = reduce(wf.Image.merge, parts[::-1])
    for image in (merged, backward):
        assert image.rgb.tobytes() == whole.rgb.tobytes()
        assert set(image.layers) == set(whole.layers)
        for name, layer in whole.layers.items():
            assert image.layers[name].tobytes() == layer.tobytes(), name
        assert image.metadata["sample_ranges"] == [[0, 16]]
        assert (image.spp, image.metadata["spp"]) == (16, 16)
        assert image.metadata["samples"] == whole.metadata["samples"]
        assert image.metadata["rays"] == whole.metadata["rays"]
        assert image.variance is not None
        np.testing.assert_allclose(image.variance, whole.variance, rtol=1e-5)
    assert merged.metadata["seconds"] == pytest.approx(sum(part.metadata["seconds"] for part in parts))


def test_merging_changes_neither_picture() -> None:
    a, b, c = (wf.render(SCENE, samples=range(first, first + 4)) for first in (0, 4, 8))
    before = a.rgb.copy(), a.sums.film.count.copy()  # type: ignore[union-attr]
    once = a.merge(b).merge(c)
    twice = a.merge(c).merge(b)
    assert once.rgb.tobytes() == twice.rgb.tobytes()
    assert a.merge(c).metadata["sample_ranges"] == [[0, 4], [8, 12]]
    assert (a.rgb == before[0]).all()
    assert (a.sums.film.count == before[1]).all()  # type: ignore[union-attr]


def test_npz_files_carry_the_sums(tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}.npz" for number in range(3)]
    for first, path in zip((0, 3, 6), paths, strict=True):
        wf.render(SCENE, samples=range(first, first + 3), aovs=AOVS).save(path)
    wf.Image.load(paths[0]).merge(wf.Image.load(paths[2])).save(paths[0])
    merged = wf.Image.load(paths[0]).merge(wf.Image.load(paths[1]))
    whole = wf.render(SCENE, 9, aovs=AOVS)
    assert merged.rgb.tobytes() == whole.rgb.tobytes()
    assert all(merged.layers[name].tobytes() == layer.tobytes() for name, layer in whole.layers.items())


def test_what_cannot_be_merged_is_an_error() -> None:
    part, later = wf.render(SCENE, samples=range(4)), range(4, 8)
    for other, message in [
        (wf.render(SCENE, 8), r"pictures without the sums .*render with samples=range\(...\)"),
        (wf.render(SCENE, samples=range(3, 8)), "pictures that share samples .*: 3 to 3 are in both"),
        (wf.render(SCENE, samples=later, seed=1), "different renders .*: seed was 0 and is 1"),
        (wf.render(SCENE, samples=later, size=(8, 8)), r"size was \[16, 12\] and is \[8, 8\]"),
        (wf.render(SCENE, samples=later, aovs="alpha"), r"aovs was \[\] and is \['alpha'\]"),
        (wf.render(wf.Scene(SCENE.shapes, [wf.Environment(1)], CAMERA), samples=later), "the scene differs"),
        (part.rgb, "a picture is merged with another one, got ndarray"),
    ]:
        with pytest.raises(wf.SceneError, match=message):
            part.merge(other)


def test_a_part_that_was_stopped_cannot_be_merged() -> None:

    def stop(done: float, total: float) -> None:
        if done > 200:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted) as stopped:
        wf.render(SCENE, samples=range(4, 8), wave_size=150, progress=stop, workers=1)
    with pytest.raises(wf.SceneError, match="whose pixels have 1 to 2 samples cannot be merged"):
        wf.render(SCENE, samples=range(4)).merge(stopped.value.image)


def test_sums_that_were_damaged_are_an_error(tmp_path: Path) -> None:
    wf.render(SCENE, samples=range(4)).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive:
        arrays = dict(archive)
    for name, value in [
        ("sums.film.count", arrays["sums.film.count"][:-1]),
        ("sums.film.sums.high", arrays["sums.film.sums.high"].astype(np.float32)),
        ("metadata", np.array("{}")),
    ]:
        np.savez(tmp_path / "b.npz", **{**arrays, name: value})
        with pytest.raises(wf.SceneError, match=r"b\.npz: the sums of its samples are damaged"):
            wf.Image.load(tmp_path / "b.npz")


def test_the_command_line_renders_parts_and_merges_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    options = ["--size", "12x8", "--lighting", "studio", "--quiet"]
    for samples, output in (("0:4", "a.npz"), ("4:9", "b.npz")):
        assert main(["render", "t.obj", *options, "--samples", samples, "-o", output]) == 0
    assert main(["render", "t.obj", *options, "--spp", "9", "-o", "whole.npy"]) == 0
    capsys.readouterr()
    assert main(["merge", "b.npz", "a.npz", "-o", "merged.npy"]) == 0
    assert capsys.readouterr().out == "merged.npy: 9 spp, samples 0:9\n"
    assert np.load("merged.npy").tobytes() == np.load("whole.npy").tobytes()
    assert main(["merge", "a.npz", "whole.npy", "-o", "merged.npy"]) == 2
    assert "whole.npy: pictures without the sums of their samples cannot be merged" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["render", "t.obj", "--samples", "4:4"])

"""Converged pictures of benchmarks: kept, found again, and never those of something else."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import cornell_box

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import references
from references import Converged, References, hash_of

import wavefront as wf

SIDE = "wavefront numpy plain"


def test_a_kept_picture_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = References(tmp_path / "new")
    made = kept.picture("box", cornell_box((4, 4)), SIDE, 1, 16)
    monkeypatch.delattr(references, "_made")
    found = kept.picture("box", cornell_box((4, 4)), SIDE, 1, 16)
    assert np.array_equal(found.picture, made.picture)
    assert np.array_equal(found.error, made.error)
    assert found.noise == made.noise > 0


@pytest.mark.parametrize(
    "other",
    [{"size": (5, 4)}, {"spp": 24}, {"side": "wavefront numpy independent"}, {"max_bounces": 2}],
    ids=str,
)
def test_a_picture_of_something_else_is_not(other: dict, tmp_path: Path) -> None:
    def picture(size=(4, 4), side=SIDE, max_bounces=1, spp=16) -> Converged:
        return References(tmp_path).picture("box", cornell_box(size), side, max_bounces, spp)

    picture()
    picture(**other)
    assert len(list(tmp_path.iterdir())) == 2


def test_noise_is_that_of_the_mean() -> None:
    """Of passes whose mean is known: the error of each, divided by their number."""
    rng = np.random.default_rng(0)
    passes = [1 + 0.1 * rng.normal(size=(64, 64, 3)) for _ in range(16)]
    found = Converged.of(passes)
    assert found.noise == pytest.approx(0.01 / 16, rel=0.1)
    assert found.error == pytest.approx(0.1 / 64 / 4, rel=0.6)


def test_a_picture_of_another_version_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for version in ("1", "2"):
        monkeypatch.setattr(references.wf, "__version__", version)
        References(tmp_path).picture("box", cornell_box((4, 4)), SIDE, 1, 16)
    assert len(list(tmp_path.iterdir())) == 2


def test_scenes_have_hashes_of_what_they_show() -> None:
    def scene(emission=1.0, gray=0.5, x=0.0, sky=1.0, fov=40.0) -> wf.Scene:
        ball = wf.Sphere((x, 0, 0), 1, material=wf.Diffuse(gray), emission=emission)
        camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=fov, size=(4, 4))
        return wf.Scene([ball], [wf.Environment(sky)], camera)

    others = [scene(emission=2.0), scene(gray=0.6), scene(x=0.1), scene(sky=2.0), scene(fov=41.0)]
    assert len({hash_of(each) for each in (scene(), scene(), *others)}) == 6

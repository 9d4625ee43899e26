"""assert_same_picture: a regression test of pictures."""

import numpy as np
import pytest
from significance import render

import wavefront as wf
from wavefront.testing import assert_same_picture

BALL = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5))
LAMP = wf.Sphere((1.2, 1.2, 1.2), 0.1, emission=30, material=wf.Diffuse(0))
SIZE = (40, 32)


def picture(seed=0, spp=16, gain=1.0, **settings) -> wf.Image:
    return render([BALL, LAMP, wf.Environment(0.2 * gain)], spp, seed=seed, size=SIZE, **settings)


@pytest.fixture(scope="module")
def before() -> wf.Image:
    return picture()


def test_the_same_render_is_the_same(before, tmp_path) -> None:
    """With one seed on both sides, and from a file."""
    assert assert_same_picture(picture(), before).p_value == 1
    for name in ("before.npz", "before.exr"):
        before.save(tmp_path / name)
        assert assert_same_picture(before, tmp_path / name).p_value == 1


def test_noise_is_no_difference(before) -> None:
    found = assert_same_picture(picture(seed=1), before)
    assert 1e-3 < found.p_value < 1
    assert found.shared == ""
    assert "share samples" in assert_same_picture(picture(spp=8), before).shared


@pytest.mark.parametrize("seed", [0, 1])
def test_what_differs_is_told(before, seed: int) -> None:
    """Light that is 10 % brighter, with the same samples and with others."""
    with pytest.raises(AssertionError, match="differ by more than noise") as caught:
        assert_same_picture(picture(seed, gain=1.1), before)
    assert "relative MSE" in str(caught.value)


def test_the_place_of_the_difference_is_told(before) -> None:
    other = picture(seed=1)
    other.rgb[5:25, 33:38] += 1
    with pytest.raises(AssertionError, match="most at x=32 to 39, y=0 to 31:"):
        assert_same_picture(other, before)


def test_samples_are_compared_and_no_denoised_picture(before) -> None:
    smooth = before.denoise("nonlocal_means")
    assert wf.compare(smooth, before).p_value == 1
    assert assert_same_picture(smooth, before).p_value == 1
    assert assert_same_picture(before, smooth).p_value == 1
    with pytest.raises(AssertionError):
        assert_same_picture(picture(gain=1.5).denoise("nonlocal_means"), smooth)


@pytest.mark.parametrize(
    "other", [np.ones((32, 40, 3), np.float32), wf.Image(np.ones((32, 40, 3), np.float32))]
)
def test_without_samples_nothing_is_said(before, other) -> None:
    with pytest.raises(
        wf.SceneError, match=r"cannot be compared by their samples: .* b has no standard error"
    ):
        assert_same_picture(before, other)


def test_how_unlikely_is_the_users() -> None:
    def gray(level: float, seed: int) -> wf.Image:
        ones = np.ones((8, 8, 3), np.float32)
        noise = np.random.default_rng(seed).normal(0, 0.1, (8, 8, 3)).astype(np.float32)
        known = {"counts": np.full((8, 8), 64), "variance": 0.64 * ones, "standard_error": 0.1 * ones}
        return wf.Image(level * ones + noise, **known)

    a, b = gray(1.03, 1), gray(1, 2)
    chance = wf.compare(a, b).p_value
    assert 1e-3 < chance < 0.9
    assert_same_picture(a, b, p=0.99 * chance)
    with pytest.raises(AssertionError):
        assert_same_picture(a, b, p=1.01 * chance)
    with pytest.raises(wf.SceneError, match="p is 2"):
        assert_same_picture(a, b, p=2)

"""Differences and multiples of pictures."""

import numpy as np
import pytest
from significance import render

import wavefront as wf


def picture(seed, **more) -> wf.Image:
    rng = np.random.default_rng(seed)
    rgb, error = rng.random((2, 3, 5, 3)).astype(np.float32)
    return wf.Image(rgb, 8, {"seed": seed, "sampler": "sobol", "spp": 8}, standard_error=error, **more)


def test_difference() -> None:
    """Has the error of independent pictures."""
    a, b = picture(1), picture(2)
    found = a - b
    assert (found.rgb == a.rgb - b.rgb).all()
    assert found.standard_error == pytest.approx(np.sqrt(a.standard_error**2 + b.standard_error**2))
    assert found.spp == 8
    assert not found.layers
    assert (a - picture(1)).standard_error is None  # shares its samples
    assert (a - wf.Image(b.rgb)).standard_error is None


def test_difference_of_renders_is_noise() -> None:
    """Of the estimated size."""
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1), wf.PointLight((2, 2, 2), 9)])
    camera = wf.Camera.look_at((0, 0, 1.9), (0, 0, 0), size=(16, 16))
    a, b = (render(scene, 64, seed=seed, camera=camera, sampler="independent") for seed in (1, 2))
    found = a - b
    assert 0.8 < np.sqrt(np.mean(found.rgb**2) / np.mean(found.standard_error**2)) < 1.25


def test_multiple() -> None:
    """Scales errors and radiance, and nothing else."""
    ones = np.ones((3, 5, 3), np.float32)
    layers = {"direct": ones, "albedo": ones, "light_groups.lamp": ones, "depth": ones[..., 0]}
    errors = {"direct": ones, "albedo": ones, "light_groups.lamp": ones}
    a = picture(1, layers=layers, errors=errors, variance=ones, counts=np.full((3, 5), 8))
    for factor in (-2, 2.5, (1, 2, -3), np.array([1, 0, 2])):
        scale = np.broadcast_to(np.asarray(factor, np.float32), (3,))
        found = a * factor
        assert (found.rgb == a.rgb * scale).all()
        assert (found.standard_error == a.standard_error * abs(scale)).all()
        assert (found.variance == scale**2).all()
        for name in ("direct", "light_groups.lamp"):
            assert (found.layers[name] == scale).all()
            assert (found.errors[name] == abs(scale)).all()
        assert (found.layers["albedo"] == 1).all()
        assert (found.errors["albedo"] == 1).all()
        assert (found.depth == 1).all()
        assert (found.counts == 8).all()
        assert found.metadata == a.metadata
    assert (a.rgb == picture(1).rgb).all()
    assert ((2 * a).rgb == a.rgb * 2).all()


@pytest.mark.parametrize("factor", [(1, 2), np.nan, np.ones((3, 5, 3)), (1, 2, np.inf)])
def test_wrong_factors(factor) -> None:
    """Are named."""
    with pytest.raises(wf.SceneError, match="number or an rgb triple"):
        picture(1) * factor


def test_wrong_operands() -> None:
    """Sizes and types."""
    with pytest.raises(wf.SceneError, match="5x3 and 2x2"):
        picture(1) - wf.Image(np.zeros((2, 2, 3), np.float32))
    for wrong in ("2", None, picture(2)):
        with pytest.raises(TypeError):
            picture(1) * wrong
    assert isinstance(picture(1) - np.zeros((3, 5, 3), np.float32), np.ndarray)  # as NumPy has it

"""Scrambled Sobol points against plain random numbers, as the picture sees them."""

import sys
from pathlib import Path

import numpy as np
import pytest

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
from cornell_box import cornell_box

SIZE = 32


@pytest.fixture(scope="module")
def converged() -> np.ndarray:
    """The Cornell box at 1024 spp."""
    return wf.render(cornell_box(SIZE), 1024, max_bounces=7, seed=99, accel="numpy", progress=False).rgb


def errors(sampler: str, spp: int, exact: np.ndarray) -> np.ndarray:
    """Squared error per pixel, the mean of four seeds, (H, W)."""
    return np.mean(
        [((render(sampler, spp, seed).astype(float) - exact) ** 2).mean(2) for seed in range(4)], axis=0
    )


def render(sampler: str, spp: int, seed: int) -> np.ndarray:
    """The Cornell box by one sampler."""
    scene = cornell_box(SIZE)
    return wf.render(scene, spp, max_bounces=7, seed=seed, sampler=sampler, accel="numpy", progress=False).rgb


@pytest.mark.slow
def test_sobol_halves_the_error(converged: np.ndarray) -> None:
    """At 64 spp the MSE on the Cornell box is at most half of independent's."""
    sobol, independent = (errors(sampler, 64, converged).mean() for sampler in ("sobol", "independent"))
    assert sobol <= 0.5 * independent


@pytest.mark.slow
def test_sobol_is_steeper_where_the_picture_is_smooth() -> None:
    """On a plain floor under one light the error falls faster than 1/spp, by which independent's falls."""
    floor = wf.Rectangle((-9, 0, 9), (18, 0, 0), (0, 0, -18))
    light = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), emission=1.0)
    camera = wf.Camera.look_at((0, 1.5, 2.5), (0, 0, 0), fov=30, size=(16, 16))
    scene = wf.Scene([floor, light], camera=camera)
    exact = wf.render(scene, 1 << 12, max_bounces=1, seed=7, accel="numpy", progress=False).rgb
    slope = {}
    for sampler in ("sobol", "independent"):
        error = [
            np.mean(
                [
                    (wf.render(scene, spp, max_bounces=1, seed=s, sampler=sampler, accel="numpy").rgb - exact)
                    ** 2
                    for s in range(4)
                ]
            )
            for spp in (16, 64, 256)
        ]
        slope[sampler] = np.polyfit(np.log([16, 64, 256]), np.log(error), 1)[0]
    assert slope["independent"] == pytest.approx(-1, abs=0.15)
    assert slope["sobol"] < -1.2

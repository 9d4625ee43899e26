"""Light samples to points of what glows on grids."""

from functools import cache

import numpy as np
import pytest
from inside import GlowLights
from scenes import MET_AND_SAMPLED, probe
from scipy import stats
from significance import ALPHA, Mean, assert_mean, measure

import wavefront as wf

BOX = np.array([(-0.5, 0.3, -0.4), (0.5, 1.1, 0.6)])
FLOOR = wf.Rectangle((-9, 0, 9), (18, 0, 0), (0, 0, -18), material=wf.Diffuse(0.8))
SPOT = probe((0.2, 0, 0.1), (0.8, 0.2, 4))  # sees the floor below the fire
INTEGRATORS = ("naive", "direct_simple", "direct_mis", "full")


def flame(shape=(6, 5, 7)) -> np.ndarray:
    """Emission that is uneven, and 0 in half of the voxels."""
    return np.maximum(0, np.random.default_rng(1).random((*shape, 3)) - 0.5) * (1, 2, 4)


@pytest.mark.parametrize("shape", [(6, 5, 7), (1, 1, 3), (40, 3, 64)])
def test_points_follow_their_density(shape) -> None:
    """χ² of the cells, and of the places within them; the density is that which weighs samples."""
    light = GlowLights.of(
        wf.GridMedium(np.ones((2, 2, 2)), BOX, emission=flame(shape)).record(np.zeros(3)), 0
    )
    n, aim, rate = 200_000, light.cells.media.aim, light.cells.media.points_on_ray[0]
    size = aim.size
    unit, at = light.cells.points(np.random.default_rng(2).random((2, n), np.float32))
    np.testing.assert_allclose(at.T, BOX[0] + (BOX[1] - BOX[0]) * unit.T, atol=1e-5)
    cell = np.minimum((unit * size).astype(int), size - 1)
    counts = np.bincount(cell[0] + size[0] * (cell[1] + size[1] * cell[2]), minlength=int(size.prod()))
    share = aim.values[0].astype(float) * rate * np.prod(BOX[1] - BOX[0]) / size.prod()
    assert share.sum() == pytest.approx(1, rel=1e-5)
    assert not counts[share == 0].any()
    often = share * n > 10
    found, due = (np.append(each[often], each[~often].sum()) for each in (counts, share * n))
    some = due > 0
    assert stats.chisquare(found[some], due[some] * found.sum() / due[some].sum()).pvalue > ALPHA
    place = np.minimum((4 * (unit * size - cell)).astype(int), 3)
    assert stats.chisquare(np.bincount(place[0] + 4 * (place[1] + 4 * place[2]), minlength=64)).pvalue > ALPHA


def test_samples_bring_what_is_emitted() -> None:
    """The mean of ε/q is the integral of ε, in each channel."""
    medium = wf.GridMedium(np.ones((2, 3, 2)), BOX, emission=flame(), scale=3)
    light = GlowLights.of(medium.record(np.zeros(3)), 0)
    point = np.zeros((3, 200_000), np.float32)
    sample = light.sample_li(point, np.random.default_rng(3).random((2, 200_000), np.float32))
    volume = np.prod(BOX[1] - BOX[0])
    for channel, due in zip(sample.radiance, flame().mean((0, 1, 2)) * 3 * volume, strict=True):
        brought = channel * sample.distance**2 / sample.pdf
        # voxels at the sides count as the others: what is interpolated has the same mean
        assert_mean(Mean.of(brought.reshape(400, -1).mean(1, dtype=np.float64)), due, 0.01)
    assert light.power(1)[0] == pytest.approx(4 * np.pi * flame().mean() * 3 * volume, rel=1e-4)


def fog(density: float) -> wf.GridMedium:
    return wf.GridMedium(np.full((2, 2, 2), density), BOX, absorption=1, emission=2)


@cache
def radiance_below(density: float) -> float:
    """ρ/π·∫ε·exp(−σ·l)·cosθ/d² dV, with the part l of the way that is in the box."""
    steps = (np.indices((96, 96, 96)).reshape(3, -1) + 0.5) / 96
    away = BOX[0][:, None] + (BOX[1] - BOX[0])[:, None] * steps - np.array([[0.2], [0], [0.1]])
    d2 = (away**2).sum(0)
    inside = (1 - 0.3 / away[1]) * np.sqrt(d2)  # rays enter through the bottom
    each = 2 * density * np.exp(-density * inside) * away[1] / d2**1.5
    return float(0.8 / np.pi * each.mean() * np.prod(BOX[1] - BOX[0]))


@pytest.mark.parametrize("density", [0.01, 3.0])
@pytest.mark.parametrize("integrator", MET_AND_SAMPLED)
def test_irradiance_by_quadrature(integrator: str, density: float) -> None:
    """A glowing box above a floor."""
    scene = wf.Scene([wf.GridBox(fog(density)), FLOOR], camera=SPOT)
    mean = measure(scene, 256, max_bounces=1, lighting=None, integrator=integrator)
    most = {"naive": 0.02, "direct_simple": 0.01}.get(integrator, 0.005)
    assert_mean(mean, radiance_below(density), most)


@pytest.mark.parametrize("holder", ["cut", "hidden", "two"])
def test_estimators_agree(holder: str) -> None:
    """Where a shape cuts off what glows, where something is in its place, and with other lights around."""
    fire = wf.GridMedium(np.ones((3, 3, 3)), BOX, 1, 1, emission=flame())
    inside = wf.Material(wf.NullSurface(), interior=fire)
    shapes = {
        "cut": [wf.Sphere((0.2, 0.7, 0), 0.35, material=inside)],
        "hidden": [
            wf.GridBox(fire),
            wf.Box((0, 0.6, 0), 0.5, material=wf.Material(wf.Diffuse(0.5), priority=1)),
            wf.Box((0.3, 0.6, 0), 0.5, material=wf.Material(wf.Dielectric(1.5), priority=2)),
        ],
        "two": [
            wf.GridBox(fire),
            wf.GridBox(wf.GridMedium(flame()[..., 0], [(1, 0, -1), (2, 1, 0)], 2, emission=3)),
            wf.Sphere((-2, 1, 0), 0.3, emission=1),
        ],
    }[holder]
    scene = wf.Scene([*shapes, FLOOR], camera=SPOT)
    options = {"max_bounces": 3, "lighting": None}
    found = [measure(scene, 128, integrator=each, seed=7, **options) for each in ("naive", "full")]
    both = np.hypot(*(each.error for each in found))
    assert abs(found[0].value - found[1].value) < 4 * both
    assert found[1].error < found[0].error

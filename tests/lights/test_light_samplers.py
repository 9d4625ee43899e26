"""The choice of one light among many, by place."""

import numpy as np
import pytest

import wavefront as wf
from wavefront.arrays.vec import f4
from wavefront.lights import LightTable, PointLightRecord, TriangleLights
from wavefront.lights.samplers import BY_POWER, SpatialLightSampler


def two_points() -> LightTable:
    """A light near each end of a long scene."""
    return LightTable(
        [PointLightRecord(np.array([[-9, 9], [1, 1], [0, 0]], f4), np.ones((3, 2), f4))], (10, 1, 1)
    )


@pytest.mark.parametrize(("x", "near"), [(-9.0, 0), (9.0, 1)])
def test_near_lights_are_preferred(x: float, near: int) -> None:
    """At one end of the room the light there has nearly all of the choice, the other never none."""
    lights = two_points()
    point = np.repeat(np.array([[x], [0], [0]], f4), 2, 1)
    chance = lights.choice.pmf(np.arange(2), point)
    assert chance[near] > 0.95
    assert chance[1 - near] >= BY_POWER / 2
    assert chance.sum() == pytest.approx(1, rel=1e-6)


def test_lights_that_face_away_get_what_their_power_gives() -> None:
    """Below a triangle that shines upwards there is nothing to be had from it."""
    up = np.array([[[0, 1, 0], [0, 1, 1], [1, 1, 0]]], float)
    down = up[:, ::-1]
    lights = LightTable(
        [TriangleLights.from_triangles(np.concatenate([up, down]), np.ones((3, 1), f4))], (20, 20, 20)
    )
    chance = lights.choice.pmf(np.arange(2), np.repeat(np.array([[0], [-18], [0]], f4), 2, 1))
    assert chance == pytest.approx([BY_POWER / 2, 1 - BY_POWER / 2], rel=1e-5)


@pytest.mark.parametrize("k", [1, 2, 3, 5, 1000])
def test_sampling_follows_the_probabilities(k: int) -> None:
    """In every cell each of k lights is drawn as often as its pmf says; u = 0 and 1 - 2^-24 too."""
    rng = np.random.default_rng(3)
    choice = SpatialLightSampler(
        -np.ones(3), np.ones(3), lambda c, r: rng.random((c.shape[1], k)) ** 4, rng.random(k)
    )
    n = 1 << 18
    for _ in range(3):
        point = np.repeat(rng.uniform(-1, 1, (3, 1)).astype(f4), n, 1)
        u = ((np.arange(n) + 0.5) / n).astype(f4)
        light, chance = choice.sample(point, u)
        expected = choice.pmf(np.arange(k), point[:, :k])
        assert np.abs(np.bincount(light, minlength=k) / n - expected).max() < 2 / n
        assert (chance == expected[light]).all()
        edge, _ = choice.sample(point[:, :2], np.array([0, 1 - 2**-24], f4))
        assert edge.tolist() == [0, k - 1]


def test_points_outside_the_grid_belong_to_its_border() -> None:
    """A point beyond the scene's bounds is chosen for like the nearest cell."""
    lights = two_points()
    back_facing, outside = (np.array([[x], [0.9], [-0.9]], f4) for x in (9.99, 1e6))
    assert lights.choice.pmf(np.array([1]), back_facing) == lights.choice.pmf(np.array([1]), outside)


@pytest.mark.parametrize("extent", [(0, 0, 0), (1, 0, 1), (1e-6, 1e6, 1)], ids=str)
def test_flat_and_empty_extents(extent: tuple[float, float, float]) -> None:
    """A scene without height or depth still has a grid of at least one cell."""
    lights = LightTable(
        [PointLightRecord(np.array([[-1, 1], [1, 1], [0, 0]], f4), np.ones((3, 2), f4))], extent
    )
    _, chance = lights.choice.sample(np.zeros((3, 4), f4), np.linspace(0, 0.99, 4, dtype=f4))
    assert (chance > 0).all()


def test_unknown_choice() -> None:
    with pytest.raises(
        wf.SceneError, match=r"light_sampler is 'best'; it must be one of spatial, power, uniform"
    ):
        LightTable([], 1.0, "best")

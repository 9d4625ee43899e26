"""The choice of one light among many, by place."""

from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from inside import (
    BY_POWER,
    Emitters,
    LightSampler,
    LightTable,
    PointLightRecord,
    Receiver,
    SpatialLightSampler,
    TriangleLights,
    chi_square,
    f4,
    fingerprint,
    samplers,
)
from significance import assert_same_images, repeat

import wavefront as wf


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


class AnyIrradiance:
    """Lights of all kinds: placed, nowhere, at infinity; what each brings is random."""

    def __init__(self, k: int) -> None:
        rng = self.rng = np.random.default_rng(3)
        self.k, self.power = k, rng.random(k)
        facing = rng.normal(size=(3, k))
        extent2 = np.where(np.arange(k) % 7 == 5, np.inf, 0.1)
        where = np.where(np.arange(k) % 5 == 3, np.nan, rng.uniform(-1, 1, (3, k)))
        extent2[np.isnan(where[0])] = np.nan
        self.emitters = Emitters(where, facing / np.linalg.norm(facing, axis=0), extent2)

    def __call__(self, center: np.ndarray, radius: float) -> np.ndarray:
        return self.rng.random((center.shape[1], self.k)) ** 4


def receivers(normal: np.ndarray, n: int, opaque: bool = True) -> Receiver:
    """The same surface n times."""
    normal = np.repeat((normal / np.linalg.norm(normal)).astype(f4)[:, None], n, 1)
    return Receiver(normal, np.full(n, opaque))


def lit(choice: LightSampler, normal: np.ndarray | None, n: int) -> LightSampler:
    """The choice for n lanes of a surface."""
    return choice if normal is None else choice.lighting(receivers(normal, n))


@pytest.mark.parametrize("k", [1, 2, 3, 5, 17, 1000])
def test_sampling_follows_the_probabilities(k: int) -> None:
    """In every cell, for every normal, each of k lights is drawn as often as its pmf says, also for u = 0
    and 1 - 2^-24; the pmf sums to 1."""
    given = AnyIrradiance(k)
    rng, n = given.rng, 1 << 18
    choice = SpatialLightSampler(-np.ones(3), np.ones(3), given, given.power)
    normals = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1])).reshape(3, -1).T
    for normal in normals[np.abs(normals).sum(1) > 0]:
        place = rng.uniform(-1, 1, (3, 1)).astype(f4)
        chance = lit(choice, normal, k).pmf(np.arange(k), np.repeat(place, k, 1))
        assert chance.sum(dtype=float) == pytest.approx(1, abs=1e-6)
        assert (chance > 0).all()
    for normal in (None, np.array([0, 1, 0]), np.array([0.6, -0.3, 0.5])):
        place = rng.uniform(-1, 1, (3, 1)).astype(f4)
        point, for_all = np.repeat(place, n, 1), lit(choice, normal, n)
        u = ((np.arange(n) + 0.5) / n).astype(f4)
        light, chance = for_all.sample(point, u)
        expected = lit(choice, normal, k).pmf(np.arange(k), point[:, :k])
        assert np.abs(np.bincount(light, minlength=k) / n - expected).max() < 3 / n, normal
        assert (chance == expected[light]).all()
        edge, chance = lit(choice, normal, 2).sample(point[:, :2], np.array([0, 1 - 2**-24], f4))
        assert (chance == expected[edge]).all()


@pytest.mark.parametrize(("factor", "passes"), [(1.0, True), (1.01, False)])
def test_random_choices_pass_a_chi_square_test(factor: float, passes: bool) -> None:
    """Counts of a light by random numbers, at points and normals of their own, agree with the sums of pmfs;
    a probability that is wrong by 1 % is found out."""
    k, n = 6, 1 << 20
    given = AnyIrradiance(k)
    choice = SpatialLightSampler(-np.ones(3), np.ones(3), given, given.power)
    rng = np.random.default_rng(5)
    point, normal = rng.uniform(-1, 1, (3, 64)).astype(f4), rng.normal(size=(3, 64)).astype(f4)
    yes = np.ones(n, np.bool_)
    each = Receiver(normal / np.linalg.norm(normal, axis=0), yes[:64])
    pmf = np.array([choice.lighting(each).pmf(np.full(64, i), point) for i in range(k)], float)
    at = np.arange(n) % 64
    u = (rng.integers(0, 1 << 24, n) / (1 << 24)).astype(f4)
    light, _ = choice.lighting(each.take(at)).sample(point[:, at], u)
    count = np.bincount(light, minlength=k)
    often = int(count.argmax())
    found = np.array([count[often], n - count[often]])
    chance = factor * pmf[often].mean()
    assert (chi_square(found, n * np.array([chance, 1 - chance]))[2] > 1e-3) == passes
    assert chi_square(count, n * pmf.mean(1))[2] > 1e-3


def test_lights_below_the_horizon_are_chosen_seldom() -> None:
    """Of two lights, a surface gets nearly always the one that it faces; without a normal, or if it is
    transmitting, both alike. A light at infinity counts by its direction."""
    up, down = np.array([[0, 1, 0]]).T, np.array([[0, -1, 0]]).T
    points = PointLightRecord(np.concatenate([up, down], 1).astype(f4), np.ones((3, 2), f4))
    suns = [wf.DirectionalLight(way, 1).record(np.zeros(3)) for way in ((0, -1, 0), (0, 1, 0))]
    point = np.zeros((3, 2), f4)
    for kinds in ([points], [type(suns[0]).concatenate(suns)]):
        choice = LightTable(kinds, 2).choice
        assert choice is not None
        assert choice.pmf(np.arange(2), point) == pytest.approx(0.5)
        clear = receivers(np.array([0, 1, 0]), 2, opaque=False)
        assert choice.lighting(clear).pmf(np.arange(2), point) == pytest.approx(0.5)
        chance = lit(choice, np.array([0, 1, 0]), 2).pmf(np.arange(2), point)
        assert chance[0] > 0.9
        assert chance[1] >= BY_POWER / 2
        sideways = lit(choice, np.array([1, 0, 0]), 2).pmf(np.arange(2), point)
        assert sideways == pytest.approx(0.5, abs=1e-3)


def test_a_light_in_the_cell_is_chosen_from_any_side() -> None:
    """Its nearest surfaces get nearly all of their light from it, wherever in the cell it is."""
    others = 8 * np.concatenate([np.eye(3), -np.eye(3)], 1)
    for near in np.random.default_rng(1).uniform(-2, 2, (20, 3, 1)):
        place = np.concatenate([near, others], 1).astype(f4)
        choice = LightTable([PointLightRecord(place, np.ones((3, 7), f4))], 10).choice
        for normal in others.T:
            assert lit(choice, normal / 8, 1).pmf(np.zeros(1, np.intp), place[:, :1])[0] > 0.9


class Flipping(wf.LightSampler):
    """A user's choice, which knows nothing of normals."""

    def __init__(self, power: np.ndarray, half_size: np.ndarray, irradiance: object) -> None:
        self.chance = (power / power.sum()).astype(f4)

    def sample(self, point: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        light = (u >= self.chance[0]).astype(np.intp)
        return light, self.chance[light]

    def pmf(self, light: np.ndarray, point: np.ndarray) -> np.ndarray:
        return self.chance[light]


@pytest.mark.parametrize("environment", [0.0, 0.5])
@pytest.mark.slow
def test_pictures_do_not_depend_on_the_choice(environment: float) -> None:
    """By significance: lights above, below and at infinity, on matte, metal and glass, by cells and normals,
    by a tree, and by a user's sampler."""
    floor = wf.Rectangle((-2, -1, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.6))
    balls = [
        wf.Sphere((x, -0.4, 0), 0.6, material=material)
        for x, material in (
            (-1.3, wf.Diffuse(0.7)),
            (0, wf.Conductor.named("gold", 0.4)),
            (1.3, wf.Dielectric(1.5, 0.3)),
        )
    ]
    panel = wf.Rectangle((-0.5, 1.5, -0.5), (1, 0, 0), (0, 0, 1), emission=4)
    lamp = wf.Sphere((0.6, 0.4, 1), 0.1, emission=20)
    sky = [wf.Environment(environment)] if environment else []
    lights = [wf.PointLight((-2, -0.5, 1), 2), wf.DirectionalLight((1, -1, -1), 0.5), *sky]
    camera = wf.Camera.look_at((0, 0.6, 4), (0, -0.2, 0), fov=45, size=(16, 8))
    scene = wf.Scene([floor, *balls, panel, lamp], lights, camera)
    how = {"max_bounces": 3, "branches": 1, "reuse": False, "accel": "auto"}
    uniform = repeat(scene, 40, light_sampler="uniform", **how)
    for chosen in ("spatial", tree_sampler):
        found = repeat(scene, 40, first_seed=100, light_sampler=chosen, **how)
        assert_same_images(found, uniform, max_error=0.02)


def tree_sampler(power: np.ndarray, half_size: np.ndarray, irradiance: Any) -> LightSampler:
    """A tree where a grid would be used."""
    with patch.object(samplers, "MOST_IN_GRID", 1):
        return samplers.spatial(power, half_size, irradiance)


def test_a_sampler_without_normals_is_used_as_it_is() -> None:
    lights = LightTable(two_points().kinds, 10, Flipping)
    assert not lights.takes_receiver
    point = np.zeros((3, 2), f4)
    sample, light = lights.sample_li(
        point, np.array([0.1, 0.9], f4), np.full((2, 2), 0.5, f4), receivers(np.array([0, 1, 0]), 2)
    )
    assert light.tolist() == [0, 1]
    assert sample.pdf == pytest.approx(0.5)


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


@pytest.mark.parametrize("lights", [3, 40])
def test_tables_have_the_same_bits_each_time(lights: int) -> None:
    """Numbers that were in their memory before leave nothing in them."""
    points = np.random.default_rng(0).random((3, lights)).astype(f4)
    kinds = [PointLightRecord(points, np.ones((3, lights), f4))]
    found = set()
    for k in range(3):
        with patch("numpy.empty", lambda shape, dtype=float, k=k: np.full(shape, k, dtype)):
            found.add(fingerprint("the choice", LightTable(kinds, 1.0).choice))
    assert len(found) == 1

"""The choice of one light among very many, by a tree."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from inside import (
    Emitters,
    Floats,
    HalvedLightSampler,
    LightRecord,
    LightSample,
    LightTable,
    LightTreeSampler,
    PointLightRecord,
    Receiver,
    SubsetLightSampler,
    TriangleLights,
    chi_square,
    f4,
    samplers,
    soa,
)

import wavefront as wf

LARGEST = 1 - 2.0**-24  # of all u


def lights(k: int, seed: int = 0) -> tuple[Emitters, np.ndarray]:
    """Lights of all kinds in a cube of side 2: places, directions or none, sizes; and powers."""
    rng = np.random.default_rng(seed)
    facing = rng.normal(size=(3, k))
    facing *= (rng.random(k) < 0.7) / np.linalg.norm(facing, axis=0)
    return Emitters(rng.uniform(-1, 1, (3, k)), facing, rng.random(k) ** 4 * 0.01), rng.random(k) ** 3 + 1e-4


def tree(k: int) -> LightTreeSampler:
    """A tree over k lights."""
    return LightTreeSampler(*lights(k), 3**0.5)


@pytest.mark.parametrize("k", [1, 3, 17, 4097])
def test_sampling_follows_the_probabilities(k: int) -> None:
    """Each of k lights is drawn as often as its pmf says, inside the scene and outside, for extreme u too."""
    choice, n = tree(k), 1 << 16
    u = ((np.arange(n) + 0.5) / n).astype(f4)
    for at in ((0.1, 0.2, -0.3), (0.9, -0.9, 0.9), (30, 2, 5)):
        place = np.array(at, f4)[:, None]
        point = np.repeat(place, n, 1)
        light, chance = choice.sample(point, u)
        expected = choice.pmf(np.arange(k), np.repeat(place, k, 1))
        assert expected.sum(dtype=float) == pytest.approx(1, abs=1e-5)
        assert (chance == expected[light]).all()
        observed = np.bincount(light, minlength=k)
        assert np.abs(observed / n - expected).max() < 4 / n
        edge, chance = choice.sample(point[:, :2], np.array([0, LARGEST], f4))
        assert ((edge >= 0) & (edge < k) & (chance > 0)).all()


@pytest.mark.parametrize("k", [17, 4097])
def test_surfaces_are_lit_from_above_their_horizon(k: int) -> None:
    """Sampling follows the pmf for a normal too, which halves that of lights below the horizon at least."""
    choice, n = tree(k), 1 << 16
    u = ((np.arange(n) + 0.5) / n).astype(f4)
    normal = np.array([[0.48], [0.6], [0.64]], f4)

    def lit(m: int, opaque: bool) -> LightTreeSampler:
        return choice.lighting(Receiver(np.repeat(normal, m, 1), np.full(m, opaque)))

    point = np.repeat(np.array([[0.1], [0.2], [-0.3]], f4), n, 1)
    light, chance = lit(n, True).sample(point, u)
    expected = lit(k, True).pmf(np.arange(k), point[:, :k])
    assert expected.sum(dtype=float) == pytest.approx(1, abs=1e-5)
    assert (chance == expected[light]).all()
    assert np.abs(np.bincount(light, minlength=k) / n - expected).max() < 4 / n
    before = choice.pmf(np.arange(k), point[:, :k])
    assert (lit(k, False).pmf(np.arange(k), point[:, :k]) == before).all()
    below = (normal * (lights(k)[0].middle - point[:, :1])).sum(0) < 0
    assert expected[below].sum() < before[below].sum() / 2


def test_random_choices_pass_a_chi_square_test() -> None:
    """Counts of 300 lights by random numbers, at points of their own, agree with the sums of pmfs."""
    choice, k, n = tree(300), 300, 1 << 16
    rng = np.random.default_rng(5)
    point = np.repeat(rng.uniform(-1, 1, (3, 64)).astype(f4), n // 64, 1)
    u = (rng.integers(0, 1 << 24, n) / (1 << 24)).astype(f4)
    light, _ = choice.sample(point, u)
    each = point[:, :: n // 64]
    pmf = np.array([choice.pmf(np.full(64, i), each) for i in range(k)], float)
    _, _, p = chi_square(np.bincount(light, minlength=k), pmf.sum(1) * (n // 64))
    assert p > 1e-3


def test_bits_do_not_depend_on_the_other_columns() -> None:
    """A part of the points gives the same lights and probabilities as all of them."""
    choice, rng = tree(3000), np.random.default_rng(1)
    point, u = rng.uniform(-1, 1, (3, 10_000)).astype(f4), rng.random(10_000).astype(f4)
    light, chance = choice.sample(point, u)
    for part in (slice(0, 1), slice(5, 12), slice(4000, 9000)):
        some, its_chance = choice.sample(point[:, part], u[part])
        assert (some == light[part]).all()
        assert its_chance.tobytes() == chance[part].tobytes()
        assert choice.pmf(some, point[:, part]).tobytes() == its_chance.tobytes()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_equal_places_and_unequal_powers(scale: float) -> None:
    """Lights at one place, at the point itself, and of powers that differ by 10^30 give no NaN."""
    k = 40
    power = np.full(k, 1e-30)
    power[7] = 1
    choice = LightTreeSampler(Emitters(np.zeros((3, k)), np.zeros((3, k)), np.zeros(k)), power, scale)
    point = np.array([[0, scale], [0, 0], [0, 0]], f4)
    light, chance = choice.sample(point, np.array([0.5, LARGEST], f4))
    assert light.tolist() == [7, 7]
    assert chance == pytest.approx(1, abs=1e-6)
    assert np.isfinite(choice.pmf(np.arange(k), np.repeat(point[:, :1], k, 1))).all()


def test_very_many_lights_are_chosen_by_a_tree() -> None:
    """From a limit on; lights that are nowhere get half of the samples."""
    k = samplers.MOST_IN_GRID
    position = np.random.default_rng(0).normal(size=(3, k)).astype(f4)
    few = PointLightRecord(position, np.ones((3, k), f4))
    assert isinstance(LightTable([few], 10).choice, samplers.SpatialLightSampler)
    many = [few, PointLightRecord(np.zeros((3, 1), f4), np.ones((3, 1), f4))]
    assert isinstance(LightTable(many, 10).choice, LightTreeSampler)
    sky = wf.Environment(1).record(np.zeros(3))
    assert isinstance(sky, LightRecord)
    mixed = LightTable([*many, sky], 10).choice
    assert isinstance(mixed, HalvedLightSampler)
    assert isinstance(mixed.first, SubsetLightSampler)
    point = np.zeros((3, 3), f4)
    light, chance = mixed.sample(point, np.array([0.1, 0.5, LARGEST], f4))
    assert light[0] <= k
    assert light[1:].tolist() == [k + 1, k + 1]
    assert mixed.pmf(light, point).tobytes() == chance.tobytes()
    assert chance[1:].tolist() == [0.5, 0.5]


@soa
class Dish(LightRecord):
    """Triangles that are chosen by a tree, as one light."""

    strength: Floats  # (1,)

    @staticmethod
    @cache
    def table() -> LightTable:
        rng = np.random.default_rng(2)
        corners = rng.normal(size=(12, 1, 3))
        corners *= 6 / np.linalg.norm(corners, axis=2, keepdims=True)
        triangles = corners + rng.normal(size=(12, 3, 3)) * 0.5
        both = np.concatenate([triangles, triangles[:, ::-1]])  # two sides, one after the other
        return LightTable(
            [TriangleLights.from_triangles(both, np.ones((3, 1), f4))],
            8,
            lambda power, half, irradiance: LightTreeSampler(irradiance.emitters, power, 8.0),
        )

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        split = u[0] * f4(4096)
        whole = np.floor(split)
        sample, _ = self.table().sample_li(point, whole / f4(4096), np.stack([split - whole, u[1]]))
        sample.pdf = np.where(sample.pdf > 0, self.pdf_li(point, sample.wi), f4(0))
        return sample

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        n = wi.shape[1]
        return np.sum([self.table().pdf_li(np.full(n, i), point, wi) for i in range(24)], 0).astype(f4)

    def le(self, wi: Floats, surface: object = None) -> Floats:
        return np.ones_like(wi)

    def power(self, scene_radius: float) -> np.ndarray:
        return np.ones(1)


@pytest.mark.slow
def test_a_tree_of_triangles_is_a_light() -> None:
    """Directions to 24 triangles that a tree chooses from have the density that pdf_li says."""
    wf.testing.check_light(Dish(np.ones((1,), f4)), points=[[2, 1, 3]], samples=50_000)


def test_pictures_have_the_mean_of_other_samplers(tree_of_lights: None) -> None:
    """Points, a spot, triangles, a sphere and a sky: by the tree, and by power, the same within 3 sigma."""
    rng = np.random.default_rng(3)
    corner = rng.uniform((-2, 1, -2), (2, 3, 2), (30, 1, 3))
    faces = np.arange(90).reshape(30, 3)
    scene = wf.Scene(
        [
            wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6)),
            wf.Mesh((corner + rng.normal(size=(30, 3, 3)) * 0.2).reshape(-1, 3), faces, emission=3),
            wf.Sphere((1, 0.5, 0), 0.4, emission=(4, 2, 1)),
            wf.Sphere((-1, 0.5, 0), 0.5),
        ],
        [
            wf.PointLights(rng.uniform((-3, 0.3, -3), (3, 3, 3), (50, 3)), 0.2),
            wf.SpotLight((0, 3, 0), 5, target=(0, 0, 0), angle=60),
            wf.Environment(0.2),
        ],
        wf.Camera.look_at((0, 3, 6), (0, 0.5, 0), size=(24, 24)),
    )

    def mean(choice: str, seed: int) -> float:
        options = {"accel": "numpy", "workers": 1, "executor": "threads", "progress": False}
        image = wf.render(scene, 16, light_sampler=choice, seed=seed, sampler="independent", **options)
        return float(image.rgb.mean())

    by_power = np.array([mean("power", seed) for seed in range(8)])
    by_tree = np.array([mean("spatial", seed) for seed in range(8)])
    sigma = np.hypot(by_power.std(ddof=1), by_tree.std(ddof=1)) / np.sqrt(8)
    assert sigma < 0.01 * by_power.mean()
    assert abs(by_tree.mean() - by_power.mean()) < 3 * sigma
    assert by_tree.std() < by_power.std()

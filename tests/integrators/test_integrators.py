"""The four estimators against each other, where they estimate the same thing."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
import scenes
from inside import Dimension, Sampler, make_sampler, steps
from significance import Mean, assert_same_images, render, repeat

import wavefront as wf

DIRECT_SPP = {"naive": 256, "direct_simple": 96, "direct_mis": 64, "full": 64}
# of the runs, and of the samples of each
parts = pytest.mark.parametrize("part", [2, pytest.param(1, marks=pytest.mark.slow)])


@cache
def room(integrator: str, max_bounces: int, spp: int, sampler: str = "sobol", part: int = 1):
    """Runs of the room with a mirror and a glass sphere; every estimator has seeds of its own."""
    first_seed = 1000 * scenes.ALL.index(integrator)
    options = {"integrator": integrator, "max_bounces": max_bounces, "sampler": sampler}
    return repeat(scenes.room(), spp // part, 16 // part, first_seed=first_seed, **options)


@pytest.mark.parametrize(("a", "b"), list(combinations(scenes.ALL, 2)))
@parts
def test_direct_light_agrees(a: str, b: str, part: int) -> None:
    """With one scattering event all four estimate emission and direct light."""
    one, other = (room(each, 1, DIRECT_SPP[each], part=part) for each in (a, b))
    assert_same_images(one, other, 0.002 * part)


@parts
def test_direct_light_behind_mirrors_and_glass_agrees(part: int) -> None:
    """Both direct estimators follow specular surfaces to the first that is not."""
    a, b = (room(each, 8, DIRECT_SPP[each], part=part) for each in ("direct_simple", "direct_mis"))
    assert_same_images(a, b, 0.002 * part)
    assert a.mean() > 1.05 * room("direct_simple", 1, DIRECT_SPP["direct_simple"], part=part).mean()


@pytest.mark.parametrize("max_bounces", [pytest.param(2, marks=pytest.mark.slow), 8])
@parts
def test_indirect_light_agrees(max_bounces: int, part: int) -> None:
    """Naive and full, with light that took several bounces, caustics among it."""
    naive, full = (room(each, max_bounces, spp, part=part) for each, spp in (("naive", 256), ("full", 128)))
    assert_same_images(naive, full, 0.003 * part)


@pytest.mark.slow
@pytest.mark.parametrize(("sampler", "spp"), [("independent", 256), ("bluenoise", 128)])
def test_samplers_agree(sampler: str, spp: int) -> None:
    """Plain random numbers and blue noise give the same picture as Sobol points."""
    assert_same_images(room("full", 8, 128), room("full", 8, spp, sampler), 0.004)


@pytest.mark.parametrize(
    ("integrator", "after"),
    [
        ("full", 0),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (("naive", False), ("naive", 0), ("full", False))
        ),
    ],
)
@parts
def test_roulette_changes_nothing_but_noise(integrator: str, after: int, part: int) -> None:
    """From the first bounce on, or never."""
    spp = 256 if integrator == "naive" else 128
    options = {"integrator": integrator, "max_bounces": 8, "first_seed": 9000, "roulette": after}
    other = repeat(scenes.room(), spp // part, 16 // part, **options)
    assert_same_images(room(integrator, 8, spp, part=part), other, 0.004 * part)


@pytest.mark.slow
def test_full_has_a_tenth_of_the_variance_of_naive() -> None:
    variance = {}
    for integrator in scenes.INDIRECT:
        runs = repeat(scenes.cornell_box(), 64, runs=3, integrator=integrator)
        variance[integrator] = runs.var(0, ddof=1).mean()
    assert variance["full"] < 0.1 * variance["naive"]


@pytest.mark.parametrize("integrator", scenes.SAMPLING_LIGHTS)
def test_no_bounce_shows_only_lights(integrator: str) -> None:
    image = render(scenes.everything((33, 25)), 1, integrator=integrator, max_bounces=0)
    seen = np.unique(image.rgb.reshape(-1, 3).round(5), axis=0)
    lights = np.array([[0, 0, 0], [0.2, 0.3, 0.5], [0.5, 1, 2], [3, 2.5, 2]])
    assert all(np.abs(lights - value).sum(1).min() < 1e-4 for value in seen)


@pytest.mark.parametrize("integrator", scenes.INDIRECT)
def test_every_bounce_adds_its_own_light(integrator: str) -> None:
    """The light of exactly k bounces of a furnace of 0.5 is 2^-k; the same numbers give the rest."""
    scene = scenes.furnace(0.5)
    means = [
        Mean.of(render(scene, 256, integrator=integrator, max_bounces=k).rgb.astype(float)) for k in range(4)
    ]
    steps = np.diff([0, *(mean.value for mean in means)])
    assert steps == pytest.approx([1, 0.5, 0.25, 0.125], rel=0.01)


class Once(Sampler):
    """Another sampler's numbers, none of which may be asked for twice."""

    def __init__(self, name: str, seed: int = 0, width: int = 1) -> None:
        super().__init__(seed)
        self.inner = make_sampler(name, seed, width)
        self.given: dict[tuple[int, int], np.ndarray] = {}

    def draw_1d(self, pixel, sample, bounce, dimension):
        self.note(pixel, sample, bounce, dimension)
        return self.inner.draw_1d(pixel, sample, bounce, dimension)

    def draw_2d(self, pixel, sample, bounce, dimension):
        self.note(pixel, sample, bounce, dimension)
        return self.inner.draw_2d(pixel, sample, bounce, dimension)

    def note(self, pixel, sample, bounce, dimension) -> None:
        """Remember addresses, and complain of those that come again."""
        stream = int(bounce), int(dimension)
        now = pixel.astype(np.uint64) << np.uint64(32) | sample
        before = self.given.get(stream, now[:0])
        everything = np.concatenate([before, now])
        assert len(np.unique(everything)) == len(everything), f"numbers of {stream} are used twice"
        self.given[stream] = everything


@pytest.mark.parametrize(
    ("integrator", "options"),
    [
        *((integrator, {}) for integrator in scenes.ALL),
        ("full", {"branches": 3}),
        ("full", {"branches": 3, "guide": True}),
        ("full", {"caustics": True}),
    ],
)
def test_no_number_is_used_twice(integrator, options, short_training):
    """Not by two decisions, bounces or branches: the means of many scenes would not show it."""
    given: list[Once] = []

    def record(seed: int, width: int) -> Once:
        given.append(Once("sobol", seed, width))
        return given[-1]

    scene = scenes.everything((12, 9))
    veils = [
        wf.Rectangle((-2, -2, z), (4, 0, 0), (0, 4, 0), material=wf.Material(wf.Diffuse(0.5), alpha=0.3))
        for z in (1.1, 1.2, 1.3)
    ]
    blend = wf.Sphere((0.2, 0.3, 0.2), 0.2, material=wf.Mix(wf.Diffuse(0.7), wf.Dielectric(1.5, 0.3)))
    camera = wf.Camera.look_at((0, 0, 3.9), (0, 0, 0), size=(12, 9), aperture=0.1, focus=3.9)
    scene = wf.Scene([*scene.shapes, *veils, blend], [wf.Environment((0.2, 0.3, 0.5))], camera)
    render(scene, 16, sampler=record, max_bounces=5, integrator=integrator, **options)
    left_out = {"naive": {Dimension.LIGHT, Dimension.LIGHT_POINT}, "full": set()}
    decisions = {*Dimension, Dimension.OPACITY + 1, Dimension.OPACITY + 2}  # three veils
    decisions -= {Dimension.MEDIUM, Dimension.TRANSMITTANCE}  # no medium scatters
    decisions -= {Dimension.FEATURE, Dimension.TIME}  # no feature of a user draws, and nothing moves
    assert {dimension for _, dimension in given[-1].given} == decisions - left_out.get(
        integrator, {Dimension.ROULETTE}
    ) - (set() if "guide" in options else {Dimension.GUIDE, Dimension.GUIDE_DIRECTION}) - (
        set() if "caustics" in options else {Dimension.SPECULAR_SURFACE, Dimension.SPECULAR_POINT}
    )


@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
def test_contributions_keep_the_number_of_their_light(calls_of, integrator: str) -> None:
    """What is added to a picture, summed by light, is what each light brings alone."""
    lamp = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), material=wf.Diffuse(0), emission=(2, 0, 0))
    points = [wf.PointLight((0, 2, 1), (0, 5, 0)), wf.PointLight((1, 2, 0), (0, 0, 4))]
    camera = wf.Camera.look_at((0, 2, 4), (0, 1.5, 0), fov=70, size=(8, 6))
    floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))
    sums = np.zeros(3)
    accumulate = steps.accumulate

    def recorded(L, paths, contribution):
        carried = (paths.throughput[:, contribution.lanes] * contribution.radiance).sum(0)
        sums[:] += np.bincount(contribution.light, carried, 3)
        accumulate(L, paths, contribution)

    for module in ("ladder", "steps"):
        calls_of(f"wavefront.integrators.{module}.accumulate", recorded)
    image = render(wf.Scene([floor, lamp], points, camera), 16, integrator=integrator, executor="threads")
    found = sums / (16 * 8 * 6)
    assert found == pytest.approx(image.rgb.mean((0, 1)), rel=1e-4)  # each light has a channel of its own

"""Measured light against exact light: every case for every integrator that reaches it."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from inside import ROULETTE_AFTER, SAMPLERS, Dimension, LightTable, TriangleLights, f4, make_sampler, warp
from scenes import Case, each
from significance import ROUNDING, Mean, assert_mean, measure, repeat

import wavefront as wf


def run(case: Case, integrator: str, **options):
    """Measure a case as one integrator sees it."""
    spp = case.naive_spp if integrator == "naive" else case.spp
    options = {"integrator": integrator, "max_bounces": 4, **case.options, **options}
    if options.get("sampler") != "bluenoise":
        return measure(case.build(), spp, **options)
    # pixels complement each other, so seeds are the batches that know nothing of each other
    return Mean.of(repeat(case.build(), spp // 16, **options).mean((1, 2, 3)))


def stratified(case: Case) -> Case:
    """Return a case with a quarter of the samples at lights: Sobol points need no more for its error."""
    return replace(case, spp=case.spp // 4)


@pytest.mark.parametrize(**each(scenes.DIRECT_CASES))
def test_direct_light(case: Case, integrator: str) -> None:
    """Point, sphere, disk, rectangle and environment above a floor, also half hidden."""
    assert_mean(run(stratified(case), integrator), case.expected, case.max_error)


@pytest.mark.parametrize(**each(scenes.TRIANGLE_CASES))
def test_triangle_light(case: Case, integrator: str) -> None:
    """To a standard error of 0.1 %, and within three of them."""
    assert_mean(run(stratified(case), integrator), case.expected, case.max_error, sigmas=3)


@pytest.mark.parametrize(**each(scenes.INDIRECT_CASES))
@pytest.mark.first(6)
def test_indirect_light(case: Case, integrator: str) -> None:
    assert_mean(run(case, integrator), case.expected, case.max_error)


@pytest.mark.parametrize(**each(scenes.SPECULAR_CASES))
def test_specular_light(case: Case, integrator: str) -> None:
    """Glass, metal and mirrors, through which every integrator sees.

    Stratified numbers may choose a lobe equally often in all 64 batches, which then show no spread;
    what happens to ten of all samples may go unseen in one of 2e4 renders (e^-10).
    """
    spp = case.naive_spp if integrator == "naive" else case.spp
    unseen = 10 / (64 * spp * case.expected)
    assert_mean(run(case, integrator), case.expected, case.max_error, rounding=ROUNDING + unseen)


@pytest.mark.slow
@pytest.mark.parametrize("after", [ROULETTE_AFTER, False], ids=["roulette", "no roulette"])
@pytest.mark.parametrize("filter", ["box", "tent", "gaussian"])
@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize(
    "case",
    [*scenes.DIRECT_CASES, *scenes.TRIANGLE_CASES, *scenes.INDIRECT_CASES, *scenes.SPECULAR_CASES],
    ids=str,
)
def test_every_case_by_every_sampler_and_filter(case: Case, sampler: str, filter: str, after: int) -> None:
    """The means stay what they are, whatever numbers and filter are used, with roulette and without."""
    if sampler == "independent" and case in scenes.SPECULAR_CASES:  # a rare lobe, chosen without strata
        case = replace(case, spp=4 * case.spp)
    unseen = 10 / (64 * case.spp * case.expected)
    measured = run(case, case.integrators[-1], sampler=sampler, filter=filter, roulette=after)
    assert_mean(measured, case.expected, 3 * case.max_error, rounding=ROUNDING + unseen)


@pytest.mark.parametrize(
    "case",
    [case for case in scenes.DIRECT_CASES if not case.later or case.name.endswith("center")],
    ids=str,
)
def test_independent_numbers(case: Case) -> None:
    """The plain random sampler agrees too, so nothing rests on the structure of the other."""
    case = replace(case, spp=case.spp // 2)
    assert_mean(run(case, "direct_mis", sampler="independent"), case.expected, 0.004)


@pytest.mark.parametrize(("expected", "corners"), scenes.NORI_TRIANGLES)
def test_published_values_are_exact(expected: float, corners) -> None:
    """The values of the public test suite are those of Lambert's formula."""
    assert abs(scenes.polygon_irradiance(corners) * scenes.ALBEDO / np.pi - expected) < 5e-7


@pytest.mark.parametrize(("x", "expected"), [(0, 0.628319), (1, 0.460076), (3, 0.080608)])
def test_disk_is_fine_enough(x: float, expected: float) -> None:
    """256 triangles of the right area are a disk, to far below any standard error here."""
    mesh = scenes.disk(1, 2)
    rim = mesh.vertices[:-1] - (x, 0, 0)
    assert abs(scenes.polygon_irradiance(rim) / expected - 1) < 1e-4
    assert abs(scenes.disk_irradiance(1, 2, x) / expected - 1) < 1e-5


@pytest.mark.parametrize("integrator", scenes.ALL)
def test_field_of_view(integrator: str) -> None:
    """A square of half-size 0.5 at distance 1 fills a quarter of a picture of 90 degrees."""
    light = wf.Rectangle((-0.5, -0.5, -1), (1, 0, 0), (0, 1, 0), material=scenes.BLACK, emission=1.0)
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -1), fov=90, size=(10, 10))
    runs = repeat(wf.Scene([light], camera=camera), 64, integrator=integrator, max_bounces=0)
    assert_mean(Mean.of(runs.mean((1, 2, 3))), 0.25, 0.001)
    back_facing = np.zeros((10, 10), bool)
    back_facing[3:7, 3:7] = True
    assert (runs[:, back_facing] == 1).all()
    assert (runs[:, [0, 1, 8, 9]] == 0).all()


@pytest.mark.parametrize(
    ("integrator", "build"),
    [
        pytest.param(integrator, build, marks=[] if (number + ball) % 2 else pytest.mark.slow)
        for number, integrator in enumerate(scenes.ALL)
        for ball, build in enumerate([scenes.glass_box, scenes.glass_ball])
    ],
)
def test_lossless_glass_vanishes(build, integrator: str) -> None:
    """In an environment of 1 every sample is 1, whatever way it takes; roulette keeps the mean."""
    options = {"integrator": integrator, "max_bounces": 1000}
    runs = repeat(build(), 16, **options)
    assert_mean(Mean.of(runs.mean((1, 2, 3))), 1.0, 0.0005)
    assert repeat(build(), 16, runs=1, roulette=False, **options) == pytest.approx(1.0, abs=2e-5)


def test_mirrors_take_part_of_the_light_each_time() -> None:
    """Nine scattering events are one too few to leave a corridor of ten mirrors."""
    scene = scenes.corridor(0.9, 10)
    assert measure(scene, 1, integrator="direct_simple", max_bounces=9).value == 0
    assert measure(scene, 1, integrator="direct_simple", max_bounces=10).value == pytest.approx(
        0.9**10, rel=1e-6
    )


# --- Sampling and solid angles (cases 17 and 18) -------------------------------------------------


def numbers(sampler: str, n: int) -> np.ndarray:
    """64 batches of points in the unit square, each with a seed of its own, (2, 64 n)."""
    pixel, sample = np.full(n, 5, np.uint32), np.arange(n, dtype=np.uint32)
    batches = [
        make_sampler(sampler, seed, 8).draw_2d(pixel, sample, 2, Dimension.DIRECTION) for seed in range(64)
    ]
    return np.concatenate(batches, 1)


MOMENTS = {
    "cosine hemisphere, cos": (lambda u: warp.cosine_hemisphere(u)[2], 2 / 3),
    "cosine hemisphere, cos²": (lambda u: warp.cosine_hemisphere(u)[2] ** 2, 1 / 2),
    "uniform hemisphere, cos": (lambda u: warp.uniform_hemisphere(u)[2], 1 / 2),
    "sphere, z²": (lambda u: warp.uniform_sphere(u)[2] ** 2, 1 / 3),
    "disk, r²": (lambda u: (warp.uniform_disk(u) ** 2).sum(0), 1 / 2),
}
TRIANGLE_FACING_ORIGIN = {
    "octant": ([[[1, 0, 0], [0, 0, 1], [0, 1, 0]]], np.pi / 2),
    "rectangle": (scenes.panel((-1, -1), (1, 1), 1).vertices[[[0, 1, 2], [0, 2, 3]]], 2.094395),
}


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("name", MOMENTS)
def test_moments_of_warps(name: str, sampler: str) -> None:
    value, expected = MOMENTS[name]
    batches = value(numbers(sampler, 1 << 13)).reshape(64, -1).mean(1, dtype=np.float64)
    assert_mean(Mean.of(batches), expected, 0.002)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("name", TRIANGLE_FACING_ORIGIN)
def test_solid_angles(name: str, sampler: str) -> None:
    """The mean of 1/pdf over a light's samples is the solid angle that it fills."""
    triangles, expected = TRIANGLE_FACING_ORIGIN[name]
    light = TriangleLights.from_triangles(np.asarray(triangles, float), np.ones((3, 1), f4))
    table = LightTable([light], 1.0)
    u = numbers(sampler, 1 << 12)
    choice = np.roll(u[1], 1234)
    sample, _ = table.sample_li(np.zeros_like(u[[0, 0, 0]]), choice, u)
    batches = (1 / sample.pdf.astype(float)).reshape(64, -1).mean(1)
    assert_mean(Mean.of(batches), expected, 0.002)

"""Measured light against exact light: every case for every integrator that reaches it."""

import numpy as np
import pytest
import scenes
from scenes import Case, each
from significance import assert_mean, measure


def run(case: Case, integrator: str, **options):
    """Measure a case as one integrator sees it."""
    spp = case.naive_spp if integrator == "naive" else case.spp
    return measure(case.build(), spp, integrator=integrator, **{"max_bounces": 4, **case.options, **options})


@pytest.mark.parametrize(**each(scenes.DIRECT_CASES))
def test_direct_light(case: Case, integrator: str) -> None:
    """Point, sphere, disk, rectangle and environment above a floor, also half hidden."""
    assert_mean(run(case, integrator), case.expected, case.max_error)


@pytest.mark.parametrize(**each(scenes.TRIANGLE_CASES))
def test_triangle_light(case: Case, integrator: str) -> None:
    """To a standard error of 0.1 %, and within three of them."""
    assert_mean(run(case, integrator), case.expected, case.max_error, sigmas=3)


@pytest.mark.parametrize(**each(scenes.INDIRECT_CASES))
def test_indirect_light(case: Case, integrator: str) -> None:
    """Closed rooms, where the light is a geometric series."""
    assert_mean(run(case, integrator), case.expected, case.max_error)


@pytest.mark.parametrize(**each(scenes.SPECULAR_CASES))
def test_specular_light(case: Case, integrator: str) -> None:
    """Glass, metal and mirrors, through which every integrator sees."""
    assert_mean(run(case, integrator), case.expected, case.max_error)


@pytest.mark.parametrize("case", scenes.DIRECT_CASES, ids=str)
def test_independent_numbers(case: Case) -> None:
    """The plain random sampler agrees too, so nothing rests on the structure of the other."""
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

"""Fresnel reflectance against published numbers and quadrature."""

import numpy as np
import pytest
from inside import Dielectric, SurfaceInteraction, fresnel_conductor, fresnel_dielectric

F4 = np.float32


def cos_of(degrees):
    return np.cos(np.radians(np.atleast_1d(degrees))).astype(F4)


def eta(value):
    return np.array([value], F4)


def toward(degrees):
    """A direction (3, 1) at an angle from the normal."""
    theta = np.radians(degrees)
    return np.array([[np.sin(theta)], [0], [np.cos(theta)]], F4)


def surface(wo, back_facing):
    n = wo.shape[1]
    normal = np.repeat(np.array([[0], [0], [1]], F4), n, 1)
    zero, index = np.zeros(n, F4), np.zeros(n, np.intp)
    return SurfaceInteraction(
        np.zeros((3, n), F4), zero, normal, normal, wo, index, index, np.full(n, back_facing)
    )


@pytest.mark.parametrize(
    ("angle", "reflectance"),
    [
        (0, 0.04),
        (30, 0.041523),
        (45, 0.050240),
        (60, 0.089187),
        (75, 0.253061),
        (80, 0.387704),
        (85, 0.612800),
        (89, 0.904185),
        (56.309932, 0.073965),
    ],
)
def test_glass_from_outside(angle, reflectance):
    assert fresnel_dielectric(cos_of(angle), eta(1.5))[0] == pytest.approx(reflectance, abs=2e-6)


@pytest.mark.parametrize(("angle", "reflectance"), [(10, 0.040083), (30, 0.055190), (40, 0.245291)])
def test_glass_from_inside(angle, reflectance):
    assert fresnel_dielectric(cos_of(angle), eta(1 / 1.5))[0] == pytest.approx(reflectance, abs=3e-6)


def test_all_light_is_reflected_beyond_the_critical_angle():
    angles = np.linspace(41.8104, 90, 1000)
    reflectance, cos = fresnel_dielectric(cos_of(angles), eta(1 / 1.5))
    assert (reflectance == 1).all()
    assert (cos == 0).all()
    assert fresnel_dielectric(cos_of(41.80), eta(1 / 1.5))[0] < 1


def test_refracted_cosine_follows_snell():
    _, cos = fresnel_dielectric(cos_of(45), eta(1.5))
    assert np.degrees(np.arccos(cos)) == pytest.approx(28.125506, abs=2e-5)


def test_index_1_reflects_nothing_at_any_angle():
    cos = np.geomspace(1e-15, 1, 1000, dtype=F4)
    reflectance, refracted = fresnel_dielectric(cos, eta(1))
    assert (reflectance == 0).all()
    assert refracted == pytest.approx(cos, rel=1e-6)


@pytest.mark.parametrize("ratio", [1.5, 1 / 1.5, 1.0001, 1e-3, 1e3])
def test_reflectance_stays_within_0_and_1(ratio):
    reflectance, cos = fresnel_dielectric(np.linspace(0, 1, 10_001, dtype=F4), eta(ratio))
    assert ((reflectance >= 0) & (reflectance <= 1)).all()
    assert ((cos >= 0) & (cos <= 1)).all()


@pytest.mark.parametrize(("ratio", "mean"), [(1.5, 0.091778), (1 / 1.5, 0.596346)])
def test_hemispherical_mean(ratio, mean):
    sin2 = (np.arange(200_000) + 0.5) / 200_000
    reflectance, _ = fresnel_dielectric(np.sqrt(1 - sin2).astype(F4), eta(ratio))
    assert reflectance.mean(dtype=np.float64) == pytest.approx(mean, abs=2e-6)


def test_conductor_agrees_with_complex_arithmetic():
    rng = np.random.default_rng(5)
    n, k = rng.uniform(0.05, 5, (3, 5000)), rng.uniform(0, 12, (3, 5000))
    cos = rng.random(5000).astype(F4)
    index = n.astype(F4).astype(complex) + 1j * k.astype(F4)
    inner = np.sqrt(index**2 - (1 - cos.astype(float) ** 2))
    perpendicular = np.abs((cos - inner) / (cos + inner)) ** 2
    parallel = np.abs((index**2 * cos - inner) / (index**2 * cos + inner)) ** 2
    exact = (perpendicular + parallel) / 2
    assert fresnel_conductor(cos, n.astype(F4), k.astype(F4)) == pytest.approx(exact, abs=2e-6)


def test_conductor_without_extinction_is_a_dielectric():
    cos = np.linspace(0.001, 1, 1000, dtype=F4)
    metal = fresnel_conductor(cos, np.full((3, 1), 1.5, F4), np.zeros((3, 1), F4))
    assert metal[0] == pytest.approx(fresnel_dielectric(cos, eta(1.5))[0], abs=1e-6)


@pytest.mark.parametrize(("angle", "transmitted"), [(0, 0.923077), (45, 0.904327)])
def test_slab_of_glass_by_the_series_of_its_reflections(angle, transmitted):
    glass = Dielectric(1.5)
    lowest, highest = np.zeros((3, 1), F4), np.full((3, 1), np.nextafter(F4(1), F4(0)))
    enter = glass.bind(surface(toward(angle), False)).sample_f(toward(angle), highest)
    assert enter.wi[2] < 0
    assert enter.eta == pytest.approx(1.5)
    within = -enter.wi
    back_facing = glass.bind(surface(within, True))
    leave, stay = back_facing.sample_f(within, highest), back_facing.sample_f(within, lowest)
    assert leave.wi == pytest.approx(-toward(angle), abs=1e-6)
    assert stay.wi[2] > 0
    bounce = stay.weight[0] * stay.pdf
    total, carried = 0.0, enter.weight[0] * enter.pdf
    for _ in range(40):
        total += carried * leave.weight[0] * leave.pdf
        carried = carried * bounce**2
    assert total == pytest.approx(transmitted, abs=3e-6)


def test_radiance_is_scaled_by_the_squared_index():
    glass = Dielectric(1.5)
    through = np.full((3, 1), np.nextafter(F4(1), F4(0)))
    wo = toward(20)
    assert glass.sample_f(wo, through).weight == pytest.approx(1 / 2.25, rel=1e-6)
    leaving = glass.bind(surface(wo, True)).sample_f(wo, through)
    assert leaving.weight == pytest.approx(2.25, rel=1e-6)
    assert leaving.eta == pytest.approx(1 / 1.5)

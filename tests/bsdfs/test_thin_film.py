"""Films with interference, beside Airy's formula summed over the spectrum."""

import numpy as np
import pytest
from inside import BSDFS_SHARES as SHARES
from inside import (
    GAUSSIANS,
    WHITE,
    XYZ_TO_RGB,
    Conductor,
    Dielectric,
    Principled,
    SceneError,
    film_reflectance,
    fresnel_conductor,
    fresnel_dielectric,
)

from wavefront.testing import check_bsdf

F4 = np.float32
COSINES = np.array([1, 0.8, 0.5, 0.25])


def airy(cos, thickness, film, before, beyond):
    """Reflectance (3, n) by complex amplitudes at 2000 wave numbers, weighed as the film's series is."""
    wave = np.linspace(1.0e6, 3.0e6, 2000)[:, None]  # 1/m
    weight = np.zeros((3, len(wave)))
    for function, amplitude, center, variance in GAUSSIANS:
        weight[function] += amplitude * np.exp(-((wave[:, 0] - center) ** 2) / (4 * variance))
    weight = SHARES @ (weight / weight.sum(1, keepdims=True))
    sin2 = before**2 * (1 - cos**2)
    one, two, three = (np.sqrt(np.asarray(n, complex) ** 2 - sin2) for n in (before, film, beyond))
    turn = np.exp(4j * np.pi * wave * thickness * 1e-9 * two)
    total = 0
    for a, b, c, d in (
        (one, two, two, three),
        (film**2 * one, before**2 * two, beyond**2 * two, film**2 * three),
    ):
        first, second = (a - b) / (a + b), (c - d) / (c + d)
        total = total + np.abs((first + second * turn) / (1 + first * second * turn)) ** 2 / 2
    return weight @ total


@pytest.mark.parametrize(
    ("film", "before", "beyond"),
    [(1.33, 1, 1.5), (1.33, 1.5, 1), (1.8, 1, 1), (1.6, 1, 2 + 3j), (1.3, 1, 0.2 + 3.5j)],
)
@pytest.mark.parametrize("thickness", [80, 250, 400, 900])
def test_films(film, before, beyond, thickness):
    """With six terms of the series, the error is largest at grazing angles and on metals."""
    cos = COSINES[COSINES > 0.75] if before > film else COSINES
    ours = film_reflectance(
        cos.astype(F4),
        F4([thickness]),
        F4([film]),
        F4(before),
        np.full((3, 1), np.real(beyond), F4),
        np.imag(beyond),
    )
    exact = np.clip(airy(cos, thickness, film, before, beyond), 0, 1)
    assert ours == pytest.approx(exact, abs=0.005)


def test_the_colors_are_those_of_rec_709():
    """White is white, and luminance is that of the primaries."""
    assert pytest.approx([1, 1, 1], abs=1e-4) == XYZ_TO_RGB @ [0.95047, 1, 1.08883]
    luminance = [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.072175],
        [0.0193339, 0.119192, 0.9503041],
    ]
    assert np.linalg.inv(XYZ_TO_RGB) == pytest.approx(np.array(luminance), abs=1e-5)


@pytest.mark.parametrize("path", [200, 350, 500, 700])
def test_gaussians_fit_the_matching_functions(path):
    """The mean phase by the fit of C. Wyman et al. 2013 (JCGT 2(2), section 2.2) to CIE 1931."""
    lobes = (
        ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
        ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
        ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
    )
    wave = np.linspace(360, 830, 2000)
    for function, parts in enumerate(lobes):
        weight = sum(
            height * np.exp(-0.5 * ((wave - middle) / np.where(wave < middle, low, high)) ** 2)
            for height, middle, low, high in parts
        )
        exact = (weight * np.exp(2j * np.pi * path / wave)).sum() / weight.sum()
        ours = sum(
            amplitude
            * np.sqrt(2 * np.pi * variance)
            / WHITE
            * np.exp(2j * np.pi * path * 1e-9 * center - variance * (2 * np.pi * path * 1e-9) ** 2)
            for number, amplitude, center, variance in GAUSSIANS
            if number == function
        )
        assert abs(ours - exact) < 0.05


def test_gaussians_have_the_integrals_of_the_matching_functions():
    """To what their coefficients are rounded to: light of equal energy is 1 in each channel."""
    for number in range(3):
        total = sum(a * np.sqrt(2 * np.pi * v) for n, a, _, v in GAUSSIANS if n == number)
        assert total == pytest.approx(WHITE, rel=2e-3)


def test_all_is_reflected_before_a_film_of_a_lower_index():
    """Within glass, beyond the critical angle of the film and below it."""
    for cos, total in ((0.5, True), (0.7, False)):
        seen = film_reflectance(F4([cos]), F4([300]), F4([1.2]), F4(1.5), np.full((3, 1), 1.7, F4))
        assert (seen == 1).all() == total
        assert (seen <= 1).all()


def test_no_film_reflects_more_than_all():
    """Where the series of six terms is above 1, as on metals."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        eta, k = rng.uniform(0.1, 3, (3, 1)), rng.uniform(0, 6, (3, 1))
        cos, nanometers, film = rng.random(50), rng.uniform(0, 1000, 50), rng.uniform(1, 2.5, 50)
        seen = film_reflectance(*(x.astype(F4) for x in (cos, nanometers, film)), F4(1), eta.astype(F4), k)
        assert (seen <= 1).all()


def test_channels_of_a_film_have_their_own_indices():
    cos, film, beyond = F4([0.7]), F4([[1.3], [1.35], [1.4]]), F4([[1.5], [1.6], [1.7]])
    together = film_reflectance(cos, F4([400]), film, F4(1), beyond)
    alone = [film_reflectance(cos, F4([400]), film[k], F4(1), beyond)[k] for k in range(3)]
    assert together == pytest.approx(np.array(alone), rel=1e-6)


@pytest.mark.parametrize("thickness", [-1, 100_001, np.nan])
def test_bad_thicknesses_are_named(thickness):
    with pytest.raises(SceneError, match="Conductor film_thickness"):
        Conductor(2, 4, film_thickness=thickness)
    assert Dielectric(film_thickness=0.5).has_film
    assert not Dielectric(film_thickness=0).has_film


def test_a_film_of_the_index_of_its_surface_is_none():
    cos = COSINES.astype(F4)
    glass = film_reflectance(cos, F4([300]), F4([1.5]), F4(1), np.full((3, 1), 1.5, F4))
    assert glass == pytest.approx(np.tile(fresnel_dielectric(cos, F4([1.5]))[0], (3, 1)), abs=1e-6)
    eta, k = np.array([[0.2], [1], [1.4]], F4), np.array([[3.5], [2.5], [2]], F4)
    metal = film_reflectance(cos, F4([3000]), F4([1.0]), F4(1), eta, k)
    assert metal == pytest.approx(fresnel_conductor(cos, eta, k), abs=1e-5)


@pytest.mark.parametrize(
    "bsdf",
    [
        Conductor((2, 1, 0.6), (3, 4, 5), 0.5, film_thickness=600.0, film_ior=1.6),
        Conductor((2, 1, 0.6), (3, 4, 5), film_thickness=300),
        Dielectric(1.5, 0.4, film_thickness=400, film_ior=1.8),
        Principled((0.9, 0.5, 0.2), 0.3, 0.4, film_thickness=400),
        Principled((0.9, 0.5, 0.2), 0, 0.4, transmission=0.6, film_thickness=400),
        Principled((0.9, 0.5, 0.2), 0, 0.4, transmission=0.6, thin=True, film_thickness=400),
        Principled(1.0, 0, 0.2, film_thickness=300, film_ior=1.8),
    ],
    ids=lambda bsdf: type(bsdf).__name__,
)
@pytest.mark.first(1)
def test_contract(bsdf):
    check_bsdf(bsdf, samples=10_000, angles=(10.0, 75.0))


def test_smooth_glass_with_a_film_absorbs_nothing():
    check_bsdf(
        Dielectric(1.5, film_thickness=400, film_ior=1.3), samples=10_000, angles=(60.0,), albedo=(1, 1)
    )


def test_a_principled_metal_has_the_film_of_a_metal_of_its_color():
    """Of an index without extinction, (1 + √F0)/(1 − √F0), as in KHR_materials_iridescence."""
    rng = np.random.default_rng(0)
    wo, wi = rng.normal(size=(2, 3, 500))
    wo[2], wi[2] = np.abs(wo[2]), np.abs(wi[2])
    wo, wi = ((w / np.linalg.norm(w, axis=0)).astype(F4) for w in (wo, wi))
    root = np.sqrt(np.array([0.9, 0.5, 0.2]))
    ours = Principled((0.9, 0.5, 0.2), 1, 0.4, film_thickness=350, film_ior=1.4, multiscatter=False)
    known = Conductor((1 + root) / (1 - root), 0, 0.4, film_thickness=350, film_ior=1.4, multiscatter=False)
    assert ours.f(wo, wi) == pytest.approx(known.f(wo, wi), rel=1e-4)

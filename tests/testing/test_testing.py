"""The checks themselves: their statistics, and that they catch errors of one percent."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from inside import (
    CHARTS,
    BsdfSample,
    ConstantEnvironment,
    Dielectric,
    Diffuse,
    Environment,
    PointLight,
    SphereLights,
    TriangleLights,
    check_density,
    warp,
    weigh,
)
from scipy import special, stats

from wavefront import testing
from wavefront.testing import chi2

F4 = np.float32


# --- Statistics -----------------------------------------------------------------------------------


@pytest.mark.parametrize("a", [0.5, 1, 5, 40, 400, 2000])
def test_incomplete_gamma_agrees_with_scipy(a):
    for x in [0, 0.01 * a, 0.5 * a, 0.9 * a, a, a + 1, 1.1 * a, 2 * a, 5 * a]:
        assert chi2.gamma_q(a, x) == pytest.approx(special.gammaincc(a, x), rel=1e-9, abs=1e-13)


def test_chi_square_agrees_with_scipy():
    rng = np.random.default_rng(1)
    expected = rng.uniform(10, 100, 50)
    observed = rng.poisson(expected)
    expected *= observed.sum() / expected.sum()
    statistic, freedom, p = chi2.chi_square(observed, expected)
    known = stats.chisquare(observed, expected)
    assert freedom == 49
    assert (statistic, p) == pytest.approx((known.statistic, known.pvalue), rel=1e-9)


def test_chi_square_pools_cells_below_five():
    observed, expected = np.array([100, 1, 2, 1, 96]), np.array([98.0, 2, 2, 2, 96])
    _, freedom, _ = chi2.chi_square(observed, expected)
    assert freedom == 2


def test_chi_square_rejects_what_cannot_happen():
    assert chi2.chi_square(np.array([10, 90]), np.array([0.0, 100]))[2] < 1e-3


def test_an_error_of_the_quadrature_is_no_loss_of_samples():
    """All samples have a point, while the cells cover but 0.99991 of the density."""
    rng, n = np.random.default_rng(1), 1 << 20
    pilot, points = (rng.random((2, count), F4) for count in (1 << 14, n))
    report = testing.Report("even")
    even = lambda p: np.full(p.shape[1], 1 - 9e-5, F4)  # noqa: E731
    check_density(report, "", CHARTS["square"], pilot, points, n, even, 1e-4)
    report.raise_if_failed()


def test_a_small_part_of_a_density_is_integrated_if_any_sample_is_there():
    """All points of the first quadrature miss it, and so do the first samples."""
    rng, n, few, low, side = np.random.default_rng(1), 1 << 18, 40, [[0.2331], [0.3131]], 0.002

    def density(p):
        inside = ((p >= low) & (p < np.add(low, side))).all(0)
        return np.where(inside, few / n / side**2, 2 * (1 - few / n) * (p[0] >= 0.5)).astype(F4)

    pilot, points = (rng.random((2, count)) * [[0.5], [1]] + [[0.5], [0]] for count in (1 << 14, n))
    points[:, -few:] = low + side * rng.random((2, few))
    report = testing.Report("part")
    check_density(report, "", CHARTS["square"], pilot.astype(F4), points.astype(F4), n, density, 1e-4)
    report.raise_if_failed()


@pytest.mark.parametrize(("count", "trials", "p"), [(480, 1000, 0.5), (3, 1000, 0.01), (0, 10, 0.3)])
def test_binomial_agrees_with_scipy(count, trials, p):
    tails = stats.binom.cdf(count, trials, p), stats.binom.sf(count - 1, trials, p)
    assert chi2.binomial_p(count, trials, p) == pytest.approx(min(1, 2 * min(tails)), rel=1e-8)


def test_binomial_of_a_certain_outcome():
    assert chi2.binomial_p(10, 10, 1.0) == 1
    assert chi2.binomial_p(9, 10, 1.0) == 0


# --- Errors of one percent ------------------------------------------------------------------------


class TooDense(Diffuse):
    """A pdf that is 1 % too high, used consistently."""

    def pdf(self, wo, wi):
        return super().pdf(wo, wi) * F4(1.01)

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        pdf = self.pdf(wo, s.wi)
        return BsdfSample(s.wi, weigh(self.f(wo, s.wi), s.wi, pdf), pdf, s.specular)


class WrongPdf(TooDense):
    """A pdf of the right integral and the wrong shape, by about a percent at each end."""

    def pdf(self, wo, wi):
        return Diffuse.pdf(self, wo, wi) * (F4(0.98) + F4(0.03) * wi[2])


class WrongWeight(Diffuse):
    """A weight of f·cos^1.01/pdf."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = s.weight * np.maximum(s.wi[2], F4(1e-6)) ** F4(0.01)
        return s


class TooBright(Diffuse):
    """1 % more light leaves than arrives."""

    def f(self, wo, wi):
        return super().f(wo, wi) * F4(1.01)

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = s.weight * F4(1.01)
        return s


class OneNumber(Diffuse):
    """The same random number used twice."""

    def sample_f(self, wo, u):
        return super().sample_f(wo, np.stack([u[0], u[0]]))


class Leaking(Diffuse):
    """Reflects below the surface, where it never samples."""

    def f(self, wo, wi):
        return self.reflectance * np.full_like(wi[2], 1 / np.pi)


class OneWay(Diffuse):
    """Not reciprocal."""

    def f(self, wo, wi):
        return super().f(wo, wi) * (F4(1) - F4(0.01) * wo[2])

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = s.weight * (F4(1) - F4(0.01) * wo[2])
        return s


class Mingling(Diffuse):
    """Lanes that depend on the lanes beside them."""

    def f(self, wo, wi):
        return super().f(wo, wi) * np.float32(1 - 1e-6 * (wi.shape[1] % 7))


class Doubles(Diffuse):
    """Arrays of the wrong type."""

    def f(self, wo, wi):
        return super().f(wo, wi).astype(np.float64)


class Unbroadcast(Diffuse):
    """A constant that is not spread over the lanes."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = self.reflectance
        return s


class NotFinite(Diffuse):
    """NaN at one direction in many."""

    def f(self, wo, wi):
        return np.where(np.abs(wi[0] - F4(0.5)) < 1e-3, F4(np.nan), super().f(wo, wi))


class WrongScaling(Dielectric):
    """η² is 1 % off."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = np.where(s.eta == 1, s.weight, s.weight * F4(1.01))
        return s


class NoScaling(Dielectric):
    """η² is left out."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = s.weight * s.eta**2
        return s


class WrongChoice(Dielectric):
    """Reflects 1 % less often than its pdf says."""

    def sample_f(self, wo, u):
        return super().sample_f(wo, u * np.array([[1], [1], [1.01]], F4))


class WrongFresnel(Dielectric):
    """Reflects by a Fresnel factor that is 1 % too low, and transmits by the right one."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = np.where(s.eta == 1, s.weight * F4(0.99), s.weight)
        return s


class OneWayFresnel(Dielectric):
    """Transmits 1 % too little from outside."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        s.weight = np.where(s.eta > 1, s.weight * F4(0.99), s.weight)
        return s


class Transposed(Diffuse):
    """Has a row for each lane."""

    def f(self, wo, wi):
        return super().f(wo, wi).T


class WrongSnell(Dielectric):
    """Refracts as if the index were 1 % higher."""

    def sample_f(self, wo, u):
        s = super().sample_f(wo, u)
        below = s.wi[2] < 0
        s.wi[:2] = np.where(below, s.wi[:2] * F4(0.99), s.wi[:2])
        cos = np.sqrt(1 - s.wi[0] ** 2 - s.wi[1] ** 2)
        s.wi[2] = np.where(below, -cos, s.wi[2])
        return s


class NotMatte(Diffuse):
    """Darker seen from the side."""

    view_independent = True

    def f(self, wo, wi):
        return super().f(wo, wi) * wo[2] * wi[2]


class NotLambertian(Diffuse):
    """Brighter towards the normal, the same from everywhere."""

    view_independent = lambertian = True

    def f(self, wo, wi):
        return super().f(wo, wi) * wi[2]


MUTANTS = [
    (NotLambertian(1.0), "lambertian"),
    (NotMatte(1.0), "view_independent"),
    (TooDense(1.0), "integral of pdf"),
    (WrongPdf(0.5), "chi-square"),
    (WrongWeight(0.5), "weight"),
    (TooBright(1.0), "albedo"),
    (OneNumber(0.5), "chi-square"),
    (Leaking(0.5), "no transmission"),
    (OneWay(0.5), "reciprocity"),
    (Mingling(0.5), "lanes independent"),
    (Doubles(0.5), "shape and type"),
    (Unbroadcast(0.5), "shape and type"),
    (
        Transposed(0.5),
        "shape and type of f() at wo 0° outside: measured float32 (1000, 3), expected float32 (3, 1000)",
    ),
    (NotFinite(0.5), "finite"),
    (WrongScaling(1.5), "albedo"),
    (NoScaling(1.5), "albedo"),
    (WrongChoice(1.5), "delta lobe"),
    (WrongFresnel(1.5), "albedo (least)"),
    (OneWayFresnel(1.5), "delta reciprocity"),
    (WrongSnell(1.5), "delta reciprocity"),
]


# what an error of one percent needs
SAMPLES = {"chi-square": 1_000_000, "albedo": 200_000, "albedo (least)": 200_000, "delta lobe": 200_000}
GROSS = (OneNumber, NoScaling)


@pytest.mark.parametrize(("mutant", "check"), MUTANTS, ids=[type(m).__name__ for m, _ in MUTANTS])
def test_mutant_is_caught(mutant, check):
    with pytest.raises(AssertionError) as caught:
        testing.check_bsdf(
            mutant,
            samples=20_000 if isinstance(mutant, GROSS) else SAMPLES.get(check, 20_000),
            angles=(0.0, 60.0),
            albedo=(1, 1) if check == "albedo (least)" else (0, 1),
        )
    message = str(caught.value).splitlines()[0]
    assert check in str(caught.value)
    assert message.startswith(f"check_bsdf({type(mutant).__name__}): ")
    assert "at wo " in message
    assert "measured" in message
    assert "expected" in message


def test_report_names_every_check():
    report = testing.check_bsdf(Diffuse(0.5), samples=20_000, angles=(30.0,))
    assert all(check.passed for check in report.checks.values())
    lines = str(report).splitlines()
    assert lines[0] == "check_bsdf(Diffuse)"
    assert len(lines) == len(report.checks) + 1
    assert {"chi-square", "integral of pdf", "weight", "reciprocity", "albedo"} <= set(report.checks)


def test_nan_never_passes():
    assert not testing.Check("x", "", float("nan"), "", float("nan")).passed


# --- Lights and warps -----------------------------------------------------------------------------


def radiance(*values):
    return np.array(values, F4).reshape(3, 1)


TRIANGLE = np.array([[[0.1, 1, 2.4], [1, 0.2, 2], [0, 0, 2]]])


def sphere(center, radius, kind=SphereLights):
    return kind(np.array(center, F4).reshape(3, 1), np.array([radius], F4), radiance(1, 2, 3))


LIGHTS = {
    "point": PointLight((1, 2, 3), (10, 2, 1)),
    "environment": ConstantEnvironment(radiance(1, 2, 3)),
    "sphere": sphere((5, 3, 2), 0.5),
    "sphere far away": sphere((50, 3, 2), 0.5),
    "sphere from inside": sphere((0, 0, 0), 100),
    "triangle": TriangleLights.from_triangles(TRIANGLE, radiance(1, 2, 3)),
    "cosine environment": scenes.CosineEnvironment(2.0).record(np.zeros(3)),
}


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.first(3)
def test_light(name):
    testing.check_light(LIGHTS[name], points=[[0, 0, 0], [-3, 2, -1]], samples=50_000)


def test_light_of_a_picture_of_great_contrast():
    """The rounding of directions changes the radiance of its dark places by more than a 10,000th."""
    picture = np.random.default_rng(1).random((1, 8, 3)) ** 60
    testing.check_light(Environment(picture), points=[[0, 0, 0]], samples=20_000)


class WrongSolidAngle(SphereLights):
    """Its pdf_li is 1 % too high."""

    def pdf_li(self, point, wi):
        return super().pdf_li(point, wi) * F4(1.01)


class WrongRadiance(SphereLights):
    """Samples are 1 % brighter than the light looks."""

    def le(self, wi):
        return super().le(wi) * F4(0.99)


@pytest.mark.parametrize(
    ("kind", "check"),
    [(WrongSolidAngle, "sample pdf"), (WrongRadiance, "radiance"), (WrongSolidAngle, "integral")],
)
def test_wrong_light_is_caught(kind, check):
    with pytest.raises(AssertionError, match=check):
        testing.check_light(sphere((5, 3, 2), 0.5, kind), points=[[0, 0, 0]], samples=50_000)


@pytest.mark.parametrize(
    ("name", "domain"),
    [
        ("cosine_hemisphere", "sphere"),
        ("uniform_hemisphere", "sphere"),
        ("uniform_sphere", "sphere"),
        ("uniform_disk", "disk"),
        ("uniform_triangle", "triangle"),
    ],
)
def test_warp(name, domain):
    """Samples follow the density by χ², which integrates to 1, and the inverse leads back."""
    sample, pdf, inverse = (getattr(warp, name + part) for part in ("", "_pdf", "_inverse"))
    testing.check_warp(sample, pdf, inverse, domain=domain, samples=200_000)


def test_wrong_warp_is_caught():
    with pytest.raises(AssertionError, match="chi-square"):
        testing.check_warp(warp.cosine_hemisphere, warp.uniform_hemisphere_pdf, samples=50_000)


def test_wrong_inverse_is_caught():
    with pytest.raises(AssertionError, match="round trip"):
        testing.check_warp(
            warp.uniform_sphere, warp.uniform_sphere_pdf, warp.cosine_hemisphere_inverse, samples=50_000
        )


@pytest.mark.parametrize("field", ["wi", "distance", "radiance", "pdf"])
def test_check_light_checks_types(field: str) -> None:
    """Embree, for one, takes no float64."""

    class Wide(ConstantEnvironment):
        def sample_li(self, points, u):
            drawn = super().sample_li(points, u)
            return replace(drawn, **{field: getattr(drawn, field).astype(np.float64)})

    with pytest.raises(AssertionError, match=rf"shape and type of sample_li\(\)\.{field} .*float64"):
        testing.check_light(Wide(np.ones((3, 1), F4)), samples=1000)


@pytest.mark.parametrize("method", ["pdf_li", "le"])
def test_check_light_checks_types_of_methods(method: str) -> None:
    class Wide(ConstantEnvironment):
        def pdf_li(self, points, wi):
            return super().pdf_li(points, wi).astype(np.float64 if method == "pdf_li" else F4)

        def le(self, wi, surface=None):
            return super().le(wi, surface).astype(np.float64 if method == "le" else F4)

    with pytest.raises(AssertionError, match=rf"shape and type of {method}\(\) .*float64"):
        testing.check_light(Wide(np.ones((3, 1), F4)), samples=1000)


def test_check_bsdf_checks_the_type_of_eta() -> None:
    class Wide(Dielectric):
        def sample_f(self, wo, u):
            drawn = super().sample_f(wo, u)
            return replace(drawn, eta=drawn.eta.astype(np.float64))

    with pytest.raises(AssertionError, match=r"shape and type of eta .*float64"):
        testing.check_bsdf(Wide(1.5, 0.3), samples=1000)

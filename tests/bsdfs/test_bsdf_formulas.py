"""Every formula of the materials against its source, written out again in float64, and against quadrature.

The references read as their sources do, angles and all; the package's forms avoid divisions by cosines.
"""

import numpy as np
import pytest
from inside import BSDFS_METALS as METALS
from inside import (
    SIZE,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Facets,
    Mirror,
    Mix,
    OrenNayar,
    Plastic,
    Principled,
    SurfaceInteraction,
    Tangent,
    ThinDielectric,
    alpha_of,
    boundary_tables,
    cosine_mean,
    fiber_density,
    gloss_tables,
    is_smooth,
    lookup,
    part_escaping,
    reflect,
    refract,
    sheen_albedo,
    sheen_lobe,
)
from near import assert_near
from scipy import special
from scipy.stats import qmc

F4 = np.float32
COLOR = (0.9, 0.5, 0.1)


def column(value):
    return np.reshape(value, (3, 1)).astype(float)


def pairs(n=2000, seed=0, below=False):
    """Directions wo above and wi above or `below` the surface, (3, n) float32 each, none of them grazing."""
    v = np.random.default_rng(seed).normal(size=(2, 3, 3 * n))
    v[:, 2] = np.abs(v[:, 2])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    wo, wi = v[:, :, (v[:, 2] > 0.05).all(0)][:, :, :n].astype(F4)
    if below:
        wi[2] *= -1
    return wo, wi


def dot(a, b):
    return (a.astype(float) * b).sum(0)


def half_vector(wo, wi):
    h = wo.astype(float) + wi
    return h / np.linalg.norm(h, axis=0)


def midpoints(count, low=0.0, high=1.0):
    """Midpoints (count,) of equal parts, and the width of one."""
    return low + (np.arange(count) + 0.5) * (high - low) / count, (high - low) / count


# ---- sources, in float64 ------------------------------------------------------------------------


def fresnel(cos, eta):
    """Unpolarized reflectance by Snell's law and Fresnel's equations."""
    return sum(polarizations(cos, eta)) / 2


def polarizations(cos, eta):
    """Reflectance of both polarizations."""
    sin = np.sqrt(1 - cos**2) / eta
    cos_t = np.sqrt(np.maximum(1 - sin**2, 0))
    s = (cos - eta * cos_t) / (cos + eta * cos_t)
    p = (eta * cos - cos_t) / (eta * cos + cos_t)
    return tuple(np.where(sin < 1, each**2, 1.0) for each in (s, p))


def sheet_series(cos, eta):
    """Reflectance of a sheet: both faces, and all between, for each polarization by itself."""
    faces = polarizations(cos, eta)
    return sum(face + (1 - face) ** 2 * face / (1 - face**2) for face in faces) / 2


def schlick(f0, cos, f90=1.0):
    """C. Schlick 1994, eq. 15."""
    return f0 + (f90 - f0) * (1 - cos) ** 5


def ggx(cos, alpha):
    """B. Walter et al. 2007, eq. 33."""
    tan2 = 1 / cos**2 - 1
    return alpha**2 / (np.pi * cos**4 * (alpha**2 + tan2) ** 2)


def smith(z, alpha):
    """Λ of E. Heitz 2014, eq. 72."""
    return (np.sqrt(1 + alpha**2 * (1 / z.astype(float) ** 2 - 1)) - 1) / 2


def reflection(wo, wi, alpha):
    """D·G2/(4·cosθo·cosθi) (Heitz 2014, eq. 99 for G2), and the cosine between wo and the half vector."""
    h = half_vector(wo, wi)
    shadowing = 1 / (1 + smith(wo[2], alpha) + smith(wi[2], alpha))
    return ggx(h[2], alpha) * shadowing / (4 * wo[2].astype(float) * wi[2]), dot(wo, h)


def refraction(wo, wi, alpha, eta):
    """Walter et al. 2007, eqs. 16 and 21, over η² for radiance, without Fresnel; 0 where no facet does it."""
    h = wo.astype(float) + eta * wi
    h /= np.linalg.norm(h, axis=0) * np.sign(h[2])
    o, i = dot(wo, h), dot(wi, h)
    shadowing = 1 / (1 + smith(wo[2], alpha) + smith(np.abs(wi[2]), alpha))
    value = np.abs(o * i) * ggx(h[2], alpha) * shadowing / (wo[2].astype(float) * -wi[2] * (o + eta * i) ** 2)
    return np.where((o > 0) & (i < 0), value, 0.0), o


# A. Conty Estevez and C. Kulla 2017, table 1: a, b, c, d, e for roughness 0 and for roughness 1.
SMOOTH_FIT = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967)
ROUGH_FIT = (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)


def fiber_shadowing(z, roughness):
    """Λ of Conty Estevez and Kulla 2017, eq. 3."""
    weight = (1 - roughness) ** 2
    a, b, c, d, e = (weight * s + (1 - weight) * r for s, r in zip(SMOOTH_FIT, ROUGH_FIT, strict=True))

    def fit(x):
        return a / (1 + b * x**c) + d * x + e

    z = z.astype(float)
    return np.exp(np.where(z < 0.5, fit(z), 2 * fit(0.5) - fit(1 - z)))


def fibers(wo, wi, roughness):
    """Conty Estevez and Kulla 2017, eqs. 1 to 3."""
    sin = np.sqrt(1 - half_vector(wo, wi)[2] ** 2)
    density = (2 + 1 / roughness) * sin ** (1 / roughness) / (2 * np.pi)
    shadowing = 1 / (1 + fiber_shadowing(wo[2], roughness) + fiber_shadowing(wi[2], roughness))
    return density * shadowing / (4 * wo[2].astype(float) * wi[2])


def qualitative(wo, wi, sigma):
    """M. Oren and S. Nayar 1994, eq. 30, of albedo 1."""
    theta_o, theta_i = np.arccos(wo[2].astype(float)), np.arccos(wi[2].astype(float))
    phi = np.arctan2(wo[1], wo[0]) - np.arctan2(wi[1], wi[0])
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    steep = np.sin(np.maximum(theta_o, theta_i)) * np.tan(np.minimum(theta_o, theta_i))
    return (a + b * np.maximum(np.cos(phi), 0) * steep) / np.pi


def eon(wo, wi, rho, r):
    """J. Portsmouth, P. Kutz and S. Hill 2025, eqs. 16 to 27 (FON, its albedo, the compensation)."""
    o, i = wo.astype(float), wi.astype(float)
    a = 1 / (1 + (1 / 2 - 2 / (3 * np.pi)) * r)
    s = dot(o, i) - o[2] * i[2]
    single = rho / np.pi * a * (1 + r * s / np.where(s > 0, np.maximum(o[2], i[2]), 1))

    def albedo(z):
        theta, sin = np.arccos(z), np.sqrt(1 - z**2)
        g = sin * (theta - sin * z) + 2 / 3 * (sin / z * (1 - sin**3) - sin)
        return a * (1 + r / np.pi * g)

    mean = a * (1 + (2 / 3 - 28 / (15 * np.pi)) * r)
    left = (1 - albedo(o[2])) * (1 - albedo(i[2])) / (1 - mean)
    return single + rho**2 * mean / (1 - rho * (1 - mean)) / np.pi * left


# ---- distributions by quadrature ----------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.07, 0.3, 0.6, 1.0])
def test_fibers_cover_the_surface_once(roughness):
    """∫ D cosθ dω = 1."""
    theta, width = midpoints(20_000, 0, np.pi / 2)
    density = fiber_density((np.sin(theta) ** 2).astype(F4), F4(roughness)).astype(float)
    assert (density * np.cos(theta) * 2 * np.pi * np.sin(theta) * width).sum() == pytest.approx(1, abs=2e-5)


@pytest.mark.parametrize("alpha", [1e-3, 0.03, 0.3, 1.0])
def test_microfacets_cover_the_surface_once(alpha):
    """∫ D cosθ dω = 1."""
    t, width = midpoints(20_000)
    theta = np.arctan(alpha * t / (1 - t))  # the narrow peak spread out
    slope = alpha / (1 - t) ** 2 / (1 + np.tan(theta) ** 2)
    h = np.stack([np.sin(theta), 0 * theta, np.cos(theta)])
    density = Facets(alpha).normal_density(h, dot(h, h))
    around = 2 * np.pi * np.sin(theta) * slope * width
    assert (density * np.cos(theta) * around).sum() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("mu", [1.0, 0.5, 0.1])
@pytest.mark.parametrize("alpha", [0.1, 0.4, 1.0])
def test_visible_microfacets_cover_what_is_seen_of_the_surface(alpha, mu):
    """∫ G1 max(wo·m, 0) D dω = cosθo (Heitz 2014, eq. 14)."""
    t, wide = midpoints(1500)
    phi, turn = midpoints(360, 0, 2 * np.pi)
    theta = np.arctan(alpha * t / (1 - t))[:, None]
    slope = (alpha / (1 - t) ** 2)[:, None] / (1 + np.tan(theta) ** 2)
    m = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi])
    wo = np.array([np.sqrt(1 - mu * mu), 0, mu]).reshape(3, 1, 1)
    sigma = float(Facets(alpha).stretched(wo.reshape(3, 1))[0])
    masked = (
        2
        * mu
        / (mu + sigma)
        * np.maximum((wo * m).sum(0), 0)
        * Facets(alpha).normal_density(m, (m * m).sum(0))
    )
    total = (masked * np.sin(theta) * slope).sum() * wide * turn
    assert total == pytest.approx(mu, rel=1e-3)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize(("along", "across", "degrees"), [(0.7, 0.7, 0), (0.4, 0.9, 0), (0.9, 0.5, 30)])
@pytest.mark.parametrize("shadowing", ["correlated", "separable"])
def test_facets_of_a_metal(distribution, along, across, degrees, shadowing):
    """D, G and the Jacobian as in Heitz 2014 (eqs. 71, 72, 83, 85, 98, 99), with u turned by an angle."""
    wo, wi = pairs()
    turn = np.radians(degrees)
    turned = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    o, i, h = (turned @ w.astype(float) for w in (wo, wi, half_vector(wo, wi)))
    au, av = along**2, across**2
    slope2 = ((h[0] / au) ** 2 + (h[1] / av) ** 2) / h[2] ** 2
    shape = np.exp(-slope2) if distribution == "beckmann" else 1 / (1 + slope2) ** 2
    density = shape / (np.pi * au * av * h[2] ** 4)

    def masking(w):
        a = np.abs(w[2]) / np.hypot(au * w[0], av * w[1])
        if distribution == "ggx":
            return (np.sqrt(1 + 1 / a**2) - 1) / 2
        exact = (np.exp(-(a**2)) / np.sqrt(np.pi) / a + special.erf(a) - 1) / 2
        return exact

    lo, li = masking(o), masking(i)
    g = 1 / (1 + lo + li) if shadowing == "correlated" else 1 / (1 + lo) / (1 + li)
    metal = Conductor(
        1e-6,
        1e4,
        along,
        roughness_v=across,
        rotation=degrees,
        distribution=distribution,
        shadowing=shadowing,
        multiscatter=False,
    )
    n = wo.shape[1]
    zero, up, lane = np.zeros(n, F4), np.repeat(F4([[0], [0], [1]]), n, 1), np.zeros(n, np.intp)
    at = SurfaceInteraction(up, zero, up, up, wo, lane, lane, zero > 0)
    # the approximation of Beckmann's masking is off by 0.35 % for each direction
    expected = density * g / (4 * o[2] * i[2])
    off = 7e-3 if distribution == "beckmann" else 1e-3
    assert_near(metal.bind(at).f(wo, wi)[0], expected, rel=off, abs=1e-6)


def test_the_tangent_follows_the_coordinates_and_turns_towards_v():
    """Seen from both sides, for a surface whose u runs along y and whose v runs along -x or x."""
    n = np.array([[0.0, 0.0], [0, 0], [1, -1]], F4)
    lane, zero = np.zeros(2, np.intp), np.zeros(2, F4)
    at = SurfaceInteraction(n, zero, n, n, n, lane, lane, zero > 0)
    for sign, size in ((1, 1), (-1, 1), (1, 0.1), (-1, 0.1)):  # of coordinates, which may be any
        frame = F4([[0], [2], [0.1], [-3 * sign], [0], [0]])
        at.tangent_frame = np.repeat(F4(size) * frame, 2, 1)
        cos, sin = Tangent(np.array([30.0], F4)).at(at)
        back = at.frame().to_world(np.stack([cos, sin, zero]))
        turn = np.radians(30)
        expected = [-sign * np.sin(turn), np.cos(turn), 0]
        assert back == pytest.approx(np.repeat(np.reshape(expected, (3, 1)), 2, 1), abs=1e-6)


def test_a_sheet_that_scatters_to_both_sides():
    """M. Pharr et al. 2023, section 9.2: ρ/π and τ/π; samples by the brightest channels of both."""
    (wo, wi), (_, below) = pairs(), pairs(below=True)
    sheet = DiffuseTransmission(COLOR, (0.1, 0.2, 0.3))
    assert sheet.f(wo, wi) == pytest.approx(np.tile(column(COLOR) / np.pi, wi.shape[1]), rel=1e-6)
    assert sheet.f(wo, below) == pytest.approx(
        np.tile(column((0.1, 0.2, 0.3)) / np.pi, wi.shape[1]), rel=1e-6
    )
    assert sheet.pdf(wo, wi) == pytest.approx(0.75 * wi[2] / np.pi, rel=1e-6)
    assert sheet.pdf(wo, below) == pytest.approx(-0.25 * below[2] / np.pi, rel=1e-6)
    assert DiffuseTransmission().albedo(wo)[:, 0] == pytest.approx([0.5] * 3)
    assert DiffuseTransmission().f(wo, below)[0, 0] == pytest.approx(0.25 / np.pi)
    assert (DiffuseTransmission(0.9, 0.8).albedo(wo) == 1).all()


def test_brushes_run_along_u_unless_turned():
    assert Conductor(1, 1, 0.5, roughness_v=0.2).rotation == 0


@pytest.mark.parametrize("ior", [1.3, 1.5, 2.2, 0.8, 0.1])
def test_what_escapes_a_smooth_boundary(ior):
    """By quadrature of the reflectance of diffuse light inside, where all is reflected beyond an angle."""
    mu, width = midpoints(200_000)
    escaping = (2 * mu * (1 - fresnel(mu, 1 / ior))).sum() * width
    assert part_escaping(ior) == pytest.approx(escaping, abs=2e-5)


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("ior", [0.05, 0.5, 0.9, 1.5])
def test_what_escapes_a_rough_boundary(ior, roughness):
    """All that the rarer side does not reflect, over η² from the denser side."""
    _, _, escaping = boundary_tables(ior, roughness, False, False, True)
    from_rarer = Dielectric(max(ior, 1 / ior), roughness, multiscatter=False)
    rng = np.random.default_rng(0)
    u = rng.random((3, 100_000), dtype=F4)
    mu = np.sqrt(rng.random(u.shape[1], dtype=F4))
    wo = np.stack([np.sqrt(1 - mu * mu), 0 * mu, mu])
    sample = from_rarer.sample_f(wo, u)
    reflected = np.where(sample.wi[2] > 0, sample.weight[0], 0).mean(dtype=float)
    assert escaping[0] == pytest.approx((1 - reflected) / max(ior, 1) ** 2, abs=6e-3)


@pytest.mark.parametrize("roughness", [0.5, 1.0])
@pytest.mark.parametrize("ior", [1.2, 1.5])
def test_tables_of_a_rough_boundary(ior, roughness):
    """What is reflected and what is let in once, by quadrature of Walter et al. over the facets."""
    alpha = roughness**2
    (t, wide), (phi, turn) = midpoints(400), midpoints(100, 0, 2 * np.pi)
    t, phi = (each.ravel() for each in np.meshgrid(t, phi))
    theta = np.arctan(alpha * t / (1 - t))
    m = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    facet = ggx(m[2], alpha) * np.sin(theta) * alpha / (1 - t) ** 2 / (1 + np.tan(theta) ** 2) * wide * turn
    whole, entered = (boundary_tables(ior, roughness, False, False, again)[0][0] for again in (True, False))
    for k in (10, 40, 63):
        mu = k / 63
        wo = column((np.sqrt(1 - mu * mu), 0, mu))
        cos = (wo * m).sum(0)
        seen = facet * np.maximum(cos, 0) / mu
        reflected = fresnel(np.maximum(cos, 1e-9), ior)
        above = 2 * cos * m[2] - mu
        kept = (above > 0) / (1 + smith(wo[2], alpha) + smith(np.maximum(above, 1e-9), alpha))
        assert whole[k] == pytest.approx(1 - (seen * reflected * kept).sum(), abs=2e-4)
        along = (cos / ior - np.sqrt(np.maximum(1 - (1 - cos**2) / ior**2, 0))) * m[2] - mu / ior
        kept = (along < 0) / (1 + smith(wo[2], alpha) + smith(np.maximum(-along, 1e-9), alpha))
        assert entered[k] == pytest.approx((seen * (1 - reflected) * kept).sum(), abs=2e-4)


@pytest.mark.parametrize("roughness", [0.0, 0.4])
@pytest.mark.parametrize("ior", [1e-6, 1e-3, 1e3, 1e6])
def test_plastic_of_any_index_is_finite_and_reflects_no_more_than_all(ior, roughness):
    wo, wi = pairs()
    for nonlinear in (False, True):
        values = Plastic(1.0, roughness, ior, nonlinear=nonlinear).f(wo, wi)
        gloss = Plastic(0.0, roughness, ior, nonlinear=nonlinear).f(wo, wi)
        assert np.isfinite(values).all()
        assert (values >= gloss).all()
        red = Plastic(0.5, roughness, ior, nonlinear=nonlinear).f(wo, wi)
        assert (red <= values).all()


@pytest.mark.parametrize("nonlinear", [False, True])
def test_smooth_plastic(nonlinear):
    """Mitsuba 3's `plastic`: diffuse/(1 − diffuse·F inside)·(1 − Fo)(1 − Fi)/(π·η²)."""
    wo, wi = pairs()
    albedo = column(COLOR)
    inside = 1 - part_escaping(1.4)
    base = albedo / (1 - (albedo * inside if nonlinear else inside))
    exact = base * (1 - fresnel(wo[2].astype(float), 1.4)) * (1 - fresnel(wi[2].astype(float), 1.4)) / 1.4**2
    ours = Plastic(COLOR, 0, 1.4, nonlinear=nonlinear, specular_reflectance=0.8)
    assert_near(ours.f(wo, wi), exact / np.pi, rel=1e-4)
    seen = 1 - fresnel(wo[2].astype(float), 1.4)
    gloss, matte = 0.8 * (1 - seen), np.mean(COLOR) * seen
    assert_near(ours.pdf(wo, wi), matte / (gloss + matte) * wi[2] / np.pi, rel=1e-4)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_boundary_of_rough_plastic(distribution):
    """What gets in, and what is reflected inside, are sums over samples of rough glass of that kind."""
    from_outside, _, escaping = boundary_tables(1.5, 0.5, distribution == "beckmann", False, False)
    for k in (10, 40, 63):
        mu = k / 63
        u = np.random.default_rng(0).random((3, 200_000), dtype=F4)
        wo = np.repeat(np.array([[np.sqrt(1 - mu * mu)], [0], [mu]], F4), u.shape[1], 1)
        sample = Dielectric(1.5, 0.5, distribution=distribution, multiscatter=False).sample_f(wo, u)
        through = np.where(sample.wi[2] < 0, sample.weight[0] * sample.eta**2, 0)
        assert from_outside[0, k] == pytest.approx(through.mean(dtype=float), abs=4e-3)
    assert 0.4 < 1 - escaping[0] < 1 - part_escaping(1.5)


@pytest.mark.parametrize("nonlinear", [False, True])
def test_base_of_rough_plastic_that_scatters_once(nonlinear):
    """Mitsuba 3's `roughplastic`: diffuse/(1 − diffuse·r)·T(wo)·T(wi)/(π·η²) with r reflected inside."""
    wo, wi = pairs()
    options = {"nonlinear": nonlinear, "multiscatter": False}
    through, _, escaping = boundary_tables(1.4, 0.5, False, False, False)
    cosines = np.linspace(0, 1, through.shape[1])
    seen, lit = (np.interp(w[2], cosines, through[0]) for w in (wo, wi))
    albedo, inside = column(COLOR), 1 - escaping[0]
    base = albedo / (1 - (albedo * inside if nonlinear else inside))
    gloss = Plastic(0, 0.5, 1.4, **options).f(wo, wi)
    found = Plastic(COLOR, 0.5, 1.4, **options).f(wo, wi) - gloss
    assert_near(found, base * seen * lit / (np.pi * 1.4**2), rel=1e-3, abs=1e-5)


def test_what_is_reflected_inside_a_rough_boundary_that_scatters_once():
    """The mean of a table of rough glass seen from inside, weighted with cosines at its columns."""
    _, _, escaping = boundary_tables(1.5, 0.5, False, False, False)
    glass, u = Dielectric(1 / 1.5, 0.5, multiscatter=False), np.random.default_rng(0).random((3, 20_000), F4)
    cosines, reflected = np.linspace(0, 1, 64), []
    for mu in np.maximum(cosines, 1e-6):
        wo = np.repeat(column([np.sqrt(1 - mu * mu), 0, mu]).astype(F4), u.shape[1], 1)
        sample = glass.sample_f(wo, u)
        reflected.append(np.where(sample.wi[2] > 0, sample.weight[0], 0).mean(dtype=float))
    assert 1 - escaping[0] == pytest.approx(2 * np.mean(cosines * reflected), abs=3e-3)


@pytest.mark.parametrize("roughness", [0.2, 0.6])
def test_gloss_of_rough_plastic(roughness):
    """A rough mirror times Fresnel's equations and the tint."""
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    exact = column(COLOR) * value * fresnel(cos, 1.4)
    gloss = Plastic(0, roughness, 1.4, specular_reflectance=COLOR)
    assert gloss.f(wo, wi) == pytest.approx(exact, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_albedo_of_plastic(roughness, nonlinear):
    """The mean weight of its samples, with colors and tints that differ by channel."""
    plastic = Plastic(COLOR, roughness, 1.6, specular_reflectance=(0.3, 0.6, 1.0), nonlinear=nonlinear)
    points = qmc.Sobol(3, seed=0).random_base2(16).T.astype(F4)
    for mu in (0.9, 0.5, 0.2):
        wo = column([np.sqrt(1 - mu * mu), 0, mu]).astype(F4)
        weights = plastic.sample_f(np.repeat(wo, points.shape[1], 1), points).weight
        assert plastic.albedo(wo)[:, 0] == pytest.approx(weights.mean(1, dtype=float), rel=2e-3)


def test_plastic_by_default():
    """A gray base below a smooth boundary of index 1.5."""
    wo, wi = pairs()
    plastic = Plastic()
    assert np.array_equal(plastic.f(wo, wi), Plastic(0.5, 0.0, 1.5, specular_reflectance=1.0).f(wo, wi))
    assert plastic.dimensions == 3


def test_a_texture_of_roughness_finds_the_boundary_between_rows():
    wo, wi = pairs()
    for roughness in (0.57, 0.98):
        rough, textured = Plastic(0.6, roughness), Plastic(0.6, roughness)
        vars(textured).update(_one=None)
        assert textured.f(wo, wi) == pytest.approx(rough.f(wo, wi), rel=3e-3)


# ---- values -------------------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.3, 0.7, 1.0])
def test_sheen(roughness):
    wo, wi = pairs()
    exact = fibers(wo, wi, max(roughness, 0.07))
    assert sheen_lobe(wo, wi, F4(roughness)) == pytest.approx(exact, rel=2e-4, abs=1e-6)


@pytest.mark.parametrize("roughness", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("mu", [0.3, 0.6, 1.0])
def test_albedo_of_sheen(roughness, mu):
    z, tall = midpoints(400)
    phi, turn = midpoints(400, 0, 2 * np.pi)
    z, phi = (x.ravel() for x in np.meshgrid(z, phi))
    wi = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    wo = np.repeat(np.array([[np.sqrt(1 - mu * mu)], [0], [mu]]), len(z), 1)
    exact = (fibers(wo, wi, roughness) * z).sum() * tall * turn
    found = sheen_albedo(np.array([mu], F4), np.array([roughness], F4))[0]
    assert found == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("sigma", [0.05, 0.3, 0.8, 1.5])
def test_oren_nayar(sigma):
    wo, wi = pairs()
    exact = column(COLOR) * qualitative(wo, wi, sigma)
    assert OrenNayar(COLOR, sigma).f(wo, wi) == pytest.approx(exact, rel=2e-4)


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_eon(roughness):
    wo, wi = pairs()
    exact = eon(wo, wi, column(COLOR), roughness)
    assert OrenNayar(COLOR, roughness, energy_preserving=True).f(wo, wi) == pytest.approx(exact, rel=2e-4)


@pytest.mark.parametrize("roughness", [0.2, 0.6, 1.0])
def test_rough_metal(roughness):
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    index = 0.5 + 3j
    inner = np.sqrt(index**2 - (1 - cos**2))
    s, p = (cos - inner) / (cos + inner), (index**2 * cos - inner) / (index**2 * cos + inner)
    exact = value * (np.abs(s) ** 2 + np.abs(p) ** 2) / 2
    assert Conductor(0.5, 3, roughness, multiscatter=False).f(wo, wi)[1] == pytest.approx(
        exact, rel=5e-4, abs=1e-6
    )
    part = Conductor(0.5, 3, roughness, reflectance=(0.25, 0.5, 1), multiscatter=False).f(wo, wi)
    np.testing.assert_allclose(part, part[2] * np.array([[0.25], [0.5], [1]]), rtol=1e-6)
    assert part[2] == pytest.approx(exact, rel=5e-4, abs=1e-6)


@pytest.mark.parametrize("back_facing", [False, True])
@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_rough_glass(roughness, back_facing):
    glass = Dielectric(1.5, roughness, reflectance=COLOR, transmittance=COLOR[::-1], multiscatter=False)
    eta = 1 / 1.5 if back_facing else 1.5
    glass.eta = np.array([eta], F4)
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    exact = column(COLOR) * (value * fresnel(cos, eta))
    assert_near(glass.f(wo, wi), exact, rel=1e-3, abs=1e-6)
    wo, wi = pairs(below=True)
    value, cos = refraction(wo, wi, roughness**2, eta)
    sound = np.abs(wo + eta * wi)[2] > 0.05  # elsewhere the half vector has few digits
    exact = column(COLOR[::-1]) * (value * (1 - fresnel(np.clip(cos, 1e-9, 1), eta)))
    assert (value > 0).mean() > 0.1
    assert_near(glass.f(wo, wi)[:, sound], exact[:, sound], rel=3e-3, abs=1e-5)


@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_rough_sheet(roughness):
    sheet = ThinDielectric(1.5, roughness, reflectance=COLOR, transmittance=COLOR[::-1], multiscatter=False)
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    series = sheet_series(cos, 1.5)
    assert_near(sheet.f(wo, wi), column(COLOR) * (value * series), rel=1e-3, abs=1e-6)
    through = column(COLOR[::-1]) * (value * (1 - series))
    wi[2] *= -1
    assert_near(sheet.f(wo, wi), through, rel=1e-3, abs=1e-6)


def test_smooth_sheet():
    sheet = ThinDielectric(1.5, reflectance=COLOR, transmittance=COLOR[::-1])
    wo, _ = pairs()
    series = sheet_series(wo[2].astype(float), 1.5)
    up = sheet.sample_f(wo, np.zeros((3, wo.shape[1]), F4))
    down = sheet.sample_f(wo, np.full((3, wo.shape[1]), np.nextafter(F4(1), F4(0))))
    mirrored = wo * np.array([[-1], [-1], [1]], F4)
    assert np.array_equal(up.wi, mirrored)
    assert np.array_equal(down.wi, -wo)
    assert up.pdf == pytest.approx(series, rel=1e-4)
    assert down.pdf == pytest.approx(1 - series, rel=1e-4)
    assert up.weight[:, 0] == pytest.approx(COLOR)
    assert down.weight[:, 0] == pytest.approx(COLOR[::-1])


@pytest.mark.parametrize("back_facing", [False, True])
def test_smooth_glass(back_facing):
    glass = Dielectric(1.5, reflectance=COLOR, transmittance=COLOR[::-1])
    eta = 1 / 1.5 if back_facing else 1.5
    glass.eta = np.array([eta], F4)
    wo, _ = pairs()
    wo = wo[:, np.hypot(wo[0], wo[1]) < 0.99 * min(eta, 1)]
    part = fresnel(wo[2].astype(float), eta)
    up = glass.sample_f(wo, np.zeros((3, wo.shape[1]), F4))
    down = glass.sample_f(wo, np.full((3, wo.shape[1]), np.nextafter(F4(1), F4(0))))
    refracted = np.stack([-wo[0] / eta, -wo[1] / eta, -np.sqrt(1 - (wo[0] ** 2 + wo[1] ** 2) / eta**2)])
    assert np.array_equal(up.wi, wo * np.array([[-1], [-1], [1]], F4))
    assert down.wi == pytest.approx(refracted, abs=1e-5)
    assert up.pdf == pytest.approx(part, rel=1e-3)
    assert down.pdf == pytest.approx(1 - part, rel=1e-3)
    assert (up.eta == 1).all()
    assert down.eta == pytest.approx(eta)
    assert up.weight[:, 0] == pytest.approx(COLOR)
    assert down.weight[:, 0] == pytest.approx(np.array(COLOR[::-1]) / eta**2)


def test_matte_and_mirror():
    wo, wi = pairs(100)
    assert Diffuse(COLOR).f(wo, wi)[:, 0] == pytest.approx(np.array(COLOR) / np.pi)
    assert Diffuse(COLOR).pdf(wo, wi) == pytest.approx(wi[2] / np.pi)
    assert Mirror(COLOR).sample_f(wo, np.zeros((2, 100), F4)).weight[:, 0] == pytest.approx(COLOR)


def test_mix_is_a_mean():
    wo, wi = pairs(100)
    one, two = OrenNayar(COLOR, 0.3), Conductor(2, 4, 0.5)
    mix = Mix(one, two, 0.3)
    for method in ("f", "pdf"):
        first, second = getattr(one, method)(wo, wi), getattr(two, method)(wo, wi)
        assert getattr(mix, method)(wo, wi) == pytest.approx(0.7 * first + 0.3 * second, rel=1e-5)


def test_parts_of_a_mix_are_chosen_by_its_weight():
    wo, _ = pairs(1000)
    u = np.random.default_rng(0).random((3, 1000)).astype(F4)
    for mix, chance in ((Mix(Mirror(), Diffuse(), 0.3), 0.7), (Mix(Diffuse(), Mirror(), 0.3), 0.3)):
        sample = mix.sample_f(wo, u)
        assert sample.pdf[sample.specular] == pytest.approx(chance)
        assert sample.specular.mean() == pytest.approx(chance, abs=0.05)


# ---- principled, part by part -------------------------------------------------------------------


def gloss_of(ior, specular, tint, cos):
    """KHR_materials_specular and _ior: Schlick from the tinted reflectance along the normal."""
    f0 = np.minimum(column(tint) * ((ior - 1) / (ior + 1)) ** 2, 1) * specular
    return schlick(f0, cos, specular)


@pytest.mark.parametrize("tint", [(1, 1, 1), (2, 0.5, 30)])
def test_opaque_base_to_the_letter(tint):
    """KHR_materials_specular: fresnel_mix, with the largest channel taken from the matte base."""
    ior, specular, metallic, roughness = 1.7, 0.8, 0.3, 0.6
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    gloss = gloss_of(ior, specular, tint, cos)
    plastic = gloss * value + column(COLOR) / np.pi * (1 - gloss.max(0))
    metal = schlick(column(COLOR), cos) * value
    bsdf = Principled(
        COLOR, metallic, roughness, ior, specular=specular, specular_color=tint, conserve_energy=False
    )
    exact = metallic * metal + (1 - metallic) * plastic
    assert bsdf.f(wo, wi) == pytest.approx(exact, rel=5e-4)


def test_opaque_base_that_conserves_energy():
    """Kulla and Conty 2017: (1 − E(wo))·(1 − E(wi))/(1 − mean E), E by the tables tested below."""
    ior, specular, tint, roughness = 1.7, 0.8, (2, 0.5, 1), 0.6
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    gloss = gloss_of(ior, specular, tint, cos)
    f0, f90 = gloss_of(ior, specular, tint, 1.0).max(), specular
    a, b, mean_a, mean_b = gloss_tables()
    rough = np.full(len(cos), roughness, F4)

    def left(first, second, z):
        return 1 - f0 * lookup(first, rough, z).astype(float) - f90 * lookup(second, rough, z)

    under = left(a, b, wo[2]) * left(a, b, wi[2]) / left(mean_a, mean_b, wo[2])
    exact = gloss * value + column(COLOR) / np.pi * under
    bsdf = Principled(COLOR, 0, roughness, ior, specular=specular, specular_color=tint)
    assert bsdf.f(wo, wi) == pytest.approx(exact, rel=5e-4)


@pytest.mark.parametrize("thin", [False, True])
def test_clear_base(thin):
    """KHR_materials_transmission and _volume, with Fresnel's equations."""
    clear, metallic, roughness = 0.7, 0.2, 0.6
    bsdf = Principled(COLOR, metallic, roughness, 1.5, clear, thin=thin, specular=0.0, multiscatter=False)
    wo, wi = pairs()
    value, cos = reflection(wo, wi, roughness**2)
    reflected = sheet_series(cos, 1.5) if thin else fresnel(cos, 1.5)
    part = (1 - metallic) * clear
    diffuse = (1 - metallic) * (1 - clear) * column(COLOR) / np.pi
    exact = metallic * schlick(column(COLOR), cos) * value + part * reflected * value + diffuse
    assert_near(bsdf.f(wo, wi), exact, rel=1e-3)
    if thin:
        through = value * (1 - reflected)
        wi[2] *= -1
        sound = np.ones(len(cos), bool)
    else:
        wo, wi = pairs(below=True)
        through, cos = refraction(wo, wi, roughness**2, 1.5)
        through = through * (1 - fresnel(np.clip(cos, 1e-9, 1), 1.5))
        sound = np.abs(wo + 1.5 * wi)[2] > 0.05
    exact = column(COLOR) * part * through
    assert_near(bsdf.f(wo, wi)[:, sound], exact[:, sound], rel=3e-3, abs=1e-5)


def test_clear_coat():
    base = Principled(COLOR, 0.5, 0.5)
    bsdf = Principled(COLOR, 0.5, 0.5, clearcoat=0.8, clearcoat_roughness=0.4)
    wo, wi = pairs()
    value, cos = reflection(wo, wi, 0.4**2)
    passed = (1 - 0.8 * schlick(0.04, wo[2].astype(float))) * (1 - 0.8 * schlick(0.04, wi[2].astype(float)))
    exact = base.f(wo, wi) * passed + 0.8 * schlick(0.04, cos) * value
    assert bsdf.f(wo, wi) == pytest.approx(exact, rel=5e-4)


def test_sheen_over_the_base():
    """KHR_materials_sheen: the base is weakened by the larger of both albedos."""
    base, tint = Principled(COLOR, 0.5, 0.5), (0.9, 0.3, 0.6)
    bsdf = Principled(COLOR, 0.5, 0.5, sheen=0.7, sheen_color=tint, sheen_roughness=0.4)
    wo, wi = pairs()
    rough = np.full(wo.shape[1], 0.4, F4)
    seen = np.maximum(sheen_albedo(wo[2], rough), sheen_albedo(wi[2], rough))
    exact = base.f(wo, wi) * (1 - 0.7 * 0.9 * seen) + 0.7 * column(tint) * fibers(wo, wi, 0.4)
    assert bsdf.f(wo, wi) == pytest.approx(exact, rel=5e-4, abs=1e-6)


@pytest.mark.parametrize(("color", "sheen", "roughness"), [(COLOR, 0.7, 0.5), ((1e-3, 0, 0), 0.0, 0.2)])
def test_shares_of_the_lobes(color, sheen, roughness):
    """The density is a mean of those of the lobes, weighted by about what each reflects along wo."""
    metallic, clear, specular, ior, tint, coat = 0.3, 0.4, 0.8, 1.7, (0.5, 0.5, 0.5), 0.6
    bsdf = Principled(
        color, metallic, roughness, ior, clear, thin=True, specular=specular, specular_color=tint,
        clearcoat=coat, clearcoat_roughness=0.3, sheen=sheen, sheen_color=tint, multiscatter=False,
    )  # fmt: skip
    wo, wi = pairs()

    def luminance(color):
        return (column((0.2126, 0.7152, 0.0722)) * color).sum(0)

    away = (1 - wo[2].astype(float)) ** 5
    opaque = (1 - metallic) * (1 - clear)
    seen = luminance(gloss_of(ior, specular, tint, wo[2].astype(float)))
    gloss = metallic * (luminance(schlick(column(color), wo[2].astype(float))) + 0.1) + opaque * (seen + 0.1)
    glass = (1 - metallic) * clear
    varnish = coat * (0.1 + schlick(0.04, wo[2].astype(float)))
    diffuse = opaque * (luminance(column(color)) + 0.01) + sheen * 0.5 * (0.2 + away)
    rough, smooth = (Facets(F4(r**2)).mirror_lobe(wo, wi)[1] for r in (roughness, 0.3))
    sheet = sheet_series(dot(wo, half_vector(wo, wi)).astype(float), ior)
    lobes = gloss * rough + glass * rough * sheet + varnish * smooth + diffuse * wi[2] / np.pi
    assert bsdf.pdf(wo, wi) == pytest.approx(lobes / (gloss + glass + varnish + diffuse), rel=1e-3)


@pytest.mark.parametrize("make", [Dielectric, lambda ior, rough: Principled(1.0, 0, rough, ior, 1.0)])
@pytest.mark.parametrize("back_facing", [False, True])
def test_what_crosses_says_the_index_it_met(make, back_facing):
    """And what is reflected says 1, as does all that crosses a sheet."""
    wo = np.repeat(np.array([[0.3], [0], [np.sqrt(0.91)]], F4), 256, 1)
    u = np.random.default_rng(0).random((3, 256)).astype(F4)
    glass = make(1.5, 0.3)
    glass.back_facing, glass.eta = (
        np.full(256, back_facing),
        np.full(256, 1 / 1.5 if back_facing else 1.5, F4),
    )
    sample = glass.sample_f(wo, u)
    below = sample.wi[2] < 0
    assert below.any()
    assert not below.all()
    sound = sample.pdf > 0
    expected = np.where(below, 1 / 1.5 if back_facing else 1.5, 1)
    assert sample.eta[sound] == pytest.approx(expected[sound])
    sheet = Principled(1.0, 0, 0.3, 1.5, 1.0, thin=True).sample_f(wo, u)
    assert (sheet.eta == 1).all()


@pytest.mark.parametrize(
    ("ior", "bent"), [(1.0, 1.001), (1.0005, 1.001), (0.9995, 1.001), (1.02, 1.02), (0.98, 0.98)]
)
def test_clear_bases_bend_a_little_at_least(ior, bent):
    wo = np.repeat(np.array([[0.3], [0], [np.sqrt(0.91)]], F4), 64, 1)
    u = np.random.default_rng(0).random((3, 64)).astype(F4)
    sample = Principled(1.0, 0, 0.3, ior, 1.0).sample_f(wo, u)
    assert sample.eta[sample.wi[2] < 0] == pytest.approx(bent, rel=1e-5)


def test_indices_too_near_1_to_be_rough():
    assert [Dielectric(ior, 0.5).specular for ior in (0.99901, 1.00099, 1.00101, 0.99899, 1.02)] == [
        True, True, False, False, False,
    ]  # fmt: skip


def test_the_widest_slopes():
    assert OrenNayar(0.5, np.pi / 2).sigma[0] == F4(np.pi / 2)


# ---- tables -------------------------------------------------------------------------------------


def test_lookup_is_bilinear_in_roughness_and_the_root_of_the_cosine():
    side = np.linspace(0, 1, SIZE)
    table = (0.2 + 0.5 * side[:, None] + 0.3 * side - 0.7 * side[:, None] * side).astype(F4)
    rng = np.random.default_rng(0)
    rough, cos = rng.random((2, 1000)).astype(F4)
    y, x = rough.astype(float), np.sqrt(cos.astype(float))
    assert lookup(table, rough, cos) == pytest.approx(0.2 + 0.5 * y + 0.3 * x - 0.7 * y * x, abs=1e-5)
    assert lookup(table, np.array([0, 1, 2], F4), np.array([1, 0, 2], F4)) == pytest.approx([0.5, 0.7, 0.3])


def test_means_over_the_hemisphere():
    """∫ 2μ·1 dμ = 1, ∫ 2μ·μ dμ = 2/3, ∫ 2μ·√μ dμ = 4/5."""
    root = np.linspace(0, 1, SIZE)
    table = np.repeat(np.ones(SIZE)[:, None], SIZE, 1)
    for power, mean in ((0, 1), (1, 4 / 5), (2, 2 / 3)):
        assert cosine_mean((table * root**power).astype(F4)) == pytest.approx(mean, rel=1e-3)


@pytest.mark.parametrize("roughness", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("mu", [0.3, 0.7, 1.0])
def test_albedo_of_gloss(roughness, mu):
    """∫ f cosθ dω with Schlick's Fresnel of F0 and F90, by quadrature."""
    z, tall = midpoints(600)
    phi, turn = midpoints(300, 0, 2 * np.pi)
    z, phi = (x.ravel() for x in np.meshgrid(z, phi))
    wi = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    wo = np.repeat(np.array([[np.sqrt(1 - mu * mu)], [0], [mu]]), len(z), 1)
    value, cos = reflection(wo, wi, roughness**2)
    at = np.array([roughness], F4), np.array([mu], F4)
    a, b, _, _ = gloss_tables()
    for table, weight in ((a, 1 - (1 - cos) ** 5), (b, (1 - cos) ** 5)):
        exact = (value * weight * z).sum() * tall * turn
        assert lookup(table, *at)[0] == pytest.approx(exact, rel=0.01, abs=2e-4)


# ---- densities ----------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
def test_density_of_refraction(eta, alpha):
    """Walter et al., eqs. 17 and 24: D·G1·|wo·m|/cosθo times the Jacobian η²|wi·m|/(wo·m + η wi·m)²."""
    wo, wi = pairs(below=True)
    _, pdf, _, valid = Facets(F4(alpha)).refraction_lobe(wo, wi, F4(eta))
    h = wo.astype(float) + eta * wi
    h /= np.linalg.norm(h, axis=0) * np.sign(h[2])
    o, i = dot(wo, h), dot(wi, h)
    visible = ggx(h[2], alpha) / (1 + smith(wo[2], alpha)) * o / wo[2]
    exact = visible * eta**2 * -i / (o + eta * i) ** 2
    sound = valid & (np.abs(wo + eta * wi)[2] > 0.05)
    assert sound.sum() > 150
    assert pdf[sound] == pytest.approx(exact[sound], rel=3e-3, abs=1e-5)


@pytest.mark.parametrize("beckmann", [False, True])
def test_nothing_is_refracted_where_no_facet_does_it(beckmann):
    wo, wi = pairs(below=True)
    value, pdf, _, valid = Facets(F4(0.5), beckmann=beckmann).refraction_lobe(wo, wi, F4(1.5))
    assert 100 < valid.sum() < valid.size - 100
    assert (value[valid] > 0).any()
    assert not value[~valid].any()
    assert not pdf[~valid].any()


def test_facets_of_some_points():
    facets = Facets(F4([0.1, 0.2]), F4([0.3, 0.4]), F4([[1, 0], [0, 1]])).take(np.array([1]))
    assert (facets.alpha, facets.alpha_v) == (F4([0.2]), F4([0.4]))
    assert facets.tangent.tolist() == [[0], [1]]


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_density_of_reflection(alpha):
    """Walter et al., eqs. 14 and 24: D·G1·|wo·m|/cosθo times the Jacobian 1/(4|wo·m|)."""
    wo, wi = pairs()
    exact = ggx(half_vector(wo, wi)[2], alpha) / (1 + smith(wo[2], alpha)) / (4 * wo[2].astype(float))
    assert Facets(F4(alpha)).mirror_lobe(wo, wi)[1] == pytest.approx(exact, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
def test_directions_by_snell(eta):
    """Both leave in the plane of wo and m: at the angle of wo, and by sinθo = η·sinθt beyond."""
    wo, _ = pairs()
    m = half_vector(wo, np.array([[0.3], [0.1], [0.9]])).astype(F4)
    cos = dot(wo, m)
    sin = np.sqrt(1 - cos**2)
    keep = sin < 0.99 * min(eta, 1)
    wo, m, cos, sin = wo[:, keep], m[:, keep], cos[keep], sin[keep]
    along = (wo - m * cos) / sin
    cos_t = np.sqrt(1 - (sin / eta) ** 2)
    assert reflect(wo, m) == pytest.approx(m * cos - along * sin, abs=1e-5)
    refracted = refract(wo, m, cos.astype(F4), cos_t.astype(F4), F4(eta))
    assert refracted == pytest.approx(-m * cos_t - along * sin / eta, abs=1e-5)


def test_roughness_maps_to_its_square():
    assert is_smooth(np.array([0.0316], F4))
    assert not is_smooth(np.array([0.0317], F4))
    assert alpha_of(np.array([0.5, 1.0, 0.01], F4)) == pytest.approx([0.25, 1.0, 1e-3])


# ---- metals -------------------------------------------------------------------------------------

# Reflectance along the normal and at 75°, from η and k by complex arithmetic.
REFLECTANCE = {
    "aluminum": (0.908614, 0.916006, 0.923660, 0.855032, 0.871748, 0.892568),
    "chromium": (0.550269, 0.556233, 0.555395, 0.515620, 0.522170, 0.551609),
    "copper": (0.921320, 0.619890, 0.519937, 0.918436, 0.669226, 0.597503),
    "gold": (0.968144, 0.745573, 0.371949, 0.964419, 0.798566, 0.513934),
    "iron": (0.528315, 0.513475, 0.493431, 0.511066, 0.502146, 0.505091),
    "nickel": (0.691238, 0.640995, 0.558910, 0.645705, 0.617853, 0.582316),
    "platinum": (0.673658, 0.638112, 0.580892, 0.622920, 0.608404, 0.587847),
    "silver": (0.988662, 0.983989, 0.977261, 0.985261, 0.981871, 0.980593),
    "titanium": (0.614508, 0.579985, 0.541060, 0.570847, 0.555775, 0.544883),
}


@pytest.mark.parametrize("name", METALS)
def test_metals(name):
    wo = np.array([[0], [0], [1]], F4)
    at_75 = np.array([[np.sin(np.radians(75))], [0], [np.cos(np.radians(75))]], F4)
    metal = Conductor.named(name)
    seen = [metal.sample_f(w, np.zeros((2, 1), F4)).weight[:, 0] for w in (wo, at_75)]
    assert np.concatenate(seen) == pytest.approx(REFLECTANCE[name], abs=2e-5)

"""Microfacet, rough matte and metal models against published numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import BSDFS_ALL as ALL
from inside import Facets, OpenPBRBsdf, check_bsdf
from near import assert_near
from significance import render

import wavefront as wf

F4 = np.float32
LAST = np.nextafter(F4(1), F4(0))


def toward(mu, n=1):
    """wo (3, n) of cosine mu."""
    return np.repeat(np.array([[np.sqrt(1 - mu * mu)], [0], [mu]], F4), n, 1)


def stratified(rows, side=512, seed=0):
    """Jittered u (rows, side²): two rows on a grid, the others shuffled."""
    rng = np.random.default_rng(seed)
    n = side * side
    k = np.arange(n)
    grid = [(k % side + rng.random(n)) / side, (k // side + rng.random(n)) / side]
    other = [(rng.permutation(n) + rng.random(n)) / n for _ in range(rows - 2)]
    return np.minimum(np.array(grid + other, F4), LAST)


def upper_hemisphere(side):
    """Directions (3, side²) at the midpoints of equal solid angles; each stands for 2π/side²."""
    z, phi = np.meshgrid((np.arange(side) + 0.5) / side, 2 * np.pi * (np.arange(side) + 0.5) / side)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z]).reshape(3, -1).astype(F4)


def albedo(bsdf, mu, back_facing=False):
    """Part of the energy that leaves again."""
    if back_facing:
        bsdf.eta = 1 / bsdf.ior
    u = stratified(bsdf.dimensions)
    sample = bsdf.sample_f(toward(mu, u.shape[1]), u)
    energy = sample.weight[0].astype(float)
    return (energy if sample.eta is None else energy * sample.eta.astype(float) ** 2).mean()


GGX = {
    (0.1, 1): 0.988304,
    (0.5, 1): 0.687849,
    (1, 1): 0.306853,
    (0.1, 0.5): 0.969205,
    (0.5, 0.5): 0.698251,
    (1, 0.5): 0.450694,
    (0.1, 0.1): 0.883455,
    (0.5, 0.1): 0.860105,
    (1, 0.1): 0.760210,
}


@pytest.mark.parametrize(("alpha", "mu"), GGX)
def test_ggx_directional_albedo(alpha, mu):
    perfect = wf.Conductor(1e-6, 1e4, np.sqrt(alpha), multiscatter=False)  # reflects all at every angle
    assert albedo(perfect, mu) == pytest.approx(GGX[alpha, mu], abs=5e-5)


@given(
    alpha=st.floats(float(F4(1e-3)), 1, width=32),
    mu=st.floats(float(F4(1e-4)), 1, width=32),
    u=st.tuples(st.floats(0, float(LAST), width=32), st.floats(0, float(LAST), width=32)),
)
def test_visible_normals_are_visible(alpha, mu, u):
    wo = toward(mu)
    m = Facets(F4(alpha)).visible_normals(wo, np.array(u, F4).reshape(2, 1))
    assert np.isfinite(m).all()
    assert np.linalg.norm(m.astype(float)) == pytest.approx(1, abs=1e-6)
    assert m[2] >= 0
    assert (wo * m).sum() >= -1e-6


@given(alpha=st.floats(1e-3, 1), mu=st.floats(1e-3, 1), nu=st.floats(1e-3, 1), phi=st.floats(0, 7))
def test_mirror_lobe_is_reciprocal_and_finite(alpha, mu, nu, phi):
    wo = toward(mu)
    r = np.sqrt(1 - nu * nu)
    wi = np.array([[r * np.cos(phi)], [r * np.sin(phi)], [nu]], F4)
    forth, pdf, cos = Facets(F4(alpha)).mirror_lobe(wo, wi)
    back, _, _ = Facets(F4(alpha)).mirror_lobe(wi, wo)
    assert forth == pytest.approx(back, rel=1e-5)
    assert np.isfinite(forth).all()
    assert np.isfinite(pdf).all()
    assert 0 <= cos[0] <= 1


@given(ior=st.floats(0.4, 3), roughness=st.floats(0, 1), mu=st.floats(1e-5, 1), back_facing=st.booleans())
def test_dielectric_samples_keep_their_promises(ior, roughness, mu, back_facing):
    glass = wf.Dielectric(ior, roughness, multiscatter=False)
    glass.eta = 1 / glass.ior if back_facing else glass.ior
    rng = np.random.default_rng(0)
    wo = toward(mu, 200)
    sample = glass.sample_f(wo, rng.random((3, 200), dtype=F4))
    assert np.isfinite(sample.weight).all()
    energy = sample.weight * sample.eta**2
    assert (energy <= 1 + 2e-3).all()
    assert (np.abs(np.linalg.norm(sample.wi.astype(float), axis=0) - 1) < 2e-6).all()


@pytest.mark.parametrize(
    ("roughness", "outside", "back_facing"),
    [
        (0.0, 0, 0),
        (0.1**0.5, 0.0012, 0.0110),
        (0.5, 0.0080, 0.0708),
        (0.5**0.5, 0.0320, 0.2461),
        (1.0, 0.1066, 0.5829),
    ],
)
def test_rough_glass_loses_what_its_documentation_says(roughness, outside, back_facing):
    assert 1 - albedo(wf.Dielectric(1.5, roughness, multiscatter=False), 1.0) == pytest.approx(
        outside, abs=3e-4
    )
    assert 1 - albedo(
        wf.Dielectric(1.5, roughness, multiscatter=False), 1.0, back_facing=True
    ) == pytest.approx(back_facing, abs=1e-3)


@pytest.mark.parametrize(
    ("roughness", "loss"),
    [(0.1, 0.0006), (0.1**0.5, 0.0400), (0.5, 0.1831), (0.5**0.5, 0.4104), (1.0, 0.6522)],
)
def test_a_ball_of_rough_glass_loses_what_its_documentation_says(roughness, loss):
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.5, roughness, multiscatter=False))
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=1.8, size=(24, 24))
    scene = wf.Scene(ball, [wf.Environment(1.0)], camera)
    y, x = np.mgrid[:24, :24] - 11.5
    within = np.hypot(x, y) < 12  # nine tenths of its radius
    seen = render(scene, 32, integrator="naive", max_bounces=200).rgb[within].mean(dtype=float)
    assert 1 - seen == pytest.approx(loss, abs=5e-3 if roughness > 0.1 else 5e-4)


def test_rough_glass_becomes_smooth_glass():
    rough, smooth = wf.Dielectric(1.5, 0.032), wf.Dielectric(1.5)
    u = stratified(3, 64)
    for mu in (1, 0.5, 0.1):
        wo = toward(mu, u.shape[1])
        a, b = rough.sample_f(wo, u), smooth.sample_f(wo, u)
        up = a.wi[2] > 0
        assert up.mean() == pytest.approx((b.wi[2] > 0).mean(), abs=5e-3)
        assert a.wi[:, up].mean(1) == pytest.approx(b.wi[:, b.wi[2] > 0].mean(1), abs=5e-3)
        assert a.wi[:, ~up].mean(1) == pytest.approx(b.wi[:, b.wi[2] < 0].mean(1), abs=5e-3)


@pytest.mark.parametrize(("angle", "value"), [(0, 0.784483), (45, 0.851128), (75, 0.918104)])
def test_oren_nayar_albedo(angle, value):
    wi = upper_hemisphere(700)
    wo = np.repeat(toward(np.cos(np.radians(angle))), wi.shape[1], 1)
    f = wf.OrenNayar(1.0, 0.5).f(wo, wi)[0].astype(float)
    assert (f * wi[2]).mean() * 2 * np.pi == pytest.approx(value, abs=2e-5)


@pytest.mark.parametrize("mu", [1.0, 0.5, 0.05, 1e-3])
@pytest.mark.parametrize("sigma", [0.1, 0.5, 1.0])
def test_eon_preserves_energy_at_every_angle(sigma, mu):
    wi = upper_hemisphere(700)
    wo = np.repeat(toward(mu), wi.shape[1], 1)
    f = wf.OrenNayar(1.0, sigma, energy_preserving=True).f(wo, wi)[0].astype(float)
    assert (f * wi[2]).mean() * 2 * np.pi == pytest.approx(1, abs=1e-4)


def test_sigma_0_is_diffuse():
    wi = upper_hemisphere(50)
    wo = np.repeat(toward(0.3), wi.shape[1], 1)
    for preserving in (False, True):
        lambertian = wf.OrenNayar(0.7, 0.0, energy_preserving=preserving)
        assert lambertian.f(wo, wi) == pytest.approx(wf.Diffuse(0.7).f(wo, wi), rel=1e-5)


def appendix_b(base_color, metallic, roughness, wo, wi):
    """The BRDF of the glTF 2.0 specification, appendix B, in float64, above the surface."""
    v, l = wo.astype(float), wi.astype(float)
    h = v + l
    h /= np.linalg.norm(h, axis=0)
    a2 = roughness**4
    d = a2 / (np.pi * (h[2] ** 2 * (a2 - 1) + 1) ** 2)
    root_v, root_l = (np.sqrt(a2 + (1 - a2) * w[2] ** 2) for w in (v, l))
    specular = d * 0.5 / (v[2] * root_l + l[2] * root_v)
    away = (1 - np.abs((v * h).sum(0))) ** 5
    color = np.array(base_color, float).reshape(3, 1)
    fresnel = 0.04 + 0.96 * away
    dielectric = (1 - fresnel) * color / np.pi + fresnel * specular
    metal = (color + (1 - color) * away) * specular
    return (1 - metallic) * dielectric + metallic * metal


@pytest.mark.parametrize("metallic", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_principled_holds_the_gltf_material(metallic, roughness):
    rng = np.random.default_rng(3)
    wo, wi = rng.normal(size=(2, 3, 1000)).astype(F4)
    wo[2], wi[2] = np.abs(wo[2]), np.abs(wi[2])
    wo, wi = (w / np.linalg.norm(w, axis=0) for w in (wo, wi))
    exact = appendix_b((0.9, 0.5, 0.1), metallic, roughness, wo, wi)
    literal = wf.Principled((0.9, 0.5, 0.1), metallic, roughness, conserve_energy=False).f(wo, wi)
    assert_near(literal, exact, rel=1e-4)
    if metallic == 1:
        assert_near(
            wf.Principled((0.9, 0.5, 0.1), 1, roughness, multiscatter=False).f(wo, wi), exact, rel=1e-4
        )


@pytest.mark.parametrize("mu", [1.0, 0.5, 0.1, 0.02])
@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_white_plastic_reflects_all_light(roughness, mu):
    assert albedo(wf.Principled(1.0, 0, roughness), mu) == pytest.approx(1, abs=4e-3)


def test_parts_of_principled_agree_with_the_materials_of_their_own():
    rng = np.random.default_rng(4)
    wo, wi = rng.normal(size=(2, 3, 5000)).astype(F4)
    wo[2] = np.abs(wo[2])
    wo, wi = (w / np.linalg.norm(w, axis=0) for w in (wo, wi))
    for whole, part in (
        (
            wf.Principled((1, 0.5, 0.2), 0, 0.5, 1.4, 1.0),
            wf.Dielectric(1.4, 0.5, transmittance=(1, 0.5, 0.2)),
        ),
        (
            wf.Principled((1, 0.5, 0.2), 0, 0.5, 1.4, 1.0, thin=True),
            wf.ThinDielectric(1.4, 0.5, transmittance=(1, 0.5, 0.2)),
        ),
        (wf.Principled(0.3, 0, 0.5, specular=0.0), wf.Diffuse(0.3)),
    ):
        for ours, theirs in zip(whole.evaluate(wo, wi), part.evaluate(wo, wi), strict=True):
            assert_near(ours, theirs, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("back_facing", [False, True])
@pytest.mark.parametrize(("ior", "alpha"), [(1.0232, 1.03e-3), (0.9736, 7.3e-3), (0.7047, 1.03e-3)])
def test_the_narrowest_densities_of_glass_are_whole(ior, alpha, back_facing):
    """The lobe of refraction is as narrow as α·|ior − 1|; one integral along the normal resolves it."""
    edges = np.concatenate([[0], np.geomspace(1e-9, np.pi / 2 - 1e-6, 400_001)])
    theta = (edges[1:] + edges[:-1]) / 2
    solid_angle = 4 * np.pi * np.sin(theta) * np.sin(np.diff(edges) / 2)
    glass, wo = wf.Dielectric(ior, np.sqrt(alpha)), toward(1.0, len(theta))
    glass.eta = 1 / glass.ior if back_facing else glass.ior
    total = 0.0
    for side in (1, -1):
        wi = np.stack([np.sin(theta), 0 * theta, side * np.cos(theta)]).astype(F4)
        total += (glass.pdf(wo, wi) * solid_angle).sum()
    assert total == pytest.approx(1, abs=1e-5)


def color(rng):
    return rng.random(3)


def index(rng):
    """An ior that is not near 1: there the lobe is too narrow for the checker's quadrature (see above)."""
    return rng.choice([rng.uniform(0.5, 0.9), rng.uniform(1.1, 2.5)])


def facets(rng, roughness):
    """What else facets may have; two roughnesses where the checker's quadrature resolves both."""
    return {
        "distribution": str(rng.choice(["ggx", "beckmann"])),
        "shadowing": str(rng.choice(["correlated", "separable"])),
        "roughness_v": rng.choice([None, rng.uniform(0.1, 1)]) if roughness > 0.1 else None,
        "rotation": rng.uniform(0, 360),
    }


# 0.05, as the checker's own quadrature is off by up to 0.04 % for glass of 0.032, along the normal, where
# an integral of one dimension finds the density whole (above).
ROUGHNESS = [0.0, 1e-3, 0.05, None, 1.0]
# One material of each kind with random parameters, of a given roughness where it has one.
RANDOM = {
    wf.Diffuse: lambda rng, roughness: wf.Diffuse(color(rng)),
    wf.Mirror: lambda rng, roughness: wf.Mirror(color(rng)),
    wf.Conductor: lambda rng, roughness: wf.Conductor(
        rng.uniform(0.1, 3, 3),
        rng.uniform(0, 6, 3),
        roughness,
        reflectance=color(rng),
        **facets(rng, roughness),
    ),
    wf.Dielectric: lambda rng, roughness: wf.Dielectric(
        index(rng), roughness, reflectance=color(rng), transmittance=color(rng), **facets(rng, roughness)
    ),
    wf.Plastic: lambda rng, roughness: wf.Plastic(
        color(rng),
        roughness,
        rng.uniform(1.1, 2.5),
        specular_reflectance=color(rng),
        nonlinear=rng.random() < 0.5,
        distribution=rng.choice(["ggx", "beckmann"]),
        multiscatter=rng.random() < 0.5,
    ),
    wf.ThinDielectric: lambda rng, roughness: wf.ThinDielectric(
        index(rng), roughness, reflectance=color(rng), transmittance=color(rng)
    ),
    wf.OrenNayar: lambda rng, roughness: wf.OrenNayar(
        color(rng), roughness, energy_preserving=rng.random() < 0.5
    ),
    wf.Principled: lambda rng, roughness: wf.Principled(
        color(rng),
        rng.choice([0, 1, rng.random()]),
        roughness,
        index(rng),
        rng.choice([0, 1, rng.random()]),
        thin=rng.random() < 0.3,
        clearcoat=rng.choice([0, rng.random()]),
        clearcoat_roughness=rng.choice([roughness, rng.random()]),
        sheen=rng.choice([0, rng.random()]),
        sheen_color=color(rng),
        sheen_roughness=rng.choice([roughness, rng.random()]),
        specular=rng.random(),
        specular_color=4 * color(rng),
    ),
    wf.Mix: lambda rng, roughness: wf.Mix(
        RANDOM[rng.choice([wf.Diffuse, wf.Mirror, wf.Conductor])](rng, roughness),
        RANDOM[rng.choice([wf.Dielectric, wf.ThinDielectric, wf.OrenNayar, wf.Principled])](rng, roughness),
        rng.random(),
    ),
}


RANDOM[wf.Disney] = lambda rng, roughness: wf.Disney(
    0.3 * color(rng),  # it may reflect more light than arrives
    roughness,
    rng.choice([0, rng.random()]),
    anisotropic=rng.choice([0, rng.random()]) if roughness > 0.1 else 0,
    ior=rng.uniform(1.1, 2),
    transmission=rng.choice([0, rng.random()]),
    specular_tint=0.3 * rng.random(),
    flatness=rng.random(),
    clearcoat=rng.choice([0, rng.random()]),
    clearcoat_gloss=0.5 * rng.random(),
)
RANDOM[OpenPBRBsdf] = lambda rng, roughness: OpenPBRBsdf(
    base_weight=rng.random(),
    base_color=color(rng),
    base_diffuse_roughness=rng.choice([0, rng.random()]),
    base_metalness=rng.choice([0, 1, rng.random()]),
    specular_weight=rng.choice([1, rng.random()]),
    specular_color=color(rng),
    specular_roughness=roughness,
    specular_ior=index(rng),
    transmission_weight=rng.choice([0, 1, rng.random()]),
    transmission_color=color(rng),
    geometry_thin_walled=rng.random() < 0.3,
    coat_weight=rng.choice([0, rng.random()]),
    coat_color=color(rng),
    coat_roughness=rng.choice([roughness, rng.random()]),
    coat_ior=rng.uniform(1, 2),
    fuzz_weight=rng.choice([0, rng.random()]),
    fuzz_color=color(rng),
    fuzz_roughness=rng.choice([roughness, rng.random()]),
    thin_film_weight=rng.choice([0, 0, rng.random()]),
)
RANDOM[wf.ThinDisney] = lambda rng, roughness: wf.ThinDisney(
    0.5 * color(rng),  # it may reflect more light than arrives
    roughness,
    anisotropic=rng.choice([0, rng.random()]) if roughness > 0.1 else 0,
    ior=rng.uniform(1.1, 2),
    transmission=rng.choice([0, rng.random()]),
    diffuse_transmission=rng.choice([0, 2 * rng.random()]),
    specular_tint=0.3 * rng.random(),
    flatness=rng.random(),
)
RANDOM[wf.DiffuseTransmission] = lambda rng, roughness: wf.DiffuseTransmission(
    0.5 * color(rng), 0.5 * color(rng)
)
RANDOM[wf.Sides] = lambda rng, roughness: wf.Sides(
    RANDOM[rng.choice([wf.Diffuse, wf.Mirror, wf.Conductor])](rng, roughness),
    rng.choice([None, RANDOM[rng.choice([wf.OrenNayar, wf.Plastic])](rng, roughness)]),
)
# with the roughnesses of each; None is a random one, and the others have none
KINDS = [
    (kind, r)
    for kind in ALL
    for r in ([None] if kind in (wf.Diffuse, wf.DiffuseTransmission, wf.Mirror) else ROUGHNESS)
]


def test_every_material_has_random_parameters():
    assert set(RANDOM) == set(ALL)


def check_random(kind, roughness, seed, samples):
    rng = np.random.default_rng(seed)
    bsdf = RANDOM[kind](rng, rng.random() if roughness is None else roughness)
    # Light that crosses at 89.5° leaves so near the critical angle that float32 keeps few digits of
    # its cosine: 1 in 100 pairs of directions would differ by 0.4 % in reciprocity, where 0.3 % may.
    grazing = 89.0 if bsdf.transmissive else 89.5
    angles = 0.0, float(rng.uniform(0, 89)), grazing
    reciprocal = kind is not wf.ThinDisney and not getattr(bsdf, "fuzz_weight", 0)
    # Disney's coat adds up to a quarter of the light to what the base reflects.
    most = 1.25 if kind is wf.Disney else 1.0
    check_bsdf(bsdf, angles=angles, seed=seed, samples=samples, reciprocal=reciprocal, albedo=(0.0, most))


@pytest.mark.parametrize(("kind", "roughness"), [(k, r) for k, r in KINDS if r in (None, 1e-3)])
@pytest.mark.first(2)
def test_random_parameters(kind, roughness):
    """χ², reciprocity and energy, at grazing angles too; roughness None is a random one."""
    check_random(kind, roughness, 0, 25_000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("kind", "roughness"), KINDS)
def test_many_random_parameters(kind, roughness, seed):
    check_random(kind, roughness, seed, 500_000)

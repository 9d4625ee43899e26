"""OpenPBR by the equations of its specification."""

import numpy as np
import pytest
from inside import (
    OpenPBRBsdf,
    OrenNayar,
    SceneError,
    dielectric_albedo,
    film_reflectance,
    fresnel_conductor,
    fresnel_dielectric,
    fuzz_albedo,
    fuzz_lobe,
    weighted_index,
)
from test_bsdfs import surface

import wavefront as wf

F4 = np.float32
ANGLES = np.radians([0, 30, 60, 80])


def pair(wo_z: float, wi_z: float, turn: float = np.pi) -> tuple[np.ndarray, np.ndarray]:
    """Directions (3, 1) of cosines."""

    def at(z: float, turn: float) -> np.ndarray:
        r = np.sqrt(1 - z * z)
        return np.array([[r * np.cos(turn)], [r * np.sin(turn)], [z]], F4)

    return at(wo_z, 0), at(wi_z, turn)


def facet_cosine(wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """Of wo and the facet that mirrors it to wi, which is turned to the upper side."""
    half = wo + wi * np.array([[1], [1], [-1]]) * np.sign(-wi[2])
    return np.linalg.norm(half, axis=0) / 2


def mean_fresnel(ior: float) -> float:
    mu = (np.arange(2000) + 0.5) / 2000
    return float((2 * mu * fresnel_dielectric(mu, np.array([ior]))[0]).mean())


def test_a_metal_is_tinted_at_82_degrees():
    tint, f0 = np.array([[0.9], [0.5], [0.2]]), np.array([[0.8], [0.4], [0.3]])
    metal = {"base_metalness": 1.0, "base_color": f0, "specular_roughness": 0.4, "multiscatter": False}
    wo, wi = pair(1 / 7, 1 / 7)
    plain, tinted = OpenPBRBsdf(**metal), OpenPBRBsdf(**metal, specular_color=tint)
    assert tinted.f(wo, wi) / plain.f(wo, wi) == pytest.approx(tint, rel=1e-5)
    up, also = pair(1, 1)
    assert tinted.f(up, also) == pytest.approx(plain.f(up, also), rel=1e-5)
    for z in (1.0, 0.5):
        lobe = OpenPBRBsdf(**{**metal, "base_color": 1.0}).f(*pair(z, z))
        schlick = f0 + (1 - f0) * (1 - z) ** 5
        assert plain.f(*pair(z, z)) / lobe == pytest.approx(schlick, rel=1e-5)
    for weight, part in ((0.3, 0.3), (2.0, 1.0)):  # more than all is all
        weighted = OpenPBRBsdf(**metal, specular_weight=weight)
        assert weighted.f(wo, wi) == pytest.approx(part * plain.f(wo, wi), rel=1e-5)


def test_the_weight_scales_the_reflectance_along_the_normal():
    for ior in (0.7, 1.2, 1.5, 2.4):
        for weight in (0.0, 0.3, 1.0, 2.0):
            bent = weighted_index(np.full(1, ior, F4), np.full(1, weight, F4))
            expected = weight * ((ior - 1) / (ior + 1)) ** 2
            assert ((bent - 1) / (bent + 1)) ** 2 == pytest.approx(expected, rel=1e-4, abs=1e-9)
            assert (bent >= 1) == (ior >= 1 or weight == 0)
    for ior, most in ((1.5, 1999), (1 / 1.5, 1 / 1999)):  # of reflectances as near to 1 as float32 resolves
        assert weighted_index(np.full(1, ior, F4), np.full(1, 1e6, F4)) == pytest.approx(most, rel=1e-3)


def test_the_diffuse_base_is_eon():
    color = np.array([[0.9], [0.5], [0.2]])
    wo, wi = pair(0.6, 0.4, 0.3)
    bare = {"base_color": color, "specular_weight": 0.0}
    for weight in (1.0, 0.4):
        f = OpenPBRBsdf(**bare, base_weight=weight, base_diffuse_roughness=0.7).f(wo, wi)
        assert f == pytest.approx(OrenNayar(weight * color, 0.7, energy_preserving=True).f(wo, wi), rel=2e-4)
    assert OpenPBRBsdf(**bare).f(wo, wi) == pytest.approx(color / np.pi, rel=2e-4)
    below = OpenPBRBsdf(**bare, subsurface_weight=0.25, subsurface_color=(0.1, 0.2, 0.3)).f(wo, wi)
    mixed = 0.75 * color + 0.25 * np.array([[0.1], [0.2], [0.3]])
    assert below == pytest.approx(mixed / np.pi, rel=2e-4)


@pytest.mark.parametrize("ior", [1.02, 1.5, 2.5])
@pytest.mark.parametrize("roughness", [0.0, 0.5, 1.0])
def test_a_white_base_reflects_all_light(ior, roughness):
    bsdf = OpenPBRBsdf(base_color=1.0, specular_ior=ior, specular_roughness=roughness)
    u = np.random.default_rng(0).random((3, 40_000), dtype=F4)
    for angle in ANGLES:
        wo = np.repeat(pair(np.cos(angle), 1)[0], u.shape[1], 1)
        assert bsdf.sample_f(wo, u).weight.mean() == pytest.approx(1, abs=0.01)


def test_anisotropy_keeps_the_mean_square_of_alpha():
    for r, a in ((0.3, 0.0), (0.5, 0.6), (0.8, 0.95)):
        facets = OpenPBRBsdf(specular_roughness=r, specular_roughness_anisotropy=a).layers().base.facets()
        across = facets.alpha if facets.alpha_v is None else facets.alpha_v
        assert across / facets.alpha == pytest.approx(1 - a, rel=1e-5)
        assert (across**2 + facets.alpha**2) / 2 == pytest.approx(r**4, rel=1e-5)


def test_a_rough_coat_makes_the_base_rougher():
    base = OpenPBRBsdf(specular_roughness=0.3, coat_roughness=0.4, coat_weight=0.5).layers().base
    assert base.roughness == pytest.approx(0.5 * (0.3 + (0.3**4 + 2 * 0.4**4) ** 0.25), rel=1e-5)
    most = OpenPBRBsdf(specular_roughness=0.3, coat_roughness=1.0, coat_weight=1.0).layers().base
    assert most.roughness == pytest.approx(1)


def test_layers_of_a_coat():
    """The base under a coat, less the coat's own reflection: its losses, color and darkening."""
    tint = np.array([[0.9], [0.5], [0.2]])
    zo, zi, ior = 0.6, 0.8, 1.6
    wo, wi = pair(zo, zi, 0.4)
    coated = {"specular_weight": 0.0, "coat_weight": 1.0, "coat_roughness": 0.5, "coat_ior": ior}
    gloss = OpenPBRBsdf(base_color=0.0, **coated).f(wo, wi)

    def base(**given) -> np.ndarray:
        return (OpenPBRBsdf(**coated, **given).f(wo, wi) - gloss) * np.pi

    lost = max(float(dielectric_albedo(F4([ior]), F4([0.5]), F4([z]))[0]) for z in (zo, zi))
    assert base(base_color=0.5, coat_darkening=0.0) == pytest.approx(0.5 * (1 - lost), rel=1e-3)
    lengths = [1 / np.sqrt(1 - (1 - z * z) / ior**2) for z in (zo, zi)]
    colored = base(base_color=0.5, coat_darkening=0.0, coat_color=tint)
    assert colored == pytest.approx(0.5 * (1 - lost) * tint ** (sum(lengths) / 2), rel=1e-3)
    back = 1 - (1 - mean_fresnel(ior)) / ior**2
    dark = 0.5 * (1 - lost) * (1 - back) / (1 - 0.5 * back)
    assert base(base_color=0.5) == pytest.approx(dark, rel=3e-3)
    assert base(base_color=1.0) == pytest.approx(1 - lost, rel=1e-3)  # a white base has nothing to darken
    half = base(base_color=0.5, coat_darkening=0.5)
    assert half == pytest.approx((dark + 0.5 * (1 - lost)) / 2, rel=3e-3)


def test_light_that_crosses_passes_a_coat_once():
    tint, z = np.array([[0.9], [0.5], [0.2]]), 0.8
    given = {"transmission_weight": 1.0, "specular_roughness": 0.4, "coat_weight": 1.0, "coat_darkening": 0.0}
    wo, wi = pair(z, -z, 3)
    plain, tinted = (OpenPBRBsdf(**given, coat_color=c).f(wo, wi) for c in (1.0, tint))
    assert tinted / plain == pytest.approx(tint ** (0.5 / np.sqrt(1 - (1 - z * z) / 1.6**2)), rel=1e-4)


def test_the_thickness_of_a_film_is_in_micrometers():
    """The base below gets and returns what the film lets pass, as in `Principled`."""
    given = {"thin_film_weight": 1.0, "thin_film_thickness": 0.4, "specular_ior": 1.8}
    given["specular_roughness"] = 0.1  # so that facets reflect as the surface does

    def film(z):
        return film_reflectance(F4(z), F4([400]), F4([1.4]), F4(1), F4([1.8]))

    base = OpenPBRBsdf(**given, base_color=0.5).layers().base
    assert base.gloss.reflectance(F4([0.7])) == pytest.approx(film([0.7]), rel=1e-3)
    wo, wi = pair(0.7, 0.4, 0.3)
    white, black = (OpenPBRBsdf(**given, base_color=color).f(wo, wi) for color in (1.0, 0.0))
    z = (np.arange(1000) + 0.5) / 1000
    mean = 2 * ((1 - film(z)) * z).mean(1, keepdims=True)
    assert white - black == pytest.approx((1 - film([0.7])) * (1 - film([0.4])) / mean / np.pi, rel=0.01)


@pytest.mark.parametrize("edge", [0.0, 0.4, 1.0])
def test_a_metal_below_a_film_has_an_index(edge):
    """With F0 along the normal, and from the index with no extinction to the least one by its tint."""
    f0 = np.array([[0.9], [0.5], [0.2]])
    metal = {"base_metalness": 1.0, "base_color": f0, "specular_color": edge, "thin_film_weight": 1.0}
    root = np.sqrt(f0)
    eta = (1 - edge) * (1 + root) / (1 - root) + edge * (1 - f0) / (1 + f0)
    k = np.sqrt((f0 * (eta + 1) ** 2 - (eta - 1) ** 2) / (1 - f0))
    cos = F4([0.2, 0.7, 1])
    assert fresnel_conductor(F4([1]), eta, k) == pytest.approx(f0, rel=1e-5)
    film = film_reflectance(cos, F4([350]), F4([1.4]), F4(1), eta.astype(F4), k.astype(F4))
    base = OpenPBRBsdf(**metal, thin_film_thickness=0.35).layers().base
    assert base.metal.reflectance(cos) == pytest.approx(film, rel=1e-3)


@pytest.mark.parametrize(("metal", "clear"), [(0.0, 0.0), (0.3, 0.4), (1.0, 0.0)])
@pytest.mark.parametrize("roughness", [0.2, 0.9])
def test_darkening_by_a_coat(metal: float, clear: float, roughness: float):
    """Δ = (1 − K)/(1 − E·K): K is between the means of F outside and inside by how diffuse the base is."""
    f0, coat = 0.6, 1.7
    wo, wi = pair(0.8, 0.5, 0.3)
    dark, bright = (
        OpenPBRBsdf(
            base_color=f0,
            base_metalness=metal,
            transmission_weight=clear,
            specular_roughness=roughness,
            coat_weight=1.0,
            coat_ior=coat,
            coat_darkening=darkening,
            multiscatter=False,
        ).f(wo, wi)
        for darkening in (1.0, 0.0)
    )
    outside, below = mean_fresnel(coat), mean_fresnel(coat / 1.5)
    inside = 1 - (1 - outside) / coat**2
    gloss = below + (1 - below) * metal
    back = outside + (inside - outside) * (1 - gloss + roughness * gloss)
    base = (1 - clear) * (f0 + (1 - f0) * below) + clear
    albedo = (1 - metal) * base + metal * (f0 + (1 - f0) / 21)  # Schlick's mean
    assert dark / bright == pytest.approx(np.full((3, 1), (1 - back) / (1 - albedo * back)), rel=2e-3)


@pytest.mark.parametrize("ior", [1.2, 1.8])
def test_a_coat_reflects_by_its_index(ior: float):
    wo, wi = pair(0.7, 0.7)
    bare = {"base_color": 0.0, "specular_weight": 0.0, "coat_roughness": 0.3, "coat_weight": 0.5}
    metal = {"base_metalness": 1.0, "base_color": 1.0, "specular_roughness": 0.3, "multiscatter": False}
    lobe = OpenPBRBsdf(**metal).f(wo, wi) / (1 + 0 * wo)
    reflected = fresnel_dielectric(F4([0.7]), F4([ior]))[0]
    assert OpenPBRBsdf(**bare, coat_ior=ior).f(wo, wi) == pytest.approx(0.5 * reflected * lobe, rel=1e-4)


def test_the_gloss_below_a_coat_is_relative_to_its_index():
    for ior, other in ((1.6 * 1.3, 1.3), (1.6 / 1.3, 1.3)):  # a denser coat reflects nothing totally
        base = OpenPBRBsdf(specular_ior=ior, coat_weight=1.0).layers().base
        expected = fresnel_dielectric(F4([0.7]), F4([other]))[0]
        assert base.gloss.reflectance(F4([0.7]))[0] == pytest.approx(expected, rel=1e-4)


def test_fuzz_lies_above_all():
    zo, zi = 0.4, 0.8
    wo, wi = pair(zo, zi, 0.4)
    color = np.array([[0.9], [0.5], [0.2]])
    f = OpenPBRBsdf(
        base_color=0.5, specular_weight=0.0, fuzz_weight=0.6, fuzz_color=color, fuzz_roughness=0.7
    ).f(wo, wi)
    lost = 0.6 * float(fuzz_albedo(F4([zo]), F4([0.7]))[0])
    expected = 0.5 / np.pi * (1 - lost) + 0.6 * color * fuzz_lobe(wo, wi, F4([0.7]))[0]
    assert f == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    "part", [{"base_metalness": 1.0}, {"transmission_weight": 1.0}, {"base_color": 0.0}], ids=str
)
def test_a_film_covers_a_part(part):
    wo, wi = pair(0.7, 0.7, 3)
    given = {"specular_roughness": 0.5, "multiscatter": False, "thin_film_thickness": 0.4, **part}
    none, half, full = (OpenPBRBsdf(**given, thin_film_weight=w).f(wo, wi) for w in (0.0, 0.5, 1.0))
    assert half == pytest.approx((none + full) / 2, rel=1e-4)
    assert not np.allclose(none, full, rtol=0.02)


def test_light_that_crosses_is_tinted():
    tint = np.array([[0.9], [0.5], [0.2]])
    for thin in (False, True):
        given = {"transmission_weight": 1.0, "specular_roughness": 0.4, "geometry_thin_walled": thin}
        wo, wi = pair(0.8, -0.8, 3)
        plain, tinted = (OpenPBRBsdf(**given, transmission_color=c).f(wo, wi) for c in (1.0, tint))
        assert (plain > 0).all()
        length = 1 / np.sqrt(1 - (1 - facet_cosine(wo, wi) ** 2) / 1.5**2) if thin else 1.0
        assert tinted == pytest.approx(tint**length * plain, rel=1e-4)


@pytest.mark.parametrize("thin", [False, True])
def test_a_clear_part_reflects_its_color_outside_alone(thin):
    tint = np.array([[0.9], [0.5], [0.2]])
    given = {"transmission_weight": 1.0, "specular_roughness": 0.6, "geometry_thin_walled": thin}
    for inside in (False, True):
        wo, wi = pair(0.6, 0.4, 0.3)
        plain, tinted = (
            OpenPBRBsdf(**given, specular_color=c).bind(surface(wo, inside)).f(wo, wi) for c in (1.0, tint)
        )
        assert tinted == pytest.approx(plain * (1.0 if inside and not thin else tint), rel=1e-4)
        down = wi * F4([[1], [1], [-1]])
        plain, tinted = (
            OpenPBRBsdf(**given, specular_color=c).bind(surface(wo, inside)).f(wo, down) for c in (1.0, tint)
        )
        assert tinted == pytest.approx(plain, rel=1e-5)


def test_light_that_crosses_is_that_of_the_clear_part():
    wo, wi = pair(0.8, -0.6, 3)
    whole, half = (
        OpenPBRBsdf(base_color=1.0, transmission_weight=w, specular_roughness=0.5, multiscatter=False).f(
            wo, wi
        )
        for w in (1.0, 0.5)
    )
    assert (whole > 0).all()
    assert half == pytest.approx(0.5 * whole, rel=1e-5)


def test_defaults_are_those_of_the_specification():
    specified = {
        "base_weight": 1, "base_color": 0.8, "base_metalness": 0, "base_diffuse_roughness": 0,
        "specular_weight": 1, "specular_color": 1, "specular_roughness": 0.3, "specular_ior": 1.5,
        "specular_roughness_anisotropy": 0, "transmission_weight": 0, "transmission_color": 1,
        "subsurface_weight": 0, "subsurface_color": 0.8, "coat_weight": 0, "coat_color": 1,
        "coat_roughness": 0, "coat_ior": 1.6, "coat_darkening": 1, "fuzz_weight": 0, "fuzz_color": 1,
        "fuzz_roughness": 0.5, "thin_film_weight": 0, "thin_film_thickness": 0.5, "thin_film_ior": 1.4,
    }  # fmt: skip
    found = vars(OpenPBRBsdf())
    assert {name: float(F4(value)) for name, value in specified.items()} == {
        name: float(found[name].max()) for name in specified
    }


@pytest.mark.parametrize(
    ("name", "allowed", "refused"),
    [
        ("specular_weight", 0, -0.01),
        ("coat_ior", 1, 0.99),
        ("coat_ior", 1e6, 1.01e6),
        ("thin_film_thickness", 0, -0.01),
        ("thin_film_thickness", 100, 100.5),
    ],
)
def test_parameters_out_of_range_are_refused(name: str, allowed: float, refused: float):
    assert vars(OpenPBRBsdf(**{name: allowed}))[name] == F4(allowed)
    with pytest.raises(SceneError, match=f"OpenPBRBsdf {name}"):
        OpenPBRBsdf(**{name: refused})


def test_unknown_parameters_are_refused():
    with pytest.raises(TypeError, match="coat_wight"):
        OpenPBRBsdf(coat_wight=1)


def test_a_film_lies_on_what_varies():
    """The index below it is one for each point, by a texture or by what is around."""
    shades = wf.Texture(np.linspace(0.2, 1, 64).reshape(8, 8))
    sphere = wf.Sphere((0, 0, 0), 1, material=wf.OpenPBR(specular_weight=shades, thin_film_weight=1.0))
    image = wf.render([sphere, wf.Environment(1)], spp=1, size=(12, 12), progress=False)
    assert np.isfinite(image.rgb).all()
    plain = wf.OpenPBR(specular_weight=0.6, thin_film_weight=1.0)
    constant = wf.Texture(np.full((2, 2), 0.6))
    one, two = (
        wf.render(
            [wf.Sphere((0, 0, 0), 1, material=each), wf.Environment(1)], spp=2, size=(12, 12), progress=False
        )
        for each in (plain, wf.OpenPBR(specular_weight=constant, thin_film_weight=1.0))
    )
    np.testing.assert_allclose(one.rgb, two.rgb, rtol=2e-3)

"""Every material under the one contract: what is in `bsdfs.ALL` is checked here."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from inside import (
    BaseTexture,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Disney,
    Mirror,
    Mix,
    OpenPBRBsdf,
    OrenNayar,
    Plastic,
    Principled,
    SceneError,
    Sides,
    SurfaceInteraction,
    ThinDielectric,
    ThinDisney,
)
from near import assert_near

from wavefront import bsdfs, testing

F4 = np.float32

# Arguments for each material, in full and in the corners of its parameters.
EXAMPLES = {
    Diffuse: [{"reflectance": 0.5}, {"reflectance": (1, 0.5, 0)}],
    Mirror: [{}, {"reflectance": (0.9, 0.5, 0)}],
    Dielectric: [
        {},
        {"ior": 1.0},
        {"ior": 1 / 1.33},
        {"ior": 2.4, "reflectance": (1, 0.5, 0.2), "transmittance": (0.2, 0.9, 1)},
        {"roughness": 1e-3},
        {"roughness": 0.04},
        {"roughness": 0.5, "transmittance": (0.2, 0.9, 1)},
        {"ior": 1 / 1.33, "roughness": 1.0},
        {"ior": 1.0, "roughness": 0.5},
        {"roughness": 0.5, "distribution": "beckmann"},
        {"roughness": 0.3, "roughness_v": 0.7, "rotation": 30.0, "shadowing": "separable"},
        {"roughness": 0.8, "multiscatter": False},
    ],
    Conductor: [
        {"eta": 2, "k": 4},
        {"eta": (0.15, 0.4, 1.4), "k": (3.5, 2.4, 1.6), "roughness": 0.04},
        {"eta": 2.0, "k": 4.0, "roughness": 0.5},
        {"eta": 0.1, "k": 8.0, "roughness": 1.0},
        {"eta": 0.1, "k": 8.0, "roughness": 0.7, "distribution": "beckmann", "shadowing": "separable"},
        {"eta": 2.0, "k": 4.0, "roughness": 0.8, "roughness_v": 0.3, "rotation": -20.0},
        {"eta": 2.0, "k": 4.0, "roughness": 0.8, "multiscatter": False},
        {"eta": 2.0, "k": 4.0, "roughness": 0.3, "reflectance": (0.2, 0.5, 1.0)},
    ],
    OrenNayar: [
        {"reflectance": (1, 0.5, 0), "sigma": 0.5},
        {"reflectance": 0.7, "sigma": 0.0},
        {"reflectance": (1, 0.5, 0.1), "sigma": 1.0, "energy_preserving": True},
    ],
    Plastic: [
        {"reflectance": (0.9, 0.5, 0.1)},
        {"reflectance": 1.0, "roughness": 0.6, "nonlinear": True},
        {"roughness": 0.6, "ior": 2, "specular_reflectance": (1, 0.5, 0), "distribution": "beckmann"},
        {"reflectance": 0.0, "roughness": 0.2, "shadowing": "separable"},
    ],
    ThinDielectric: [{}, {"ior": 1.7, "roughness": 0.3, "transmittance": (1, 0.5, 0)}, {"roughness": 1.0}],
    Principled: [
        {},
        {"base_color": (0.9, 0.5, 0.1), "metallic": 1.0, "roughness": 0.3},
        {"base_color": 1.0, "roughness": 0.0},
        {"base_color": 0.0, "roughness": 1.0, "specular": 0.0},
        {"base_color": (1, 0.5, 0.2), "metallic": 0.2, "roughness": 0.3, "transmission": 0.6},
        {"base_color": (1, 0.5, 0.2), "transmission": 0.7, "thin": True, "ior": 1.3},
        {"base_color": 1.0, "roughness": 0.4, "transmission": 1.0, "ior": 1.0},
        {"base_color": 1.0, "clearcoat": 1.0, "clearcoat_roughness": 0.2},
        {"base_color": (0.2, 0.1, 0.8), "sheen": 1.0, "sheen_color": (1, 0.5, 0.5), "sheen_roughness": 0.1},
        {
            "base_color": (1, 0.5, 0.2),
            "metallic": 0.2,
            "transmission": 0.5,
            "clearcoat": 0.7,
            "sheen": 0.5,
            "specular": 0.5,
            "specular_color": (1, 0.9, 0.2),
        },
        {"base_color": 1.0, "roughness": 0.3, "roughness_v": 0.6, "clearcoat": 0.5, "transmission": 0.5},
    ],
    OpenPBRBsdf: [
        {},
        {"base_color": 1.0, "base_diffuse_roughness": 1.0, "specular_ior": 1.05, "subsurface_weight": 0.3},
        {"base_metalness": 1.0, "specular_color": (0.5, 0.9, 0.2), "specular_weight": 0.7},
        {"transmission_weight": 1.0, "transmission_color": (1, 0.5, 0.2), "specular_roughness": 0.5},
        {"transmission_weight": 0.6, "geometry_thin_walled": True, "specular_ior": 1.0},
        {"base_color": 1.0, "coat_weight": 0.8, "coat_color": (1, 0.5, 0), "coat_roughness": 0.3},
        {"fuzz_weight": 0.7, "fuzz_color": (1, 0.5, 0.2), "coat_weight": 1.0, "base_metalness": 0.5},
        {"thin_film_weight": 0.7, "base_metalness": 0.3, "transmission_weight": 0.4},
        {"specular_roughness_anisotropy": 0.6, "specular_weight": 2.0, "coat_weight": 0.5},
    ],
    Disney: [
        {"base_color": (0.3, 0.2, 0.1), "metallic": 0.3, "transmission": 0.6, "specular_tint": 0.5},
        {"base_color": 0.2, "roughness": 0.3, "anisotropic": 0.8, "clearcoat": 1.0, "clearcoat_gloss": 0.1},
        {"base_color": (0.3, 0.2, 0.1)},
        {"base_color": (0.3, 0.2, 0.1), "flatness": 0.7, "sheen": 0.1, "sheen_tint": 0.5, "roughness": 0.9},
    ],
    ThinDisney: [
        {"base_color": 0.3, "roughness": 0.4, "transmission": 0.6, "diffuse_transmission": 2, "ior": 1.3},
        {"base_color": 0.5, "transmission": 0.3, "diffuse_transmission": 0.4, "anisotropic": 0.6},
        {"base_color": 0.5, "diffuse_transmission": 1.4, "flatness": 0.7, "sheen": 0.1, "sheen_tint": 0.5},
        {"base_color": (0.9, 0.5, 0.1), "transmission": 1.0, "roughness": 0.7, "specular_tint": 0.5},
        {"base_color": (0.3, 0.2, 0.1)},
    ],
    DiffuseTransmission: [
        {"reflectance": (0.6, 0.3, 0.1), "transmittance": (0.1, 0.2, 0.4)},
        {"reflectance": 0.0, "transmittance": 0.7},
    ],
    Sides: [
        {"front": Diffuse((0.9, 0.5, 0.1))},
        {"front": Conductor(2, 4, 0.5), "back": Mirror(0.8)},
        {"front": Mirror(), "back": Conductor(2, 4)},
    ],
    Mix: [
        {"first": Diffuse(0.8), "second": Mirror(0.9), "weight": 0.3},
        {"first": Dielectric(1.5), "second": Diffuse((0.9, 0.5, 0.1)), "weight": 0.5},
        {"first": Mix(Diffuse(1.0), Conductor(2, 4, 0.3)), "second": Dielectric(1.5, 0.4), "weight": 0.7},
        {"first": Diffuse(0.8), "second": Mirror(0.9), "weight": 0.0},
        {"first": Mirror(0.8), "second": Mirror(0.8), "weight": 1.0},
    ],
}
# Materials that absorb nothing.
LOSSLESS = [
    Mirror(),
    Diffuse(1.0),
    Dielectric(),
    Dielectric(1 / 1.33),
    ThinDielectric(),
    Plastic(1.0),
    Plastic(1.0, ior=2.0, nonlinear=True),
    OrenNayar(1.0, 1.0, energy_preserving=True),
    OrenNayar(1.0, 0.2, energy_preserving=True),
    Mix(Mirror(), Dielectric(), 0.4),
]

CASES = [(kind, arguments) for kind, examples in EXAMPLES.items() for arguments in examples]
NAMES = [f"{kind.__name__}{number}" for number, (kind, _) in enumerate(CASES)]


class Constant(BaseTexture):
    """A texture of one value."""

    def __init__(self, value):
        self.value = value

    def at(self, surface):
        n = len(surface)
        if np.ndim(self.value) == 0:
            return np.full(n, self.value, F4)
        return np.repeat(np.array(self.value, F4).reshape(3, 1), n, 1)


def varying(bsdf, name, value):
    """A texture of a parameter's value, a color where the material keeps a color."""
    if not isinstance(value, float | tuple):
        return value
    is_color = getattr(getattr(bsdf, name, None), "ndim", 0) == 2
    return Constant(np.broadcast_to(value, 3) if is_color else value)


def surface(wo, back_facing=False):
    n = wo.shape[1]
    normal = np.repeat(np.array([[0], [0], [1]], F4), n, 1)
    zero, index = np.zeros(n, F4), np.zeros(n, np.intp)
    return SurfaceInteraction(
        np.zeros((3, n), F4), zero, normal, normal, wo, index, index, np.full(n, back_facing)
    )


def directions(n, seed=0, upper=True):
    v = np.random.default_rng(seed).normal(size=(3, n))
    v /= np.linalg.norm(v, axis=0)
    if upper:
        v[2] = np.abs(v[2])
    return v.astype(F4)


def uniforms(bsdf, n, seed=1):
    return np.random.default_rng(seed).random((bsdf.dimensions, n), dtype=F4)


def test_every_material_has_examples():
    assert set(EXAMPLES) == set(bsdfs.ALL)


def test_every_material_is_public():
    assert {kind.__name__ for kind in bsdfs.ALL} <= set(bsdfs.__all__)


def two_of_each_kind() -> Iterator[object]:
    """Yield all cases; the second of a kind at one angle, and slow with those after it at all."""
    seen: Counter[type] = Counter()
    every, slow = (0.0, 89.0), [pytest.mark.slow]
    for (kind, arguments), name in zip(CASES, NAMES, strict=True):
        seen[kind] += 1
        if seen[kind] == 2:
            yield pytest.param(kind, arguments, (60.0,), id=f"{name} at 60")
        yield pytest.param(kind, arguments, every, id=name, marks=slow if seen[kind] > 1 else [])


@pytest.mark.parametrize(("kind", "arguments", "angles"), list(two_of_each_kind()))
def test_contract(kind, arguments, angles):
    # the first as in Mitsuba, fuzz as in its paper
    reciprocal = kind is not ThinDisney and not arguments.get("fuzz_weight")
    testing.check_bsdf(kind(**arguments), samples=40_000, angles=angles, reciprocal=reciprocal)


@pytest.mark.parametrize("angles", [(60.0,), pytest.param((0.0, 89.0), marks=pytest.mark.slow)], ids=str)
@pytest.mark.parametrize("bsdf", LOSSLESS, ids=lambda b: type(b).__name__)
def test_nothing_is_lost(bsdf, angles):
    testing.check_bsdf(bsdf, samples=40_000, angles=angles, albedo=(1, 1))


def test_only_diffuse_is_matte():
    """Classes derived from it need not be."""

    class Glossy(Diffuse):
        pass

    assert [kind for kind, arguments in CASES if kind(**arguments).view_independent] == [Diffuse, Diffuse]
    assert not Glossy(0).view_independent
    assert not Glossy(0).black
    assert [Diffuse(reflectance).black for reflectance in (0, (0, 0, 0.1))] == [True, False]


@pytest.mark.parametrize(("kind", "arguments"), CASES, ids=NAMES)
def test_textures_of_one_value_equal_the_value(kind, arguments):
    """But for the light that is scattered more than once, whose tables for textures are interpolated."""
    if kind in (Conductor, Dielectric, ThinDielectric, Principled, OpenPBRBsdf):
        arguments = {**arguments, "multiscatter": False}
    plain = kind(**arguments)
    textured = kind(**{name: varying(plain, name, value) for name, value in arguments.items()})
    wo, wi, u = directions(200), directions(200, 2, upper=False), uniforms(plain, 200)
    for back_facing in (False, True):
        a, b = plain.bind(surface(wo, back_facing)), textured.bind(surface(wo, back_facing))
        if plain.specular and "roughness" in arguments:
            continue  # a texture of roughness 0 is raised to a very sharp lobe
        assert_near(a.f(wo, wi), b.f(wo, wi), rel=1e-5)
        assert_near(a.pdf(wo, wi), b.pdf(wo, wi), rel=1e-5)
        one, two = a.sample_f(wo, u), b.sample_f(wo, u)
        assert_near(one.wi, two.wi, rel=1e-6, abs=1e-6)
        assert_near(one.weight, two.weight, rel=1e-5)


@pytest.mark.parametrize(("kind", "arguments"), CASES, ids=NAMES)
@pytest.mark.parametrize("n", [0, 1])
def test_few_lanes(kind, arguments, n):
    bsdf = kind(**arguments)
    wo, wi = directions(n), directions(n, 3)
    bound = bsdf.bind(surface(wo))
    sample = bound.sample_f(wo, uniforms(bsdf, n))
    assert sample.wi.shape == sample.weight.shape == bound.f(wo, wi).shape == (3, n)
    assert sample.pdf.shape == sample.specular.shape == bound.pdf(wo, wi).shape == (n,)


@pytest.mark.parametrize(("kind", "arguments"), CASES, ids=NAMES)
def test_corners_of_the_random_numbers(kind, arguments):
    bsdf = kind(**arguments)
    last = np.nextafter(F4(1), F4(0))
    corners = (
        np.stack(np.meshgrid(*[[0, 0.5, last]] * bsdf.dimensions)).reshape(bsdf.dimensions, -1).astype(F4)
    )
    for z in (1, 0.5, 1e-3, 1e-6):
        wo = np.repeat(np.array([[np.sqrt(1 - z * z)], [0], [z]], F4), corners.shape[1], 1)
        for back_facing in (False, True):
            bound = bsdf.bind(surface(wo, back_facing))
            sample = bound.sample_f(wo, corners)
            values = np.concatenate([sample.wi, sample.weight, sample.pdf[None], bound.f(wo, sample.wi)])
            assert np.isfinite(values).all()
            assert (sample.weight >= 0).all()


def test_dielectric_knows_its_side():
    glass = Dielectric(1.5)
    wo = directions(4)
    at = surface(wo)
    at.back_facing = np.array([False, True, False, True])
    assert glass.bind(at).eta == pytest.approx([1.5, 1 / 1.5, 1.5, 1 / 1.5])
    assert glass.eta == pytest.approx([1.5])


def test_index_1_goes_straight_through():
    wo = directions(1000)
    for back_facing in (False, True):
        clear = Dielectric(1.0).bind(surface(wo, back_facing))
        sample = clear.sample_f(wo, uniforms(clear, 1000))
        assert sample.wi == pytest.approx(-wo, abs=1e-7)
        assert (sample.weight == 1).all()
        assert (sample.pdf == 1).all()


# (value, a part of the message); other values must be within 0 and 1
BAD = {
    Diffuse: {
        "reflectance": [1.5, (0.5, -0.1, 0), ((0.5, 0.1), "shape"), ("rde", "color"), (np.nan, "finite")]
    },
    Mirror: {"reflectance": [2]},
    Dielectric: {
        "ior": [(ior, "more than 0") for ior in (0, -1.5, np.inf)]
        + [("glas", "must be one of acetone"), *((ior, "from 1e-06 to 1e+06") for ior in (1e30, 1e-30))],
        "roughness": [-0.1],
        "reflectance": [-1],
        "transmittance": [3],
    },
    ThinDielectric: {
        "ior": [(0, "more than 0"), (1e20, "from 1e-06 to 1e+06")],
        **{name: [2] for name in ("roughness", "reflectance", "transmittance")},
    },
    Conductor: {
        "eta": [(0, "more than 0"), ((1, 0, 1), "more than 0"), (1e7, "[0, 1e+06]")],
        "k": [(-1, "[0, 1e+06]")],
        "reflectance": [1.5],
        "roughness": [1.1],
        "roughness_v": [-0.2],
        "rotation": [(np.inf, "finite")],
        "distribution": [("phong", "ggx, beckmann")],
        "shadowing": [("none", "correlated, separable")],
    },
    Plastic: {
        "ior": [(0, "more than 0"), (1e20, "from 1e-06 to 1e+06")],
        **{name: [2] for name in ("reflectance", "roughness", "specular_reflectance")},
    },
    OrenNayar: {"reflectance": [2], "sigma": [(1.6, "[0, π/2]")]},
    Principled: {
        "ior": [(0, "more than 0"), (1e20, "from 1e-06 to 1e+06")],
        "specular_color": [(-1, "at least 0")],
        "sheen_color": [(0, 0, 2)],
        **{
            name: [2]
            for name in ("base_color", "metallic", "transmission", "clearcoat", "clearcoat_roughness")
        },
        **{name: [-1] for name in ("roughness", "sheen", "sheen_roughness", "specular")},
    },
    OpenPBRBsdf: {
        "specular_ior": [(0, "more than 0")],
        "specular_weight": [(-1, "at least 0"), (np.inf, "at least 0")],
        "coat_ior": [(0.9, "from 1 to 1e+06")],
        "thin_film_thickness": [(101, "[0, 100] micrometers")],
        **{name: [2] for name in ("base_weight", "base_color", "base_diffuse_roughness", "base_metalness")},
        **{name: [-1] for name in ("specular_color", "specular_roughness", "transmission_weight")},
        **{
            name: [2] for name in ("specular_roughness_anisotropy", "transmission_color", "subsurface_weight")
        },
        **{name: [2] for name in ("subsurface_color", "coat_weight", "coat_color", "coat_roughness")},
        **{name: [-1] for name in ("coat_darkening", "fuzz_weight", "fuzz_color", "fuzz_roughness")},
        "thin_film_ior": [(0, "more than 0")],
        "thin_film_weight": [2],
    },
    Disney: {
        "ior": [(0, "more than 0")],
        **{
            name: [2]
            for name in (
                "base_color",
                "roughness",
                "metallic",
                "anisotropic",
                "transmission",
                "specular_tint",
            )
        },
        **{name: [-1] for name in ("sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss")},
    },
    DiffuseTransmission: {"reflectance": [2], "transmittance": [-1]},
    ThinDisney: {
        "ior": [(0, "more than 0")],
        "diffuse_transmission": [(2.5, "[0, 2]"), (-0.1, "[0, 2]")],
        **{name: [2] for name in ("base_color", "roughness", "anisotropic", "transmission")},
        **{name: [-1] for name in ("specular_tint", "sheen", "sheen_tint", "flatness")},
    },
    Sides: {"front": [(None, "Bsdf such as"), (Dielectric(), "not cross")], "back": [(0.5, "not cross")]},
    Mix: {"weight": [1.5], "first": [(None, "Bsdf such as")], "second": [(0.5, "Bsdf such as")]},
}
GOOD = {
    Conductor: {"eta": 1, "k": 1},
    Mix: {"first": Diffuse(), "second": Diffuse()},
    Sides: {"front": Diffuse()},
}


@pytest.mark.parametrize("kind", BAD, ids=lambda kind: kind.__name__)
def test_bad_parameters_are_named(kind):
    """With the value and what it must be."""
    for name, values in BAD[kind].items():
        for value in values:
            value, part = (
                value if isinstance(value, tuple) and isinstance(value[-1], str) else (value, "[0, 1]")
            )
            with pytest.raises(SceneError, match=f"{kind.__name__} {name}") as caught:
                kind(**{**GOOD.get(kind, {}), name: value})
            assert part in str(caught.value)
            assert not isinstance(value, int | float) or f"{value:g}" in str(caught.value)


def test_sides():
    """Each side has its BSDF, and the back none by default."""
    wo, wi = directions(500), directions(500, 2)
    behind = np.arange(500) % 2 == 0
    at = surface(wo)
    at.back_facing = behind
    metal, matte = Conductor(2, 4, 0.5), OrenNayar((0.2, 0.5, 0.7))
    both, one = Sides(metal, matte).bind(at), Sides(metal).bind(at)
    u = uniforms(both, 500)
    for bsdf, other in ((both, matte), (one, None)):
        f, pdf = metal.evaluate(wo, wi)
        weight = metal.sample_f(wo, u).weight
        other_f, other_pdf = (0, 0) if other is None else other.evaluate(wo, wi)
        other_weight = 0 if other is None else other.sample_f(wo, u).weight
        np.testing.assert_array_equal(bsdf.f(wo, wi), np.where(behind, other_f, f))
        np.testing.assert_array_equal(bsdf.pdf(wo, wi), np.where(behind, other_pdf, pdf))
        np.testing.assert_array_equal(bsdf.sample_f(wo, u).weight, np.where(behind, other_weight, weight))
    assert (one.albedo(wo)[:, behind] == 0).all()
    assert not both.specular
    assert Sides(Mirror()).specular


def test_bad_combinations_are_named():
    with pytest.raises(SceneError, match=r"sigma is 1.2; .* energy"):
        OrenNayar(0.5, 1.2, energy_preserving=True)
    with pytest.raises(SceneError, match=r"'oak'; .*gold"):
        Conductor.named("oak")

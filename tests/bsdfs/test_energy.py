"""Light that microfacets scatter more than once: white furnaces, colors, what the tables hold."""

import itertools
from functools import partial
from typing import Any

import numpy as np
import pytest
from inside import (
    Bsdf,
    Conductor,
    Dielectric,
    OpenPBRBsdf,
    Plastic,
    Principled,
    RoughBsdf,
    Shape,
    ThinDielectric,
    fresnel_dielectric,
    gain,
    loss,
    mean_over_cosines,
    part_kept,
    reflect,
    refract,
    scalar,
    scaling,
)
from scipy import stats
from test_bsdfs import Constant, surface

import wavefront as wf

F4 = np.float32
SAMPLES = 10_000
WITHIN = 0.01  # of all light
ALPHA = 1e-4  # probability of a false alarm of one test


def toward(mu: float, turn: float, n: int) -> np.ndarray:
    """wo (3, n) of a cosine and an azimuth."""
    r = np.sqrt(1 - mu * mu)
    return np.repeat(np.array([[r * np.cos(turn)], [r * np.sin(turn)], [mu]], F4), n, 1)


def energies(bsdf: Bsdf, wo: np.ndarray, inside: bool, rng: np.random.Generator) -> np.ndarray:
    """The energy of samples per channel, (3, n)."""
    n = wo.shape[1]
    sample = bsdf.bind(surface(wo, inside)).sample_f(wo, rng.random((bsdf.dimensions, n), F4))
    energy = sample.weight.astype(float)
    return energy if sample.eta is None else energy * sample.eta.astype(float) ** 2


WHITE = {
    "metal": lambda rng, r: Conductor(1e-6, 1e4, r),
    "metal of Beckmann": lambda rng, r: Conductor(1e-6, 1e4, r, distribution="beckmann"),
    "metal with separable shadowing": lambda rng, r: Conductor(1e-6, 1e4, r, shadowing="separable"),
    "brushed metal": lambda rng, r: Conductor(1e-6, 1e4, r, roughness_v=rng.uniform(0.2, 1), rotation=40.0),
    "metal brushed by a texture": lambda rng, r: Conductor(1e-6, 1e4, Constant(r), roughness_v=0.3),
    "metal brushed by textures": lambda rng, r: Conductor(
        1e-6, 1e4, Constant(r), roughness_v=Constant(rng.uniform(0.2, 1))
    ),
    "metal by texture": lambda rng, r: Conductor(1e-6, 1e4, Constant(r)),
    "glass": lambda rng, r: Dielectric(rng.uniform(1.1, 2.4), r),
    "bubble": lambda rng, r: Dielectric(1 / rng.uniform(1.1, 2.4), r),
    "glass of Beckmann": lambda rng, r: Dielectric(1.5, r, distribution="beckmann"),
    "almost air": lambda rng, r: Dielectric(rng.uniform(1.002, 1.1), max(r, 0.2)),
    "brushed glass": lambda rng, r: Dielectric(1.5, r, roughness_v=max(0.2, r * rng.uniform(0.6, 1))),
    "glass brushed by a texture": lambda rng, r: Dielectric(1.5, 0.3, roughness_v=Constant(max(0.1, r))),
    "glass brushed by textures": lambda rng, r: Dielectric(
        1.5, Constant(max(0.1, r)), roughness_v=Constant(rng.uniform(0.2, 1))
    ),
    "glass by texture": lambda rng, r: Dielectric(1.5, Constant(r)),
    "plastic": lambda rng, r: Plastic(1.0, r, rng.uniform(1.05, 2.4), nonlinear=rng.random() < 0.5),
    "plastic rarer than around": lambda rng, r: Plastic(
        1.0, r, rng.uniform(0.2, 0.95), nonlinear=rng.random() < 0.5
    ),
    "plastic of Beckmann": lambda rng, r: Plastic(1.0, r, distribution="beckmann"),
    "plastic with separable shadowing": lambda rng, r: Plastic(1.0, r, shadowing="separable"),
    "plastic by texture": lambda rng, r: Plastic(1.0, Constant(r)),
    "sheet": lambda rng, r: ThinDielectric(rng.uniform(1.1, 2.4), r),
    "principled metal": lambda rng, r: Principled(1.0, 1.0, r),
    "principled gloss": lambda rng, r: Principled(1.0, 0.0, r),
    "principled glass": lambda rng, r: Principled(1.0, 0.0, r, rng.uniform(1.1, 2.4), 1.0),
    "principled sheet": lambda rng, r: Principled(1.0, 0.0, r, 1.5, 1.0, thin=True),
    "sheet of OpenPBR": lambda rng, r: OpenPBRBsdf(
        transmission_weight=1.0, specular_roughness=r, geometry_thin_walled=True
    ),
    "clear part of OpenPBR": lambda rng, r: OpenPBRBsdf(transmission_weight=1.0, specular_roughness=r),
    "all of principled": lambda rng, r: Principled(1.0, 0.3, r, 1.5, 0.5),
}


HEAVY = {"glass brushed by textures", "brushed glass", "plastic by texture", "plastic of Beckmann"}

# what is approximated by tables of something near it: how far from 1 it may be, and a surface
NEARLY_WHITE = {
    "gloss below a film": (
        0.03,
        lambda rng, r: Principled(
            1.0, 0.0, r, film_thickness=rng.uniform(50, 800), film_ior=rng.uniform(1.2, 1.8)
        ),
    ),
    "gloss of OpenPBR below a film": (
        0.03,
        lambda rng, r: OpenPBRBsdf(
            base_color=1.0,
            specular_roughness=r,
            thin_film_weight=1.0,
            thin_film_thickness=rng.uniform(0.05, 0.8),
        ),
    ),
    "glass below a film": (
        0.05,
        lambda rng, r: Dielectric(
            1.5, r, film_thickness=rng.uniform(50, 800), film_ior=rng.uniform(1.2, 1.8)
        ),
    ),
    "principled glass below a film": (
        0.05,
        lambda rng, r: Principled(1.0, 0.0, r, 1.5, 1.0, film_thickness=rng.uniform(50, 800)),
    ),
    "brushed gloss": (
        0.03,
        lambda rng, r: Principled(1.0, 0.0, 0.4 * r, roughness_v=0.5, rotation=30.0),
    ),
    "brushed gloss of OpenPBR": (
        0.03,
        lambda rng, r: OpenPBRBsdf(
            base_color=1.0, specular_roughness=0.6 * r, specular_roughness_anisotropy=rng.uniform(0.6, 0.9)
        ),
    ),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in HEAVY else n for n in WHITE]
)
def test_a_white_surface_loses_nothing(name: str) -> None:
    """At random roughnesses and angles; the deviation from 1 is more than 1 % with no significance."""
    check_white(WHITE[name], WITHIN, list(WHITE).index(name))


@pytest.mark.parametrize("name", NEARLY_WHITE)
@pytest.mark.first(1)
def test_a_white_surface_loses_next_to_nothing(name: str) -> None:
    within, make = NEARLY_WHITE[name]
    check_white(make, within, list(NEARLY_WHITE).index(name))


def check_white(make: Any, within: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 8
    limit = stats.norm.isf(1 - (1 - ALPHA) ** (1 / count))
    for _ in range(count):
        bsdf = make(rng, rng.uniform(0.05, 1))
        mu = np.cos(np.radians(rng.choice([rng.uniform(0, 80), rng.uniform(80, 89)])))
        wo = toward(float(mu), rng.uniform(0, 2 * np.pi), SAMPLES)
        energy = energies(bsdf, wo, bool(bsdf.transmissive and rng.random() < 0.5), rng)[1]
        error = energy.std() / np.sqrt(SAMPLES)
        assert error < 0.02
        assert abs(energy.mean() - 1) < within + limit * error, (vars(bsdf), mu)


# two roughnesses, and which of them are textures
BRUSHED = {
    "none": lambda kind, along, across: kind(along, roughness_v=across),
    "one": lambda kind, along, across: kind(Constant(along), roughness_v=across),
    "both": lambda kind, along, across: kind(Constant(along), roughness_v=Constant(across)),
}
METAL = partial(Conductor, 1e-6, 1e4)


@pytest.mark.parametrize("textures", BRUSHED)
@pytest.mark.parametrize("kind", [METAL, pytest.param(partial(Dielectric, 1.5), marks=pytest.mark.slow)])
def test_unlike_roughnesses_lose_and_gain_one_percent_at_most(kind: Any, textures: str) -> None:
    """From the widest direction to the narrowest, inside and outside."""
    rng = np.random.default_rng(3)
    n, limit = 4 * SAMPLES, stats.norm.isf(ALPHA / 54)
    for along, across in ((1.0, 0.3), (0.1, 0.7), (0.3, 0.9)):
        bsdf = BRUSHED[textures](kind, along, across)
        sides = (False, True) if bsdf.transmissive else (False,)
        for mu, turn, inside in itertools.product((1.0, 0.5, 0.05), (0.0, 0.8, 1.57), sides):
            energy = energies(bsdf, toward(mu, turn, n), inside, rng)[0]
            error = energy.std() / np.sqrt(n)
            assert abs(energy.mean() - 1) < WITHIN + limit * error, (along, across, mu, turn, inside)


def test_single_scattering_loses_light() -> None:
    rng = np.random.default_rng(0)
    wo = toward(1.0, 0.0, SAMPLES)
    for bsdf in (Conductor(1e-6, 1e4, 1.0, multiscatter=False), Principled(1.0, 1, 1.0, multiscatter=False)):
        assert energies(bsdf, wo, False, rng).mean() == pytest.approx(0.307, abs=0.02)


def test_mean_over_cosines() -> None:
    """Exact for polynomials up to the fifth degree."""
    for k in range(6):
        mean = mean_over_cosines(lambda mu, k=k: (mu.astype(float) ** k)[None])
        assert mean == pytest.approx(2 / (k + 2), rel=1e-6)


@pytest.mark.parametrize("f0", [0.3, 0.9])
@pytest.mark.parametrize("roughness", [0.4, 1.0])
def test_colors_deepen_with_each_reflection(f0: float, roughness: float) -> None:
    """A metal of one reflectance F keeps F·M/(1 − F·(1 − M)) of what it scatters more than once."""
    rng = np.random.default_rng(1)
    table = scaling(Shape(roughness**2, None, False, False))
    u = rng.random((2, SAMPLES), F4)
    cosines, flat = np.sqrt(u[0]), np.full(SAMPLES, F4(1))
    mu = np.stack([np.sqrt(1 - cosines**2), 0 * flat, cosines])
    once = Conductor(1e-6, 1e4, roughness, multiscatter=False)
    mean = energies(once, mu, False, rng)[0].mean()  # of light from all directions
    assert table.albedo[0, 0, 0] == pytest.approx(mean, abs=0.01)
    metal = Principled(f0, 1.0, roughness)
    single = Principled(f0, 1.0, roughness, multiscatter=False)
    fresnel = f0 + (1 - f0) / 21
    kept = fresnel * mean / (1 - fresnel * (1 - mean))
    wo, wi = toward(0.8, 0.0, SAMPLES), toward(0.5, 1.0, SAMPLES)
    white = Conductor(1e-6, 1e4, roughness).f(wo, wi) / once.f(wo, wi)
    assert (metal.f(wo, wi) / single.f(wo, wi))[0, 0] == pytest.approx(1 + (white[0, 0] - 1) * kept, abs=0.01)


def test_the_layer_albedo_of_a_metal_is_that_of_its_samples() -> None:
    rng = np.random.default_rng(2)
    for roughness in (0.5, 1.0):
        metal = Principled((0.9, 0.5, 0.2), 1.0, roughness)
        for mu in (1.0, 0.4):
            wo = toward(mu, 0.0, 100_000)
            assert metal.albedo(wo)[:, 0] == pytest.approx(energies(metal, wo, False, rng).mean(1), abs=0.02)


def test_the_literal_material_of_gltf_has_none() -> None:
    wo, wi = toward(0.8, 0.0, 1), toward(0.5, 1.0, 1)
    literal = Principled(0.9, 1.0, 0.9, conserve_energy=False).f(wo, wi)
    assert literal == pytest.approx(Principled(0.9, 1.0, 0.9, multiscatter=False).f(wo, wi), rel=1e-6)


def test_dispersion_and_textures_of_the_index_are_without() -> None:
    wo, wi = toward(0.8, 0.0, 100), toward(0.5, 1.0, 100)
    for arguments in ({"ior": (1.5, 1.51, 1.53)}, {"ior": Constant(1.5)}):
        with_it, without = (
            Dielectric(**{"roughness": 0.8, **arguments}, multiscatter=on).bind(surface(wo)).f(wo, wi)
            for on in (True, False)
        )
        np.testing.assert_array_equal(with_it, without)


def test_surfaces_without_microfacets_need_no_table() -> None:
    scaling.cache_clear()
    loss.cache_clear()
    wo = toward(0.8, 0.0, 10)
    for bsdf in (Conductor(0.2, 3), Dielectric(1.5), ThinDielectric(1.5), Principled(0.5)):
        bsdf.bind(surface(wo)).sample_f(wo, np.full((bsdf.dimensions, 10), 0.5, F4))
    assert scaling.cache_info().currsize == loss.cache_info().currsize == 0


@pytest.mark.parametrize("across", [None, 0.3])
def test_tables_have_their_shape_by_the_roughness(across: float | None) -> None:
    class Rough(RoughBsdf):
        """A surface of microfacets without a model."""

        def __init__(self, roughness):
            self.roughness = scalar("roughness", roughness)
            super().__init__(roughness_v=across, distribution="beckmann", shadowing="separable")

        def evaluate(self, wo, wi):
            raise NotImplementedError

    alpha_v, brushed = (None, False) if across is None else (pytest.approx(0.09), True)
    assert Rough(0.5).shape == (pytest.approx(0.25), alpha_v, True, True, brushed)
    assert Rough(Constant(0.5)).shape == (None, alpha_v, True, True, brushed)


def test_a_metal_keeps_its_part() -> None:
    """F·M/(1 − F·(1 − M)), by a sum over the further reflections, each of F after the part 1 − M."""
    metal = Conductor(1.0, 1.0, 0.8)
    mean = float(scaling(metal.shape).albedo[0, 0, 0])
    reflectance = np.array([[0.2], [0.7], [1.0]])
    series = sum(reflectance * mean * (reflectance * (1 - mean)) ** k for k in range(200))
    assert part_kept(metal, reflectance.astype(F4)) == pytest.approx(series, rel=1e-5)


@pytest.mark.parametrize("ior", [1.1, 1.5, 1 / 1.33])
@pytest.mark.parametrize("across", [None, 0.4])
def test_the_lobe_of_glass_returns_what_is_lost(ior: float, across: float | None) -> None:
    glass = Dielectric(ior, 0.7, roughness_v=across)
    table = loss(glass.shape, ior)
    k = np.arange(1 << 15)
    u = (0.5 + k * np.array([[0.8191725134], [0.6710436067], [0.5497004779]])) % 1  # evenly spread
    for mu in (0.9, 0.3):
        wo = toward(mu, 1.0, k.size)
        for side in (False, True):
            inside, eta = np.full(k.size, side), 1 / ior if side else ior
            wi = table.directions(glass, u.astype(F4), inside, k)
            stretched = glass.facets().stretched(wo), glass.facets().stretched(wi)
            value, density, chance = table.lobe(glass, wo, wi, inside, stretched)
            energy = value * np.abs(wi[2]) * np.where(wi[2] < 0, eta**2, 1) / density
            assert energy.mean(dtype=float) == pytest.approx(chance[0], rel=5e-3)


@pytest.mark.parametrize(
    ("along", "across", "gained", "left"),
    [(0.9, 0.4, 0.003, 0.0015), (0.5, 0.9, 0.0015, 0.0015), (0.7, None, 0.0005, 0.0008)],
)
def test_tables_hold_what_is_lost(along: float, across: float | None, gained: float, left: float) -> None:
    """Of a white metal that is 0, of glass what sums over facets say: root mean squares over directions."""
    rng, n, count = np.random.default_rng(0), 1 << 14, 50
    u = ((0.5 + np.arange(n) * np.array([[0.7548776662], [0.5698402910]])) % 1).astype(F4)  # evenly spread
    metal, glass = METAL(along, roughness_v=across), Dielectric(1.5, along, roughness_v=across)
    facets, table = metal.facets(), loss(glass.shape, 1.5)
    of_metal, of_glass = [], []
    for mu, turn in zip(rng.uniform(0.1, 1, count), rng.uniform(0, 2 * np.pi, count), strict=True):
        wo = toward(mu, turn, n)
        m = facets.visible_normals(wo, u)
        wi, seen = reflect(wo, m), np.maximum((wo * m).sum(0), 0)
        above = np.where(wi[2] > 0, facets.weight(wo, wi, m) * gain(metal, wo, wi), 0)
        of_metal.append(1 - above.mean(dtype=float))
        for inside, eta in ((False, F4(1.5)), (True, F4(1 / 1.5))):
            reflected, cos = fresnel_dielectric(seen, np.full(1, eta))
            wi = refract(wo, m, seen, cos, eta)
            below = np.where(wi[2] < 0, facets.weight(wo, wi, m), 0)
            lost = 1 - (reflected * above + (1 - reflected) * below).mean(dtype=float)
            of_glass.append(float(table.at(glass, wo[:, :1], np.array([inside]))[0]) - lost)
    assert np.sqrt(np.mean(np.square(of_metal))) < gained
    assert np.sqrt(np.mean(np.square(of_glass))) < left


def test_as_much_crosses_either_way() -> None:
    """The mean transmittance of a smooth boundary, 1 − ∫ 2μ·F dμ from the rarer side."""
    mu = (np.arange(4000) + F4(0.5)) / F4(4000)
    passed = 1 - (2 * mu * fresnel_dielectric(mu, np.full(1, F4(1.5)))[0]).mean(dtype=float)
    for ior in (1.5, 1 / 1.5):
        assert loss(Dielectric(ior, 0.7).shape, ior).passed == pytest.approx(passed, rel=1e-3)


def test_glass_within_glass_is_without() -> None:
    """The index around may differ from point to point."""
    wo, wi = toward(0.8, 0.0, 100), toward(0.5, 1.0, 100)
    at = surface(wo)
    at.index_around = np.full(100, 1.2, F4)
    both = (Dielectric(1.5, 0.8, multiscatter=on).bind(at).f(wo, wi) for on in (True, False))
    np.testing.assert_array_equal(*both)


@pytest.mark.parametrize("plugin", ["roughconductor", "roughdielectric", "roughplastic"])
def test_scenes_of_mitsuba_scatter_once(plugin: str) -> None:
    ball = {"type": "sphere", "bsdf": {"type": plugin, "alpha": 0.5}}
    scene = wf.from_mitsuba({"type": "scene", "ball": ball})
    assert not scene.shapes[0].material.bsdf.multiscatter

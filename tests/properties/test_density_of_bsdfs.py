"""The densities of all BSDFs, by differentiation at any u, and what else their samples promise.

A BSDF chooses a lobe by u[2], and the lobe maps u[:2] to a direction. So its density at a direction is the
sum, over all u[:2] that lead there, of the part of the numbers u[2] with which they do over the Jacobian of
the map. The u[:2] that may lead to a direction are found by the inverses of the maps that BSDFs are made of.
"""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from inside import (
    INV_PI,
    UP,
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Disney,
    Facets,
    LayeredBsdf,
    Measured,
    Microfacets,
    Mirror,
    Mix,
    OpenPBRBsdf,
    OrenNayar,
    Plastic,
    Principled,
    ShadowCatcher,
    Sides,
    SurfaceInteraction,
    ThinDielectric,
    ThinDisney,
    Varnish,
    _coordinates,
    _elevation,
    _transformation,
    _turned,
    alpha_of,
    cosine_hemisphere_inverse,
    normalize,
)
from jacobians import columns, doubles, fewest, inner, jacobian, some
from measurements import measured

from wavefront import bsdfs

f4 = np.float32
CHOICES = 1024  # numbers u[2] that are tried: the part of a lobe is known to 2/CHOICES
part = st.floats(0.05, 1)
rough = st.floats(0.2, 1)
color = st.tuples(part, part, part)
index = st.floats(1.1, 2.5) | st.floats(0.4, 0.9)


facets = {
    "roughness_v": st.none() | rough,
    "rotation": st.floats(0, 360),
    "distribution": st.sampled_from(["ggx", "beckmann"]),
    "shadowing": st.sampled_from(["correlated", "separable"]),
    "multiscatter": st.booleans(),
}


class ByValue(Bsdf):
    """A material of one's own that gives its value only."""

    def __init__(self, reflectance: float) -> None:
        self.reflectance = np.float32(reflectance)

    def f(self, wo, wi):
        return self.reflectance * INV_PI * (wi[2] > 0) * (1 + wi[0]) * np.ones_like(wi)


MATTE = st.one_of(st.builds(Diffuse, color), st.builds(OrenNayar, color, st.floats(0, 1)))
SHINY = st.one_of(st.builds(Conductor, color, st.floats(0.5, 5), rough), st.builds(Dielectric, index, rough))
KINDS = {
    Diffuse: st.builds(Diffuse, color),
    DiffuseTransmission: st.builds(DiffuseTransmission, color, color),
    ShadowCatcher: st.builds(ShadowCatcher, color),
    OrenNayar: st.builds(OrenNayar, color, st.floats(0, 1), energy_preserving=st.booleans()),
    Mirror: st.builds(Mirror, color),
    Conductor: st.builds(Conductor, color, st.floats(0.5, 5))
    | st.builds(Conductor, color, st.floats(0.5, 5), rough, reflectance=color, **facets),
    Dielectric: st.builds(Dielectric, index, reflectance=color, transmittance=color)
    | st.builds(Dielectric, index, rough, reflectance=color, transmittance=color, **facets),
    Plastic: st.builds(
        Plastic,
        color,
        st.just(0.0) | st.just(0.5),
        distribution=st.sampled_from(["ggx", "beckmann"]),
        multiscatter=st.booleans(),
    ),
    ThinDielectric: st.builds(
        ThinDielectric, index, st.just(0.0) | rough, reflectance=color, transmittance=color
    ),
    Principled: st.builds(
        Principled,
        color,
        st.floats(0, 1),
        rough,
        index,
        st.just(0.0) | st.floats(0, 1),
        thin=st.booleans(),
        clearcoat=st.just(0.0) | part,
        clearcoat_roughness=rough,
        sheen=st.just(0.0) | part,
        specular=st.floats(0, 1),
    ),
    OpenPBRBsdf: st.builds(
        OpenPBRBsdf,
        base_color=color,
        base_diffuse_roughness=st.just(0.0) | part,
        base_metalness=st.floats(0, 1),
        specular_color=color,
        specular_roughness=rough,
        specular_ior=index,
        transmission_weight=st.just(0.0) | st.floats(0, 1),
        geometry_thin_walled=st.booleans(),
        coat_weight=st.just(0.0) | part,
        coat_roughness=rough,
        fuzz_weight=st.just(0.0) | part,
        fuzz_roughness=rough,
    ),
    Disney: st.builds(
        Disney, color, rough, part, anisotropic=part, ior=st.floats(1.1, 2), transmission=st.just(0.0) | part
    ),
    ThinDisney: st.builds(
        ThinDisney,
        color,
        rough,
        anisotropic=part,
        ior=st.floats(1.1, 2),
        transmission=part,
        diffuse_transmission=st.just(0.0) | st.floats(0.1, 2),
    ),
    Measured: st.builds(measured, st.sampled_from(["0", "1", "2", "4", "merl"])),
    ByValue: st.builds(ByValue, part),
    Sides: st.builds(Sides, MATTE, st.none() | st.builds(Mirror, color)),
    Mix: st.builds(Mix, MATTE, SHINY | st.builds(Mirror, color), st.floats(0.1, 0.9)),
}
kinds = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
integrals = pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[pytest.mark.slow] if kind is Measured else []) for kind in KINDS],
    ids=lambda kind: kind.__name__,
)
scattering = pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind is not Mirror], ids=lambda kind: kind.__name__
)
cosines = st.floats(0.1, 1)
cubes = st.tuples(inner, inner, inner)


def test_every_bsdf_is_here() -> None:
    assert {*bsdfs.ALL, ShadowCatcher, Measured, ByValue} == set(KINDS)


def bound_to(bsdf: Bsdf, wo: np.ndarray, inside: bool) -> Bsdf:
    """The BSDF at n points seen along wo (3, n), perhaps from inside."""
    n = wo.shape[1]
    up, zero = np.repeat(f4([[0], [0], [1]]), n, 1), np.zeros(n, f4)
    lane = np.zeros(n, np.intp)
    back = np.full(n, inside and bsdf.transmissive)
    return bsdf.bind(SurfaceInteraction(np.zeros((3, n), f4), zero, up, up, wo, lane, lane, back))


def toward(z: float, turn: float = 0.4) -> np.ndarray:
    """A unit vector (3, 1) of float64."""
    r = np.sqrt(1 - z * z)
    return columns(r * np.cos(turn), r * np.sin(turn), z)


def sampled(bsdf: Bsdf, wo: np.ndarray, u: np.ndarray, inside: bool):
    wide = np.repeat(wo, u.shape[1], 1)
    return bound_to(bsdf, wide, inside).sample_f(wide, u)


def facets_of(bsdf: Bsdf) -> list[Facets]:
    """The facets of all lobes of a bound BSDF."""
    if isinstance(bsdf, Mix):
        return [*facets_of(bsdf.first), *facets_of(bsdf.second)]
    if isinstance(bsdf, LayeredBsdf):
        layers = bsdf.layers()
        found = [layers.base.facets()]
        found += [layers.base._facets_through()] if isinstance(bsdf, ThinDisney) else []
        varnish = [Facets(alpha_of(cover.roughness)) for cover in layers.covers if isinstance(cover, Varnish)]
        return [*found, *varnish]
    return [bsdf.facets()] if isinstance(bsdf, Microfacets) else []


def indices_of(bsdf: Bsdf, inside: bool) -> list[float]:
    """The relative indices of refraction."""
    if isinstance(bsdf, Mix):
        return [*indices_of(bsdf.first, inside), *indices_of(bsdf.second, inside)]
    ior = getattr(bsdf, "ior", None) if bsdf.transmissive else None
    return [] if ior is None else [1.0 / float(ior[0]) if inside else float(ior[0])]


def normal_inverse(wo: np.ndarray, m: np.ndarray, facets: Facets) -> np.ndarray:
    """The u (2, 1) that `visible_normals` maps to the normal m (3, 1)."""
    across = facets.alpha if facets.alpha_v is None else facets.alpha_v
    scale = columns(float(np.ravel(facets.alpha)[0]), float(np.ravel(across)[0]), 1)
    cos, sin = (1.0, 0.0) if facets.tangent is None else facets.tangent[:, 0].astype(float)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    squeezed = turn @ wo * scale
    squeezed /= np.linalg.norm(squeezed)
    half = turn @ m / scale
    half /= np.linalg.norm(half)
    cap = 2 * (squeezed * half).sum() * half - squeezed
    turn = np.arctan2(cap[1], cap[0]) / (2 * np.pi) % 1
    return np.stack([turn, 1 - (cap[2] + squeezed[2]) / (1 + squeezed[2])])


def unstretched_inverse(w: np.ndarray, facets: Facets) -> np.ndarray:
    """The u (2, 1) of a cosine-weighted direction that `unstretched` maps to w (3, 1), on any side."""
    across = facets.alpha if facets.alpha_v is None else facets.alpha_v
    cos, sin = (1.0, 0.0) if facets.tangent is None else facets.tangent[:, 0].astype(float)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    wide = turn @ w * columns(float(np.ravel(facets.alpha)[0]), float(np.ravel(across)[0]), 1)
    return cosine_hemisphere_inverse(wide / np.linalg.norm(wide))


def tables_inverse(bsdf: Measured, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """The u (2, 1) that measured tables map to wi (3, 1), whose numbers come from a first density."""
    axes = bsdf._axes(wo)
    seen = _turned(wo, axes)
    m = normalize(seen + _turned(wi, axes))
    u, mix = _coordinates(m, _elevation(m, UP)), bsdf.data.mix(seen)
    for density in (bsdf.data.density, bsdf.data.before):
        u = u if density is None else density.inverse(u, mix)[0]
    return u


def preimages(bsdf: Bsdf, wo: np.ndarray, wi: np.ndarray, inside: bool) -> list[np.ndarray]:
    """All u (2, 1) that may be mapped to wi, without repeats."""
    found = [cosine_hemisphere_inverse(wi)]
    found += [unstretched_inverse(wi, facets) for facets in facets_of(bound_to(bsdf, wo, inside))]
    if isinstance(bsdf, Measured):
        found.append(tables_inverse(bsdf, wo, wi))
    if isinstance(bsdf, OpenPBRBsdf) and bsdf.fuzz_weight[0] > 0:
        a, b = (np.ravel(each)[0] for each in _transformation(wo[2], bsdf.fuzz_roughness.astype(float)))
        below = columns(*(a * wi[:2, 0] + b * wo[:2, 0] * wi[2, 0]), wi[2, 0])
        found.append(cosine_hemisphere_inverse(below / np.linalg.norm(below)))
    halves = [wo + wi, wo + wi * columns(1, 1, -1)]
    halves += [wo + eta * wi for eta in indices_of(bsdf, inside)]
    for half in halves:
        size = np.linalg.norm(half)
        if size < 1e-3:
            continue
        m = half * (np.copysign(1, half[2]) / size)
        found += [normal_inverse(wo, m, facets) for facets in facets_of(bound_to(bsdf, wo, inside))]
    kept: list[np.ndarray] = []
    for u in found:
        if not ((u >= 0) & (u < 1)).all():
            continue
        assume(((u > 1e-6) & (u < 1 - 1e-6)).all())  # there are no differences at the edge of the square
        if all(np.abs(u - v).max() > 1e-9 for v in kept):
            kept.append(u)
    return kept


def density_by_differentiation(bsdf, wo, wi, inside):
    """Return the density at wi (3, 1) and a bound on its error."""
    third = (np.arange(CHOICES) + 0.5) / CHOICES
    total, bound = 0.0, 0.0
    for u in preimages(bsdf, wo, wi, inside):
        tried = np.concatenate([np.repeat(u, CHOICES, 1), third[None]])[: max(bsdf.dimensions, 2)]
        sample = sampled(bsdf, wo, tried, inside)
        same = (np.abs(sample.wi - wi).max(0) < 1e-6) & (sample.pdf > 0) & ~sample.specular
        lanes = np.flatnonzero(same)
        if not lanes.size:
            if bsdf.transmissive and getattr(bsdf, "multiscatter", False):  # the lobe may be too rare
                wide = max(
                    facets.wide_pdf(wi, facets.stretched(wi))[0]
                    for facets in facets_of(bound_to(bsdf, wo, inside))
                )
                bound += 2 * wide / CHOICES
            continue
        choice = third[lanes[lanes.size // 2]]

        def direction(v, choice=choice):
            numbers = np.concatenate([v, np.full((1, v.shape[1]), choice)])[: max(bsdf.dimensions, 2)]
            return sampled(bsdf, wo, numbers, inside).wi

        area, error = jacobian(direction, (float(u[0, 0]), float(u[1, 0])))
        chance = lanes.size / CHOICES
        total += chance / area
        bound += (chance * error + (2 / CHOICES if lanes.size < CHOICES else 0)) / area
    return total, bound


@scattering
@some
@given(data=st.data(), z=cosines, inside=st.booleans(), u=cubes)
def test_density_of_directions(kind: type[Bsdf], data: st.DataObject, z: float, inside: bool, u) -> None:
    bsdf, wo = data.draw(KINDS[kind]), toward(z)
    assume(not bsdf.specular)
    with doubles():
        numbers = columns(*u)[: bsdf.dimensions]
        sample = sampled(bsdf, wo, numbers, inside)
        assume(sample.pdf[0] > 0)
        assume(not sample.specular[0])
        assume(abs(sample.wi[2, 0]) > 1e-3)
        density, bound = density_by_differentiation(bsdf, wo, sample.wi, inside)
        assume(bound < 0.06 * density)
        assert abs(sample.pdf[0] - density) <= bound + 1e-4 * density


@kinds
@some
@given(data=st.data(), z=cosines, inside=st.booleans(), u=cubes)
def test_samples_keep_their_promises(kind, data, z, inside, u):
    """In float32, as in a render: the density at the sample is the one returned; weight = f·cos/pdf."""
    bsdf, wo = data.draw(KINDS[kind]), toward(z).astype(f4)
    sample = sampled(bsdf, wo, columns(*u).astype(f4)[: bsdf.dimensions], inside)
    here = bound_to(bsdf, wo, inside)
    assert sample.wi.dtype == sample.pdf.dtype == f4
    assert np.linalg.norm(sample.wi.astype(float)) == pytest.approx(1, abs=3e-6)
    if sample.pdf[0] == 0:
        assert not sample.weight.any()
        return
    f, pdf = here.f(wo, sample.wi), here.pdf(wo, sample.wi)
    if sample.specular[0]:
        assert 0 < sample.pdf[0] <= 1 + 1e-6
        if bsdf.specular:
            assert not f.any()
            assert not pdf.any()
        return
    assert pdf[0] == pytest.approx(sample.pdf[0], rel=1e-5)
    due = f.astype(float) * abs(float(sample.wi[2, 0])) / float(sample.pdf[0])
    np.testing.assert_allclose(sample.weight, due, rtol=2e-5, atol=1e-7)


@integrals
@fewest
@given(data=st.data(), z=cosines, inside=st.booleans())
def test_densities_integrate_to_the_chance_of_a_sample(kind, data, z, inside):
    """Over the sphere, by the midpoint rule; delta lobes and directions to the wrong side are left out."""
    bsdf, wo = data.draw(KINDS[kind]), toward(z).astype(f4)
    rows = 448  # so that the narrowest lobes cross several rows
    theta, phi = np.meshgrid(
        np.pi * (np.arange(rows) + 0.5) / rows, np.pi * (np.arange(2 * rows) + 0.5) / rows
    )
    r = np.sin(theta)
    w = np.stack([r * np.cos(phi), r * np.sin(phi), np.cos(theta)]).reshape(3, -1).astype(f4)
    wide = np.repeat(wo, w.shape[1], 1)
    pdf = bound_to(bsdf, wide, inside).pdf(wide, w)
    total = 2 * np.pi**2 * (pdf * r.ravel()).mean(dtype=float)
    sides = np.full(bsdf.dimensions, 96 if bsdf.dimensions == 2 else 48)
    grid = (np.indices(sides).reshape(sides.size, -1) + 0.5) / sides[:, None]
    sample = sampled(bsdf, wo, grid.astype(f4), inside)
    chance = np.mean((sample.pdf > 0) & ~sample.specular)
    # a facet's horizon and the lobes' ends cross cells of both grids
    assert total == pytest.approx(chance, abs=1 / 32)


@kinds
@some
@given(data=st.data(), z=cosines, inside=st.booleans(), u=cubes)
def test_delta_lobes_have_their_chance(kind, data, z, inside, u):
    """The part of the numbers u[2] that lead to a delta lobe is the probability returned with it."""
    bsdf, wo = data.draw(KINDS[kind]), toward(z)
    third = (np.arange(CHOICES) + 0.5) / CHOICES
    tried = np.concatenate([np.repeat(columns(*u[:2]), CHOICES, 1), third[None]])[: bsdf.dimensions]
    with doubles():
        sample = sampled(bsdf, wo, tried, inside)
    delta = np.flatnonzero(sample.specular & (sample.pdf > 0))
    for lane in delta[:1], delta[-1:]:
        if lane.size:
            same = (sample.wi == sample.wi[:, lane]).all(0) & sample.specular
            assert same.mean() == pytest.approx(sample.pdf[lane[0]], abs=2 / CHOICES)


@some
@given(alpha=st.floats(0.01, 1), across=st.none() | st.floats(0.01, 1), z=cosines, u=st.tuples(inner, inner))
def test_visible_normals_have_their_inverse(alpha, across, z, u):
    facets = Facets(columns(alpha)[0], None if across is None else columns(across)[0], columns(0.6, 0.8))
    with doubles():
        m = facets.visible_normals(toward(z), columns(*u))
    np.testing.assert_allclose(normal_inverse(toward(z), m, facets)[:, 0], u, atol=1e-6)

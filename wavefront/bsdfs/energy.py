"""The light that microfacets scatter more than once, which models of single scattering lose.

Metals and thin sheets: the lobe is multiplied by c(wo)·c(wi), with the c for which a surface that absorbs
nothing reflects all light from every direction, c(wo)·∫ f·c(wi)·cosθi dωi = 1. So the lobe keeps its shape
and its sampling, as in E. Turquin 2019, "Practical Multiple Scattering Compensation for Microfacet Models",
whose factor 1/E(wo) is not reciprocal. Absorption deepens colors as in C. Kulla and A. Conty 2017,
"Revisiting Physically Based Shading at Imageworks".

Boundaries that refract: reflection is multiplied by the same c(wo)·c(wi), and the light still lost, L(w),
returns as Kulla and Conty's lobe L(wo)·L(wi)/(π·mean L). As much of it crosses as the other side can return,
times the mean transmittance: f·η² stays reciprocal.
"""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import INV_PI, Bools, Doubles, Floats, Ints, dot, f4
from ..sampling.warp import cosine_hemisphere
from .albedo import interpolate
from .fresnel import fresnel_dielectric
from .microfacet import Facets, alpha_of, reflect, refract

if TYPE_CHECKING:
    from collections.abc import Callable

    from .rough import MicrofacetSurface

COLUMNS = 32  # of a table, by the angle to the normal
FINE = 1024  # of a table of one row, in the end
# roughnesses of tables for textures, where polynomials of them are stable (Chebyshev), and in the end
NODES = 0.5 - 0.5 * sin_cos_turns((np.arange(7) + 0.5) / 14)[1]
ROUGHNESSES = np.linspace(0, 1, 25)
TURNS = 6  # rows of a table of two roughnesses: cos² of azimuths in [0, 1]
GOLDEN = 0.6180339887498949  # (√5 − 1)/2, whose multiples are spread evenly
MIDPOINTS, AROUND = 512, 16  # of roots of cosines, and of azimuths, for means
STEPS = 8  # to c, each of which halves the error or more
LEAST = 1e-4  # part that is lost, so that the lobe has a value wherever it has samples
# ∫ 2μ·g(μ) dμ by the quadrature of Gauss and Jacobi: nodes and weights
MEAN = (
    (0.2123405382391529, 0.13965395987677572),
    (0.5905331355592653, 0.4584822127191725),
    (0.9114120404872960, 0.4018638274079180),
)


class Size(NamedTuple):
    """The size of the table of a roughness or two."""

    turns: int
    columns: int
    normals: int  # microfacets that each entry sums over


Place: TypeAlias = tuple[Floats | None, Floats]  # row, in a table of two roughnesses, and column, in [0, 1]


class Shape(NamedTuple):
    """The parameters of tables, beside an index of refraction."""

    alpha: float | None  # None: all roughnesses, for textures
    alpha_v: float | None  # the same across, if it is brushed
    beckmann: bool
    separable: bool
    brushed: bool = False  # two roughnesses


# Tables have axes for the side, `roughness`, `roughness_v`, the azimuth and the angle to the normal; axes of
# constants, and of parameters without influence, have one entry.


class Scaling(NamedTuple):
    """The tables by which reflection grows."""

    factor: Floats  # (1, …) c
    albedo: Floats  # (1, r, r) mean albedo of single scattering


class Loss(NamedTuple):
    """The lobe of the light that a dielectric boundary loses otherwise; its sides are outside and inside."""

    lost: Floats  # (2, …) L
    means: Floats  # (2, r, r) of L, times the square of the index of the side
    passed: float  # mean transmittance of a smooth boundary
    ior: float

    def at(
        self, bsdf: MicrofacetSurface, w: Floats, inside: Bools, stretched: Floats | None = None
    ) -> Floats:
        """Return L of directions w (3, n) on the inside or not, and of a σ, if it is known, (n,)."""
        place = _place_of_refraction(bsdf.facets(), w, stretched)
        return _directional(bsdf, self.lost, place, inside)

    def lobe(
        self,
        bsdf: MicrofacetSurface,
        wo: Floats,
        wi: Floats,
        inside: Bools,
        stretched: tuple[Floats, Floats],
        chance: Floats | None = None,
    ) -> tuple[Floats, Floats, Floats]:
        """Return value and density, and the probability to sample it, if it is not known, (n,) each."""
        below = wi[2] < 0
        chance = self.at(bsdf, wo, inside, stretched[0]) if chance is None else chance
        share, scale = self._sides(bsdf, inside, below)
        value = chance * self.at(bsdf, wi, inside != below, stretched[1]) * scale
        return value, bsdf.facets().wide_pdf(wi, stretched[1]) * share, chance

    def directions(self, bsdf: MicrofacetSurface, u: Floats, inside: Bools, lanes: Ints) -> Floats:
        """Return directions of the lobe (3, k) on some lanes, for u (3, n) and wo inside or not."""
        crossing = np.broadcast_to(self._sides(bsdf, inside, True)[0], u[2].shape).take(lanes)
        u = u.take(lanes, 1)
        second = u[2] >= 0.5
        wi = cosine_hemisphere(u)
        wi = np.where(second, bsdf.facets().take(lanes).unstretched(wi), wi)
        wi[2] *= np.where(f4(2) * u[2] - second < crossing, f4(-1), f4(1))
        return wi

    def _sides(self, bsdf: MicrofacetSurface, inside: Bools, below: Bools | bool) -> tuple[Floats, Floats]:
        """Return the part of the lobe on a side of the boundary, and the factor of products of L."""
        out, in_ = (_of_roughness(bsdf, self.means, side) for side in (0, 1))
        least, squared = f4(self.passed) * np.minimum(out, in_), f4(self.ior * self.ior)
        cross = least / out, least / in_
        parts = f4(1) - cross[0], cross[0], f4(1) - cross[1], cross[1]  # outside, above and below; inside
        scales = (
            parts[0] * INV_PI / out,
            parts[1] * INV_PI / in_,
            parts[2] * INV_PI * squared / in_,
            parts[3] * INV_PI * squared / out,
        )
        number = np.add(inside, inside, dtype=np.intp) + below
        if out.size == 1:
            return np.concatenate(parts).take(number), np.concatenate(scales).take(number)
        return np.choose(number, parts), np.choose(number, scales)


def mean_over_cosines(reflectance: Callable[[Floats], Floats]) -> Floats:
    """Return the mean of a reflectance over diffuse light, ∫ 2μ·F(μ) dμ."""
    first, *others = (reflectance(np.full(1, mu, f4)) * f4(weight) for mu, weight in MEAN)
    return sum(others, first)


def gain(
    bsdf: MicrofacetSurface,
    wo: Floats,
    wi: Floats,
    mean_reflectance: Floats | None = None,
    stretched: tuple[Floats | None, Floats | None] = (None, None),
) -> Floats:
    """Return the factor by which reflection grows, (n,); of a metal with a mean reflectance (3, n).

    `stretched` is as for `mirror_lobe`.
    """
    table, facets = scaling(bsdf.shape).factor, bsdf.facets()
    places = (_place_of_masking(facets, *pair) for pair in zip((wo, wi), stretched, strict=True))
    one, other = (_directional(bsdf, table, place) for place in places)
    if mean_reflectance is None:
        return one * other
    return f4(1) + (one * other - f4(1)) * part_kept(bsdf, mean_reflectance)


def part_kept(bsdf: MicrofacetSurface, mean_reflectance: Floats) -> Floats:
    """Return the part of multiple scattering that a metal does not absorb, beside the first F, (3, n).

    It is F·M/(1 − F·(1 − M)), with M the mean albedo of single scattering (Kulla and Conty).
    """
    mean = _of_roughness(bsdf, scaling(bsdf.shape).albedo)
    return mean_reflectance * mean / (f4(1) - mean_reflectance * (f4(1) - mean))


def _place_of_masking(facets: Facets, w: Floats, stretched: Floats | None = None) -> Place:
    """Return where directions w (3, n) are in `Scaling`: by the azimuth and cosine of stretched ones."""
    size = facets.stretched(w) if stretched is None else stretched
    return facets.stretched_turn(w), np.abs(w[2]) / size


def _place_of_refraction(facets: Facets, w: Floats, stretched: Floats | None = None) -> Place:
    """Return where directions w (3, n) are in `Loss`: masking follows stretched ones, refraction does not."""
    z, size = np.abs(w[2]), facets.stretched(w) if stretched is None else stretched
    return facets.turn(w), _column_of_refraction(z, size)


def _column_of_refraction(z: Any, stretched: Any) -> Any:
    """Return the column in `Loss` of cosines and σ: evenly by cosines, but more where masking changes."""
    return z * (z * f4(0.4) + f4(0.4)) + np.sqrt(z / stretched) * f4(0.2)


def _directional(bsdf: MicrofacetSurface, table: Floats, place: Place, side: Bools | int = 0) -> Floats:
    """Return the values (n,) of a table (sides, …) for directions at a place."""
    turn, column = place
    if table.shape[-1] == FINE:
        nearest = (column * f4(FINE - 1) + f4(0.5)).astype(np.intp)
        return table.ravel().take(nearest + side * FINE)
    return interpolate(table, (bsdf.roughness, bsdf.roughness_v, turn, column), side)


def _of_roughness(bsdf: MicrofacetSurface, table: Floats, side: Bools | int = 0) -> Floats:
    """Return the values, (n,) or (1,), of a table (sides, r, r) for the roughnesses of a BSDF."""
    return interpolate(table, (bsdf.roughness, bsdf.roughness_v), np.atleast_1d(side))


@cache
def scaling(shape: Shape) -> Scaling:
    """Return the table of surfaces that reflect, or let pass without bending."""
    factor, albedo = _tabulate(shape, _scaling_of_pair)
    return Scaling(_fine(factor), albedo.astype(np.float32))


@cache
def loss(shape: Shape, ior: float) -> Loss:
    """Return the table of a boundary of an index of refraction, inside relative to outside."""
    size = Size(1, COLUMNS, 1024 if shape.alpha else 512)
    if shape.brushed:  # total reflection ends abruptly across
        size = Size(24, 48, 512) if shape.alpha and shape.alpha_v else Size(16, 32, 256)
    lost, means = _tabulate(shape, partial(_loss_of_pair, ior=ior, size=size))
    denser = np.full(1, max(ior, 1 / ior), f4)
    passed = 1 - float(mean_over_cosines(lambda mu: fresnel_dielectric(mu, denser)[0])[0])
    return Loss(_fine(np.clip(lost, LEAST, 1)), means.astype(np.float32), passed, ior)


def _tabulate(shape: Shape, pair: Callable[[Shape], tuple[Doubles, Doubles]]) -> list[Doubles]:
    """Return the tables that `pair` gives for constants, of all roughnesses that vary: (sides, r, r, …)."""
    along, across = _roughnesses(shape.alpha), _roughnesses(shape.alpha_v) if shape.brushed else [None]
    cells = [[pair(shape._replace(alpha=a, alpha_v=b)) for b in across] for a in along]
    tables = [np.array([[cell[k] for cell in row] for row in cells]) for k in (0, 1)]
    for axis in (0, 1):
        tables = [_at_roughnesses(table, axis) for table in tables]
    return [np.moveaxis(table, 2, 0) for table in tables]


def _roughnesses(alpha: float | None) -> list[float]:
    return alpha_of(NODES.astype(f4)).tolist() if alpha is None else [alpha]


def _at_roughnesses(table: Doubles, axis: int) -> Doubles:
    """Return a table of `NODES` along an axis at `ROUGHNESSES`, by the polynomial through them."""
    if table.shape[axis] == 1:
        return table
    table, basis = np.moveaxis(table, axis, 0), np.ones((NODES.size, ROUGHNESSES.size))
    for k, j in np.ndindex(NODES.size, NODES.size):
        if j != k:
            basis[k] *= (ROUGHNESSES - NODES[j]) / (NODES[k] - NODES[j])
    total = sum(np.multiply.outer(weight, values) for weight, values in zip(basis, table, strict=True))
    return np.moveaxis(total, 0, axis)


@cache
def _scaling_of_pair(shape: Shape) -> tuple[Doubles, Doubles]:
    """Return c (1, turns, columns) and mean albedo (1,) of constants."""
    alpha, across = _constants(shape)
    if alpha < across:
        factor, albedo = _scaling_of_pair(shape._replace(alpha=across, alpha_v=alpha))
        return factor[:, ::-1], albedo
    x, facets = np.linspace(0, 1, COLUMNS), _facets(shape)
    kernels, turns = [], np.linspace(0, 1, TURNS) if shape.brushed else np.ones(1)
    for turn in turns:
        turned = turn * across**2 / (turn * across**2 + (1 - turn) * alpha**2)
        toward = np.sqrt(turned * alpha**2 + (1 - turned) * across**2) * x
        wo, m = _visible(
            facets, turned, toward / np.sqrt(toward**2 + 1 - x * x), 256 if shape.brushed else 1024
        )
        wi = reflect(wo, m)
        weight = np.where(wi[2] > 0, facets.weight(wo, wi, m), f4(0)).astype(float)
        row, column = _place_of_masking(facets, wi)
        corners = _neighbors(column, COLUMNS)
        if row is not None:
            corners = [(j * COLUMNS + i, y * x) for j, y in _neighbors(row, TURNS) for i, x in corners]
        total = turns.size * COLUMNS
        start = np.arange(COLUMNS).repeat(weight.size // COLUMNS) * total
        sums = [np.bincount(start + i, weight * share, COLUMNS * total) for i, share in corners]
        kernels.append(sum(sums[1:], sums[0]).reshape(COLUMNS, total) * (COLUMNS / weight.size))
    kernel = np.concatenate(kernels)
    factor = np.ones(len(kernel))
    for _ in range(STEPS):
        factor = np.sqrt(factor / (kernel * factor).sum(1))
    albedo = _means(facets, kernel.sum(1).reshape(1, -1, COLUMNS), _place_of_masking)
    return factor.reshape(1, -1, COLUMNS), albedo


@cache
def _loss_of_pair(shape: Shape, ior: float, size: Size) -> tuple[Doubles, Doubles]:
    """Return L (2, turns, columns) and its means (2,), of constants."""
    alpha, across = _constants(shape)
    if alpha < across:
        lost, means = _loss_of_pair(shape._replace(alpha=across, alpha_v=alpha), ior, size)
        return lost[:, ::-1], means
    facets, (factor, _) = _facets(shape), _scaling_of_pair(shape)
    table, cos, places = factor.astype(f4), np.linspace(0, 1, 2048) ** 2, np.linspace(0, 1, size.columns)
    turns = np.linspace(0, 1, size.turns) if shape.brushed else np.ones(1)
    lost = np.empty((2, turns.size, size.columns))
    for k, turn in enumerate(turns):
        toward2 = turn * alpha**2 + (1 - turn) * across**2
        known = _column_of_refraction(cos, np.sqrt(cos**2 + toward2 * (1 - cos**2)))
        wo, m = _visible(facets, turn, np.interp(places, known, cos), size.normals)
        seen, wi = np.maximum(dot(wo, m), f4(0)), reflect(wo, m)
        one, other = (interpolate(table, _place_of_masking(facets, w)) for w in (wo, wi))
        above = np.where(wi[2] > 0, facets.weight(wo, wi, m) * one * other, f4(0))
        for side, eta in enumerate((ior, 1 / ior)):
            index = np.full(1, eta, f4)
            reflected, cos_refracted = fresnel_dielectric(seen, index)
            wi = refract(wo, m, seen, cos_refracted, index)
            below = np.where(wi[2] < 0, facets.weight(wo, wi, m), f4(0))
            energy = reflected * above + (f4(1) - reflected) * below
            lost[side, k] = 1 - energy.reshape(size.columns, -1).mean(1, dtype=float)
    lost = np.clip(lost, LEAST, 1)
    return lost, _means(facets, lost, _place_of_refraction) * np.array([1, ior**2])


def _constants(shape: Shape) -> tuple[float, float]:
    """Return α along and across."""
    assert shape.alpha is not None
    return shape.alpha, shape.alpha if shape.alpha_v is None else shape.alpha_v


def _facets(shape: Shape) -> Facets:
    """Return the facets of constants."""
    across = None if shape.alpha_v is None else np.full(1, shape.alpha_v, f4)
    return Facets(np.full(1, shape.alpha, f4), across, None, shape.beckmann, shape.separable)


def _visible(facets: Facets, turn: float, cos: Doubles, count: int) -> tuple[Floats, Floats]:
    """Return directions of a cos² of the azimuth and cosines (k,), and microfacets they see, (3, k·count)."""
    cos = np.clip(cos, 1e-4 * float(facets.alpha[0]), 1)
    sin = np.sqrt(1 - cos * cos)
    k = np.arange(count)
    u = np.stack([k * GOLDEN % 1, (k + 0.5) / count]).astype(f4)
    wo = np.stack([sin * np.sqrt(turn), sin * np.sqrt(1 - turn), cos]).astype(f4).repeat(count, 1)
    return wo, facets.visible_normals(wo, np.tile(u, cos.size))


def _neighbors(x: Floats, size: int) -> list[tuple[Ints, Floats]]:
    """Return the two entries of a table next to x in [0, 1], and their parts."""
    x = np.clip(x.astype(float), 0, 1) * (size - 1)
    i = np.minimum(x.astype(np.intp), size - 2)
    return [(i, 1 - (x - i)), (i + 1, x - i)]


def _fine(table: Doubles) -> Floats:
    """Return a table in float32; one of a single row gets so many columns that the nearest is enough."""
    if table[0].size == COLUMNS:
        fine, known = np.linspace(0, 1, FINE), np.linspace(0, 1, COLUMNS)
        rows = [np.interp(fine, known, side) for side in table.reshape(-1, COLUMNS)]
        table = np.stack(rows).reshape(*table.shape[:-1], FINE)
    return table.astype(np.float32)


def _means(facets: Facets, table: Doubles, place: Callable[[Facets, Floats], Place]) -> Doubles:
    """Return the means of a table (sides, turns, columns) over cosines, (sides,), by midpoints."""
    turns, midpoints = (1, MIDPOINTS) if facets.alpha_v is None else (AROUND, MIDPOINTS // 4)
    root, turned = ((np.arange(k) + f4(0.5)) / f4(k) for k in (midpoints, turns))
    sin, cos = sin_cos_turns(turned * f4(0.25))
    mu = np.tile(root * root, turns)
    r = np.sqrt(f4(1) - mu * mu)
    w = np.stack([r * cos.repeat(midpoints), r * sin.repeat(midpoints), mu])
    weight = np.tile(4.0 * root**3, turns) / mu.size  # 2μ dμ
    return np.array(
        [(interpolate(table, place(facets, w), side) * weight).sum() for side in range(len(table))]
    )

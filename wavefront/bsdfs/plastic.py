"""Plastics: a matte base below a clear boundary, between which light goes back and forth."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from ..arrays.vec import INV_PI, Doubles, Floats, dot, f4
from ..core.errors import flag, number
from ..core.parameter import Parameter, parametrized
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..textures.base import BaseTexture
from ..textures.parameter import MAX_INDEX, Color, Scalar, color, index_of, scalar
from .base import BsdfSample, weigh
from .fresnel import fresnel_dielectric
from .microfacet import Facets, alpha_of, reflect, refract
from .mirror import mirrored
from .rough import Distribution, Microfacets, Shadowing, distribution_of, shadowing_of

COSINES = 64  # columns of a table: cosines in [0, 1]
ROWS = 41  # rows of a table for textures: roughnesses in [0, 1]
LEAST = 1e-30  # mean of the light that gets in, where a table has 0


@parametrized
class Plastic(Microfacets):
    """A plastic, by its physics: a smooth or rough clear boundary over a matte base.

    Light that gets through the boundary is scattered by the base, and part of it is reflected back to the
    base by the boundary, again and again. It is the model of Mitsuba's `plastic` and `roughplastic`. A
    plastic with `reflectance` 1 reflects all light.

    Parameters
    ----------
    reflectance
        Albedo of the base per channel, in [0, 1]: a number, three numbers, or a texture.
    roughness
        Of the boundary, in [0, 1]; α = roughness². Below α = 0.001 it is perfectly smooth.
    ior
        Refractive index of the inside relative to the outside, a number from 1e-6 to 1e6.
    specular_reflectance
        Tint of reflection at the boundary, per channel, in [0, 1]. 1 is physical.
    nonlinear
        The base colors light at each of its reflections, so that colors become more saturated. False: once.
    distribution, shadowing
        As for `Conductor`.
    multiscatter
        All light that a rough boundary does not reflect gets to the base. False: only light that the facets
        refract once, as in Mitsuba, so that with `reflectance` 1 about 2 % is lost at roughness 0.05 and 70 %
        at 1.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> toy = wf.Plastic((0.8, 0.1, 0.1))
    >>> worn = wf.Plastic((0.8, 0.1, 0.1), roughness=0.4, nonlinear=True)
    """

    dimensions = 3

    reflectance: Parameter[Color] = Parameter(color, default=0.5)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.0)
    ior: Parameter[float] = Parameter(
        lambda name, value: number(
            name,
            index_of(name, value),
            lambda x: 1 / MAX_INDEX <= x <= MAX_INDEX,
            f"more than 0, from {1 / MAX_INDEX:g} to {MAX_INDEX:g}",
        ),
        default=1.5,
    )
    specular_reflectance: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    nonlinear: Parameter[bool] = Parameter(flag, default=False, kw_only=True)
    distribution: Parameter[Distribution] = Parameter(distribution_of, default="ggx", kw_only=True)
    shadowing: Parameter[Shadowing] = Parameter(shadowing_of, default="correlated", kw_only=True)
    multiscatter: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

    def derive(self) -> None:
        """Set whether the boundary is smooth, and which table it has: one roughness, or None for all."""
        super().derive()
        self._smooth, self.specular = self.specular, False
        self._one = None if isinstance(self.roughness, BaseTexture) else float(self.roughness[0])

    def albedo(self, wo: Floats) -> Floats:
        """Return the approximate albedo of boundary and base."""
        through, _, escaping = self._boundary(wo[2])
        base = self._base(escaping) * through
        return base + self.specular_reflectance * (f4(1) - through)

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the base and, if it is rough, the boundary."""
        above = wi[2] > 0
        through, mean, escaping = self._boundary(wo[2])
        back, _, _ = self._boundary(np.maximum(wi[2], f4(0)))
        index = np.full(1, self.ior, f4)
        scale = np.where(above, INV_PI / mean, f4(0))
        f = self._base(escaping) * (through * back * scale)
        chance = self._chance(through)
        pdf = cosine_hemisphere_pdf(wi) * (f4(1) - chance)
        if self._smooth:
            return f, pdf
        value, density, cos = self.facets().mirror_lobe(wo, wi)
        reflected, _ = fresnel_dielectric(cos, index)
        return f + self.specular_reflectance * (value * reflected), pdf + density * chance

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Reflect at the boundary, or scatter at the base, by u[2] and their approximate albedos."""
        through, _, _ = self._boundary(wo[2])
        chance = self._chance(through)
        glossy = u[2] < chance
        wi = mirrored(wo) if self._smooth else reflect(wo, self.facets().visible_normals(wo, u))
        wi = np.where(glossy, wi, cosine_hemisphere(u))
        f, pdf = self.evaluate(wo, wi)
        weight = weigh(f, wi, pdf)
        if not self._smooth:
            return BsdfSample(wi, weight, pdf, np.zeros(len(pdf), np.bool_))
        scale = (f4(1) - through) / np.where(chance > 0, chance, f4(1))
        weight = np.where(glossy, self.specular_reflectance * scale, weight)
        return BsdfSample(wi, weight, np.where(glossy, chance, pdf), glossy)

    def _base(self, escaping: Floats) -> Floats:
        """Part of the light below the boundary that gets out, after all reflections at the base, (3, n)."""
        if not self.nonlinear:
            return self.reflectance
        out = self.reflectance * escaping
        return out / (f4(1) - self.reflectance + out)

    def _chance(self, through: Floats) -> Floats:
        """Probability of reflection at the boundary, (n,), as Mitsuba chooses it."""
        gloss = _mean(self.specular_reflectance) * (f4(1) - through)
        base = _mean(self.reflectance) * through
        total = gloss + base
        return gloss / np.where(total > 0, total, f4(1))

    def _boundary(self, cos: Floats) -> tuple[Floats, Floats, Floats]:
        """Transmittances (n,): of light to the base, of diffuse light to the base, and of that from it."""
        if self._smooth:
            reflected, _ = fresnel_dielectric(cos, np.full(1, self.ior, f4))
            escaping = part_escaping(self.ior)
            return f4(1) - reflected, np.full(1, escaping * self.ior**2, f4), np.full(1, escaping, f4)
        shape = self.distribution == "beckmann", self.shadowing == "separable"
        through, *parts = boundary_tables(self.ior, self._one, *shape, self.multiscatter)
        x = np.clip(cos, f4(0), f4(1)) * f4(COSINES - 1)
        i = np.minimum(x.astype(np.intp), COSINES - 2)
        x = x - i.astype(f4)
        if self._one is not None:
            return through[0].take(i) * (f4(1) - x) + through[0].take(i + 1) * x, *parts
        y = np.clip(self.roughness, f4(0), f4(1)) * f4(ROWS - 1)
        j = np.minimum(y.astype(np.intp), ROWS - 2)
        y, flat, corner = y - j.astype(f4), through.ravel(), j * COSINES + i
        low = flat.take(corner) * (f4(1) - x) + flat.take(corner + 1) * x
        high = flat.take(corner + COSINES) * (f4(1) - x) + flat.take(corner + COSINES + 1) * x
        mean, escaping = (table.take(j) * (f4(1) - y) + table.take(j + 1) * y for table in parts)
        return low * (f4(1) - y) + high * y, mean, escaping


def _mean(color: Floats) -> Floats:
    return (color[0] + color[1] + color[2]) * f4(1 / 3)


@cache
def part_escaping(ior: float) -> float:
    """Part of diffuse light inside a smooth boundary that gets out: (1 − F)/η², by F from the rarer side."""
    mu = (np.arange(4096) + 0.5) / 4096
    passed = 1 - (2 * mu * fresnel_dielectric(mu, np.full(1, max(ior, 1 / ior)))[0]).mean()
    return float(passed / max(ior, 1) ** 2)


@cache
def boundary_tables(
    ior: float, roughness: float | None, beckmann: bool, separable: bool, multiscatter: bool
) -> tuple[Floats, Floats, Floats]:
    """Return the light that gets in through rough boundaries (r, COSINES), its mean, and that gets out (r,).

    Rows are one roughness, or `ROWS` from 0 to 1. With multiple scattering all gets through that the rarer
    side does not reflect. Without, as in Mitsuba 3's `roughplastic`, a mean over diffuse light is that of the
    columns, 1.5 % less than the integral, and the light that gets in is η² times that which gets out.
    """
    cos, mu = np.linspace(0, 1, COSINES), (np.arange(4096) + 0.5) / 4096
    rows = np.linspace(0, 1, ROWS) if roughness is None else np.array([roughness])
    through, mean, escaping = [], [], []
    for row in rows:
        facets = Facets(alpha_of(np.full(1, row, f4)), None, None, beckmann, separable)
        reflected = partial(_directional, facets, refracted=False)
        if not multiscatter:
            through.append(_directional(facets, ior, refracted=True))
            escaping.append(1 - 2 * (cos * reflected(1 / ior)).mean())
            mean.append(escaping[-1] * ior**2)
            continue
        through.append(np.maximum(1 - reflected(ior), 0))
        rarer = through[-1] if ior >= 1 else 1 - reflected(1 / ior)
        entering, passing = ((2 * mu * np.interp(mu, cos, passed)).mean() for passed in (through[-1], rarer))
        mean.append(max(entering, LEAST))
        escaping.append(passing / max(ior, 1) ** 2)
    return np.array(through, np.float32), np.array(mean, np.float32), np.array(escaping, np.float32)


def _directional(facets: Facets, eta: float, refracted: bool) -> Doubles:
    """Integrate single scattering by a boundary over the visible normals, for each cosine, (COSINES,)."""
    (around, parts), (along, lengths) = (np.polynomial.legendre.leggauss(side) for side in (24, 48))
    # half a turn stands for all of it
    u = np.stack(np.meshgrid((around + 1) / 4, (along + 1) / 2)).reshape(2, -1).astype(f4)
    weight = (lengths[:, None] * parts / 4).ravel()
    out = np.zeros(COSINES)
    for k, mu in enumerate(np.maximum(np.linspace(0, 1, COSINES), 1e-6)):
        wo = np.repeat(np.array([[np.sqrt(1 - mu * mu)], [0], [mu]], f4), u.shape[1], 1)
        m = facets.visible_normals(wo, u)
        cos = np.maximum(dot(wo, m), f4(0))
        index = np.full(1, eta, f4)
        reflected, cos_refracted = fresnel_dielectric(cos, index)
        if refracted:
            wi = refract(wo, m, cos, cos_refracted, index)
            value, pdf, _, _ = facets.refraction_lobe(wo, wi, index)
            factor = (f4(1) - reflected) * index * index
        else:
            wi, factor = reflect(wo, m), reflected
            value, pdf, _ = facets.mirror_lobe(wo, wi)
        term = factor * np.abs(wi[2]) * value / np.where(pdf > 0, pdf, f4(1))
        # the sum of the second is about 1: it corrects Beckmann's approximate masking
        out[k] = (term * weight).sum(dtype=float) / (facets.visible_weight(wo, m) * weight).sum(dtype=float)
    return out

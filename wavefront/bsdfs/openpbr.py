"""The scattering of OpenPBR: a coat and fuzz over metal, glossy diffuse and clear parts.

Source: the OpenPBR Surface specification 1.1 (Academy Software Foundation, 2024). docs/openpbr.md lists what
differs from it.
"""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np

from ..arrays.elementary import exp, log
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_PI, TINY, Bools, Floats, dot, f4
from ..core.errors import flag
from ..core.parameter import Parameter, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, index_of, refractive_index, scalar
from .albedo import dielectric_albedo, facet_cosines, gloss_tables, lookup
from .base import BsdfSample, JointBsdf
from .energy import Shape, mean_over_cosines
from .fresnel import fresnel_dielectric
from .fuzz import fuzz_albedo, fuzz_directions, fuzz_lobe
from .microfacet import Facets, alpha_of
from .oren_nayar import OrenNayar
from .principled import Chances, Principled, bent
from .rough import Tangent
from .thin_film import film_reflectance

F82 = f4(1 / 7)  # cosine of the angle where `specular_color` tints a metal, about 82°
MICROMETERS = f4(1000)  # in nanometers
LEAST_TINT = f4(1e-6)
HIGHEST_F0 = f4(0.99)  # of a metal that has an index of refraction


@parametrized
class OpenPBRBsdf(JointBsdf):
    """The BSDF of `OpenPBR`, which describes the parameters.

    Parameters
    ----------
    parameters
        Those of `OpenPBR` that are about scattering, and `multiscatter`, as for `Principled`.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.
    """

    dimensions = 3
    indices = ("specular_ior", "coat_ior")

    base_weight: Parameter[Scalar] = Parameter(scalar, default=1.0, kw_only=True)
    base_color: Parameter[Color] = Parameter(color, default=0.8, kw_only=True)
    base_diffuse_roughness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    base_metalness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    specular_weight: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x < np.inf, limit="at least 0"), default=1.0, kw_only=True
    )
    specular_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    specular_roughness: Parameter[Scalar] = Parameter(scalar, default=0.3, kw_only=True)
    specular_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.5, kw_only=True)
    specular_roughness_anisotropy: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    transmission_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    transmission_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    subsurface_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    subsurface_color: Parameter[Color] = Parameter(color, default=0.8, kw_only=True)
    coat_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    coat_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    coat_roughness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    coat_ior: Parameter[Scalar] = Parameter(
        lambda name, value: scalar(name, index_of(name, value), lambda x: 1 <= x <= 1e6, "from 1 to 1e+06"),
        default=1.6,
        kw_only=True,
    )
    coat_darkening: Parameter[Scalar] = Parameter(scalar, default=1.0, kw_only=True)
    fuzz_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    fuzz_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    fuzz_roughness: Parameter[Scalar] = Parameter(scalar, default=0.5, kw_only=True)
    thin_film_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    thin_film_thickness: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x <= 100, limit="in [0, 100] micrometers"),
        default=0.5,
        kw_only=True,
    )
    thin_film_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.4, kw_only=True)
    geometry_thin_walled: Parameter[bool] = Parameter(flag, default=False, kw_only=True)
    multiscatter: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

    @property
    def thin(self) -> bool:
        """True if the surface is a sheet."""
        return self.geometry_thin_walled

    @property
    def index_inside(self) -> Any:
        """Index of refraction of the clear part, which `specular_weight` changes."""
        varies = any(isinstance(each, BaseTexture) for each in (self.specular_ior, self.specular_weight))
        return self.specular_ior if varies else weighted_index(self.specular_ior, self.specular_weight)

    def derive(self) -> None:
        """Set which lobes exist, and the layers where all parameters are constants."""
        used = {name for name, value in vars(self).items() if isinstance(value, BaseTexture) or np.any(value)}
        textures = {name for name, value in vars(self).items() if isinstance(value, BaseTexture)}
        self.transmissive = "transmission_weight" in used
        layers = Layers(multiscatter=self.multiscatter, thin=self.thin)
        layers.transmissive, layers._coated = self.transmissive, "coat_weight" in used
        layers._fuzzy, layers.rough_base = "fuzz_weight" in used, "base_diffuse_roughness" in used
        layers.has_film = {"thin_film_weight", "thin_film_thickness"} <= used
        layers._tinted = not is_white(self.specular_color)
        layers._stained = self.thin and not is_white(self.transmission_color)
        stretched = "specular_roughness_anisotropy" in used
        layers.tangent = Tangent(np.zeros(1, f4)) if stretched else None
        across = {"specular_roughness", "specular_roughness_anisotropy", "coat_roughness", "coat_weight"}
        layers.shape = Shape(None, None, False, False, stretched)
        if not textures & across:
            along, beside = (float(alpha_of(r)[0]) for r in self._roughness())
            layers.shape = Shape(along, beside if stretched else None, False, False, stretched)
        again = self.multiscatter
        layers._metal_again = again and "base_metalness" in used
        layers._sheet_again = again and self.transmissive and self.thin
        known = not (self.thin or textures & {"specular_ior", "specular_weight"})
        layers._clear_again = again and self.transmissive and known
        if layers._clear_again:
            layers._boundary = float(bent(weighted_index(self.specular_ior, self.specular_weight))[0])
        self._layers = layers if textures else self._filled(layers)

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with the side of `wo`."""
        bound = copy(super().bind(surface))
        bound._layers = bound._filled(copy(self._layers).bind(surface))
        return bound

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes."""
        return self._layers.evaluate(wo, wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes."""
        return self._layers.sample_f(wo, u)

    def _roughness(self) -> tuple[Floats, Floats]:
        """Roughness along and across the tangent, below the coat, (n,) each."""
        below, above = (r * r * r * r for r in (self.specular_roughness, self.coat_roughness))
        coated = np.sqrt(np.sqrt(np.minimum(below + f4(2) * above, f4(1))))
        r = self.specular_roughness + (coated - self.specular_roughness) * self.coat_weight
        aspect = f4(1) - self.specular_roughness_anisotropy
        along = r * np.sqrt(np.sqrt(f4(2) / (f4(1) + aspect * aspect)))
        return along, along * np.sqrt(aspect)

    def _filled(self, layers: Layers) -> Layers:
        """Return layers with the parameters at the points."""
        along, across = self._roughness()
        base = self.base_weight * self.base_color
        around = f4(1) + (self.coat_ior - f4(1)) * self.coat_weight
        below = weighted_index(self.specular_ior / around, self.specular_weight)
        metal_weight = np.minimum(self.specular_weight, f4(1))
        vars(layers).update(
            roughness=along,
            roughness_v=None if layers.tangent is None else across,
            metallic=self.base_metalness,
            transmission=self.transmission_weight,
            ior=weighted_index(self.specular_ior, self.specular_weight),
            index_below=np.maximum(below, f4(1) / below),
            specular_weight=metal_weight,
            specular_color=self.specular_color,
            metal_color=base,
            edge=f4(1) - self.specular_color,
            base_color=base + (self.subsurface_color - base) * self.subsurface_weight,
            diffuse=base * (f4(1) - self.subsurface_weight),
            diffuse_roughness=self.base_diffuse_roughness,
            subsurface=self.subsurface_color * self.subsurface_weight,
            passed=self.transmission_color,
            film_weight=self.thin_film_weight,
            film_thickness=self.thin_film_thickness * MICROMETERS,
            film_ior=self.thin_film_ior,
            clearcoat=self.coat_weight,
            clearcoat_roughness=self.coat_roughness,
            coat_ior=np.maximum(self.coat_ior, f4(1) / self.coat_ior),
            coat_color=self.coat_color,
            darkening=self.coat_darkening * self.coat_weight,
            fuzz_weight=self.fuzz_weight,
            fuzz_color=self.fuzz_color,
            fuzz_roughness=self.fuzz_roughness,
        )
        return layers


class Layers(Principled):
    """The layers of OpenPBR at the points of a wave. Its parameters are set by `OpenPBRBsdf`."""

    indices = ()  # they are relative already

    rough_base: bool
    _fuzzy: bool
    _tinted: bool
    _stained: bool
    index_below: Floats  # (n,) of the base relative to the coat, at least 1
    metal_color: Floats  # (3, n) reflectance of the metal along the normal
    edge: Floats  # (3, n) what a metal absorbs at `F82` beyond Schlick's approximation
    diffuse: Floats  # (3, n)
    diffuse_roughness: Floats  # (n,)
    subsurface: Floats  # (3, n) scattered diffusely
    passed: Floats  # (3, n)
    film_weight: Floats  # (n,)
    coat_ior: Floats  # (n,)
    coat_color: Floats  # (3, n)
    darkening: Floats  # (n,)
    fuzz_weight: Floats  # (n,)
    fuzz_color: Floats  # (3, n)
    fuzz_roughness: Floats  # (n,)

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes: the base, then coat and fuzz layered over it."""
        chances = self._chances(wo)
        f, pdf = self._base(wo, wi, chances)
        zo, zi = wo[2], np.abs(wi[2])
        if self._coated:
            value, density, cos = Facets(alpha_of(self.clearcoat_roughness)).mirror_lobe(wo, wi)
            lost = np.maximum(
                *(dielectric_albedo(self.coat_ior, self.clearcoat_roughness, z) for z in (zo, zi))
            )
            f = f * (f4(1) - self.clearcoat * lost) * self._absorbed(zo, zi, wi[2] < 0) * self._darkened()
            f = f + value * self.clearcoat * fresnel_dielectric(cos, self.coat_ior)[0]
            pdf = pdf + chances.coat * density
        if self._fuzzy:
            value, density, albedo = fuzz_lobe(wo, wi, self.fuzz_roughness)
            f = f * (f4(1) - self.fuzz_weight * albedo) + self.fuzz_color * (self.fuzz_weight * value)
            pdf = pdf + chances.fuzz * density
        return f, pdf

    def _directions(self, wo: Floats, u: Floats) -> tuple[Floats, Bools, Floats | None]:
        wi, crosses, eta = super()._directions(wo, u)
        if self._fuzzy:
            fibers = u[2] >= f4(1) - self._chances(wo).fuzz
            wi = np.where(fibers, fuzz_directions(wo, u, self.fuzz_roughness), wi)
        return wi, crosses, eta

    def _weights(self, wo: Floats) -> Chances:
        weights = super()._weights(wo)
        if not self._fuzzy:
            return weights
        seen = self.fuzz_weight * fuzz_albedo(wo[2], self.fuzz_roughness)
        return weights._replace(fuzz=self.fuzz_color.max(0) * seen / (f4(1) - seen))

    @property
    def _tint(self) -> Floats:
        return np.ones(1, f4) if self.thin else self.passed

    @property
    def _shine(self) -> Floats:
        """Tint of what the clear part reflects outside; total reflection inside has none."""
        if not self._tinted:
            return super()._shine
        return np.where(self._inside, f4(1), self.specular_color)

    def _through(self, wo: Floats, wi: Floats, facets: Facets) -> tuple[Floats, Floats]:
        """Return what crosses; a sheet absorbs along the refracted ray."""
        value, density = super()._through(wo, wi, facets)
        if self._stained:
            half = wo + wi * np.array([[1], [1], [-1]], f4)
            value = value * _power(self.passed, self._length(f4(0.5) * np.sqrt(dot(half, half)), self.ior))
        return value, density

    def _dielectric(self, weight: Floats) -> Floats:
        """About the reflectance of the opaque dielectric, (3, n), for the choice of lobes."""
        root = (self.index_below - f4(1)) / (self.index_below + f4(1))
        return self.specular_color * (root * root + (f4(1) - root * root) * weight)

    def _gloss(self, cos: Floats) -> Floats:
        plain, _ = fresnel_dielectric(cos, self.index_below)
        return self.specular_color * (plain + self._film_adds(cos) if self.has_film else plain)

    def _film_adds(self, cos: Floats) -> Floats:
        """Return what the film adds to the reflectance of the opaque dielectric, (3, n)."""
        root = (self.index_below - f4(1)) / (self.index_below + f4(1))
        film = self._film(cos, np.broadcast_to(root * root, cos.shape))
        return (film - fresnel_dielectric(cos, self.index_below)[0]) * self.film_weight

    def _matte(self, wo: Floats, wi: Floats, part: Floats) -> Floats:
        above = part * np.where(wi[2] > 0, INV_PI, f4(0))
        if not self.rough_base:
            return self.base_color * above
        rough = copy(ROUGH)
        vars(rough).update(reflectance=self.diffuse, sigma=self.diffuse_roughness)
        return rough.f(wo, wi) * part + self.subsurface * above

    def _passed(self, roughness: Floats, cos: Floats | None) -> Floats:
        tint = self.specular_color.max(0)
        passed = f4(1) - tint * dielectric_albedo(self.index_below, roughness, cos)
        if not self.has_film or cos is None:
            return passed
        a, b, _, _ = gloss_tables()
        facet = lookup(facet_cosines(), roughness, cos)
        shown = lookup(a, roughness, cos) + lookup(b, roughness, cos)
        return passed - tint * shown * self._film_adds(facet)

    def _mean_passed(self, roughness: Floats, cos: Floats) -> Floats:
        return super()._mean_passed(roughness, cos) if self.has_film else self._passed(roughness, None)

    def _metal(self, cos: Floats) -> Floats:
        """Reflectance of the metal, (3, n), by the F82 tint (specification, section on metal)."""
        f0, away = self.metal_color, np.maximum(f4(1) - cos, f4(0))
        fifth = (away * away) * (away * away) * away
        steep = (f4(1) - F82) ** 5
        dip = (f0 + (f4(1) - f0) * steep) * self.edge / (F82 * steep * (f4(1) - F82))
        plain = f0 + (f4(1) - f0) * fifth - dip * (cos * fifth * away)
        if self.has_film:
            plain = plain + (self._metal_below_film(cos) - plain) * self.film_weight
        return np.maximum(plain, f4(0)) * self.specular_weight

    def _metal_below_film(self, cos: Floats) -> Floats:
        """Reflectance of the metal below the film, (3, n).

        Its index η + ik is that of O. Gulbrandsen 2014, "Artist Friendly Metallic Fresnel" (JCGT 3(4)), for
        its color along the normal and the tint at the edge.
        """
        f0 = np.minimum(self.metal_color, HIGHEST_F0)
        root = np.sqrt(f0)
        most, least = (f4(1) + root) / (f4(1) - root), (f4(1) - f0) / (f4(1) + f0)
        eta = least + (most - least) * self.edge
        k2 = (f0 * (eta + f4(1)) ** 2 - (eta - f4(1)) ** 2) / (f4(1) - f0)
        k = np.sqrt(np.maximum(k2, f4(0)))
        return film_reflectance(cos, self.film_thickness, self.film_ior, f4(1), eta, k)

    def _mean_metal(self) -> Floats:
        return mean_over_cosines(self._metal)

    def _fresnel(self, cos: Floats) -> tuple[Floats, Floats]:
        face, refracted = super()._fresnel(cos)
        if self.has_film:
            bare = copy(self)
            bare.has_film = False
            plain, _ = bare._fresnel(cos)
            face = plain + (face - plain) * self.film_weight
        return face, refracted

    def _absorbed(self, zo: Floats, zi: Floats, crosses: Any) -> Floats:
        """Light that the coat lets pass, (3, n): `coat_color` where it is passed twice along the normal."""
        lengths = self._length(zo, self.coat_ior) + self._length(zi, self.coat_ior)
        color = _power(self.coat_color, lengths * np.where(crosses, f4(0.25), f4(0.5)))
        return f4(1) + (color - f4(1)) * self.clearcoat

    @staticmethod
    def _length(cos: Floats, ior: Floats) -> Floats:
        """Length of a refracted ray through a layer, relative to that along the normal, (n,)."""
        sin2 = (f4(1) - cos * cos) * (f4(1) / (ior * ior))
        return f4(1) / np.sqrt(np.maximum(f4(1) - sin2, TINY))

    def _darkened(self) -> Floats:
        """Part that is left of light that the coat threw back to the base, (3, n) (specification, Δ)."""
        outside, below = (
            mean_over_cosines(lambda mu, eta=eta: fresnel_dielectric(mu, eta)[0])  # type: ignore[misc]
            for eta in (self.coat_ior, self.index_below)
        )
        inside = f4(1) - (f4(1) - outside) / (self.coat_ior * self.coat_ior)
        m, opaque = self.metallic, f4(1) - self.transmission
        rough = f4(1) + (self.roughness - f4(1)) * (below + (f4(1) - below) * m)
        back = outside + (inside - outside) * rough
        base = opaque * (self.base_color + (f4(1) - self.base_color) * below) + self.transmission
        albedo = base + (self._mean_metal() - base) * m
        return f4(1) + ((f4(1) - back) / (f4(1) - albedo * back) - f4(1)) * self.darkening


def is_white(colors: Any) -> bool:
    """Return whether colors are constant and 1."""
    return not isinstance(colors, BaseTexture) and bool(np.all(colors == 1))


def _power(colors: Floats, exponent: Floats) -> Floats:
    """Return powers of colors, (3, n)."""
    return exp(log(np.maximum(colors, LEAST_TINT)) * exponent)


def weighted_index(ior: Floats, weight: Floats) -> Floats:
    """Return the index whose reflectance along the normal is `weight` times that of another, (n,)."""
    root = (ior - f4(1)) / (ior + f4(1)) * np.sqrt(weight)
    root = np.clip(root, f4(-0.999), f4(0.999))
    return (f4(1) + root) / (f4(1) - root)


ROUGH = OrenNayar(0.5, 0.5, energy_preserving=True)

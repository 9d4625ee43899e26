"""Disney's principled material, as Mitsuba has it."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np

from ..arrays.elementary import exp, log, sin_cos_turns
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_PI, TINY, Floats, broadcast, dot, f4, luminance
from ..core.parameter import Parameter, parametrized
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, refractive_index, scalar
from .base import BsdfSample, weigh
from .fresnel import fresnel_dielectric
from .microfacet import SMOOTH, Facets, reflect, refract
from .rough import Microfacets, Tangent

COAT_F0 = f4(0.04)
COAT_SHADOWS = Facets(np.full(1, 0.25, f4), separable=True)


@parametrized
class DisneyBase(Microfacets):
    """What Disney's materials for solids and for thin sheets have in common."""

    dimensions = 3

    base_color: Parameter[Color] = Parameter(color, default=0.5)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.5)
    anisotropic: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    ior: Parameter[Scalar] = Parameter(refractive_index, default=1.5, kw_only=True)
    transmission: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    specular_tint: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    sheen: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    sheen_tint: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    flatness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    shadowing = "separable"

    def derive(self) -> None:
        """Set the direction of the facets."""
        self.tangent = Tangent(np.zeros(1, f4)) if _used(self.anisotropic) else None

    def facets(self) -> Facets:
        """Return the microfacets, stretched by the aspect ratio √(1 − 0.9·anisotropic)."""
        return self._facets_of(self.roughness)

    def _facets_of(self, roughness: Floats) -> Facets:
        alpha, aspect = roughness * roughness, np.sqrt(f4(1) - f4(0.9) * self.anisotropic)
        tangent = None if isinstance(self.tangent, BaseTexture) else self.tangent
        along, across = np.maximum(alpha / aspect, SMOOTH), np.maximum(alpha * aspect, SMOOTH)
        return Facets(along, across, tangent, separable=True)

    def _glossy(self, cos: Floats, reflected: Floats, cos_refracted: Floats) -> tuple[Floats, Floats]:
        """Fresnel reflectance of a tinted dielectric, (3, n), and Schlick's weight of white, (n,)."""
        weight = _fifth(np.where(self.ior > 1, cos, cos_refracted))
        normal = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        tinted = weight + (f4(1) - weight) * (self._hue() * normal)
        return reflected + (tinted - reflected) * self.specular_tint, weight

    def _hue(self) -> Floats:
        bright = luminance(self.base_color)
        return np.where(bright > 0, self.base_color / np.where(bright > 0, bright, f4(1)), f4(1))

    def _matte(self, wo: Floats, wi: Floats, cos: Floats) -> Floats:
        """Diffuse and retro-reflection, or approximate subsurface scattering, (3, n)."""
        zi = np.abs(wi[2])
        o, i = _fifth(wo[2]), _fifth(zi)
        retro = f4(2) * self.roughness * cos * cos
        diffuse = (f4(1) - f4(0.5) * o) * (f4(1) - f4(0.5) * i) + retro * (o + i + o * i * (retro - f4(1)))
        half = f4(0.5) * retro - f4(1)
        below = (f4(1) + half * o) * (f4(1) + half * i)
        flat = f4(1.25) * (below * (f4(1) / np.maximum(wo[2] + zi, TINY) - f4(0.5)) + f4(0.5))
        return self.base_color * ((diffuse + (flat - diffuse) * self.flatness) * INV_PI)

    def _sheen(self, cos: Floats, part: Floats) -> Floats:
        """Light that grazes cloth on a part of the surface, (3, n)."""
        hue = f4(1) + (self._hue() - f4(1)) * self.sheen_tint
        return hue * (self.sheen * part * _fifth(cos))


@parametrized
class Disney(DisneyBase):
    """Disney's principled material, with the formulas of Mitsuba 3's `principled`.

    `Principled` has about the same parameters with glTF's formulas, which lose and gain less energy. This one
    is for scenes that were made for Disney's.

    Source: B. Burley 2012, "Physically Based Shading at Disney", and 2015, "Extending the Disney BRDF to a
    BSDF with Integrated Subsurface Scattering", as implemented in Mitsuba 3.

    Parameters
    ----------
    base_color
        Albedo of the base, color of the metal, and square of the tint of transmitted light, in [0, 1].
    roughness, metallic, anisotropic
        In [0, 1]; the facets are `anisotropic` along the direction of growing u.
    ior, transmission
        Refractive index, and the part of the base that transmits light.
    specular_tint, sheen, sheen_tint
        In [0, 1]; tints are towards the hue of the base.
    flatness
        In [0, 1], from diffuse to approximate subsurface scattering.
    clearcoat, clearcoat_gloss
        Strength and gloss of a varnish, in [0, 1].

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> paint = wf.Disney((0.2, 0.1, 0.6), 0.4, clearcoat=1, flatness=0.5)
    """

    indices = ("ior",)

    metallic: Parameter[Scalar] = Parameter(scalar, default=0.0)
    clearcoat: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    clearcoat_gloss: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)

    def derive(self) -> None:
        """Set whether light crosses the surface, and the direction of the facets."""
        super().derive()
        self.transmissive = _used(self.transmission)

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with the side of `wo`."""
        bound = copy(super().bind(surface))
        bound.back_facing = surface.back_facing if self.transmissive else None
        return bound

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes."""
        facets, (front, eta, clear, gloss, coat, matte) = self.facets(), self._lobes(wo)
        value, density, cos = facets.mirror_lobe(wo, wi)
        reflected, cos_refracted = fresnel_dielectric(cos, eta)
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission) * front
        tinted = self._tinted(cos, reflected, cos_refracted)
        f = np.where(front > 0, tinted, clear * reflected) * value
        above = np.where(wi[2] > 0, front, f4(0))
        # Mitsuba evaluates the sheen where there is a diffuse base
        some = (f4(1) - self.metallic) * (self.transmission < 1)
        f = f + self._matte(wo, wi, cos) * (opaque * above) + self._sheen(cos, some) * above
        coat_value, coat_density = self._coat(wo, wi, cos)
        f = f + coat_value * above
        pdf = gloss * density * self._chance(reflected, clear, front) + coat * coat_density * above
        pdf = pdf + matte * cosine_hemisphere_pdf(wi)
        if not self.transmissive:
            return f, pdf
        through, through_density, through_cos, _ = facets.refraction_lobe(wo, wi, eta)
        beyond, _ = fresnel_dielectric(through_cos, eta)
        f = f + np.sqrt(self.base_color) * (clear * through * (f4(1) - beyond))
        return f, pdf + gloss * through_density * (f4(1) - self._chance(beyond, clear, front))

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes."""
        front, eta, clear, gloss, coat, _ = self._lobes(wo)
        m = self.facets().visible_normals(wo, u)
        coated = (u[2] >= gloss) & (u[2] < gloss + coat)
        m = np.where(coated, self._coat_normals(u), m)
        cos = np.maximum(dot(wo, m), f4(0))
        reflected, cos_refracted = fresnel_dielectric(cos, eta)
        wi = np.where(u[2] < gloss + coat, reflect(wo, m), cosine_hemisphere(u))
        crosses = (u[2] >= gloss * self._chance(reflected, clear, front)) & (u[2] < gloss)
        wi = np.where(crosses, refract(wo, m, cos, cos_refracted, eta), wi)
        f, pdf = self.evaluate(wo, wi)
        pdf = np.where((wi[2] < 0) == crosses, pdf, f4(0))
        relative = np.where(crosses, eta, f4(1)) if self.transmissive else None
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)), relative)

    def _lobes(self, wo: Floats) -> tuple[Floats, ...]:
        """Front (1 or 0), index, weight of transmission; chances of gloss, coat and base, (n,) each."""
        n = wo.shape[1]
        behind = np.zeros(n, np.bool_) if self.back_facing is None else self.back_facing
        front = np.where(behind, f4(0), f4(1))
        clear = (f4(1) - self.metallic) * self.transmission * np.ones_like(front)
        coat = f4(0.25) * self.clearcoat * front
        matte = (f4(1) - self.metallic) * (f4(1) - self.transmission) * front
        matte = matte + self.sheen * (f4(1) - self.metallic) * front * f4(0.25)
        gloss = np.where(behind & ~(clear > 0), f4(0), f4(1))
        share = f4(1) / np.maximum(gloss + coat + matte, f4(1))
        eta = np.where(behind, f4(1) / self.ior, self.ior)
        return front, eta, clear, gloss * share, coat * share, matte * share

    def _chance(self, reflected: Floats, clear: Floats, front: Floats) -> Floats:
        """Part of the light at facets that is reflected rather than transmitted, (n,)."""
        return f4(1) - np.where(front > 0, clear, f4(1)) * (f4(1) - reflected) * (clear > 0)

    def _tinted(self, cos: Floats, reflected: Floats, cos_refracted: Floats) -> Floats:
        """Fresnel reflectance of metal and dielectric from the front, (3, n)."""
        glossy, weight = self._glossy(cos, reflected, cos_refracted)
        metal = weight + (f4(1) - weight) * self.base_color
        return glossy + (metal - glossy) * self.metallic

    def _coat_alpha2(self) -> Floats:
        return (f4(0.1) + (f4(0.001) - f4(0.1)) * self.clearcoat_gloss) ** 2

    def _coat(self, wo: Floats, wi: Floats, cos: Floats) -> tuple[Floats, Floats]:
        """Value and density of the varnish (GTR1, Burley 2012, eq. 4), (n,) each."""
        h, a2 = wo + wi, self._coat_alpha2()
        h2 = np.maximum(dot(h, h), TINY)
        cos2 = h[2] * h[2] / h2
        density = (a2 - f4(1)) * INV_PI / (log(a2) * (f4(1) + (a2 - f4(1)) * cos2))
        fresnel = COAT_F0 + (f4(1) - COAT_F0) * _fifth(cos)
        so, si = COAT_SHADOWS.stretched(wo), COAT_SHADOWS.stretched(wi)
        zi = np.maximum(wi[2], f4(0))
        shadows = f4(4) * wo[2] * zi / np.maximum((wo[2] + so) * (zi + si), TINY)
        value = f4(0.25) * self.clearcoat * fresnel * density * shadows
        return value, density * np.sqrt(cos2) / np.maximum(f4(4) * cos, TINY)

    def _coat_normals(self, u: Floats) -> Floats:
        """Draw normals (3, n) of the varnish by D·cosθ."""
        a2 = self._coat_alpha2()
        cos2 = (f4(1) - exp(log(a2) * (f4(1) - u[1]))) / (f4(1) - a2)
        radius = np.sqrt(np.maximum(f4(1) - cos2, f4(0)))
        sin, cos = sin_cos_turns(u[0])
        return np.stack([radius * cos, radius * sin, np.sqrt(np.maximum(cos2, f4(0)))])


def _used(parameter: Any) -> bool:
    return isinstance(parameter, BaseTexture) or bool(parameter[0] > 0)


def _fifth(cos: Floats) -> Floats:
    away = np.clip(f4(1) - cos, f4(0), f4(1))
    return (away * away) ** 2 * away

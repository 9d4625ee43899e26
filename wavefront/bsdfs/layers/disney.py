"""The lobes of Disney's materials, for solids and for thin sheets, with the formulas of Mitsuba 3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.elementary import exp, log, sin_cos_turns
from ...arrays.soa import soa
from ...arrays.vec import INV_PI, TINY, Bools, Floats, dot, f4, luminance
from ...sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..fresnel import fresnel_dielectric
from ..microfacet import SMOOTH, Facets, reflect, refract
from .layers import Base, Chances, Cover, Drawn

COAT_F0 = f4(0.04)
COAT_SHADOWS = Facets(np.full(1, 0.25, f4), separable=True)


@dataclass(eq=False, kw_only=True)
class DisneyBase(Base):
    """The common part of the bases of solids and of thin sheets."""

    base_color: Floats  # (3, n)
    roughness: Floats  # (n,)
    anisotropic: Floats  # (n,)
    tangent: Any  # (2, n), as `Facets` has it
    ior: Floats  # (n,)
    transmission: Floats  # (n,)
    specular_tint: Floats  # (n,)
    sheen: Floats  # (n,)
    sheen_tint: Floats  # (n,)
    flatness: Floats  # (n,)

    def facets(self, roughness: Floats | None = None) -> Facets:
        """Return the microfacets, stretched by the aspect ratio √(1 − 0.9·anisotropic)."""
        roughness = self.roughness if roughness is None else roughness
        alpha, aspect = roughness * roughness, np.sqrt(f4(1) - f4(0.9) * self.anisotropic)
        along, across = np.maximum(alpha / aspect, SMOOTH), np.maximum(alpha * aspect, SMOOTH)
        return Facets(along, across, self.tangent, separable=True)

    def glossy(self, cos: Floats, reflected: Floats, cos_refracted: Floats) -> tuple[Floats, Floats]:
        """Return the reflectance of a tinted dielectric, (3, n), and Schlick's weight of white, (n,)."""
        weight = _fifth(np.where(self.ior > 1, cos, cos_refracted))
        normal = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        tinted = weight + (f4(1) - weight) * (self._hue() * normal)
        return reflected + (tinted - reflected) * self.specular_tint, weight

    def _hue(self) -> Floats:
        bright = luminance(self.base_color)
        return np.where(bright > 0, self.base_color / np.where(bright > 0, bright, f4(1)), f4(1))

    def matte(self, wo: Floats, wi: Floats, cos: Floats) -> Floats:
        """Return diffuse and retro-reflection, or approximate subsurface scattering, (3, n)."""
        zi = np.abs(wi[2])
        o, i = _fifth(wo[2]), _fifth(zi)
        retro = f4(2) * self.roughness * cos * cos
        diffuse = (f4(1) - f4(0.5) * o) * (f4(1) - f4(0.5) * i) + retro * (o + i + o * i * (retro - f4(1)))
        half = f4(0.5) * retro - f4(1)
        below = (f4(1) + half * o) * (f4(1) + half * i)
        flat = f4(1.25) * (below * (f4(1) / np.maximum(wo[2] + zi, TINY) - f4(0.5)) + f4(0.5))
        return self.base_color * ((diffuse + (flat - diffuse) * self.flatness) * INV_PI)

    def fibers(self, cos: Floats, share: Floats) -> Floats:
        """Return the light that grazes cloth on a part of the surface, (3, n)."""
        hue = f4(1) + (self._hue() - f4(1)) * self.sheen_tint
        return hue * (self.sheen * share * _fifth(cos))


@dataclass(eq=False, kw_only=True)
class DisneySolid(DisneyBase):
    """Metal, gloss, matte part and glass."""

    metallic: Floats  # (n,)
    transmissive: bool
    front: Floats  # (n,) 1 where wo is outside, else 0: there is only glass

    def __post_init__(self) -> None:
        """Compute the values that all lobes share."""
        self.clear = (f4(1) - self.metallic) * self.transmission * np.ones_like(self.front)
        self.eta = np.where(self.front == 0, f4(1) / self.ior, self.ior)

    def weights(self, wo: Floats) -> Chances:
        """Return the weights that Mitsuba gives to the lobes."""
        matte = (f4(1) - self.metallic) * (f4(1) - self.transmission) * self.front
        matte = matte + self.sheen * (f4(1) - self.metallic) * self.front * f4(0.25)
        gloss = np.where((self.front == 0) & ~(self.clear > 0), f4(0), f4(1))
        return Chances(gloss, diffuse=matte)

    def share(self, total: Floats) -> Floats:
        """Return the factor of weights of this sum: samples of absent lobes are lost."""
        return f4(1) / np.maximum(total, f4(1))

    def evaluate(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` (3, n), and its part of the `pdf` (n,)."""
        facets, front, eta, clear = self.facets(), self.front, self.eta, self.clear
        value, density, cos = facets.mirror_lobe(wo, wi)
        reflected, cos_refracted = fresnel_dielectric(cos, eta)
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission) * front
        tinted = self._tinted(cos, reflected, cos_refracted)
        f = np.where(front > 0, tinted, clear * reflected) * value
        above = np.where(wi[2] > 0, front, f4(0))
        # Mitsuba evaluates the sheen where there is a diffuse base
        opaque_part = (f4(1) - self.metallic) * (self.transmission < 1)
        f = f + self.matte(wo, wi, cos) * (opaque * above) + self.fibers(cos, opaque_part) * above
        pdf = chances.gloss * density * self._chance(reflected)
        pdf = pdf + chances.diffuse * cosine_hemisphere_pdf(wi)
        if not self.transmissive:
            return f, pdf
        through, through_density, through_cos, _ = facets.refraction_lobe(wo, wi, eta)
        beyond, _ = fresnel_dielectric(through_cos, eta)
        f = f + np.sqrt(self.base_color) * (clear * through * (f4(1) - beyond))
        return f, pdf + chances.gloss * through_density * (f4(1) - self._chance(beyond))

    def directions(self, wo: Floats, u: Floats, chances: Chances, coat: Cover | None) -> Drawn:
        """Return directions of all lobes, and which are to cross the surface."""
        gloss, eta, above = chances.gloss, self.eta, chances.gloss + chances.coat
        if coat is None or coat.normals is None:
            m = self.facets().visible_normals(wo, u)
        else:
            m = coat.normals(self.facets(), wo, u, (u[2] >= gloss) & (u[2] < above))
        cos = np.maximum(dot(wo, m), f4(0))
        reflected, cos_refracted = fresnel_dielectric(cos, eta)
        wi = np.where(u[2] < above, reflect(wo, m), cosine_hemisphere(u))
        crosses = (u[2] >= gloss * self._chance(reflected)) & (u[2] < gloss)
        wi = np.where(crosses, refract(wo, m, cos, cos_refracted, eta), wi)
        return Drawn(wi, crosses, np.where(crosses, eta, f4(1)) if self.transmissive else None)

    def _chance(self, reflected: Floats) -> Floats:
        """Part of the light at facets that is reflected rather than transmitted, (n,)."""
        transmitted = np.where(self.front > 0, self.clear, f4(1)) * (f4(1) - reflected) * (self.clear > 0)
        return f4(1) - transmitted

    def _tinted(self, cos: Floats, reflected: Floats, cos_refracted: Floats) -> Floats:
        """Fresnel reflectance of metal and dielectric from the front, (3, n)."""
        glossy, weight = self.glossy(cos, reflected, cos_refracted)
        metal = weight + (f4(1) - weight) * self.base_color
        return glossy + (metal - glossy) * self.metallic


@dataclass(eq=False, kw_only=True)
class DisneySheet(DisneyBase):
    """A thin sheet, which looks the same from both sides."""

    diffuse_transmission: Floats  # (n,)

    def weights(self, wo: Floats) -> Chances:
        """Return the weights of reflection and transmission by facets, and of both matte lobes."""
        gloss, above, below = self._shares()
        return Chances(gloss, gloss, diffuse=above + below)

    def evaluate(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` (3, n) and the `pdf` (n,), of the lobes on the side of wi."""
        upper = wi.copy()
        upper[2] = np.abs(wi[2])
        gloss, above, below = self._shares()
        value, density, cos = self.facets().mirror_lobe(wo, upper)
        reflected, cos_refracted = fresnel_dielectric(cos, self.ior)
        glossy, _ = self.glossy(cos, reflected, cos_refracted)
        f = glossy * (self.transmission * value) + self.matte(wo, upper, cos) * above
        f = f + self.fibers(cos, above)
        value, through, _ = self._facets_through().mirror_lobe(wo, upper)
        seen = dot(wi, wo + upper) < 0  # both directions see the facet, from opposite sides
        clear = np.where(seen, self.transmission * (f4(1) - reflected) * value, f4(0))
        crossing = self.base_color * (clear + INV_PI * below)
        matte, is_above = INV_PI * upper[2], wi[2] > 0
        pdf = gloss * np.where(is_above, density, np.where(seen, through, f4(0)))
        pdf = pdf + np.where(is_above, above, below) * matte
        return np.where(is_above, f, crossing), pdf

    def directions(self, wo: Floats, u: Floats, chances: Chances, coat: Cover | None) -> Drawn:
        """Return directions of all lobes, and which are to cross the surface."""
        gloss, above, _ = self._shares()
        clear, faceted = u[2] < gloss, u[2] < f4(2) * gloss
        m = np.where(
            clear, self._facets_through().visible_normals(wo, u), self.facets().visible_normals(wo, u)
        )
        wi = np.where(faceted, reflect(wo, m), cosine_hemisphere(u))
        valid = wi[2] > 0
        crosses = clear | (u[2] >= f4(2) * gloss + above)
        wi[2] *= np.where(crosses, f4(-1), f4(1))
        return Drawn(wi, crosses, valid=valid & (~clear | (dot(wi, m) < 0)))

    def _shares(self) -> tuple[Floats, Floats, Floats]:
        """Chances of each of the two faceted lobes, and of matte reflection and transmission."""
        matte, crossing = f4(1) - self.transmission, f4(0.5) * self.diffuse_transmission
        return f4(0.5) * self.transmission, matte * (f4(1) - crossing), matte * crossing

    def _facets_through(self) -> Facets:
        """Return the facets of transmission, rougher the higher the index (Burley 2015, figure 15)."""
        return self.facets((f4(0.65) * self.ior - f4(0.35)) * self.roughness)


@soa
class DisneyCoat(Cover):
    """The varnish (GTR1, Burley 2012, eq. 4), which takes no light from the layers below."""

    strength: Floats  # (n,)
    shine: Floats  # (n,) from 0 to 1
    front: Floats  # (n,) as for `DisneySolid`

    def weigh(self, weights: Chances, wo: Floats) -> Chances:
        """Return weights with that of the coat."""
        return weights._replace(coat=f4(0.25) * self.strength * self.front)

    def normals(self, facets: Facets, wo: Floats, u: Floats, chosen: Bools) -> Floats:
        """Draw normals (3, n) of the base's facets, and where it is chosen the coat's, by D·cosθ."""
        a2 = self._alpha2()
        cos2 = (f4(1) - exp(log(a2) * (f4(1) - u[1]))) / (f4(1) - a2)
        radius = np.sqrt(np.maximum(f4(1) - cos2, f4(0)))
        sin, cos = sin_cos_turns(u[0])
        coat_normals = np.stack([radius * cos, radius * sin, np.sqrt(np.maximum(cos2, f4(0)))])
        return np.where(chosen, coat_normals, facets.visible_normals(wo, u))

    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the coat and of the layers below."""
        h, a2, above = wo + wi, self._alpha2(), np.where(wi[2] > 0, self.front, f4(0))
        h2 = np.maximum(dot(h, h), TINY)
        cos2, cos = h[2] * h[2] / h2, np.minimum(f4(0.5) * np.sqrt(dot(h, h)), f4(1))
        density = (a2 - f4(1)) * INV_PI / (log(a2) * (f4(1) + (a2 - f4(1)) * cos2))
        fresnel = COAT_F0 + (f4(1) - COAT_F0) * _fifth(cos)
        so, si = COAT_SHADOWS.stretched(wo), COAT_SHADOWS.stretched(wi)
        zi = np.maximum(wi[2], f4(0))
        shadows = f4(4) * wo[2] * zi / np.maximum((wo[2] + so) * (zi + si), TINY)
        value = f4(0.25) * self.strength * fresnel * density * shadows
        drawn = density * np.sqrt(cos2) / np.maximum(f4(4) * cos, TINY)
        return f + value * above, pdf + chances.coat * drawn * above

    def _alpha2(self) -> Floats:
        return (f4(0.1) + (f4(0.001) - f4(0.1)) * self.shine) ** 2


def _fifth(cos: Floats) -> Floats:
    away = np.clip(f4(1) - cos, f4(0), f4(1))
    return (away * away) ** 2 * away

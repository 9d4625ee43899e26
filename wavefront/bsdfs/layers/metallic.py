"""The base of glTF and OpenPBR: metal, gloss over a matte part, and a clear part, in the same microfacets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.vec import TINY, Floats, dot, f4, luminance
from ...sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..channels import mean_of_channels
from ..energy import Shape, gain
from ..microfacet import reflect
from ..rough import MicrofacetSurface
from .clear import Clear
from .coat import GRAZING
from .fresnel import fifth
from .gloss import Gloss
from .layers import Base, Chances, Cover, Drawn
from .matte import Matte
from .metal import Metal


@dataclass(eq=False, kw_only=True)
class MetallicBase(MicrofacetSurface, Base):
    """Metal, gloss over a matte part, and a clear part, which share their microfacets."""

    roughness: Floats  # (n,)
    roughness_v: Floats | None  # (n,)
    tangent: Any  # (2, n), as `Facets` has it
    shape: Shape  # of tables of lost light
    color: Floats  # (3, n) about that of the base, for the choice of lobes
    metallic: Floats  # (n,)
    transmission: Floats  # (n,)
    metal: Metal
    gloss: Gloss
    matte: Matte
    clear: Clear | None  # None in opaque materials
    metal_again: bool = False  # with multiple scattering by the facets of the metal
    layered: bool = (
        True  # all light that the gloss does not reflect gets below; else by Fresnel in the facets
    )

    def weights(self, wo: Floats) -> Chances:
        """Return the approximate albedo of each lobe."""
        weight = fifth(wo[2])
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission)
        seen = luminance(self.gloss.schlick(weight))
        metal = luminance(self.color + (f4(1) - self.color) * weight)
        gloss = self.metallic * (metal + GRAZING) + opaque * (seen + GRAZING * (self.gloss.weight > 0))
        diffuse = opaque * (luminance(self.color) + (self.color > 0).any(0) * f4(0.01))
        glass = (f4(1) - self.metallic) * self.transmission
        again: Floats = np.zeros(1, f4)
        if self.clear is not None and self.clear.boundary is not None:
            again = glass * self.clear.loss(self.shape).at(self, wo, self.clear.inside)
            glass = glass - again
        return Chances(gloss, glass, again=again, diffuse=diffuse)

    def evaluate(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` (3, n), and its part of the `pdf` (n,)."""
        facets = self.facets()
        both = facets.stretched(wo), facets.stretched(wi)
        value, density, cos = facets.mirror_lobe(wo, wi, both)
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission)
        metal = self.metal.reflectance(cos)
        if self.metal_again:
            metal = metal * gain(self, wo, wi, self.metal.mean(), both)
        gloss = self.gloss.reflectance(cos)
        below = self._under_gloss(wo, wi) if self.layered else f4(1) - gloss.max(0)
        f = (metal * self.metallic + gloss * opaque) * value + self.matte.f(wo, wi, opaque * below)
        pdf = chances.gloss * density + chances.diffuse * cosine_hemisphere_pdf(wi)
        if self.clear is None:
            return f, pdf
        clear, weight = self.clear, (f4(1) - self.metallic) * self.transmission
        reflected, _ = clear.fresnel(cos)
        through, through_density = clear.through(wo, wi, facets)
        pdf = pdf + chances.glass * (density * mean_of_channels(reflected) + through_density)
        if clear.again:
            grown = gain(self, wo, wi, None, both)
            value, through = value * grown, through * grown if clear.thin else through
        once = value * reflected * (clear.shine * weight) + clear.tint * (through * weight)
        if clear.boundary is None:
            return f + once, pdf
        added, spread, _ = clear.loss(self.shape).lobe(self, wo, wi, clear.inside, both)
        tint = np.where(wi[2] < 0, clear.tint, clear.shine)
        return f + once + tint * (added * weight), pdf + chances.again * spread

    def directions(self, wo: Floats, u: Floats, chances: Chances, coat: Cover | None) -> Drawn:
        """Return directions of all lobes, and which are to cross the surface."""
        facet = chances.gloss + chances.glass
        facets, reflected_below = self.facets(), facet + chances.coat
        if coat is None or coat.normals is None:
            m = facets.visible_normals(wo, u)
        else:
            m = coat.normals(facets, wo, u, (u[2] >= facet) & (u[2] < reflected_below))
        wi = np.where(u[2] < reflected_below, reflect(wo, m), cosine_hemisphere(u))
        if self.clear is None:
            return Drawn(wi, np.zeros(wo.shape[1], np.bool_))
        return self._crossing(self.clear, wo, wi, m, u, chances)

    def _crossing(
        self, clear: Clear, wo: Floats, wi: Floats, m: Floats, u: Floats, chances: Chances
    ) -> Drawn:
        """Return directions, those that cross the surface turned to the other side."""
        facet = chances.gloss + chances.glass
        cos = np.maximum(dot(wo, m), f4(0))
        reflected, cos_refracted = clear.fresnel(cos)
        crosses = (u[2] >= chances.gloss + chances.glass * mean_of_channels(reflected)) & (u[2] < facet)
        eta = clear.eta()
        wi = np.where(crosses, clear.across(wo, wi, m, cos, cos_refracted, eta), wi)
        if clear.boundary is not None:
            left = (u[2] - (facet + chances.coat)) / np.maximum(chances.again, TINY)
            lanes = np.flatnonzero((left >= 0) & (left < 1))
            numbers = np.stack([u[0], u[1], left])
            wi[:, lanes] = clear.loss(self.shape).directions(self, numbers, clear.inside, lanes)
            crosses[lanes] = wi[2, lanes] < 0
        return Drawn(wi, crosses, np.where(crosses, eta, f4(1)))

    def _under_gloss(self, wo: Floats, wi: Floats) -> Floats:
        """Part of the light that reaches the matte part and leaves it again, (n,), or (3, n) below a film.

        Source: C. Kulla and A. Conty 2017, "Revisiting Physically Based Shading at Imageworks":
        (1 − E(wo))·(1 − E(wi))/(1 − mean E), with E the albedo of the gloss.
        """
        one, other = (self.gloss.passed(self.roughness_toward(w), np.abs(w[2])) for w in (wo, wi))
        cos = wo[2] if self.roughness_v is None else np.ones(1, f4)  # it has no influence
        mean = [self.gloss.mean_passed(roughness, cos) for roughness in self.roughnesses_around()]
        return one * other / np.maximum(sum(mean[1:], mean[0]) / f4(len(mean)), f4(1e-3))

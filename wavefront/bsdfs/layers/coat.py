"""Clear coats."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.elementary import exp, log
from ...arrays.soa import soa
from ...arrays.vec import TINY, Bools, Floats, f4
from ..albedo import dielectric_albedo
from ..fresnel import fresnel_dielectric
from ..microfacet import Facets, alpha_of
from .fresnel import schlick
from .layers import Chances, Cover

COAT_F0 = 0.04
GRAZING = f4(0.1)  # reflectance that counts beside that at wo: at grazing angles Fresnel is far higher
LEAST_TINT = f4(1e-6)


@soa
class Varnish(Cover):
    """The clear coat of glTF, of index 1.5.

    The base below it is darkened for both directions, which keeps it reciprocal.
    """

    strength: Floats  # (n,)
    roughness: Floats  # (n,)

    def weigh(self, weights: Chances, wo: Floats) -> Chances:
        """Return weights with that of the coat."""
        return weights._replace(coat=self.strength * (GRAZING + schlick(COAT_F0, wo[2])))

    def normals(self, facets: Facets, wo: Floats, u: Floats, chosen: Bools) -> Floats:
        """Draw normals (3, n) of the base's facets, and of the coat's where these are chosen."""
        alpha, across, varnish = facets.alpha, facets.alpha_v, alpha_of(self.roughness)
        across = None if across is None else np.where(chosen, varnish, across)
        return facets._replace(alpha=np.where(chosen, varnish, alpha), alpha_v=across).visible_normals(wo, u)

    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the coat over the layers below."""
        value, density, cos = Facets(alpha_of(self.roughness)).mirror_lobe(wo, wi)
        through = self.through(wo[2]) * self.through(np.abs(wi[2]))
        f = f * through + value * self.strength * schlick(COAT_F0, cos)
        return f, pdf + chances.coat * density

    def through(self, cos: Floats) -> Floats:
        """Return the part of light from cosines (n,) that is not reflected, (n,)."""
        return f4(1) - self.strength * schlick(COAT_F0, cos)


@soa
class Coat(Varnish):
    """The coat of OpenPBR, which absorbs."""

    ior: Floats  # (n,)
    color: Floats  # (3, n) transmittance of light that passes twice along the normal
    darkened: Floats  # (3, n) factor of light after reflections between coat and base

    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the coat over the layers below."""
        value, density, cos = Facets(alpha_of(self.roughness)).mirror_lobe(wo, wi)
        zo, zi = wo[2], np.abs(wi[2])
        lost = np.maximum(*(dielectric_albedo(self.ior, self.roughness, z) for z in (zo, zi)))
        f = f * (f4(1) - self.strength * lost) * self._absorbed(zo, zi, wi[2] < 0) * self.darkened
        f = f + value * self.strength * fresnel_dielectric(cos, self.ior)[0]
        return f, pdf + chances.coat * density

    def _absorbed(self, zo: Floats, zi: Floats, crosses: Any) -> Floats:
        """Return the part of light that gets through, (3, n)."""
        lengths = path_length(zo, self.ior) + path_length(zi, self.ior)
        color = power(self.color, lengths * np.where(crosses, f4(0.25), f4(0.5)))
        return f4(1) + (color - f4(1)) * self.strength


def path_length(cos: Floats, ior: Floats) -> Floats:
    """Return the length of refracted rays through a layer, relative to that along the normal, (n,)."""
    sin2 = (f4(1) - cos * cos) * (f4(1) / (ior * ior))
    return f4(1) / np.sqrt(np.maximum(f4(1) - sin2, TINY))


def power(colors: Floats, exponent: Floats) -> Floats:
    """Return powers of colors, (3, n)."""
    return exp(log(np.maximum(colors, LEAST_TINT)) * exponent)

"""Glass, water and other clear materials."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats, broadcast, dot, f4
from ..core.errors import one_of
from ..core.suggestions import suggests_keywords
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar
from .base import BsdfSample, weigh
from .fresnel import fresnel_dielectric
from .microfacet import reflect, refract
from .refractive import RefractiveBsdf

# Closer to 1 than this, refraction bends light by less than half vectors resolve: the boundary is smooth.
LEAST_BEND = 1e-3

# Refractive indices at 20 °C in the yellow light of sodium (589.3 nm) or helium (587.6 nm); they differ by
# 0.0003 at most. BK7, F2, SF11: data sheets of Schott. Fused silica: I. Malitson 1965, J. Opt. Soc. Am. 55,
# 1205. Others: CRC Handbook of Chemistry and Physics; the ordinary ray of birefringent crystals. Acrylic,
# polycarbonate, oil and window glass vary by 0.01.
INDICES = {
    "acetone": 1.3588,
    "acrylic": 1.4914,
    "air": 1.00027,
    "bk7": 1.5168,
    "diamond": 2.4173,
    "ethanol": 1.3611,
    "f2": 1.62004,
    "fused silica": 1.45846,
    "glass": 1.52,
    "glycerol": 1.4746,
    "ice": 1.309,
    "oil": 1.47,
    "polycarbonate": 1.585,
    "quartz": 1.5442,
    "salt": 1.5443,
    "sapphire": 1.7681,
    "sf11": 1.78472,
    "water": 1.333,
}


class Dielectric(RefractiveBsdf):
    """Glass, water and other clear dielectrics: a boundary that reflects and refracts.

    Parameters
    ----------
    ior
        Refractive index of the shape's inside relative to the outside, from 1e-6 to 1e6. Below 1 the outside
        is the denser medium (a bubble in water: 1/1.33). At 1 light passes straight through.
    roughness
        In [0, 1]; α = roughness². Below α = 0.001 it is perfectly smooth, and so is an index
        within 0.001 of 1. Only single scattering is simulated. For index 1.5, seen along the normal, that
        loses 0.1 % from outside and 1 % from inside at roughness 0.32, 1 % and 7 % at 0.5, 3 % and 25 % at
        0.71, 11 % and 58 % at 1. A whole sphere in uniform light loses 0.06 % at 0.1, 4 % at 0.32, 18 % at
        0.5, 41 % at 0.71, 65 % at 1.
    reflectance, transmittance
        Tints of the reflected and of the refracted light per channel, in [0, 1]. 1 is physical.
    roughness_v, rotation, distribution, shadowing
        As for `Conductor`.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> glass = wf.Dielectric(1.5)
    >>> frosted = wf.Dielectric(1.5, roughness=0.3)
    >>> lens = wf.Dielectric.named("BK7")
    """

    @classmethod
    @suggests_keywords
    def named(
        cls, name: str, roughness: Scalar = 0.0, *, reflectance: Color = 1.0, transmittance: Color = 1.0
    ) -> Self:
        """Return the clear material `name` in air: one of `INDICES`, such as "water", in capitals or not.

        The index is that of yellow light, for all channels: dispersion is not simulated.

        Raises
        ------
        SceneError
            If the name is not known, listing those that are.
        """
        key = name.lower() if isinstance(name, str) else name
        index = INDICES[one_of("Dielectric name", key, INDICES)]
        return cls(index, roughness, reflectance=reflectance, transmittance=transmittance)

    def derive(self) -> None:
        """Set `specular`, and the relative index as seen from outside, from the parameters."""
        super().derive()
        straight = not isinstance(self.ior, BaseTexture) and abs(self.ior[0] - 1) < LEAST_BEND
        self.specular = self.specular or bool(straight)
        self.eta = self.ior  # (n,) or (1,) index beyond / before; unbound, wo is outside

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with `eta` inverted where `wo` is inside."""
        bound = copy(super().bind(surface))
        bound.eta = np.where(surface.back_facing, f4(1) / bound.ior, bound.ior)
        return bound

    def albedo(self, wo: Floats) -> Floats:
        """Return the tints of reflection and refraction, weighed by the reflectance of a smooth surface."""
        reflected, _ = fresnel_dielectric(wo[2], self.eta)
        return self.transmittance + (self.reflectance - self.transmittance) * reflected

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f`, for radiance, and `pdf` (Walter et al. 2007, eqs. 20 and 21); 0 if smooth."""
        if self.specular:
            return np.zeros_like(wi), np.zeros_like(wi[2])
        facets = self.facets()
        value, density, cos = facets.mirror_lobe(wo, wi)
        through, through_density, through_cos, valid = facets.refraction_lobe(wo, wi, self.eta)
        reflected, _ = fresnel_dielectric(np.where(valid, through_cos, cos), self.eta)
        transmitted = f4(1) - reflected
        f = self.reflectance * (value * reflected) + self.transmittance * (through * transmitted)
        return f, density * reflected + through_density * transmitted

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Reflect with the probability of the Fresnel reflectance (by u[2]), else refract.

        Refracted radiance is divided by η², as the light fills a cone of another solid angle
        (Veach 1997, *Robust Monte Carlo Methods for Light Transport Simulation*, §5.2).
        """
        return self._sample_smooth(wo, u) if self.specular else self._sample_rough(wo, u)

    def _sample_smooth(self, wo: Floats, u: Floats) -> BsdfSample:
        reflected, cos_refracted = fresnel_dielectric(wo[2], self.eta)
        reflects = u[2] < reflected
        inverse = f4(1) / self.eta
        side = np.where(reflects, f4(-1), -inverse)
        wi = np.empty_like(wo)
        np.multiply(wo[0], side, out=wi[0])
        np.multiply(wo[1], side, out=wi[1])
        wi[2] = np.where(reflects, wo[2], -cos_refracted)
        weight = np.where(reflects, self.reflectance, self.transmittance * (inverse * inverse))
        pdf = np.where(reflects, reflected, f4(1) - reflected)
        eta = np.where(reflects, f4(1), self.eta)
        return BsdfSample(wi, weight, pdf, np.ones(len(pdf), np.bool_), eta)

    def _sample_rough(self, wo: Floats, u: Floats) -> BsdfSample:
        m = self.facets().visible_normals(wo, u)
        cos = np.maximum(dot(wo, m), f4(0))
        reflected, cos_refracted = fresnel_dielectric(cos, self.eta)
        reflects = u[2] < reflected
        wi = np.where(reflects, reflect(wo, m), refract(wo, m, cos, cos_refracted, self.eta))
        f, pdf = self.evaluate(wo, wi)
        # A facet may send light to the wrong side of the surface: no sample.
        pdf = np.where((wi[2] > 0) == reflects, pdf, f4(0))
        eta = np.where(reflects, f4(1), self.eta)
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)), eta)

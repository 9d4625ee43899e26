"""Glass, water and other clear materials."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import BELOW_ONE, Doubles, Floats, broadcast, dot, f4
from ..core.errors import one_of
from ..core.parameter import Parameter, parametrized
from ..core.suggestions import suggests_keywords
from ..textures.base import BaseTexture
from ..textures.parameter import INDICES, Color, Scalar, refractive_index, refractive_indices
from .base import BsdfSample, weigh
from .channels import evaluate_channels, fresnel_channels, mean_of_channels, sample_channels
from .energy import Loss, gain, loss
from .fresnel import fresnel_dielectric
from .microfacet import reflect, refract
from .refractive import RefractiveBsdf
from .thin_film import has_film, thickness

# Closer to 1 than this, refraction bends light by less than half vectors resolve: the boundary is smooth.
LEAST_BEND = 1e-3


def dispersed(index: float, abbe: float) -> Doubles:
    """Return the indices (3,) of an index at 587.6 nm and an Abbe number, at 611, 549 and 464 nm.

    By Cauchy's equation, with the lines C and F at 656.3 and 486.1 nm.
    """
    steep = (index - 1) / abbe / (1 / 0.4861**2 - 1 / 0.6563**2)
    return np.array([index + steep * (1 / at**2 - 1 / 0.5876**2) for at in (0.611, 0.549, 0.464)])


@parametrized
class Dielectric(RefractiveBsdf):
    """Glass, water and other clear dielectrics: a boundary that reflects and refracts.

    Parameters
    ----------
    ior
        Refractive index of the shape's inside relative to the outside, from 1e-6 to 1e6. Below 1 the outside
        is the denser medium (a bubble in water: 1/1.33). At 1 light passes straight through. Three numbers
        are those of red, green and blue (dispersion): each refracted path follows one channel. Or the name of
        a clear material, as for `named`.
    roughness
        In [0, 1]; α = roughness². Below α = 0.001 it is perfectly smooth, and so is an index
        within 0.001 of 1.
    reflectance, transmittance
        Tints of the reflected and of the refracted light per channel, in [0, 1]. 1 is physical.
    roughness_v, rotation, distribution, shadowing
        As for `Conductor`.
    film_thickness, film_ior
        As for `Conductor`: a film on the outside; both indices are relative to the medium around the shape.
    multiscatter
        Add multiple scattering by the microfacets, except with dispersion, an index by texture, or in
        scenes with a `priority`. Without it, for index 1.5, seen along the normal, 0.1 % from outside
        and 1 % from inside are lost at roughness 0.32, 1 % and 7 % at 0.5, 3 % and 25 % at 0.71, 11 % and
        58 % at 1. A whole sphere in uniform light loses 0.06 % at 0.1, 4 % at 0.32, 18 % at 0.5, 41 % at
        0.71, 65 % at 1.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> glass = wf.Dielectric(1.5)
    >>> frosted = wf.Dielectric(1.5, roughness=0.3)
    >>> lens = wf.Dielectric("BK7")
    >>> prism = wf.Dielectric((1.50, 1.51, 1.53))
    """

    indices = ("ior",)

    ior: Parameter[Color] = Parameter(refractive_indices, default=1.5)
    film_thickness: Parameter[Scalar] = Parameter(thickness, default=0.0, kw_only=True)
    film_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.33, kw_only=True)

    _inside = np.zeros(1, np.bool_)  # (n,) wo is inside

    @classmethod
    @suggests_keywords
    def named(
        cls, name: str, roughness: Scalar = 0.0, *, reflectance: Color = 1.0, transmittance: Color = 1.0
    ) -> Self:
        """Return the clear material `name` in air: one of `INDICES`, such as "water", in capitals or not.

        The index is that of yellow light, for all channels: without dispersion.

        Raises
        ------
        SceneError
            If the name is not known, listing those that are.
        """
        index = INDICES[one_of("Dielectric name", name.lower() if isinstance(name, str) else name, INDICES)]
        return cls(index, roughness, reflectance=reflectance, transmittance=transmittance)

    def derive(self) -> None:
        """Set `specular`, and the relative index as seen from outside, from the parameters."""
        super().derive()
        constant = not isinstance(self.ior, BaseTexture)
        straight = constant and np.abs(self.ior - 1).max() < LEAST_BEND
        self.dispersive = constant and self.ior.size == 3
        self.has_film = has_film(self.film_thickness)
        self.shares = np.full((3, 1), 1 / 3, f4)  # (3, n) probability to follow each channel
        self.before = np.ones(1, f4)  # (n,) or (3, n) index on the side of wo
        self.specular = self.specular or bool(straight)
        self.again = self.multiscatter and constant and not (self.dispersive or self.specular)
        self.boundary = float(self.ior[0]) if self.again else None  # the index that its tables are for
        self.eta = self.ior  # (n,), (1,) or (3, n) index beyond / before; unbound, wo is outside

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with `eta` inverted where `wo` is inside."""
        bound = copy(super().bind(surface))
        if surface.index_around is not None:
            bound.again = False  # its tables are those of one index
        bound._inside = surface.back_facing
        bound.eta = np.where(surface.back_facing, f4(1) / bound.ior, bound.ior)
        if self.has_film:
            bound.before = np.where(surface.back_facing, bound.ior, f4(1))
        if self.dispersive and surface.throughput is not None:
            total = surface.throughput[0] + surface.throughput[1] + surface.throughput[2]
            safe = np.where(total > 0, total, f4(1))
            bound.shares = np.where(total > 0, surface.throughput / safe, self.shares)
        return bound

    @property
    def _split(self) -> bool:
        """Whether the channels differ by more than their tints."""
        return self.dispersive or self.has_film

    def albedo(self, wo: Floats) -> Floats:
        """Return the tints of reflection and refraction, weighted by the reflectance of a smooth surface."""
        reflected = (
            fresnel_channels(self, wo[2])[0] if self._split else fresnel_dielectric(wo[2], self.eta)[0]
        )
        return self.transmittance + (self.reflectance - self.transmittance) * reflected

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f`, for radiance, and `pdf` (Walter et al. 2007, eqs. 20 and 21); 0 if smooth."""
        if self.specular:
            return np.zeros_like(wi), np.zeros_like(wi[2])
        return evaluate_channels(self, wo, wi) if self.dispersive else self._evaluate_rough(wo, wi)

    def _evaluate_rough(self, wo: Floats, wi: Floats, chance: Floats | None = None) -> tuple[Floats, Floats]:
        """Evaluate, with the probability (n,) of the lobe of multiple scattering, if it is known."""
        facets = self.facets()
        both = facets.stretched(wo), facets.stretched(wi)
        value, density, cos = facets.mirror_lobe(wo, wi, both)
        if self.again:
            value = value * gain(self, wo, wi, None, both)
        through, through_density, through_cos, valid = facets.refraction_lobe(wo, wi, self.eta, both)
        reflected, _ = self._fresnel(np.where(valid, through_cos, cos))
        share = mean_of_channels(reflected)
        f = value * reflected + through * (f4(1) - reflected)  # one of them is 0
        pdf = density * share + through_density * (f4(1) - share)
        if self.again:
            added, spread, chance = self._loss().lobe(self, wo, wi, self._inside, both, chance)
            f, pdf = f + added, pdf * (f4(1) - chance) + spread * chance
        return self._tint(wi) * f, pdf

    def _tint(self, wi: Floats) -> Floats:
        """Return the tint of light that leaves along wi (3, n), (3, n) or (3, 1)."""
        if self.reflectance is self.transmittance or np.array_equal(self.reflectance, self.transmittance):
            return self.reflectance
        return np.where(wi[2] < 0, self.transmittance, self.reflectance)

    def _fresnel(self, cos: Floats) -> tuple[Floats, Floats]:
        """Return the reflectance, with a film (3, n), and the refracted cosine, (n,) each."""
        if not self.has_film:
            return fresnel_dielectric(cos, self.eta)
        reflected, cos_refracted, _ = fresnel_channels(self, cos)
        return reflected, cos_refracted[0]

    def _loss(self) -> Loss:
        assert self.boundary is not None
        return loss(self.shape, self.boundary)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Reflect with the probability of the Fresnel reflectance (by u[2]), else refract.

        Refracted radiance is divided by η², as the light fills a cone of another solid angle
        (Veach 1997, *Robust Monte Carlo Methods for Light Transport Simulation*, §5.2).
        """
        if self.dispersive or (self.has_film and self.specular):
            return sample_channels(self, wo, u)
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
        reflected, cos_refracted = self._fresnel(cos)
        choice, chance = u[2], None
        if self.again:
            chance = self._loss().at(self, wo, self._inside)
            again = choice < chance
            choice = np.where(again, choice, choice - chance) / np.where(again, chance, f4(1) - chance)
            choice = np.minimum(choice, BELOW_ONE)
        reflects = choice < mean_of_channels(reflected)
        wi = np.where(reflects, reflect(wo, m), refract(wo, m, cos, cos_refracted, self.eta))
        if self.again:
            lanes = np.flatnonzero(again)
            spread = self._loss().directions(self, np.stack([u[0], u[1], choice]), self._inside, lanes)
            wi[:, lanes], reflects[lanes] = spread, spread[2] > 0
        f, pdf = self._evaluate_rough(wo, wi, chance)
        # A facet may send light to the wrong side of the surface: no sample.
        pdf = np.where((wi[2] > 0) == reflects, pdf, f4(0))
        eta = np.where(reflects, f4(1), self.eta)
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)), eta)

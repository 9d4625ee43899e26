"""Glass, water and other clear materials."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..state import Surface
from ..vec import Floats, f4
from .base import Bsdf, BsdfSample
from .fresnel import fresnel_dielectric
from .parameter import Colour, Scalar, colour, scalar


class Dielectric(Bsdf):
    """A clear boundary that reflects and refracts; the shape's inside has index `ior`.

    Parameters
    ----------
    ior
        Refractive index of the inside relative to the outside, more than 0. Below 1 the outside
        is the denser medium (a bubble in water: 1/1.33). At 1 light passes straight through.
    reflectance, transmittance
        Tints of the reflected and of the refracted light per channel, in [0, 1]. 1 is physical.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.
    """

    transmissive = True
    dimensions = 3
    specular = True

    def __init__(self, ior: Scalar = 1.5, *, reflectance: Colour = 1.0, transmittance: Colour = 1.0) -> None:
        self.ior = scalar("Dielectric ior", ior, lambda x: x > 0, "more than 0")
        self.reflectance = colour("Dielectric reflectance", reflectance)
        self.transmittance = colour("Dielectric transmittance", transmittance)
        self.eta = self.ior  # (n,) or (1,) index beyond / before; unbound, wo is outside

    def bind(self, surface: Surface) -> Self:
        """Look the parameters up, and turn `eta` round where `wo` is inside."""
        bound = copy(super().bind(surface))
        bound.eta = np.where(surface.inside, f4(1) / bound.ior, bound.ior)
        return bound

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (3, n): both lobes are deltas."""
        return np.zeros_like(wi)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (n,)."""
        return np.zeros_like(wi[2])

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Reflect with the probability of the Fresnel reflectance (by u[2]), else refract.

        Refracted radiance is divided by η², as the light fills a cone of another solid angle
        (Veach 1997, *Robust Monte Carlo Methods for Light Transport Simulation*, §5.2).
        """
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

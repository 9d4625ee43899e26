"""Metals."""

from __future__ import annotations

import numpy as np

from ..vec import Floats
from .base import Bsdf, BsdfSample
from .fresnel import fresnel_conductor
from .mirror import mirrored
from .parameter import Colour, colour


class Conductor(Bsdf):
    """A metal, by its complex refractive index η + ik.

    Parameters
    ----------
    eta
        Real part per channel, more than 0: a number, three numbers, or a texture.
    k
        Imaginary part (extinction) per channel, at least 0.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.
    """

    specular = True

    def __init__(self, eta: Colour, k: Colour) -> None:
        self.eta = colour("Conductor eta", eta, np.inf, above_zero=True)
        self.k = colour("Conductor k", k, np.inf)

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (3, n): the only lobe is a delta."""
        return np.zeros_like(wi)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (n,)."""
        return np.zeros_like(wi[2])

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Return the mirrored direction, weighted by the Fresnel reflectance of each channel."""
        n = wo.shape[1]
        weight = fresnel_conductor(wo[2], self.eta, self.k)
        return BsdfSample(mirrored(wo), weight, np.ones_like(wo[2]), np.ones(n, np.bool_))

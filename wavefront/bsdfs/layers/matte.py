"""Matte parts of a base."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import INV_PI, Floats, f4
from ..oren_nayar import OrenNayar

ROUGH = OrenNayar(0.5, 0.5, energy_preserving=True)


class Matte(ABC):
    """A matte part."""

    @abstractmethod
    def f(self, wo: Floats, wi: Floats, weight: Floats) -> Floats:
        """Return the value (3, n), times a weight (n,)."""


@soa
class Lambertian(Matte):
    """A matte part that looks the same from everywhere."""

    color: Floats  # (3, n)

    def f(self, wo: Floats, wi: Floats, weight: Floats) -> Floats:
        """Return the value (3, n), times a weight (n,)."""
        return self.color * (weight * np.where(wi[2] > 0, INV_PI, f4(0)))


@soa
class RoughMatte(Matte):
    """A rough matte part (EON), and one that scatters below the surface as if it were Lambertian."""

    color: Floats  # (3, n)
    roughness: Floats  # (n,)
    subsurface: Floats  # (3, n) color of the second

    def f(self, wo: Floats, wi: Floats, weight: Floats) -> Floats:
        """Return the value (3, n), times a weight (n,)."""
        above = weight * np.where(wi[2] > 0, INV_PI, f4(0))
        rough = copy(ROUGH)
        vars(rough).update(reflectance=self.color, sigma=self.roughness)
        return rough.f(wo, wi) * weight + self.subsurface * above

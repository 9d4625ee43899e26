"""Fibers on a base."""

from __future__ import annotations

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import Floats, f4
from ..fuzz import fuzz_albedo, fuzz_directions, fuzz_lobe
from ..sheen import sheen_albedo, sheen_lobe
from .fresnel import fifth
from .layers import Chances, Cover


@soa
class Sheen(Cover):
    """The sheen of glTF (bsdfs/sheen.py). Its samples are those of the matte part."""

    strength: Floats  # (n,)
    color: Floats  # (3, n)
    roughness: Floats  # (n,)

    def weigh(self, weights: Chances, wo: Floats) -> Chances:
        """Return weights with that of the sheen."""
        more = self.strength * self.color.max(0) * (f4(0.2) + fifth(wo[2]))
        return weights._replace(diffuse=weights.diffuse + more)

    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the fibers over the layers below."""
        return self._passed(wo, wi) * f + self.color * (
            self.strength * sheen_lobe(wo, wi, self.roughness)
        ), pdf

    def _passed(self, wo: Floats, wi: Floats) -> Floats:
        """Return the part of the light that passes the fibers, (n,), the lesser of both directions."""
        strength = self.strength * self.color.max(0)
        seen = np.maximum(*(sheen_albedo(z, self.roughness) for z in (wo[2], np.abs(wi[2]))))
        return np.maximum(f4(1) - strength * seen, f4(0))


@soa
class Fuzz(Cover):
    """The fuzz of OpenPBR (bsdfs/fuzz.py)."""

    weight: Floats  # (n,)
    color: Floats  # (3, n)
    roughness: Floats  # (n,)

    def weigh(self, weights: Chances, wo: Floats) -> Chances:
        """Return weights with that of the fuzz."""
        seen = self.weight * fuzz_albedo(wo[2], self.roughness)
        return weights._replace(fuzz=self.color.max(0) * seen / (f4(1) - seen))

    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the fibers over the layers below."""
        value, density, albedo = fuzz_lobe(wo, wi, self.roughness)
        f = f * (f4(1) - self.weight * albedo) + self.color * (self.weight * value)
        return f, pdf + chances.fuzz * density

    def directions(self, wi: Floats, wo: Floats, u: Floats, chances: Chances) -> Floats:
        """Return directions (3, n), the last of which the fibers scatter back."""
        fibers = u[2] >= f4(1) - chances.fuzz
        return np.where(fibers, fuzz_directions(wo, u, self.roughness), wi)

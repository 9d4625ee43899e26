"""Lambertian reflection and transmission."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import INV_PI, TINY, Floats, broadcast, f4, highest
from ..core.parameter import Parameter, parametrized
from ..sampling.warp import cosine_hemisphere
from ..textures.parameter import Color, color
from .base import Bsdf, BsdfSample


@parametrized
class DiffuseTransmission(Bsdf):
    """A sheet that scatters light evenly to both of its sides, such as paper, cloth or a leaf.

    f = reflectance/π on the side that the light comes from, and transmittance/π on the other one. Where their
    sum is above 1, the sheet makes light.

    Source: M. Pharr, W. Jakob, G. Humphreys 2023, "Physically Based Rendering", fourth edition, §9.2.

    Parameters
    ----------
    reflectance, transmittance
        Fraction of the light that is reflected, and that is let through, per channel, each in [0, 1]: a
        number, three numbers, or a texture.

    Raises
    ------
    SceneError
        If one is outside [0, 1] or not finite.

    Examples
    --------
    >>> shade = wf.DiffuseTransmission(0.4, (0.5, 0.4, 0.25))
    """

    transmissive = True
    dimensions = 3

    reflectance: Parameter[Color] = Parameter(color, default=0.25)
    transmittance: Parameter[Color] = Parameter(color, default=0.25)

    def albedo(self, wo: Floats) -> Floats:
        """Return the light that is scattered to both sides, at most 1."""
        return np.minimum(self.reflectance + self.transmittance, f4(1))

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return the value of the side of wi, (3, n)."""
        return np.where(wi[2] > 0, self.reflectance, self.transmittance) * ((wi[2] != 0) * INV_PI)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return cosθ/π times the chance of the side of wi, (n,)."""
        reflects = self._chance()
        return np.where(wi[2] > 0, reflects, f4(1) - reflects) * (np.abs(wi[2]) * INV_PI)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Choose a side by u[2], and draw a cosine-weighted direction there."""
        wi, chance = cosine_hemisphere(u), self._chance()
        reflects = u[2] < chance
        side_chance = np.where(reflects, chance, f4(1) - chance)
        pdf = side_chance * (wi[2] * INV_PI)
        tint = np.where(reflects, self.reflectance, self.transmittance)
        weight = tint * ((pdf > 0) / np.maximum(side_chance, TINY))
        wi[2] *= np.where(reflects, f4(1), f4(-1))
        return BsdfSample(wi, weight, pdf, broadcast(np.False_, len(pdf)))

    def _chance(self) -> Floats:
        """Return the chance of reflection, by the brightest channels of both sides."""
        up, down = highest(self.reflectance), highest(self.transmittance)
        return (up + TINY) / (up + down + f4(2) * TINY)

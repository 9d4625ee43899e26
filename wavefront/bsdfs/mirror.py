"""Perfect mirror reflection."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats
from ..core.parameter import Parameter, parametrized
from ..textures.parameter import Color, color
from .base import Bsdf, BsdfSample


@parametrized
class Mirror(Bsdf):
    """An ideal mirror, which reflects the same fraction of the light at every angle.

    Parameters
    ----------
    reflectance
        Fraction of the light that is reflected, per channel, in [0, 1]: a number, three numbers,
        or a texture.

    Raises
    ------
    SceneError
        If the reflectance is outside [0, 1] or not finite.

    Notes
    -----
    f(wo, wi) = ρ · δ(wi − reflect(wo)) / ``|cosθi|``. The division cancels the cosine of the rendering
    equation, so the mirror is as bright at every angle, and a sample has the weight ``f·|cosθi|/p = ρ``
    (pbrt-v4, §9.3).

    Examples
    --------
    >>> mirror = wf.Sphere((0, 0, 0), 1, material=wf.Mirror(0.95))
    """

    specular = True

    reflectance: Parameter[Color] = Parameter(color, default=1.0)

    def albedo(self, wo: Floats) -> Floats:
        """Return the reflectance."""
        return self.reflectance

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (3, n): no two given directions mirror each other."""
        return np.zeros_like(wi)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (n,)."""
        return np.zeros_like(wi[2])

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Return the mirrored direction."""
        n = wo.shape[1]
        weight = np.broadcast_to(self.reflectance, wo.shape)
        return BsdfSample(mirrored(wo), weight, np.ones_like(wo[2]), np.ones(n, np.bool_))


def mirrored(wo: Floats) -> Floats:
    """Mirror directions (3, n) at the z axis."""
    wi = -wo
    wi[2] = wo[2]
    return wi

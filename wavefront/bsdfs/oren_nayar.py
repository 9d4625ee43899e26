"""Rough matte surfaces: plaster, clay, the moon."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays.elementary import arctan2
from ..arrays.vec import INV_PI, Floats, dot, f4
from ..core.errors import SceneError, flag
from ..core.parameter import Parameter, brief, parametrized
from ..sampling.warp import cosine_hemisphere_pdf
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, scalar
from .base import Bsdf

A_SLOPE = f4(0.5 - 2 / (3 * np.pi))
MEAN_SLOPE = f4(2 / 3 - 28 / (15 * np.pi))
LEAST_LOSS = f4(1e-7)


@parametrized
class OrenNayar(Bsdf):
    """A rough diffuse surface, such as clay or plaster: it looks flatter than `Diffuse`.

    The default is the qualitative model of M. Oren and S. Nayar 1994, "Generalization of Lambert's
    Reflectance Model", eq. 30, which ignores light that bounces between facets: it reflects less than
    `reflectance` (with sigma 0.5 at normal incidence 78 %). With `energy_preserving` it is the EON model of
    J. Portsmouth, P. Kutz and S. Hill 2025, "EON: A Practical Energy-Preserving Rough Diffuse BRDF", JCGT
    14(1), which reflects all light where `reflectance` is 1.

    Parameters
    ----------
    reflectance
        Albedo of a facet per channel, in [0, 1]: a number, three numbers, or a texture.
    sigma
        Standard deviation of the facets' slope angles, radians, in [0, π/2]. 0 is `Diffuse`. For the EON
        model, its roughness, in [0, 1].
    energy_preserving
        Use the EON model.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> plaster = wf.OrenNayar(0.7, sigma=0.5)
    """

    reflectance: Parameter[Color] = Parameter(color, default=0.5)
    sigma: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x <= np.pi / 2, limit="in [0, π/2]"), default=0.5
    )
    energy_preserving: Parameter[bool] = Parameter(flag, default=False, kw_only=True)

    def derive(self) -> None:
        """Check the roughness of the model that preserves energy."""
        if self.energy_preserving and not isinstance(self.sigma, BaseTexture) and self.sigma[0] > 1:
            sigma = brief(self.sigma)
            raise SceneError(f"OrenNayar sigma is {sigma}; it must be in [0, 1] to preserve energy")

    def albedo(self, wo: Floats) -> Floats:
        """Return the reflectance, about which the part of the scattered light varies with `wo`."""
        return self.reflectance

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return the BRDF above the surface, (3, n)."""
        zo, zi = wo[2], np.maximum(wi[2], f4(0))
        s = dot(wo, wi) - zo * wi[2]  # sinθo·sinθi·cos(φo − φi)
        larger = np.maximum(np.maximum(zo, zi), f4(1e-20))
        above = np.where(wi[2] > 0, INV_PI, f4(0))
        if self.energy_preserving:
            return self._eon(zo, zi, np.where(s > 0, s / larger, s)) * above
        sigma2 = self.sigma * self.sigma
        a = f4(1) - f4(0.5) * sigma2 / (sigma2 + f4(0.33))
        b = f4(0.45) * sigma2 / (sigma2 + f4(0.09))
        return self.reflectance * ((a + b * np.maximum(s, f4(0)) / larger) * above)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return cosθ/π, (n,)."""
        return cosine_hemisphere_pdf(wi)

    def _eon(self, zo: Floats, zi: Floats, s_over_t: Floats) -> Floats:
        """Single and multiple scattering times π, (3, n) (Portsmouth et al., listing 1, exact form)."""
        a = f4(1) / (f4(1) + A_SLOPE * self.sigma)
        mean = a * (f4(1) + MEAN_SLOPE * self.sigma)
        rho = self.reflectance
        single = rho * (a * (f4(1) + self.sigma * s_over_t))
        multiple = rho * rho * mean / (f4(1) - rho * (f4(1) - mean))
        lost_o = np.maximum(f4(1) - self._albedo(zo, a), LEAST_LOSS)
        lost_i = np.maximum(f4(1) - self._albedo(zi, a), LEAST_LOSS)
        return single + multiple * (lost_o * lost_i / np.maximum(f4(1) - mean, LEAST_LOSS))

    def _albedo(self, z: Floats, a: Floats) -> Floats:
        """Directional albedo of single scattering, (n,), without a division by the cosine."""
        sin = np.sqrt(np.maximum((f4(1) - z) * (f4(1) + z), f4(0)))
        # (sin/z)·(1 − sin³) = sin·z·(1 + sin + sin²)/(1 + sin), as 1 − sin² = z²
        steep = sin * z * (f4(1) + sin + sin * sin) / (f4(1) + sin)
        g = sin * (arctan2(sin, z) - sin * z) + f4(2 / 3) * (steep - sin)
        return a * (f4(1) + self.sigma * INV_PI * g)

"""Lambertian reflection."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import INV_PI, Floats, broadcast
from ..core.parameter import Parameter, parametrized
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..textures.base import BaseTexture
from ..textures.parameter import Color, color
from .base import Bsdf, BsdfSample


@parametrized
class Diffuse(Bsdf):
    """A diffuse (Lambertian) surface, equally bright from all directions: f = reflectance/π.

    Parameters
    ----------
    reflectance
        Fraction of the light that is reflected, per channel, in [0, 1]: a number, three numbers,
        or a texture.

    Raises
    ------
    SceneError
        If the reflectance is outside [0, 1] or not finite.

    Examples
    --------
    >>> clay = wf.Diffuse((0.7, 0.3, 0.2))
    >>> checks = wf.Diffuse(wf.Texture([[0.1, 0.8], [0.8, 0.1]], filter="nearest"))
    """

    reflectance: Parameter[Color] = Parameter(color, default=0.5)

    @property
    def view_independent(self) -> bool:
        """True for `Diffuse` itself; a subclass may define it."""
        return self.lambertian

    @property
    def lambertian(self) -> bool:
        """True for `Diffuse` itself; a subclass may define it."""
        return type(self) is Diffuse

    @property
    def black(self) -> bool:
        """True if the reflectance is 0, as is common for lights."""
        return (
            self.view_independent
            and not isinstance(self.reflectance, BaseTexture)
            and not self.reflectance.any()
        )

    def albedo(self, wo: Floats) -> Floats:
        """Return the reflectance."""
        return self.reflectance

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return reflectance/π above the surface, (3, n)."""
        return self.reflectance * ((wi[2] > 0) * INV_PI)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return cosθ/π, (n,)."""
        return cosine_hemisphere_pdf(wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw cosine-weighted directions; the weight is the reflectance itself."""
        wi = cosine_hemisphere(u)
        pdf = wi[2] * INV_PI
        weight = np.broadcast_to(self.reflectance, wi.shape)
        if not pdf.all():
            weight = weight * (pdf > 0)
        return BsdfSample(wi, weight, pdf, broadcast(np.False_, len(pdf)))

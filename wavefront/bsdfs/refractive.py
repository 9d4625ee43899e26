"""The parameters that clear materials have in common."""

from __future__ import annotations

from ..core.parameter import Parameter
from ..core.suggestions import suggests_keywords
from ..textures.parameter import Color, Scalar, color, refractive_index
from .rough import Distribution, RoughBsdf, Shadowing


class RefractiveBsdf(RoughBsdf):
    """A BSDF of a refractive index, a roughness, and tints of the reflected and the transmitted light."""

    transmissive = True
    dimensions = 3

    ior = Parameter(refractive_index)
    reflectance = Parameter(color)
    transmittance = Parameter(color)

    @suggests_keywords
    def __init__(
        self,
        ior: Color = 1.5,
        roughness: Scalar = 0.0,
        *,
        reflectance: Color = 1.0,
        transmittance: Color = 1.0,
        roughness_v: Scalar | None = None,
        rotation: Scalar = 0.0,
        distribution: Distribution = "ggx",
        shadowing: Shadowing = "correlated",
        multiscatter: bool = True,
    ) -> None:
        self.ior = ior
        self._set_facets(roughness, roughness_v, rotation, distribution, shadowing, multiscatter)
        self.reflectance = reflectance
        self.transmittance = transmittance
        self.derive()

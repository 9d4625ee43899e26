"""The common parameters of clear materials."""

from __future__ import annotations

from ..core.parameter import Parameter, parametrized
from ..textures.parameter import Color, Scalar, color, refractive_index, scalar
from .rough import RoughBsdf


@parametrized
class RefractiveBsdf(RoughBsdf):
    """A BSDF of a refractive index, a roughness, and tints of the reflected and the transmitted light."""

    transmissive = True
    dimensions = 3

    ior: Parameter[Color] = Parameter(refractive_index, default=1.5)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.0)
    reflectance: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    transmittance: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)

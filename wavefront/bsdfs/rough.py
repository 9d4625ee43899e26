"""The common parameters of surfaces of microfacets."""

from __future__ import annotations

from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats, dot, f4
from ..core.errors import flag, one_of
from ..core.parameter import Parameter, optional, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Scalar, scalar
from .base import JointBsdf
from .energy import Shape
from .microfacet import Facets, alpha_of, is_smooth

Distribution: TypeAlias = Literal["ggx", "beckmann"]
Shadowing: TypeAlias = Literal["correlated", "separable"]


AROUND = (f4(0.0669873), f4(0.5), f4(0.9330127))  # cos² of azimuths of 15°, 45° and 75°

angle = partial(scalar, holds=np.isfinite, limit="finite")
distribution_of = partial(one_of, choices=("ggx", "beckmann"))
shadowing_of = partial(one_of, choices=("correlated", "separable"))


class Tangent(BaseTexture):
    """The direction along which `roughness` counts: that of growing u, turned by degrees towards v."""

    def __init__(self, rotation: Any) -> None:
        self.rotation = rotation
        self.reads = ("tangent_frame", *(rotation.reads if isinstance(rotation, BaseTexture) else ()))

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return cosine and sine of the local azimuth, (2, n); of the x axis without coordinates."""
        n = len(surface)
        along = np.zeros((3, n), f4) if surface.tangent_frame is None else surface.tangent_frame[:3]
        x, y, _ = surface.frame().to_local(along)
        size = np.sqrt(x * x + y * y)
        known = size > 0
        scale = f4(1) / np.where(known, size, f4(1))
        x, y = np.where(known, x * scale, f4(1)), y * scale
        turned = self.rotation.at(surface) if isinstance(self.rotation, BaseTexture) else self.rotation
        sin, cos = sin_cos_turns(turned * f4(1 / 360))
        if surface.tangent_frame is not None:  # v may run either way around the normal
            frame = surface.tangent_frame
            across = np.cross(frame[:3], frame[3:], axis=0)
            sin = np.where(dot(across, surface.ns) < 0, -sin, sin)
        return np.stack([x * cos - y * sin, y * cos + x * sin])


class MicrofacetSurface:
    """A surface of microfacets."""

    roughness: Any
    roughness_v: Any = None
    distribution: Any = "ggx"
    shadowing: Any = "correlated"
    tangent: Any = None
    shape: Shape  # of tables of lost light

    def roughness_toward(self, w: Floats) -> Floats:
        """Return the roughness that masks directions w (3, n) as this surface does, (n,) or (1,)."""
        if self.roughness_v is None:
            return self.roughness
        return self._roughness_at(self.facets().turn(w))

    def roughnesses_around(self) -> list[Floats]:
        """Return roughnesses whose mean is one over all azimuths (Gauss and Chebyshev)."""
        return [self.roughness] if self.roughness_v is None else [self._roughness_at(t) for t in AROUND]

    def _roughness_at(self, turn: Any) -> Floats:
        """Return the roughness at a cos² of the azimuth."""
        along, across = ((r * r) ** 2 for r in (self.roughness, self.roughness_v))
        return np.sqrt(np.sqrt(across + (along - across) * turn))

    def facets(self) -> Facets:
        """Return the microfacets; unbound, their tangent is the x axis."""
        across = None if self.roughness_v is None else alpha_of(self.roughness_v)
        tangent = None if isinstance(self.tangent, BaseTexture) else self.tangent
        beckmann, separable = self.distribution == "beckmann", self.shadowing == "separable"
        return Facets(alpha_of(self.roughness), across, tangent, beckmann, separable)


class Microfacets(MicrofacetSurface, JointBsdf):
    """A BSDF whose surface consists of microfacets; a subclass declares its parameters."""

    rotation: Any = np.zeros(1, f4)
    multiscatter: Any = False

    def derive(self) -> None:
        """Set `specular` from the roughness, and the tangent."""
        across = self.roughness if self.roughness_v is None else self.roughness_v
        self.specular = is_smooth(self.roughness) and is_smooth(across)
        self._set_shape()

    def _set_shape(self) -> None:
        """Set the tangent, and the shape that tables of lost light depend on."""
        self.tangent = None if self.roughness_v is None else Tangent(self.rotation)
        known = [
            None
            if r is None or isinstance(r, BaseTexture) or not self.multiscatter
            else float(alpha_of(r)[0])
            for r in (self.roughness, self.roughness_v)
        ]
        beckmann, separable = self.distribution == "beckmann", self.shadowing == "separable"
        brushed = self.multiscatter and self.roughness_v is not None
        self.shape = Shape(known[0], known[1], beckmann, separable, brushed)


@parametrized
class RoughBsdf(Microfacets):
    """A BSDF with all parameters of microfacets but `roughness`, whose place a subclass chooses."""

    roughness_v: Parameter[Scalar | None] = Parameter(optional(scalar), default=None, kw_only=True)
    rotation: Parameter[Scalar] = Parameter(angle, default=0.0, kw_only=True)
    distribution: Parameter[Distribution] = Parameter(distribution_of, default="ggx", kw_only=True)
    shadowing: Parameter[Shadowing] = Parameter(shadowing_of, default="correlated", kw_only=True)
    multiscatter: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

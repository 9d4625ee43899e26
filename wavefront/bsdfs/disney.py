"""Disney's principled material, as Mitsuba has it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.vec import f4
from ..core.parameter import Parameter, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, refractive_index, scalar
from .layers.disney import DisneyBase, DisneyCoat, DisneySolid
from .layers.layers import LayeredBsdf, Layers
from .rough import Tangent


@parametrized
class DisneyModel(LayeredBsdf):
    """The common base of Disney's materials for solids and for thin sheets."""

    base_color: Parameter[Color] = Parameter(color, default=0.5)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.5)
    anisotropic: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    ior: Parameter[Scalar] = Parameter(refractive_index, default=1.5, kw_only=True)
    transmission: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    specular_tint: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    sheen: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    sheen_tint: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    flatness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    tangent: Any = None

    def derive(self) -> None:
        """Set the direction of the facets."""
        super().derive()
        self.tangent = Tangent(np.zeros(1, f4)) if "anisotropic" in self.used else None

    def shared(self) -> dict[str, Any]:
        """Return the parameters that their bases share."""
        tangent = None if isinstance(self.tangent, BaseTexture) else self.tangent
        return {"tangent": tangent, **{name: getattr(self, name) for name in SHARED}}


@parametrized
class Disney(DisneyModel):
    """Disney's principled material, with the formulas of Mitsuba 3's `principled`.

    `Principled` has about the same parameters with glTF's formulas, which lose and gain less energy. This one
    is for scenes that were made for Disney's.

    Source: B. Burley 2012, "Physically Based Shading at Disney", and 2015, "Extending the Disney BRDF to a
    BSDF with Integrated Subsurface Scattering", as implemented in Mitsuba 3.

    Parameters
    ----------
    base_color
        Albedo of the base, color of the metal, and square of the tint of transmitted light, in [0, 1].
    roughness, metallic, anisotropic
        In [0, 1]; the facets are `anisotropic` along the direction of growing u.
    ior, transmission
        Refractive index, and the part of the base that transmits light.
    specular_tint, sheen, sheen_tint
        In [0, 1]; tints are towards the hue of the base.
    flatness
        In [0, 1], from diffuse to approximate subsurface scattering.
    clearcoat, clearcoat_gloss
        Strength and gloss of a varnish, in [0, 1].

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> paint = wf.Disney((0.2, 0.1, 0.6), 0.4, clearcoat=1, flatness=0.5)
    """

    indices = ("ior",)

    metallic: Parameter[Scalar] = Parameter(scalar, default=0.0)
    clearcoat: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    clearcoat_gloss: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)

    def derive(self) -> None:
        """Set whether light crosses the surface, and the direction of the facets."""
        super().derive()
        self.transmissive = "transmission" in self.used

    def layers(self) -> Layers:
        """Return a varnish over metal, gloss, matte part and glass."""
        front = np.ones(1, f4) if self.back_facing is None else np.where(self.back_facing, f4(0), f4(1))
        base = DisneySolid(
            metallic=self.metallic, transmissive=self.transmissive, front=front, **self.shared()
        )
        coat = DisneyCoat(self.clearcoat, self.clearcoat_gloss, front)
        return Layers(base, (coat,) if "clearcoat" in self.used else ())


SHARED = tuple(name for name in DisneyBase.__dataclass_fields__ if name != "tangent")

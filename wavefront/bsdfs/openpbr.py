"""The scattering of OpenPBR: a coat and fuzz over metal, glossy diffuse and clear parts.

Source: the OpenPBR Surface specification 1.1 (Academy Software Foundation, 2024). docs/openpbr.md lists the
differences.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..arrays.vec import Floats, f4
from ..core.errors import flag
from ..core.parameter import Parameter, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, index_of, refractive_index, scalar
from .energy import Shape, mean_over_cosines
from .fresnel import fresnel_dielectric
from .layers.clear import Clear, bent
from .layers.cloth import Fuzz
from .layers.coat import Coat
from .layers.film import Film
from .layers.gloss import FresnelGloss
from .layers.layers import Cover, LayeredBsdf, Layers
from .layers.matte import Lambertian, Matte, RoughMatte
from .layers.metal import TintedMetal
from .layers.metallic import MetallicBase
from .microfacet import alpha_of
from .rough import Tangent

MICROMETERS = f4(1000)  # in nanometers
# parameters that the roughness of the facets depends on
ROUGHNESS = {"specular_roughness", "specular_roughness_anisotropy", "coat_roughness", "coat_weight"}


@parametrized
class OpenPBRBsdf(LayeredBsdf):
    """The BSDF of `OpenPBR`, which describes the parameters.

    Parameters
    ----------
    parameters
        Those of `OpenPBR` that are about scattering, and `multiscatter`, as for `Principled`.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.
    """

    indices = ("specular_ior", "coat_ior")

    base_weight: Parameter[Scalar] = Parameter(scalar, default=1.0, kw_only=True)
    base_color: Parameter[Color] = Parameter(color, default=0.8, kw_only=True)
    base_diffuse_roughness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    base_metalness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    specular_weight: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x < np.inf, limit="at least 0"), default=1.0, kw_only=True
    )
    specular_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    specular_roughness: Parameter[Scalar] = Parameter(scalar, default=0.3, kw_only=True)
    specular_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.5, kw_only=True)
    specular_roughness_anisotropy: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    transmission_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    transmission_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    subsurface_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    subsurface_color: Parameter[Color] = Parameter(color, default=0.8, kw_only=True)
    coat_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    coat_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    coat_roughness: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    coat_ior: Parameter[Scalar] = Parameter(
        lambda name, value: scalar(name, index_of(name, value), lambda x: 1 <= x <= 1e6, "from 1 to 1e+06"),
        default=1.6,
        kw_only=True,
    )
    coat_darkening: Parameter[Scalar] = Parameter(scalar, default=1.0, kw_only=True)
    fuzz_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    fuzz_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    fuzz_roughness: Parameter[Scalar] = Parameter(scalar, default=0.5, kw_only=True)
    thin_film_weight: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    thin_film_thickness: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x <= 100, limit="in [0, 100] micrometers"),
        default=0.5,
        kw_only=True,
    )
    thin_film_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.4, kw_only=True)
    geometry_thin_walled: Parameter[bool] = Parameter(flag, default=False, kw_only=True)
    multiscatter: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

    @property
    def thin(self) -> bool:
        """True if the surface is a sheet."""
        return self.geometry_thin_walled

    @property
    def index_inside(self) -> Any:
        """Index of refraction of the clear part, which `specular_weight` changes."""
        varies = any(isinstance(param, BaseTexture) for param in (self.specular_ior, self.specular_weight))
        return self.specular_ior if varies else weighted_index(self.specular_ior, self.specular_weight)

    def derive(self) -> None:
        """Set which layers exist, and the shape that tables of lost light depend on."""
        super().derive()
        textures = {name for name, value in vars(self).items() if isinstance(value, BaseTexture)}
        self.transmissive = "transmission_weight" in self.used
        stretched = "specular_roughness_anisotropy" in self.used
        self.tangent = Tangent(np.zeros(1, f4)) if stretched else None
        self.shape = Shape(None, None, False, False, stretched)
        if not textures & ROUGHNESS:
            along, across = (float(alpha_of(r)[0]) for r in self._roughness())
            self.shape = Shape(along, across if stretched else None, False, False, stretched)
        self.tinted = not is_white(self.specular_color)
        self.stained = self.thin and not is_white(self.transmission_color)
        self.metal_again = self.multiscatter and "base_metalness" in self.used
        known = not (self.thin or textures & {"specular_ior", "specular_weight"})
        self.clear_again = self.multiscatter and self.transmissive and (self.thin or known)
        self.boundary = None
        if self.clear_again and known:
            self.boundary = float(bent(weighted_index(self.specular_ior, self.specular_weight))[0])

    def layers(self) -> Layers:
        """Return a coat and fuzz over metal, gloss and glass."""
        film = None
        if {"thin_film_weight", "thin_film_thickness"} <= {*self.used}:
            film = Film(self.thin_film_thickness * MICROMETERS, self.thin_film_ior, self.thin_film_weight)
        along, across = self._roughness()
        color, subsurface = self.base_weight * self.base_color, self.subsurface_weight
        both = color + (self.subsurface_color - color) * subsurface
        matte: Matte = Lambertian(both)
        if "base_diffuse_roughness" in self.used:
            matte = RoughMatte(
                color * (f4(1) - subsurface), self.base_diffuse_roughness, self.subsurface_color * subsurface
            )
        around = f4(1) + (self.coat_ior - f4(1)) * self.coat_weight
        below = weighted_index(self.specular_ior / around, self.specular_weight)
        weight = np.minimum(self.specular_weight, f4(1))
        gloss = FresnelGloss(np.maximum(below, f4(1) / below), weight, self.specular_color, film)
        base = MetallicBase(
            roughness=along,
            roughness_v=None if self.tangent is None else across,
            tangent=None if isinstance(self.tangent, BaseTexture) else self.tangent,
            shape=self.shape,
            color=both,
            metallic=self.base_metalness,
            transmission=self.transmission_weight,
            metal=TintedMetal(color, f4(1) - self.specular_color, weight, film),
            gloss=gloss,
            matte=matte,
            clear=self._clear(film) if self.transmissive else None,
            metal_again=self.metal_again,
        )
        covers: list[Cover] = []
        if "coat_weight" in self.used:
            covers.append(self._coat(base, gloss.index))
        if "fuzz_weight" in self.used:
            covers.append(Fuzz(self.fuzz_weight, self.fuzz_color, self.fuzz_roughness))
        return Layers(base, tuple(covers))

    def _clear(self, film: Film | None) -> Clear:
        shine = np.ones(1, f4)
        if self.tinted:  # total reflection inside has no tint
            inside = np.zeros(1, np.bool_) if self.back_facing is None else self.back_facing
            shine = np.where(inside, f4(1), self.specular_color)
        return Clear(
            ior=weighted_index(self.specular_ior, self.specular_weight),
            thin=self.thin,
            tint=np.ones(1, f4) if self.thin else self.transmission_color,
            shine=shine,
            back_facing=self.back_facing,
            film=film,
            stain=self.transmission_color if self.stained else None,
            boundary=self.boundary,
            again=self.clear_again,
        )

    def _coat(self, base: MetallicBase, index: Floats) -> Coat:
        """Return the coat over a base whose index relative to it, at least 1, is given."""
        ior = np.maximum(self.coat_ior, f4(1) / self.coat_ior)
        darkened = _darkened(base, index, ior, self.coat_darkening * self.coat_weight)
        return Coat(self.coat_weight, self.coat_roughness, ior, self.coat_color, darkened)

    def _roughness(self) -> tuple[Floats, Floats]:
        """Roughness along and across the tangent, below the coat, (n,) each."""
        below, above = (r * r * r * r for r in (self.specular_roughness, self.coat_roughness))
        coated = np.sqrt(np.sqrt(np.minimum(below + f4(2) * above, f4(1))))
        r = self.specular_roughness + (coated - self.specular_roughness) * self.coat_weight
        aspect = f4(1) - self.specular_roughness_anisotropy
        along = r * np.sqrt(np.sqrt(f4(2) / (f4(1) + aspect * aspect)))
        return along, along * np.sqrt(aspect)


def _darkened(base: MetallicBase, index: Floats, coat_ior: Floats, darkening: Floats) -> Floats:
    """Return the factor (3, n) of light after reflections between coat and base (specification, Δ)."""
    outside, below = (
        mean_over_cosines(lambda mu, eta=eta: fresnel_dielectric(mu, eta)[0])  # type: ignore[misc]
        for eta in (coat_ior, index)
    )
    inside = f4(1) - (f4(1) - outside) / (coat_ior * coat_ior)
    m, opaque = base.metallic, f4(1) - base.transmission
    rough = f4(1) + (base.roughness - f4(1)) * (below + (f4(1) - below) * m)
    back = outside + (inside - outside) * rough
    dielectric = opaque * (base.color + (f4(1) - base.color) * below) + base.transmission
    albedo = dielectric + (base.metal.mean() - dielectric) * m
    return f4(1) + ((f4(1) - back) / (f4(1) - albedo * back) - f4(1)) * darkening


def is_white(colors: Any) -> bool:
    """Return whether colors are constant and 1."""
    return not isinstance(colors, BaseTexture) and bool(np.all(colors == 1))


def weighted_index(ior: Floats, weight: Floats) -> Floats:
    """Return the index whose reflectance along the normal is `weight` times that of another, (n,)."""
    root = (ior - f4(1)) / (ior + f4(1)) * np.sqrt(weight)
    root = np.clip(root, f4(-0.999), f4(0.999))
    return (f4(1) + root) / (f4(1) - root)

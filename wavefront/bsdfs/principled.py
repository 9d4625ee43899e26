"""The material of most asset files: glTF's metallic-roughness model and its extensions."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import numpy as np

from ..arrays.vec import Floats, f4
from ..core.errors import flag
from ..core.parameter import Parameter, optional, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, refractive_index, scalar
from .albedo import gloss_tables, lookup
from .energy import Shape, part_kept
from .layers.clear import Clear, bent
from .layers.cloth import Sheen
from .layers.coat import COAT_F0, Varnish
from .layers.film import Film
from .layers.fresnel import schlick
from .layers.gloss import SchlickGloss
from .layers.layers import LayeredBsdf, Layers
from .layers.matte import Lambertian
from .layers.metal import SchlickMetal
from .layers.metallic import MetallicBase
from .microfacet import alpha_of
from .rough import Tangent, angle
from .sheen import sheen_albedo
from .thin_film import thickness


@parametrized
class Principled(LayeredBsdf):
    """The principled material: metal, plastic, glass, cloth and varnish by a few intuitive parameters.

    With only `base_color`, `metallic` and `roughness` this is the metallic-roughness material of
    the glTF 2.0 specification, appendix B: mix(dielectric, metal, metallic) with Schlick's Fresnel,
    GGX with α = roughness², height-correlated Smith shadowing and a Lambertian base. The others
    follow glTF's extensions KHR_materials_ior, _specular, _transmission, _clearcoat and _sheen, except that

    - the diffuse base gets the light that the specular lobe does not reflect, by the albedo of this lobe, so
      that a white surface reflects all light and no more. `conserve_energy=False` takes the appendix's mix by
      Fresnel in the half vector, which reflects up to 1.9 times the light at grazing angles;
    - where light is transmitted, Fresnel's equations replace Schlick's approximation, which has no total
      internal reflection;
    - the base under a clear coat is darkened for both directions, which keeps it reciprocal.

    Parameters
    ----------
    base_color
        Albedo of the base, color of the metal, and tint of transmitted light, in [0, 1].
    metallic
        From 0 (dielectric) to 1 (metal).
    roughness
        In [0, 1]; α = roughness², at least 0.001: it has no delta lobe.
    roughness_v, rotation
        As for `Conductor`: roughness across, and the direction of both.
    ior
        Refractive index, from 1e-6 to 1e6; where light is transmitted at least 0.001 away from 1.
    transmission
        Fraction of the base that transmits light instead of scattering it diffusely, in [0, 1].
    thin
        The surface is a thin sheet, which does not refract light (glTF without a volume).
    clearcoat, clearcoat_roughness
        Strength of a clear varnish of index 1.5, and its roughness, in [0, 1].
    sheen, sheen_color, sheen_roughness
        Strength, color and roughness of cloth fibers, in [0, 1].
    specular, specular_color
        Strength, in [0, 1], and tint, at least 0, of the dielectric's reflection along the normal, which
        the tint raises to at most 1.
    film_thickness, film_ior
        As for `Conductor`: a film below the clear coat (KHR_materials_iridescence).
    conserve_energy
        Layer the specular lobe over the diffuse base without a gain of energy. False follows glTF's appendix
        exactly, also without multiple scattering.
    multiscatter
        Add multiple scattering by the microfacets of metal and clear parts, as in `Conductor` and
        `Dielectric`; not in clear parts that bend light with an index by texture, or in scenes with a
        `priority`.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> plastic = wf.Principled((0.1, 0.3, 0.8), roughness=0.3)
    >>> varnished_metal = wf.Principled((0.9, 0.5, 0.3), metallic=1, roughness=0.5, clearcoat=1)
    """

    indices: ClassVar[tuple[str, ...]] = ("ior",)

    base_color: Parameter[Color] = Parameter(color, default=0.8)
    metallic: Parameter[Scalar] = Parameter(scalar, default=0.0)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.5)
    ior: Parameter[Scalar] = Parameter(refractive_index, default=1.5)
    transmission: Parameter[Scalar] = Parameter(scalar, default=0.0)
    roughness_v: Parameter[Scalar | None] = Parameter(optional(scalar), default=None, kw_only=True)
    rotation: Parameter[Scalar] = Parameter(angle, default=0.0, kw_only=True)
    thin: Parameter[bool] = Parameter(flag, default=False, kw_only=True)
    clearcoat: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    clearcoat_roughness: Parameter[Scalar] = Parameter(scalar, default=0.03, kw_only=True)
    sheen: Parameter[Scalar] = Parameter(scalar, default=0.0, kw_only=True)
    sheen_color: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)
    sheen_roughness: Parameter[Scalar] = Parameter(scalar, default=0.3, kw_only=True)
    specular_weight: Parameter[Scalar] = Parameter(scalar, default=1.0, kw_only=True, alias="specular")
    specular_color: Parameter[Color] = Parameter(partial(color, high=np.inf), default=1.0, kw_only=True)
    film_thickness: Parameter[Scalar] = Parameter(thickness, default=0.0, kw_only=True)
    film_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.3, kw_only=True)
    conserve_energy: Parameter[bool] = Parameter(flag, default=True, kw_only=True)
    multiscatter: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

    def derive(self) -> None:
        """Set which layers exist, and the shape that tables of lost light depend on."""
        super().derive()
        self.transmissive = "transmission" in self.used
        again = self.multiscatter and self.conserve_energy
        self.metal_again = again and "metallic" in self.used
        known = not (self.thin or isinstance(self.ior, BaseTexture))
        self.clear_again = again and self.transmissive and (self.thin or known)
        # tables are of one index; materials that need none are shaded together
        self.boundary = float(bent(self.ior)[0]) if self.clear_again and known else None
        self.tangent = None if self.roughness_v is None else Tangent(self.rotation)
        self.shape = Shape(None, None, False, False)
        if self.metal_again or self.clear_again:
            along, across = (_constant_alpha(r) for r in (self.roughness, self.roughness_v))
            self.shape = Shape(along, across, False, False, self.roughness_v is not None)

    def layers(self) -> Layers:
        """Return sheen and a varnish over metal, gloss and glass."""
        film = Film(self.film_thickness, self.film_ior) if "film_thickness" in self.used else None
        base = MetallicBase(
            roughness=self.roughness,
            roughness_v=self.roughness_v,
            tangent=None if isinstance(self.tangent, BaseTexture) else self.tangent,
            shape=self.shape,
            color=self.base_color,
            metallic=self.metallic,
            transmission=self.transmission,
            metal=SchlickMetal(self.base_color, film),
            gloss=SchlickGloss(self.ior, self.specular_weight, self.specular_color, film),
            matte=Lambertian(self.base_color),
            clear=self._clear(film) if self.transmissive else None,
            metal_again=self.metal_again,
            layered=self.conserve_energy,
        )
        sheen = Sheen(self.sheen, self.sheen_color, self.sheen_roughness)
        varnish = Varnish(self.clearcoat, self.clearcoat_roughness)
        covers = (("sheen", sheen), ("clearcoat", varnish))
        return Layers(base, tuple(cover for name, cover in covers if name in self.used))

    def _clear(self, film: Film | None) -> Clear:
        return Clear(
            ior=self.ior,
            thin=self.thin,
            tint=self.base_color,
            shine=np.ones(1, f4),
            back_facing=self.back_facing,
            film=film,
            boundary=self.boundary,
            again=self.clear_again,
        )

    def albedo(self, wo: Floats) -> Floats:
        """Return the approximate albedo of all lobes, layered as in `evaluate`."""
        base = self._layered().base
        assert isinstance(base, MetallicBase)
        low, high, _, _ = gloss_tables()
        at_f0, at_f90 = (lookup(table, base.roughness_toward(wo), wo[2]) for table in (low, high))
        gloss = base.gloss.schlick(np.zeros(1, f4)) * at_f0 + self.specular_weight * at_f90
        metal = self.base_color * at_f0 + at_f90
        if self.metal_again:
            lost = f4(1) - at_f0 - at_f90
            metal = metal * (f4(1) + part_kept(base, base.metal.mean()) * lost / (f4(1) - lost))
        albedo = gloss + self.base_color * (f4(1) - gloss.max(0))
        if base.clear is not None:
            reflected, _ = base.clear.fresnel(wo[2])
            clear = self.base_color + (f4(1) - self.base_color) * reflected
            albedo = albedo + (clear - albedo) * self.transmission
        albedo = albedo + (metal - albedo) * self.metallic
        if "sheen" in self.used:
            fibers = self.sheen * sheen_albedo(wo[2], self.sheen_roughness)
            albedo = albedo * (f4(1) - fibers * self.sheen_color.max(0)) + self.sheen_color * fibers
        if "clearcoat" in self.used:
            through = Varnish(self.clearcoat, self.clearcoat_roughness).through(wo[2])
            albedo = albedo * (through * through) + self.clearcoat * schlick(COAT_F0, wo[2])
        return albedo


def _constant_alpha(roughness: Any) -> float | None:
    """Return α of a constant roughness; None of a texture, or where there is none."""
    return None if roughness is None or isinstance(roughness, BaseTexture) else float(alpha_of(roughness)[0])

"""The material of most asset files: glTF's metallic-roughness model and its extensions."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_PI, TINY, Bools, Floats, broadcast, dot, f4, luminance
from ..core.errors import flag
from ..core.parameter import Parameter, optional, parametrized
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..textures.base import BaseTexture
from ..textures.parameter import Color, Scalar, color, refractive_index, scalar
from .albedo import facet_cosines, gloss_tables, lookup
from .base import BsdfSample, weigh
from .channels import mean_of_channels
from .dielectric import LEAST_BEND
from .energy import Loss, Shape, gain, loss, mean_over_cosines, part_kept
from .fresnel import fresnel_dielectric, fresnel_sheet
from .microfacet import Facets, alpha_of, reflect, refract
from .rough import Microfacets, angle
from .sheen import sheen_albedo, sheen_lobe
from .thin_film import film_reflectance, has_film, thickness

COAT_F0 = 0.04


class Chances(NamedTuple):
    """Probabilities of the lobes that `sample_f` chooses from; they depend on wo only. Each (n,)."""

    gloss: Floats  # reflection in the surface's microfacets
    glass: Floats  # reflection or refraction in them, by Fresnel
    coat: Floats  # reflection in the clear coat
    again: Floats  # what the microfacets of clear parts scatter more than once, on both sides
    diffuse: Floats  # cosine-weighted
    fuzz: Floats = np.zeros(1, f4)  # fibers, of OpenPBR


@parametrized
class Principled(Microfacets):
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
        Return what the microfacets of metal and clear parts scatter more than once, as in `Conductor` and
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

    dimensions = 3
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
        """Set which lobes exist."""
        self._set_shape()
        self.transmissive = _used(self.transmission)
        self._coated = _used(self.clearcoat)
        self._cloth = _used(self.sheen)
        self.has_film = has_film(self.film_thickness)
        again = self.multiscatter and self.conserve_energy
        self._metal_again = again and _used(self.metallic)
        self._sheet_again = again and self.transmissive and self.thin
        known = not (self.thin or isinstance(self.ior, BaseTexture))
        self._clear_again = again and self.transmissive and known
        # tables are of one index; materials that need none are shaded together
        self._boundary = float(bent(self.ior)[0]) if self._clear_again else None
        if not (self._metal_again or self._sheet_again or self._clear_again):
            self.shape = Shape(None, None, False, False)

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with the side of `wo`."""
        bound = super().bind(surface)
        if self.transmissive and not self.thin:
            bound = copy(bound)
            bound.back_facing = surface.back_facing
            if surface.index_around is not None:
                bound._clear_again = False  # its tables are those of one index
        return bound

    def albedo(self, wo: Floats) -> Floats:
        """Return about the albedo of all lobes, layered as in `evaluate`."""
        low, high, _, _ = gloss_tables()
        at_f0, at_f90 = (lookup(table, self.roughness_toward(wo), wo[2]) for table in (low, high))
        gloss = self._dielectric(np.zeros(1, f4)) * at_f0 + self.specular_weight * at_f90
        metal = self.base_color * at_f0 + at_f90
        if self._metal_again:
            lost = f4(1) - at_f0 - at_f90
            metal = metal * (f4(1) + part_kept(self, self._mean_metal()) * lost / (f4(1) - lost))
        albedo = gloss + self.base_color * (f4(1) - gloss.max(0))
        if self.transmissive:
            reflected, _ = self._fresnel(wo[2])
            clear = self.base_color + (f4(1) - self.base_color) * reflected
            albedo = albedo + (clear - albedo) * self.transmission
        albedo = albedo + (metal - albedo) * self.metallic
        if self._cloth:
            fibers = self.sheen * sheen_albedo(wo[2], self.sheen_roughness)
            albedo = albedo * (f4(1) - fibers * self.sheen_color.max(0)) + self.sheen_color * fibers
        if self._coated:
            through = self._through_coat(wo[2])
            albedo = albedo * (through * through) + self.clearcoat * _schlick(COAT_F0, wo[2])
        return albedo

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes: the base, then sheen and coat layered over it."""
        chances = self._chances(wo)
        f, pdf = self._base(wo, wi, chances)
        if self._cloth:
            f = self._under_sheen(wo, wi) * f + self._sheen(wo, wi)
        if self._coated:
            value, density, cos = Facets(alpha_of(self.clearcoat_roughness)).mirror_lobe(wo, wi)
            through = self._through_coat(wo[2]) * self._through_coat(np.abs(wi[2]))
            f = f * through + value * self.clearcoat * _schlick(COAT_F0, cos)
            pdf = pdf + chances.coat * density
        return f, pdf

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes."""
        wi, crosses, eta = self._directions(wo, u)
        f, pdf = self.evaluate(wo, wi)
        pdf = np.where((wi[2] < 0) == crosses, pdf, f4(0))
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)), eta)

    def _directions(self, wo: Floats, u: Floats) -> tuple[Floats, Bools, Floats | None]:
        """Return samples of lobes (3, n), whether they are to cross the surface, and the index they meet."""
        gloss, glass, coat, again, *_ = self._chances(wo)
        facet = gloss + glass
        coated = (u[2] >= facet) & (u[2] < facet + coat)
        facets = self.facets()
        if self._coated:
            alpha, across, varnish = facets.alpha, facets.alpha_v, alpha_of(self.clearcoat_roughness)
            across = None if across is None else np.where(coated, varnish, across)
            facets = facets._replace(alpha=np.where(coated, varnish, alpha), alpha_v=across)
        m = facets.visible_normals(wo, u)
        wi = np.where(u[2] < facet + coat, reflect(wo, m), cosine_hemisphere(u))
        crosses = np.zeros(wo.shape[1], np.bool_)
        eta = None
        if self.transmissive:
            cos = np.maximum(dot(wo, m), f4(0))
            reflected, cos_refracted = self._fresnel(cos)
            crosses = (u[2] >= gloss + glass * mean_of_channels(reflected)) & (u[2] < facet)
            index = self._eta()
            wi = np.where(crosses, self._across(wo, wi, m, cos, cos_refracted, index), wi)
            if self._clear_again:
                left = (u[2] - (facet + coat)) / np.maximum(again, TINY)
                lanes = np.flatnonzero((left >= 0) & (left < 1))
                numbers = np.stack([u[0], u[1], left])
                wi[:, lanes] = self._loss().directions(self, numbers, self._inside, lanes)
                crosses[lanes] = wi[2, lanes] < 0
            eta = np.where(crosses, index, f4(1))
        return wi, crosses, eta

    def _base(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Metal, diffuse base, gloss and glass: value (3, n) and their part of the density (n,)."""
        facets = self.facets()
        both = facets.stretched(wo), facets.stretched(wi)
        value, density, cos = facets.mirror_lobe(wo, wi, both)
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission)
        metal = self._metal(cos)
        if self._metal_again:
            metal = metal * gain(self, wo, wi, self._mean_metal(), both)
        gloss = self._gloss(cos)
        below = self._under_gloss(wo, wi) if self.conserve_energy else f4(1) - gloss.max(0)
        f = (metal * self.metallic + gloss * opaque) * value + self._matte(wo, wi, opaque * below)
        pdf = chances.gloss * density + chances.diffuse * cosine_hemisphere_pdf(wi)
        if not self.transmissive:
            return f, pdf
        clear = (f4(1) - self.metallic) * self.transmission
        reflected, _ = self._fresnel(cos)
        through, through_density = self._through(wo, wi, facets)
        pdf = pdf + chances.glass * (density * mean_of_channels(reflected) + through_density)
        if self._sheet_again or self._clear_again:
            grown = gain(self, wo, wi, None, both)
            value, through = value * grown, through * grown if self.thin else through
        once = value * reflected * (self._shine * clear) + self._tint * (through * clear)
        if not self._clear_again:
            return f + once, pdf
        added, spread, _ = self._loss().lobe(self, wo, wi, self._inside, both)
        tint = np.where(wi[2] < 0, self._tint, self._shine)
        return f + once + tint * (added * clear), pdf + chances.again * spread

    @property
    def _tint(self) -> Floats:
        """Tint of the light that crosses the surface, (3, n)."""
        return self.base_color

    @property
    def _shine(self) -> Floats:
        """Tint of what the clear part reflects, (1,) or (3, n)."""
        return np.ones(1, f4)

    def _gloss(self, cos: Floats) -> Floats:
        """Reflectance of the opaque dielectric, (3, n)."""
        if self.has_film:
            return self._gloss_with_film(cos, self.specular_color)
        return self._dielectric(_fifth(cos))

    def _matte(self, wo: Floats, wi: Floats, part: Floats) -> Floats:
        """Value of the diffuse base (3, n) that is a part (n,) of the surface."""
        return self.base_color * (part * np.where(wi[2] > 0, INV_PI, f4(0)))

    def _metal(self, cos: Floats) -> Floats:
        """Reflectance of the metal, (3, n), by Schlick's approximation or that of a film."""
        if self.has_film:
            return self._film(cos, self.base_color)
        return self.base_color + (f4(1) - self.base_color) * _fifth(cos)

    def _mean_metal(self) -> Floats:
        """Mean of the reflectance of the metal over cosines, (3, n)."""
        if self.has_film:
            return mean_over_cosines(self._metal)
        return self.base_color + (f4(1) - self.base_color) * f4(1 / 21)

    @property
    def _inside(self) -> Bools:
        return np.zeros(1, np.bool_) if self.back_facing is None else self.back_facing

    def _loss(self) -> Loss:
        assert self._boundary is not None
        return loss(self.shape, self._boundary)

    def _through(self, wo: Floats, wi: Floats, facets: Facets) -> tuple[Floats, Floats]:
        """Transmission with its Fresnel factor: value (n,), with a film (3, n), and density (n,)."""
        if self.thin:
            value, density, cos = facets.mirror_lobe(wo, wi * np.array([[1], [1], [-1]], f4))
        else:
            value, density, cos, _ = facets.refraction_lobe(wo, wi, self._eta())
        reflected, _ = self._fresnel(cos)
        return value * (f4(1) - reflected), density * (f4(1) - mean_of_channels(reflected))

    def _across(
        self, wo: Floats, wi: Floats, m: Floats, cos: Floats, cos_refracted: Floats, eta: Floats
    ) -> Floats:
        """Return where light crosses to: refracted, or for a sheet the reflection wi turned over."""
        if self.thin:
            return wi * np.array([[1], [1], [-1]], f4)
        return refract(wo, m, cos, cos_refracted, eta)

    def _fresnel(self, cos: Floats) -> tuple[Floats, Floats]:
        """Exact reflectance of the clear part, with a film (3, n), and the refracted cosine, each (n,)."""
        if self.thin and not self.has_film:  # a film keeps the mean of both polarizations
            return fresnel_sheet(cos, self.ior), cos
        index = self.ior if self.thin else self._eta()
        face, refracted = fresnel_dielectric(cos, index)
        if self.has_film:
            before: Any = f4(1)
            if self.back_facing is not None:
                before = np.where(self.back_facing, f4(1) / index, f4(1))
            film = film_reflectance(cos, self.film_thickness, self.film_ior, before, before * index)
            face = np.where(face < 1, np.broadcast_to(film, (3, cos.size)), f4(1))
        return f4(2) * face / (f4(1) + face) if self.thin else face, refracted

    def _film(self, cos: Floats, f0: Floats) -> Floats:
        """Reflectance below a film, (3, n), of what reflects f0 along the normal in air."""
        root = np.sqrt(np.minimum(f0, f4(0.9999)))
        index = (f4(1) + root) / (f4(1) - root)
        return film_reflectance(cos, self.film_thickness, self.film_ior, f4(1), index)

    def _gloss_with_film(self, cos: Floats, tint: Floats) -> Floats:
        f0 = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        return self._film(cos, np.minimum(tint * f0, f4(1))) * self.specular_weight

    def _eta(self) -> Floats:
        """Index beyond / before, (n,) or (1,); 1 for a sheet, and never quite 1 otherwise."""
        if self.thin:
            return np.ones(1, f4)
        index = bent(self.ior)
        return index if self.back_facing is None else np.where(self.back_facing, f4(1) / index, index)

    def _under_gloss(self, wo: Floats, wi: Floats) -> Floats:
        """Part of the light that reaches the diffuse base and leaves it again, (n,), or (3, n) below a film.

        Source: C. Kulla and A. Conty 2017, "Revisiting Physically Based Shading at Imageworks":
        (1 − E(wo))·(1 − E(wi))/(1 − mean E), with E the albedo of the gloss.
        """
        one, other = (self._passed(self.roughness_toward(w), np.abs(w[2])) for w in (wo, wi))
        cos = wo[2] if self.roughness_v is None else np.ones(1, f4)  # it has no influence
        mean = [self._mean_passed(roughness, cos) for roughness in self.roughnesses_around()]
        return one * other / np.maximum(sum(mean[1:], mean[0]) / f4(len(mean)), f4(1e-3))

    def _passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Part of the light from cosines that the gloss does not reflect, (n,), or (3, n) below a film."""
        a, b, _, _ = gloss_tables()
        f0, f90 = self._dielectric(np.zeros(1, f4)).max(0), self.specular_weight
        at_f0, at_f90 = (lookup(table, roughness, cos) for table in (a, b))
        passed = f4(1) - f0 * at_f0 - f90 * at_f90
        if not self.has_film:
            return passed
        facet = lookup(facet_cosines(), roughness, cos)
        plain = self._dielectric(_fifth(facet)).max(0)
        return passed - (at_f0 + at_f90) * (self._gloss_with_film(facet, self.specular_color.max(0)) - plain)

    def _mean_passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the mean of `_passed` for diffuse light, at any `cos`."""
        if self.has_film:
            return mean_over_cosines(partial(self._passed, roughness))
        _, _, a, b = gloss_tables()
        f0, f90 = self._dielectric(np.zeros(1, f4)).max(0), self.specular_weight
        return f4(1) - f0 * lookup(a, roughness, cos) - f90 * lookup(b, roughness, cos)

    def _dielectric(self, weight: Floats) -> Floats:
        """Schlick's reflectance of the opaque dielectric, (3, n), at weight = (1 − cosθ)⁵."""
        f0 = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        tinted = np.minimum(self.specular_color * f0, f4(1)) * self.specular_weight
        return tinted + (self.specular_weight - tinted) * weight

    def _sheen(self, wo: Floats, wi: Floats) -> Floats:
        return self.sheen_color * (self.sheen * sheen_lobe(wo, wi, self.sheen_roughness))

    def _under_sheen(self, wo: Floats, wi: Floats) -> Floats:
        """Part of the light that passes the fibers, (n,), the lesser of both directions (reciprocal)."""
        strength = self.sheen * self.sheen_color.max(0)
        seen = np.maximum(
            sheen_albedo(wo[2], self.sheen_roughness), sheen_albedo(np.abs(wi[2]), self.sheen_roughness)
        )
        return np.maximum(f4(1) - strength * seen, f4(0))

    def _through_coat(self, cos: Floats) -> Floats:
        return f4(1) - self.clearcoat * _schlick(COAT_F0, cos)

    def _chances(self, wo: Floats) -> Chances:
        """Share the samples out by about what each lobe reflects; none that has any value gets 0."""
        weights = self._weights(wo)
        total = sum(weights[1:], weights[0])
        share = f4(1) / np.where(total > 0, total, f4(1))
        return Chances(*(np.broadcast_to(part * share, wo[2].shape) for part in weights))

    def _weights(self, wo: Floats) -> Chances:
        """Return about what each lobe reflects."""
        weight = _fifth(wo[2])
        opaque = (f4(1) - self.metallic) * (f4(1) - self.transmission)
        seen = luminance(self._dielectric(weight))
        metal = luminance(self.base_color + (f4(1) - self.base_color) * weight)
        floor = f4(0.1)  # at grazing reflections Fresnel is far higher than at wo
        gloss = self.metallic * (metal + floor) + opaque * (seen + floor * (self.specular_weight > 0))
        diffuse = opaque * (luminance(self.base_color) + (self.base_color > 0).any(0) * f4(0.01))
        glass = (f4(1) - self.metallic) * self.transmission
        if self._cloth:
            diffuse = diffuse + self.sheen * self.sheen_color.max(0) * (f4(0.2) + weight)
        again = coat = np.zeros(1, f4)
        if self._clear_again:
            again = glass * self._loss().at(self, wo, self._inside)
            glass = glass - again
        if self._coated:
            coat = self.clearcoat * (floor + _schlick(COAT_F0, wo[2]))
        return Chances(gloss, glass, coat, again, diffuse)


def _used(parameter: Any) -> bool:
    """Return whether a strength is above 0 anywhere."""
    return isinstance(parameter, BaseTexture) or bool((parameter > 0).any())


def bent(ior: Floats) -> Floats:
    """Return an index that is at least `LEAST_BEND` away from 1."""
    return np.where(np.abs(ior - f4(1)) < LEAST_BEND, f4(1 + LEAST_BEND), ior)


def _fifth(cos: Floats) -> Floats:
    """(1 − cosθ)⁵ (C. Schlick 1994, "An Inexpensive BRDF Model", eq. 15)."""
    away = np.maximum(f4(1) - cos, f4(0))
    square = away * away
    return square * square * away


def _schlick(f0: float, cos: Floats) -> Floats:
    """Schlick's reflectance from f0 at normal incidence, (n,)."""
    return f4(f0) + f4(1 - f0) * _fifth(cos)

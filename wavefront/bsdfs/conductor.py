"""Metals."""

from __future__ import annotations

from functools import partial
from typing import Any, Self

import numpy as np

from ..arrays.vec import Floats, broadcast, f4
from ..colors import rgb
from ..core.errors import SceneError, in_brief, one_of, text
from ..core.parameter import Parameter, parametrized
from ..core.suggestions import suggests_keywords
from ..textures.base import BaseTexture
from ..textures.parameter import MAX_INDEX, Color, Scalar, color, refractive_index, scalar
from .base import BsdfSample, weigh
from .energy import gain, mean_over_cosines
from .fresnel import fresnel_conductor
from .microfacet import reflect
from .mirror import mirrored
from .rough import RoughBsdf
from .thin_film import film_reflectance, has_film, thickness

# η and k of metals in linear Rec. 709 RGB: published measurements, weighted by the matching
# functions of the three primaries (CIE 1931 2° by the fit of C. Wyman et al. 2013, JCGT 2(2), to
# equal-energy white). Measurements: gold, silver, copper: P. Johnson and R. Christy 1972, Phys.
# Rev. B 6, 4370; chromium, iron, nickel, titanium: the same authors 1974, Phys. Rev. B 9, 5056;
# aluminum: A. Rakić 1995, Appl. Opt. 34, 4755; platinum: A. Rakić et al. 1998, Appl. Opt. 37, 5271.
METALS = {
    "aluminum": ((1.4411, 0.9884, 0.5853), (7.5577, 6.5663, 5.3061)),
    "chromium": ((3.2238, 3.1180, 2.2560), (3.2913, 3.3387, 3.1137)),
    "copper": ((0.2371, 1.0373, 1.2982), (3.2440, 2.6010, 2.3527)),
    "gold": ((0.1078, 0.4885, 1.4778), (3.5084, 2.3376, 1.8090)),
    "iron": ((2.9165, 2.9217, 2.5323), (3.0649, 2.9396, 2.7420)),
    "nickel": ((2.0100, 1.9042, 1.7193), (4.1206, 3.5752, 2.8630)),
    "platinum": ((2.3176, 2.0770, 1.8193), (4.1714, 3.6728, 3.0684)),
    "silver": ((0.0554, 0.0547, 0.0427), (4.2931, 3.5430, 2.5346)),
    "titanium": ((2.7159, 2.5119, 2.2270), (3.7912, 3.4042, 2.9994)),
}
SPELLINGS = {"aluminium": "aluminum", "chrome": "chromium"}


def _metal(title: str, name: Any) -> Any:
    """Return the name of a metal as it is in the table."""
    key = text(title, name).lower()
    return one_of(title, SPELLINGS.get(key, key), METALS)


class _Eta(Parameter[Color]):
    """The parameter η; the name of a metal sets k, too."""

    def __set__(self, instance: Any, value: Color) -> None:
        """Store η, or both of a metal."""
        if isinstance(value, str):
            value, k = METALS[_metal("Conductor eta", value)]
            vars(instance)["_named"] = "eta" not in vars(instance)  # in the constructor, which assigns k next
            vars(instance)["k"] = rgb("Conductor k", k)
        super().__set__(instance, value)


class _Extinction(Parameter[Color | None]):
    """The parameter k, which a metal that is given by its name has already."""

    def __set__(self, instance: Any, value: Color | None) -> None:
        """Store k, unless there is that of a metal."""
        if not vars(instance).pop("_named", False):
            if value is None:
                raise SceneError(
                    'Conductor k is missing: give eta and k, or the name of a metal, such as "gold"'
                )
            super().__set__(instance, value)
        elif value is not None:
            raise SceneError(
                f"Conductor k is {in_brief(value)}, and a named metal has its own; or is it roughness=...?"
            )


@parametrized
class Conductor(RoughBsdf):
    """A metal, by its complex refractive index η + ik: smooth, or rough.

    A rough metal reflects about as much light as a smooth one, in a deeper color: light that its microfacets
    scatter more than once is part of its lobe.

    Parameters
    ----------
    eta
        Real part η per channel, more than 0 and at most 1e6: a number, three numbers, or a texture; or the
        name of a metal, as for `named`, which also has a k.
    k
        Imaginary part (extinction) per channel, in [0, 1e6].
    roughness
        In [0, 1]; α = roughness². Below α = 0.001 it is a perfect mirror.
    roughness_v, rotation
        Roughness across, a number or a texture. Then `roughness` is that along the direction of growing u of
        the texture coordinates, turned by `rotation` degrees towards v. None: alike in all directions.
    distribution
        Of the facets' normals: "ggx", or "beckmann", whose highlights have no halo.
    shadowing
        "correlated" with masking by the facets' height, or "separable" (E. Heitz 2014, eqs. 98 and 99).
    film_thickness, film_ior
        A clear film on the surface, such as an oxide or oil, whose interference colors the light: thickness
        in nanometers, at most 1e5, 0 for none; and refractive index. See docs/materials.md.
    reflectance
        Factor of the reflection, in [0, 1]: 1 for a metal as it is, a texture for dirt on it.
    multiscatter
        Add multiple scattering by the microfacets (E. Turquin 2019, C. Kulla and A. Conty 2017). False is
        the model of single scattering, as in Mitsuba. With F = 1, seen along the normal, that loses 1 % at
        roughness 0.32, 8 % at 0.5, 31 % at 0.71, 69 % at 1.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> gold = wf.Conductor("gold", roughness=0.3)
    >>> metal = wf.Conductor(eta=(1.5, 1.0, 0.6), k=(7.6, 6.6, 5.4))
    """

    eta: Parameter[Color] = _Eta(partial(color, high=MAX_INDEX, above_zero=True))
    k: Parameter[Color | None] = _Extinction(partial(color, high=MAX_INDEX), default=None)
    roughness: Parameter[Scalar] = Parameter(scalar, default=0.0)
    film_thickness: Parameter[Scalar] = Parameter(thickness, default=0.0, kw_only=True)
    film_ior: Parameter[Scalar] = Parameter(refractive_index, default=1.33, kw_only=True)
    reflectance: Parameter[Color] = Parameter(color, default=1.0, kw_only=True)

    def derive(self) -> None:
        """Set `specular` from the roughness, whether there is a film, and the mean of constants."""
        super().derive()
        self.has_film = has_film(self.film_thickness)
        self.is_whole = not isinstance(self.reflectance, BaseTexture) and bool(np.all(self.reflectance == 1))
        varying = any(isinstance(value, BaseTexture) for value in vars(self).values())
        alone = self.specular or varying or not self.multiscatter
        self.mean_reflectance = None if alone else mean_over_cosines(self._fresnel)

    @classmethod
    @suggests_keywords
    def named(cls, name: str, roughness: Scalar = 0.0) -> Self:
        """Return the metal `name`: one of `METALS`, such as "gold", in capitals or not.

        Raises
        ------
        SceneError
            If the name is not known, listing those that are.
        """
        return cls(*METALS[_metal("Conductor name", name)], roughness)

    def albedo(self, wo: Floats) -> Floats:
        """Return the reflectance along the mirrored direction, also of rough metals."""
        return self._fresnel(wo[2])

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return F·D·G/(4·cosθo·cosθi) and the density of reflections in visible normals; 0 for a mirror."""
        if self.specular:
            return np.zeros_like(wi), np.zeros_like(wi[2])
        value, pdf, cos = self.facets().mirror_lobe(wo, wi)
        if self.multiscatter:
            mean = self.mean_reflectance
            value = value * gain(self, wo, wi, mean_over_cosines(self._fresnel) if mean is None else mean)
        return self._fresnel(cos) * value, pdf

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Return reflections at the normal, or at visible microfacets; no sample below the surface."""
        n = wo.shape[1]
        if self.specular:
            weight = self._fresnel(wo[2])
            return BsdfSample(mirrored(wo), weight, np.ones_like(wo[2]), np.ones(n, np.bool_))
        wi = reflect(wo, self.facets().visible_normals(wo, u))
        f, pdf = self.evaluate(wo, wi)
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, n))

    def _fresnel(self, cos: Floats) -> Floats:
        """Return the reflectance per channel, (3, n), with that of a film."""
        if self.has_film:
            reflectance = film_reflectance(cos, self.film_thickness, self.film_ior, f4(1), self.eta, self.k)
        else:
            reflectance = fresnel_conductor(cos, self.eta, self.k)
        return reflectance if self.is_whole else reflectance * self.reflectance

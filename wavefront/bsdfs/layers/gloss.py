"""The gloss of opaque dielectrics: its reflection, and the light that reaches the matte part below."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import Floats, f4
from ..albedo import dielectric_albedo, facet_cosines, gloss_tables, lookup
from ..energy import mean_over_cosines
from ..fresnel import fresnel_dielectric
from .film import Film
from .fresnel import fifth


class Gloss(ABC):
    """The reflection of a dielectric."""

    weight: Floats  # (n,) of its reflection

    @abstractmethod
    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,) to facets, (3, n)."""

    @abstractmethod
    def schlick(self, weight: Floats) -> Floats:
        """Return the approximate reflectance (3, n) at weight = (1 − cosθ)⁵."""

    @abstractmethod
    def passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the part of the light from cosines that is not reflected, (n,), or (3, n) below a film."""

    @abstractmethod
    def mean_passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the mean of `passed` for diffuse light, at any `cos`."""


@soa
class SchlickGloss(Gloss):
    """The gloss of glTF, by Schlick's approximation."""

    ior: Floats  # (n,)
    weight: Floats
    tint: Floats  # (3, n) of the reflectance along the normal
    film: Film | None = None

    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,) to facets, (3, n)."""
        if self.film is not None:
            return self._below(self.film, cos, self.tint)
        return self.schlick(fifth(cos))

    def schlick(self, weight: Floats) -> Floats:
        """Return the reflectance, (3, n), at weight = (1 − cosθ)⁵."""
        f0 = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        tinted = np.minimum(self.tint * f0, f4(1)) * self.weight
        return tinted + (self.weight - tinted) * weight

    def passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the part of the light from cosines that is not reflected, (n,), or (3, n) below a film."""
        a, b, _, _ = gloss_tables()
        f0, f90 = self.schlick(np.zeros(1, f4)).max(0), self.weight
        at_f0, at_f90 = (lookup(table, roughness, cos) for table in (a, b))
        passed = f4(1) - f0 * at_f0 - f90 * at_f90
        if self.film is None:
            return passed
        facet = lookup(facet_cosines(), roughness, cos)
        plain = self.schlick(fifth(facet)).max(0)
        return passed - (at_f0 + at_f90) * (self._below(self.film, facet, self.tint.max(0)) - plain)

    def mean_passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the mean of `passed` for diffuse light, at any `cos`."""
        if self.film is not None:
            return mean_over_cosines(partial(self.passed, roughness))
        _, _, a, b = gloss_tables()
        f0, f90 = self.schlick(np.zeros(1, f4)).max(0), self.weight
        return f4(1) - f0 * lookup(a, roughness, cos) - f90 * lookup(b, roughness, cos)

    def _below(self, film: Film, cos: Floats, tint: Floats) -> Floats:
        f0 = ((self.ior - f4(1)) / (self.ior + f4(1))) ** 2
        return film.over(cos, np.minimum(tint * f0, f4(1))) * self.weight


@soa
class FresnelGloss(Gloss):
    """The gloss of OpenPBR, by Fresnel's equations."""

    index: Floats  # (n,) relative to the medium above, at least 1
    weight: Floats
    tint: Floats  # (3, n)
    film: Film | None = None

    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,) to facets, (3, n)."""
        plain, _ = fresnel_dielectric(cos, self.index)
        return self.tint * (plain if self.film is None else plain + self._film_adds(self.film, cos))

    def schlick(self, weight: Floats) -> Floats:
        """Return the approximate reflectance (3, n) at weight = (1 − cosθ)⁵."""
        root = (self.index - f4(1)) / (self.index + f4(1))
        return self.tint * (root * root + (f4(1) - root * root) * weight)

    def passed(self, roughness: Floats, cos: Floats | None) -> Floats:
        """Return the part of the light from cosines that is not reflected; of diffuse light without."""
        tint = self.tint.max(0)
        passed = f4(1) - tint * dielectric_albedo(self.index, roughness, cos)
        if self.film is None or cos is None:
            return passed
        a, b, _, _ = gloss_tables()
        facet = lookup(facet_cosines(), roughness, cos)
        shown = lookup(a, roughness, cos) + lookup(b, roughness, cos)
        return passed - tint * shown * self._film_adds(self.film, facet)

    def mean_passed(self, roughness: Floats, cos: Floats) -> Floats:
        """Return the mean of `passed` for diffuse light, at any `cos`."""
        if self.film is not None:
            return mean_over_cosines(partial(self.passed, roughness))
        return self.passed(roughness, None)

    def _film_adds(self, film: Film, cos: Floats) -> Floats:
        """Return the reflectance (3, n) that a film adds."""
        root = (self.index - f4(1)) / (self.index + f4(1))
        shape = np.broadcast_shapes(root.shape, cos.shape)
        below = film.over(cos, np.broadcast_to(root * root, shape))
        return (below - fresnel_dielectric(cos, self.index)[0]) * film.weight

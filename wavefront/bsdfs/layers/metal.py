"""Metals: their reflectance by the angle."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import Floats, f4
from ..energy import mean_over_cosines
from ..thin_film import film_reflectance
from .film import Film
from .fresnel import fifth

F82 = f4(1 / 7)  # cosine of the angle where the tint of a metal counts, about 82°
HIGHEST_F0 = f4(0.99)  # of a metal that has an index of refraction


class Metal(ABC):
    """The reflectance of a metal."""

    @abstractmethod
    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,), (3, n)."""

    def mean(self) -> Floats:
        """Return the mean of the reflectance over diffuse light, (3, n)."""
        return mean_over_cosines(self.reflectance)


@soa
class SchlickMetal(Metal):
    """A metal by Schlick's approximation, as in glTF."""

    color: Floats  # (3, n) reflectance along the normal
    film: Film | None = None

    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,), (3, n)."""
        if self.film is not None:
            return self.film.over(cos, self.color)
        return self.color + (f4(1) - self.color) * fifth(cos)

    def mean(self) -> Floats:
        """Return the mean of the reflectance over diffuse light, (3, n)."""
        if self.film is not None:
            return mean_over_cosines(self.reflectance)
        return self.color + (f4(1) - self.color) * f4(1 / 21)


@soa
class TintedMetal(Metal):
    """A metal with a tint at about 82° (OpenPBR's specification, section on metal)."""

    color: Floats  # (3, n) reflectance along the normal
    edge: Floats  # (3, n) absorption at `F82` beyond Schlick's approximation
    weight: Floats  # (n,) of the reflectance
    film: Film | None = None

    def reflectance(self, cos: Floats) -> Floats:
        """Return the reflectance at cosines (n,), (3, n)."""
        f0, away = self.color, np.maximum(f4(1) - cos, f4(0))
        power = (away * away) * (away * away) * away
        steep = (f4(1) - F82) ** 5
        dip = (f0 + (f4(1) - f0) * steep) * self.edge / (F82 * steep * (f4(1) - F82))
        plain = f0 + (f4(1) - f0) * power - dip * (cos * power * away)
        if self.film is not None:
            plain = plain + (self._below_film(self.film, cos) - plain) * self.film.weight
        return np.maximum(plain, f4(0)) * self.weight

    def _below_film(self, film: Film, cos: Floats) -> Floats:
        """Return the reflectance below a film, (3, n).

        Its index η + ik is that of O. Gulbrandsen 2014, "Artist Friendly Metallic Fresnel" (JCGT 3(4)), for
        its color along the normal and the tint at the edge.
        """
        f0 = np.minimum(self.color, HIGHEST_F0)
        root = np.sqrt(f0)
        most, least = (f4(1) + root) / (f4(1) - root), (f4(1) - f0) / (f4(1) + f0)
        eta = least + (most - least) * self.edge
        k2 = (f0 * (eta + f4(1)) ** 2 - (eta - f4(1)) ** 2) / (f4(1) - f0)
        k = np.sqrt(np.maximum(k2, f4(0)))
        return film_reflectance(cos, film.thickness, film.ior, f4(1), eta, k)

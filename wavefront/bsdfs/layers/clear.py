"""The clear part of a base: glass, or a thin sheet of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import Bools, Floats, dot, f4
from ..channels import mean_of_channels
from ..dielectric import LEAST_BEND
from ..energy import Loss, Shape, loss
from ..fresnel import fresnel_dielectric, fresnel_sheet
from ..microfacet import Facets, refract
from ..thin_film import film_reflectance
from .coat import path_length, power
from .film import Film

TURNED_OVER = np.array([[1], [1], [-1]], f4)


@soa
class Clear:
    """A clear part: it reflects and transmits light by Fresnel's equations, in the facets of the base."""

    ior: Floats  # (n,)
    thin: bool  # a sheet, which does not bend light
    tint: Floats  # (3, n) of light that crosses
    shine: Floats  # (1,) or (3, n) tint of light that is reflected
    back_facing: Bools | None = None  # (n,) wo is inside; None where it never is
    film: Film | None = None
    stain: Floats | None = None  # (3, n) of a sheet that absorbs along the refracted ray; None for others
    boundary: float | None = None  # index whose lost light returns; None where none does
    again: bool = False  # lost light returns; of a sheet, too

    @property
    def inside(self) -> Bools:
        """Where wo is inside, (n,) or (1,)."""
        return np.zeros(1, np.bool_) if self.back_facing is None else self.back_facing

    def loss(self, shape: Shape) -> Loss:
        """Return the lobe of the light that the boundary loses, of microfacets of a shape."""
        assert self.boundary is not None
        return loss(shape, self.boundary)

    def eta(self) -> Floats:
        """Return the index beyond / before, (n,) or (1,); 1 for a sheet, and never quite 1 otherwise."""
        if self.thin:
            return np.ones(1, f4)
        index = bent(self.ior)
        return index if self.back_facing is None else np.where(self.back_facing, f4(1) / index, index)

    def fresnel(self, cos: Floats) -> tuple[Floats, Floats]:
        """Return the exact reflectance, with a film (3, n), and the refracted cosine, each (n,)."""
        if self.film is None:
            return self._bare(cos)
        index = self.ior if self.thin else self.eta()
        face, refracted = fresnel_dielectric(cos, index)
        before: Any = f4(1)
        if self.back_facing is not None:
            before = np.where(self.back_facing, f4(1) / index, f4(1))
        film = film_reflectance(cos, self.film.thickness, self.film.ior, before, before * index)
        face = np.where(face < 1, np.broadcast_to(film, (3, cos.size)), f4(1))
        face = f4(2) * face / (f4(1) + face) if self.thin else face  # the mean of both polarizations
        if self.film.weight is not None:
            plain, _ = self._bare(cos)
            face = plain + (face - plain) * self.film.weight
        return face, refracted

    def _bare(self, cos: Floats) -> tuple[Floats, Floats]:
        if self.thin:
            return fresnel_sheet(cos, self.ior), cos
        return fresnel_dielectric(cos, self.eta())

    def through(self, wo: Floats, wi: Floats, facets: Facets) -> tuple[Floats, Floats]:
        """Return transmission with its Fresnel factor: value (n,) or (3, n), and density (n,)."""
        if self.thin:
            value, density, cos = facets.mirror_lobe(wo, wi * TURNED_OVER)
        else:
            value, density, cos, _ = facets.refraction_lobe(wo, wi, self.eta())
        reflected, _ = self.fresnel(cos)
        value, density = value * (f4(1) - reflected), density * (f4(1) - mean_of_channels(reflected))
        if self.stain is not None:
            half = wo + wi * TURNED_OVER
            lengths = path_length(f4(0.5) * np.sqrt(dot(half, half)), self.ior)
            value = value * power(self.stain, lengths)
        return value, density

    def across(
        self, wo: Floats, wi: Floats, m: Floats, cos: Floats, cos_refracted: Floats, eta: Floats
    ) -> Floats:
        """Return where light crosses to: refracted, or for a sheet the reflection wi turned over."""
        return wi * TURNED_OVER if self.thin else refract(wo, m, cos, cos_refracted, eta)


def bent(ior: Floats) -> Floats:
    """Return an index that is at least `LEAST_BEND` away from 1."""
    return np.where(np.abs(ior - f4(1)) < LEAST_BEND, f4(1 + LEAST_BEND), ior)

"""Layers: a base, and covers on it. Each material model maps its parameters to them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Bools, Floats, broadcast, f4
from ...textures.base import BaseTexture
from ..base import BsdfSample, JointBsdf, weigh
from ..microfacet import Facets

NONE = np.zeros(1, f4)


class Chances(NamedTuple):
    """Probabilities of the lobes that samples are drawn from; they depend on wo only. Each (n,)."""

    gloss: Floats = NONE  # reflection in the base's microfacets
    glass: Floats = NONE  # reflection or refraction in them, by Fresnel
    coat: Floats = NONE  # reflection in the coat
    again: Floats = NONE  # multiple scattering by the microfacets of clear parts, on both sides
    diffuse: Floats = NONE  # cosine-weighted
    fuzz: Floats = NONE  # fibers


class Drawn(NamedTuple):
    """Directions drawn from the lobes of a base."""

    wi: Floats  # (3, n)
    crosses: Bools  # (n,) they are to cross the surface
    eta: Floats | None = None  # (n,) relative index that they meet; None where no light crosses
    valid: Bools | bool = True  # (n,) the facet sends light there


class Cover(ABC):
    """A layer on a base."""

    # draws facets of the coat: of the base's facets, wo, u, and where the coat is chosen
    normals: Callable[[Facets, Floats, Floats, Bools], Floats] | None = None

    @abstractmethod
    def weigh(self, weights: Chances, wo: Floats) -> Chances:
        """Return weights of the lobes with that of this layer, its approximate albedo."""

    @abstractmethod
    def over(self, f: Floats, pdf: Floats, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` (3, n) and `pdf` (n,) of this layer over those below, whose values are given."""

    def directions(self, wi: Floats, wo: Floats, u: Floats, chances: Chances) -> Floats:
        """Return directions (3, n), in place of some of which this layer draws its own."""
        return wi


class Base(ABC):
    """The lowest layer."""

    @abstractmethod
    def weights(self, wo: Floats) -> Chances:
        """Return the approximate albedos of its lobes."""

    def share(self, total: Floats) -> Floats:
        """Return the factor (n,) that turns weights of this sum into chances."""
        return f4(1) / np.where(total > 0, total, f4(1))

    @abstractmethod
    def evaluate(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        """Return `f` (3, n) and its part of the `pdf` (n,)."""

    @abstractmethod
    def directions(self, wo: Floats, u: Floats, chances: Chances, coat: Cover | None) -> Drawn:
        """Return directions of all lobes but the fuzz, by u[2]."""


class Layers:
    """A base and its covers, at the points of a wave.

    Parameters
    ----------
    base
        The lowest layer.
    covers
        Those above it, from below.
    """

    def __init__(self, base: Base, covers: tuple[Cover, ...] = ()) -> None:
        self.base, self.covers = base, covers
        self.coat = next((cover for cover in covers if cover.normals is not None), None)

    def chances(self, wo: Floats) -> Chances:
        """Return the probabilities of the lobes, by their approximate albedos; 0 for absent lobes."""
        weights = self.base.weights(wo)
        for cover in self.covers:
            weights = cover.weigh(weights, wo)
        share = self.base.share(sum(weights[1:], weights[0]))
        return Chances(*(np.broadcast_to(weight * share, wo[2].shape) for weight in weights))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes."""
        return self._evaluated(wo, wi, self.chances(wo))

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes."""
        chances = self.chances(wo)
        wi, crosses, eta, valid = self.base.directions(wo, u, chances, self.coat)
        for cover in self.covers:
            wi = cover.directions(wi, wo, u, chances)
        f, pdf = self._evaluated(wo, wi, chances)
        pdf = np.where(((wi[2] < 0) == crosses) & valid, pdf, f4(0))
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)), eta)

    def _evaluated(self, wo: Floats, wi: Floats, chances: Chances) -> tuple[Floats, Floats]:
        f, pdf = self.base.evaluate(wo, wi, chances)
        for cover in self.covers:
            f, pdf = cover.over(f, pdf, wo, wi, chances)
        return f, pdf


class LayeredBsdf(JointBsdf):
    """A BSDF by the parameters of a model; a subclass maps them to `Layers`.

    Attributes
    ----------
    used
        Names of the parameters that are textures, or not 0. They decide which layers there are, so that
        these are the same at all points.
    clear_again
        With multiple scattering by the facets of clear parts.
    boundary
        Index of refraction for which tables tell how; None for sheets, or where it varies.
    """

    dimensions = 3
    used: tuple[str, ...] = ()
    clear_again: bool = False
    boundary: float | None = None
    _layers: ClassVar[Layers | None] = None  # of those that are bound

    def derive(self) -> None:
        """Note which parameters are used."""
        self.used = tuple(name for name, value in vars(self).items() if name in self.defaults and used(value))

    @abstractmethod
    def layers(self) -> Layers:
        """Return the layers that the parameters stand for."""

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return the BSDF bound to `surface`, with its layers there."""
        bound = super().bind(surface)
        bound = copy(self) if bound is self else bound
        if self.encloses:
            bound.back_facing = surface.back_facing
        if surface.index_around is not None and bound.boundary is not None:
            bound.boundary, bound.clear_again = None, False  # tables are those of one index
        vars(bound)["_layers"] = bound.layers()
        return bound

    def _layered(self) -> Layers:
        return self._layers or self.layers()

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of all lobes."""
        return self._layered().evaluate(wo, wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes."""
        return self._layered().sample_f(wo, u)


def used(parameter: Any) -> bool:
    """Return whether a parameter is a texture, or not 0 everywhere."""
    return isinstance(parameter, BaseTexture) or bool(np.any(parameter))

"""Blends of two BSDFs."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import BELOW_ONE, Bools, Floats, f4
from ..core.parameter import Parameter, parametrized
from ..textures.base import BaseTexture
from ..textures.parameter import Scalar, scalar
from .base import Bsdf, BsdfSample, JointBsdf, is_bsdf, weigh


@parametrized
class Mix(JointBsdf):
    """A blend of two BSDFs: (1 − weight)·first + weight·second.

    Parameters
    ----------
    first, second
        The BSDFs; either may itself be a `Mix`.
    weight
        Fraction of the second, in [0, 1]: a number or a texture.

    Raises
    ------
    SceneError
        If the weight is outside [0, 1], or `first` or `second` is not a `Bsdf`.

    Examples
    --------
    >>> rusty = wf.Mix(wf.Conductor.named("iron", roughness=0.4), wf.Diffuse((0.4, 0.15, 0.05)), 0.6)
    """

    dimensions = 3

    first: Parameter[Bsdf] = Parameter(is_bsdf)
    second: Parameter[Bsdf] = Parameter(is_bsdf)
    weight: Parameter[Scalar] = Parameter(scalar, default=0.5)

    def derive(self) -> None:
        """Set the flags from those of both BSDFs."""
        self.transmissive = self.first.transmissive or self.second.transmissive
        self.dispersive = self.first.dispersive or self.second.dispersive
        self.specular = self.first.specular and self.second.specular

    @property
    def encloses(self) -> bool:
        """True if one of both does."""
        return self.first.encloses or self.second.encloses

    @property
    def index_inside(self) -> Any:
        """The index of refraction of both BSDFs, one after the other if they differ."""
        indices = [bsdf.index_inside for bsdf in (self.first, self.second) if bsdf.encloses]
        known = [index for index in indices if index is not None]
        varying = [index for index in known if isinstance(index, BaseTexture)]
        if varying or len(known) < 2:
            return (varying + known)[0] if known else None
        return known[0] if np.array_equal(*known) else np.concatenate([np.ravel(index) for index in known])

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Look up the weight, and the parameters of both BSDFs."""
        bound = copy(super().bind(surface))
        vars(bound).update(first=self.first.bind(surface), second=self.second.bind(surface))
        return bound

    def albedo(self, wo: Floats) -> Floats:
        """Return the albedos of both BSDFs, blended."""
        return self._blend(self.first.albedo(wo), self.second.albedo(wo))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of both BSDFs, blended."""
        f1, pdf1 = self.first.evaluate(wo, wi)
        f2, pdf2 = self.second.evaluate(wo, wi)
        return self._blend(f1, f2), self._blend(pdf1, pdf2)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a BSDF by u[2], reuse the rest of u[2], and weight by both densities.

        A sample of a delta lobe keeps its weight: the other BSDF has no value there.
        """
        chance = np.broadcast_to(self.weight, wo[2].shape)
        second = u[2] < chance
        low = np.where(second, f4(0), chance)
        size = np.where(second, chance, f4(1) - chance)
        again = u.copy()
        again[2] = np.minimum((u[2] - low) / np.where(size > 0, size, f4(1)), BELOW_ONE)
        one, two = self.first.sample_f(wo, again), self.second.sample_f(wo, again)
        wi = np.where(second, two.wi, one.wi)
        specular = np.where(second, two.specular, one.specular)
        chosen = np.where(second, two.pdf, one.pdf)
        f, density = self.evaluate(wo, wi)
        pdf = np.where(specular, chosen * size, np.where(chosen > 0, density, f4(0)))
        weight = np.where(specular, np.where(second, two.weight, one.weight), weigh(f, wi, pdf))
        eta = _eta(one, two, second) if self.transmissive else None
        return BsdfSample(wi, weight, pdf, specular, eta)

    def _blend(self, first: Floats, second: Floats) -> Floats:
        return first + (second - first) * self.weight


def _eta(one: BsdfSample, two: BsdfSample, second: Bools) -> Floats:
    """Relative index of the chosen samples, (n,)."""
    ones = np.ones_like(one.pdf)
    return np.where(second, ones if two.eta is None else two.eta, ones if one.eta is None else one.eta)

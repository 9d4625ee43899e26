"""Surfaces whose front and back scatter differently, or whose back is black."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Floats, f4
from ..core.errors import SceneError
from ..core.parameter import Parameter, parametrized
from .base import Bsdf, BsdfSample, JointBsdf


def _opaque(name: str, value: Any) -> Bsdf | None:
    """Return a BSDF that no light crosses, or None."""
    if value is not None and (not isinstance(value, Bsdf) or value.transmissive):
        wanted = "a Bsdf that light does not cross, such as wf.Diffuse(0.5)"
        raise SceneError(f"{name} must be {wanted}, got {value!r}")
    return value


@parametrized
class Sides(JointBsdf):
    """A surface with one BSDF on its front and another, or none, on its back.

    Everywhere else a BSDF scatters light on both sides of a surface.

    Parameters
    ----------
    front
        The BSDF of the side that the normals of the surface point to.
    back
        That of the other side; None: it is black.

    Raises
    ------
    SceneError
        If one of them is not a `Bsdf`, or light crosses it.

    Examples
    --------
    >>> one_sided = wf.Sides(wf.Diffuse(0.7))
    >>> card = wf.Sides(wf.Diffuse("white"), wf.Diffuse("navy"))
    """

    dimensions = 3
    front: Parameter[Bsdf] = Parameter(_opaque)
    back: Parameter[Bsdf | None] = Parameter(_opaque, default=None)

    def derive(self) -> None:
        """Check that there is a front, and set the flags."""
        if self.front is None:
            raise SceneError("Sides front must be a Bsdf such as wf.Diffuse(0.5), got None")
        self.specular = self.front.specular and (self.back is None or self.back.specular)

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Look up the parameters of both BSDFs, and the side."""
        bound = copy(super().bind(surface))
        back = None if self.back is None else self.back.bind(surface)
        vars(bound).update(front=self.front.bind(surface), back=back, back_facing=surface.back_facing)
        return bound

    def albedo(self, wo: Floats) -> Floats:
        """Return the albedo of the side of `wo`."""
        back = f4(0) if self.back is None else self.back.albedo(wo)
        return np.where(self._back_of(wo), back, self.front.albedo(wo))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the side of `wo`."""
        f, pdf = self.front.evaluate(wo, wi)
        behind = self._back_of(wo)
        other, density = (f4(0), f4(0)) if self.back is None else self.back.evaluate(wo, wi)
        return np.where(behind, other, f), np.where(behind, density, pdf)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Return samples of the side of `wo`; none where it is black."""
        one, behind = self.front.sample_f(wo, u), self._back_of(wo)
        if self.back is None:
            nothing = np.where(behind, f4(0), f4(1))
            return BsdfSample(one.wi, one.weight * nothing, one.pdf * nothing, one.specular)
        two = self.back.sample_f(wo, u)
        pairs = ((one.wi, two.wi), (one.weight, two.weight), (one.pdf, two.pdf), (one.specular, two.specular))
        return BsdfSample(*(np.where(behind, second, first) for first, second in pairs))

    def _back_of(self, wo: Floats) -> Bools:
        return np.zeros(wo.shape[1], np.bool_) if self.back_facing is None else self.back_facing

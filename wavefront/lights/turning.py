"""Lights at infinity that turn while a shutter is open: each is asked as it is at the time of the path."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Doubles, Floats, f4, normalize
from ..motion.steps import Motions, transposed_turned, turned
from .base import LightSample, Receiver
from .infinite import InfiniteLight


@soa
class TurningLight(InfiniteLight):
    """A light at infinity that is asked in its own coordinates, where it is still.

    A rotation keeps solid angles, so a density is that of the light as it is at the time.
    """

    light: InfiniteLight  # in coordinates of its own, those of the middle of the time
    number: int  # of its motion
    motions: Motions  # rotations from the scene to those coordinates
    # (12, n) of points that are lit; None where their times are not known
    matrix: Doubles | None = field(default=None, kw_only=True)

    takes_receiver: ClassVar[bool] = True
    turns: ClassVar[bool] = True

    def compensated(self) -> Self:
        """Return the light as it is best sampled beside BSDF samples."""
        return replace(self, light=self.light.compensated())

    def lighting(self, receiver: Receiver) -> Self:
        """Return the light at the times of surfaces, and as it is sampled for their normals."""
        matrix = self._matrix(receiver.time, len(receiver))
        lit = replace(self, matrix=matrix)
        if self.light.takes_receiver:
            normal = _toward(matrix, receiver.normal)
            own: Any = self.light.lighting(Receiver(normal, receiver.opaque, time=receiver.time))
            lit.light = own
        return lit

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Sample the light as it is then."""
        sample = self.light.sample_li(point, u)
        wi = transposed_turned(self._matrix(None, point.shape[1]), sample.wi)
        return replace(sample, wi=normalize(wi).astype(f4))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li`, (n,)."""
        return self.light.pdf_li(point, _toward(self._matrix(None, wi.shape[1]), wi))

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n), at the times of the points that are lit, or in the middle."""
        return self.light.le(_toward(self._matrix(None, wi.shape[1]), wi))

    def le_at(self, wi: Floats, time: Doubles | None) -> Floats:
        """Return the radiance, (3, n), at times (n,)."""
        return self.light.le(_toward(self._matrix(time, wi.shape[1]), wi))

    def power(self, scene_radius: float) -> Doubles:
        """Return that of the light, whichever way it is turned."""
        return self.light.power(scene_radius)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Return that of the light, (c, 1), which is the same for surfaces that face any way."""
        return self.light.irradiance(center, radius, scene_radius)

    def _matrix(self, time: Doubles | None, n: int) -> Doubles:
        """Return the matrices (12, n) to the light's coordinates, those that are known or at times (n,)."""
        if time is None and self.matrix is not None:
            return self.matrix
        when = np.full(n, self.motions.middle) if time is None else time
        return self.motions.at(np.full(n, self.number), when)


def _toward(matrix: Doubles, direction: Floats) -> Floats:
    """Return directions (3, n), each turned by a matrix, (12, n)."""
    return normalize(turned(matrix, direction)).astype(f4)

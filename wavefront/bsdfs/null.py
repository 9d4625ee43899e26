"""Surfaces that are not there: borders of media."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats
from .base import Bsdf


class NullSurface(Bsdf):
    """An invisible surface, such as the border of a medium: light passes it unchanged.

    A `Material` with it has an alpha of 0, whatever else is given.

    Examples
    --------
    >>> smoke = wf.Medium(scattering=2, absorption=1)
    >>> puff = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.NullSurface(), interior=smoke))
    """

    transmissive = True
    invisible = True

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (3, n): light that passes is not scattered."""
        return np.zeros_like(wi)

"""A thin film on a base."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.soa import soa
from ...arrays.vec import Floats, f4
from ..thin_film import film_reflectance


@soa
class Film:
    """A film with interference (bsdfs/thin_film.py)."""

    thickness: Floats  # (n,) nanometers
    ior: Floats  # (n,)
    weight: Any = None  # (n,) part of the surface that it covers; None for all

    def over(self, cos: Floats, f0: Floats) -> Floats:
        """Return the reflectance (3, n) of a film over a surface that reflects f0 along the normal in air."""
        root = np.sqrt(np.minimum(f0, f4(0.9999)))
        index = (f4(1) + root) / (f4(1) - root)
        return film_reflectance(cos, self.thickness, self.ior, f4(1), index)

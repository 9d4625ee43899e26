"""The emission of spheres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..textures.parameter import color
from .base import CurvedShape


class SphereEmission(CurvedShape):
    """Base class of spheres, which are the curved shapes that can shine."""

    _emission: Any = None

    @property
    def emission(self) -> Any:
        """Radiance that leaves the surface: the shape's own, or else its material's; None if dark."""
        return self.material.emission if self._emission is None else self._emission

    @emission.setter
    def emission(self, emission: Any) -> None:
        self._emission = None if emission is None else color(f"{self.name}: emission", emission, np.inf)

"""The emission of spheres: the same everywhere."""

from __future__ import annotations

from typing import Any

from ..colors import rgb
from ..errors import SceneError
from ..textures.base import BaseTexture
from .base import CurvedShape


class EvenEmission(CurvedShape):
    """Base class of curved shapes that can shine, evenly."""

    _emission: Any = None

    @property
    def emission(self) -> Any:
        """Radiance that leaves the surface: the shape's own, or else its material's; None if dark."""
        return self.material.emission if self._emission is None else self._emission

    @emission.setter
    def emission(self, emission: Any) -> None:
        if isinstance(emission, BaseTexture):
            raise SceneError(f"{self.name}: a sphere shines evenly; a mesh can shine by {emission!r}")
        self._emission = None if emission is None else rgb(f"{self.name}: emission", emission)

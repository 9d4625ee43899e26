"""The contract of what tilts the shading normals of a surface, beside its material."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..state import Surface
from ..vec import Floats, Ints


class Relief(ABC):
    """Fine detail of a surface, such as a normal map. The renderer applies it; no material does."""

    reads: tuple[str, ...]  # fields of `Surface` that `tilted` needs

    def scaled(self, factor: float) -> Relief:
        """Return this in a scene whose lengths were multiplied by `factor`: itself if it has none."""
        return self

    @abstractmethod
    def tilted(self, surface: Surface, normal: Floats) -> tuple[Ints, Floats]:
        """Return which columns are tilted, (k,), and their new unit normals, (3, k).

        Parameters
        ----------
        surface
            The hit points, n columns.
        normal
            (3, n) unit shading normals there, on the front side of the surface.
        """

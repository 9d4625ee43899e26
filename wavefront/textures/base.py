"""What varies over surfaces."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..state import SurfaceInteraction
from ..vec import Floats


class BaseTexture(ABC):
    """A material parameter that varies over surfaces, such as a texture."""

    reads: tuple[str, ...] = ("uv",)  # fields of `SurfaceInteraction` that `at` needs: "uv", "uv1", "color"
    scalar: bool | None = None  # `at` returns numbers (n,), not colors; None: what the parameter is

    def limits(self) -> tuple[float, ...]:
        """Return the least and the greatest value, or nothing where they are not known."""
        return ()

    @abstractmethod
    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values at the hit points: (3, n) for a color, (n,) for a scalar."""

"""The interface of textures."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats
from ..core.suggestions import Answers


class BaseTexture(Answers, ABC):
    """A parameter of materials and lights that varies over surfaces, such as an image.

    Examples
    --------
    >>> class Stripes(wf.BaseTexture):
    ...     reads = ("uv",)
    ...     scalar = True
    ...     def at(self, surface):
    ...         return np.float32(0.5) + np.float32(0.4) * np.sign(surface.uv[0] - np.float32(0.5))
    >>> board = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=wf.Diffuse(Stripes()))
    >>> wf.render([board, wf.Environment(1)], spp=1, size=(8, 8)).shape
    (8, 8, 3)
    """

    reads: tuple[str, ...] = ("uv",)  # fields of `SurfaceInteraction` that `at` needs: "uv", "uv1", "color"
    # whether `at` returns numbers (n,) rather than colors; None: either, as the parameter needs
    scalar: bool | None = None

    def limits(self) -> tuple[float, ...]:
        """Return the smallest and the largest value, or () where they are not known."""
        return ()

    @abstractmethod
    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values at the hit points: (3, n) for a color, (n,) for a scalar."""

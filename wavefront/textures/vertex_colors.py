"""Vertex colors of a mesh as a material parameter."""

from __future__ import annotations

from typing import Any

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats
from ..core.errors import SceneError, in_brief
from ..core.suggestions import suggests_keywords
from .base import BaseTexture
from .parameter import Color, color, scalar


class VertexColors(BaseTexture):
    """Vertex colors: the `colors` of the shape, for any material parameter that is a color or a number.

    Colors of a mesh are interpolated; `Spheres`, `Cylinders` and `Capsules` have one for each primitive. A
    shape without colors, and a `Sphere`, is opaque white.

    Parameters
    ----------
    times
        Factor of the colors, in [0, 1]: a color, a number or a texture.
    channel
        Which channel to use as a number: 0 to 2 for red, green and blue, 3 for the opacity. None
        gives a color.

    Raises
    ------
    SceneError
        If `times` is out of range, or the channel is invalid.

    Examples
    --------
    >>> corners, colors = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.eye(3)
    >>> mesh = wf.Mesh(corners, [(0, 1, 2)], colors=colors, material=wf.Diffuse(wf.VertexColors()))
    """

    @suggests_keywords
    def __init__(self, times: Color = 1.0, channel: int | None = None) -> None:
        if not (channel is None or (isinstance(channel, int) and channel in range(4))):
            raise SceneError(f"VertexColors channel is {in_brief(channel)}; it must be from 0 to 3, or None")
        self.channel = channel
        self.scalar = channel is not None
        factor: Any = times
        self.times = (scalar if self.scalar else color)("VertexColors times", factor)
        self.reads = ("color", *(self.times.reads if isinstance(self.times, BaseTexture) else ()))

    def __repr__(self) -> str:
        """Name the factor and the channel."""
        return f"VertexColors({self.times!r}, channel={self.channel!r})"

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values at hit points: (3, n), or (n,) when one channel was chosen."""
        if surface.color is None:
            raise SceneError("VertexColors: the surface has no vertex colors")
        values = surface.color[:3] if self.channel is None else surface.color[self.channel]
        return values * (self.times.at(surface) if isinstance(self.times, BaseTexture) else self.times)

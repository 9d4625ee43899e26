"""The content of a file or a trimesh object, whatever its format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..camera import Camera
from ..lights import Light
from ..shapes import Shape
from .placing import Places
from .repair import RawMesh


@dataclass
class Contents:
    """The content of a file."""

    raws: list[RawMesh]
    places: Places
    lights: Sequence[Light] = ()
    camera: Camera | None = None
    shapes: Sequence[Shape] = ()  # further ones, built already

    @classmethod
    def once(cls, raws: list[RawMesh]) -> Contents:
        """Return meshes that are placed once each, without a transform."""
        return cls(raws, Places.once(len(raws)))

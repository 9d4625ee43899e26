"""What a file or a trimesh object holds, whatever its kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..camera import Camera
from ..lights import DirectionalLight, PointLight, SpotLight
from .placing import Places
from .repair import RawMesh


@dataclass
class Contents:
    """What a file holds."""

    raws: list[RawMesh]
    places: Places
    lights: Sequence[DirectionalLight | PointLight | SpotLight] = ()
    camera: Camera | None = None

    @classmethod
    def once(cls, raws: list[RawMesh]) -> Contents:
        """Return meshes that stand where their vertices are."""
        return cls(raws, Places.once(len(raws)))

"""The content of a file or a trimesh object, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...camera import Camera
from ...lights import Light
from ...media import BaseMedium
from ...shapes import Instance, Mesh, Shape
from ...shapes.smoothing import AUTO
from ..repair import RawMesh
from .placing import Places


@dataclass
class Contents:
    """The content of a file."""

    raws: list[RawMesh]
    places: Places
    lights: Sequence[Light] = ()
    camera: Camera | None = None
    shapes: Sequence[Shape] = ()  # further ones, built already
    up: str | None = None  # the axis that is up by the format or the file; None where neither says
    settings: Mapping[str, Any] = field(default_factory=dict)  # as of `Scene`
    medium: BaseMedium | None = None  # around the shapes
    flat: bool = False  # whether meshes without normals have flat facets by the format

    @classmethod
    def once(cls, raws: list[RawMesh]) -> Contents:
        """Return meshes that are placed once each, without a transform."""
        return cls(raws, Places.once(len(raws)))

    def smooth(self, smooth: bool | float | str) -> None:
        """Say what normals the meshes get, as for `load`: "auto" keeps those of the file."""
        for raw in self.raws:
            if smooth != AUTO:
                raw.normals = raw.tangents = None
            raw.smooth = False if smooth == AUTO and self.flat else smooth
        meshes = [shape.mesh if isinstance(shape, Instance) else shape for shape in self.shapes]
        for mesh in {id(mesh): mesh for mesh in meshes if isinstance(mesh, Mesh)}.values():
            if smooth != AUTO:
                mesh.compute_normals(smooth)

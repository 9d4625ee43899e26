"""The content of a file, or of an object of another library: every importer fills it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...camera import Camera
from ...lights import Light
from ...media import BaseMedium
from ...scene import Scene
from ...shapes import Instance, Mesh, Shape
from ...shapes.smoothing import AUTO
from ..losses import Losses
from ..repair import RawMesh
from .placing import Places, place_shapes


@dataclass
class Contents:
    """The content of a file, with lengths and axes of the scene."""

    raws: list[RawMesh] = field(default_factory=list)  # each once, with its material and its light
    places: Places = field(default_factory=Places)  # of these
    lights: Sequence[Light] = ()
    camera: Camera | None = None
    shapes: Sequence[Shape] = ()  # further ones, built already
    up: str | None = None  # the axis that is up by the format or the file; None where neither says
    settings: Mapping[str, Any] = field(default_factory=dict)  # as of `Scene`
    medium: BaseMedium | None = None  # around the shapes
    span: tuple[float, float] | None = None  # seconds, where the file is to be read anew for each time
    animations: tuple[str, ...] = ()  # names of those of the file, of which one is read
    flat: bool = False  # whether meshes without normals have flat facets by the format

    @classmethod
    def once(cls, raws: list[RawMesh]) -> Contents:
        """Return meshes that are placed once each, without a transform."""
        return cls(raws, Places.once(len(raws)))

    def scene(self, name: str, losses: Losses) -> Scene:
        """Return the scene.

        Raises
        ------
        SceneError
            If it has nothing that can be seen, or as from `place_shapes`.
        """
        shapes = [*place_shapes(name, self.raws, self.places, losses), *self.shapes]
        if not shapes:
            raise losses.nothing("has no faces")
        seen = {"up": self.up, "settings": self.settings, "medium": self.medium}
        scene = Scene(shapes, self.lights, self.camera, **seen)  # type: ignore[arg-type]
        scene.losses, scene.animations = losses.found, self.animations
        return scene

    def smooth(self, smooth: bool | float | str) -> None:
        """Choose the normals of the meshes, as for `load`: "auto" keeps those of the file."""
        for raw in self.raws:
            if smooth != AUTO:
                raw.normals = raw.tangents = None
            raw.smooth = False if smooth == AUTO and self.flat else smooth
        meshes = [shape.mesh if isinstance(shape, Instance) else shape for shape in self.shapes]
        for mesh in {id(mesh): mesh for mesh in meshes if isinstance(mesh, Mesh)}.values():
            if smooth != AUTO:
                mesh.compute_normals(smooth)

"""Numbers of vertices or faces, shown by the colors of a colormap."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays.vec import Doubles
from ..bsdfs import Diffuse
from ..colors.maps import ColorMap, color_map, numeric
from ..core.errors import SceneError
from ..core.plural import plural
from ..materials import Material
from ..textures.image import Texture
from .arrays import PrimitiveArray
from .base import Shape
from .mesh import Mesh

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Coloring:
    """The numbers of a shape, and how they are shown."""

    scalars: Any  # numbers, or the name of some
    cmap: Any = None
    clim: Any = None

    def values(self, points: Doubles, known: Mapping[str, Any]) -> Doubles:
        """Return the numbers: those that are given, or known by their name, or coordinates of points (n, 3).

        Raises
        ------
        SceneError
            If there are none of the name.
        """
        scalars = self.scalars
        if isinstance(scalars, str):
            if scalars not in known and scalars not in AXES:
                names = ", ".join(map(repr, [*known, *AXES]))
                raise SceneError(f"scalars is {scalars!r}; there are {names}")
            scalars = known[scalars] if scalars in known else points[:, AXES.index(scalars)]
        return lengths("scalars", scalars)

    def map_of(self, values: Doubles) -> ColorMap:
        """Return the colors of numbers."""
        return color_map("scalars", values, self.cmap, self.clim)


def lengths(name: str, values: Any) -> Doubles:
    """Return numbers (n,): those that are given, or the lengths of vectors (n, k)."""
    array = np.asarray(values)
    if array.ndim == 2 and array.dtype.kind in "fiu":
        array = np.linalg.norm(array, axis=1)
    return numeric(name, array)


def map_material(colors: ColorMap, opacity: float = 1.0, name: str | None = None) -> Material:
    """Return a material that shows a colormap by its texture coordinates, without a blend of colors."""
    picture = colors.picture()
    alpha: Any = None if opacity == 1 else opacity
    if (picture[..., 3] < 255).any():
        values = picture[..., 3] / np.float32(255) * np.float32(opacity)
        alpha = Texture(values, channel=0, filter="nearest", wrap="clamp")
    shown = Texture(picture[..., :3], filter="nearest", wrap="clamp")
    return Material(Diffuse(shown), alpha=alpha, name=name)


def with_scalars(shape: Shape, coloring: Coloring) -> Shape:
    """Return a shape that shows numbers of its vertices, faces, or primitives.

    Raises
    ------
    SceneError
        If there are not as many numbers, or the shape has none of them.
    """
    if isinstance(shape, PrimitiveArray):
        return _colored(shape, coloring)
    if not isinstance(shape, Mesh):
        raise SceneError(f"scalars are for meshes and points; {shape.name} is a {type(shape).__name__}")
    values = coloring.values(shape.vertices, {})
    colors, count = coloring.map_of(values), len(shape.vertices)
    check_count(shape.name, values, count, len(shape.faces))
    shown = copy(shape) if len(values) == count else _with_split_corners(shape)
    shown.uvs = colors.coordinates(values if len(values) == count else np.repeat(values, 3))
    shown.material = map_material(colors)
    return shown


def check_count(name: str, values: Doubles, vertices: int, faces: int) -> None:
    """Check that there is a number for each vertex, or for each face.

    Raises
    ------
    SceneError
        If there are others.
    """
    if len(values) not in (vertices, faces):
        raise SceneError(
            f"{name}: there are {plural(len(values), 'scalar')}; there must be one for each of {vertices} "
            f"vertices or of {faces} faces"
        )


def _colored(shape: PrimitiveArray, coloring: Coloring) -> PrimitiveArray:
    values = coloring.values(getattr(shape, shape._points[0]), {})
    if len(values) != shape.count:
        raise SceneError(f"{shape.name}: there are {plural(len(values), 'scalar')}, not {shape.count}")
    shown = copy(shape)
    shown.colors = coloring.map_of(values).colors(values)
    return shown


def _with_split_corners(mesh: Mesh) -> Mesh:
    """Return a mesh each of whose corners is a vertex of its own."""
    corners = mesh.faces.ravel()
    split = copy(mesh)
    for name in ("vertices", "normals", "uvs", "uvs1", "tangents", "colors"):
        values = getattr(mesh, name)
        if values is not None:
            setattr(split, name, values[corners])
    split.faces = np.arange(corners.size).reshape(-1, 3)
    return split

"""What varies over a shape besides its place and normal: texture coordinates, vertex colours.

An attribute is interpolated over the triangles from its values at their corners, and computed on
spheres. Only those are kept that a material of the scene reads, by the name of the field of
`Surface` that takes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..vec import Floats, f4
from .mesh import Mesh

Corners: TypeAlias = tuple[Floats, Floats, Floats]  # (width, m) values at the three corners of triangles


@dataclass(frozen=True)
class Attribute:
    """Where the values of an attribute come from."""

    title: str  # for messages
    default: tuple[float, ...]  # what a mesh without it has everywhere
    of_mesh: Callable[[Mesh], NDArray[np.float64] | None]  # (vertices, width)
    on_spheres: Callable[[Floats], Floats]  # from unit normals (3, n), pointing outwards: (width, n)


def sphere_uv(normal: Floats) -> Floats:
    """Longitude and latitude as texture coordinates, (2, n)."""
    uv = np.empty((2, normal.shape[1]), f4)
    uv[0] = np.arctan2(normal[0], normal[2]) * f4(0.5 / np.pi) + f4(0.5)
    uv[1] = f4(1) - np.arccos(np.clip(normal[1], f4(-1), f4(1))) * f4(1 / np.pi)
    return uv


ATTRIBUTES = {
    "uv": Attribute("texture coordinates (uvs)", (0, 0), lambda mesh: mesh.uvs, sphere_uv),
    "uv1": Attribute("second texture coordinates (uvs1)", (0, 0), lambda mesh: mesh.uvs1, sphere_uv),
    "color": Attribute(
        "vertex colours (colors)",
        (1, 1, 1, 1),
        lambda mesh: mesh.colors,
        lambda normal: np.ones((4, normal.shape[1]), f4),
    ),
}


def corner_values(name: str, meshes: Sequence[Mesh]) -> Corners:
    """Return the values of an attribute at the corners of all triangles."""
    attribute = ATTRIBUTES[name]
    width = len(attribute.default)
    corners = np.empty((3, width, sum(len(mesh.faces) for mesh in meshes)), f4)
    start = 0
    for mesh in meshes:
        values, end = attribute.of_mesh(mesh), start + len(mesh.faces)
        if values is None:
            corners[:, :, start:end] = np.array(attribute.default).reshape(1, width, 1)
        else:
            corners[:, :, start:end] = values[mesh.faces].transpose(1, 2, 0)
        start = end
    return corners[0], corners[1], corners[2]

"""Vertex attributes: texture coordinates, vertex colors, tangents.

An attribute is interpolated over a triangle from its values at the corners, and computed on curved
primitives. Only attributes that a material of the scene reads are compiled, under the name of their field
of `SurfaceInteraction`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from ..arrays.elementary import arccos, arctan2
from ..arrays.vec import Doubles, Floats, Ints, f4
from .mesh import Mesh
from .tangents import mesh_dpduv, mesh_tangent_frame

Corners: TypeAlias = tuple[Floats, Floats, Floats]  # (width, m) values at the three corners of triangles


class CurvedSurfaces(Protocol):
    """The surfaces of curved primitives: values (width, n) at points (3, n) of primitives (n,)."""

    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return texture coordinates, (2, n)."""

    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return the derivatives of the point by the texture coordinates, (6, n)."""

    def color(self, prim: Ints, point: Floats) -> Floats:
        """Return linear RGB and opacity, (4, n)."""


@dataclass(frozen=True)
class Attribute:
    """The source of the values of an attribute."""

    title: str  # for messages
    default: tuple[float, ...]  # value of a mesh without it, everywhere
    array_of: Callable[[Mesh], Doubles | None]  # the user's array for it
    corners: Callable[[Mesh], Doubles]  # (m, 3, width), if the mesh has it
    on_curved: Callable[[CurvedSurfaces, Ints, Floats], Floats]  # at points of primitives: (width, n)
    vectors: bool = False  # whether these are vectors of three numbers each, which instances transform


def sphere_uv(normal: Floats) -> Floats:
    """Return longitude and latitude of outward unit normals (3, n) as texture coordinates, (2, n)."""
    uv = np.empty((2, normal.shape[1]), f4)
    uv[0] = arctan2(normal[0], normal[2]) * f4(0.5 / np.pi) + f4(0.5)
    uv[1] = f4(1) - arccos(np.clip(normal[1], f4(-1), f4(1))) * f4(1 / np.pi)
    return uv


def sphere_dpduv(normal: Floats, radius: Floats) -> Floats:
    """Return the derivatives of the point by these texture coordinates, (6, n), on spheres of radii (n,)."""
    x, y, z = normal
    out = np.zeros((6, normal.shape[1]), f4)
    around, up = f4(2 * np.pi) * radius, f4(np.pi) * radius
    ring = np.sqrt(x * x + z * z)
    inverse = f4(1) / np.where(ring > 0, ring, f4(1))
    out[0], out[2] = z * around, -x * around
    out[3], out[4], out[5] = -x * y * inverse * up, ring * up, -y * z * inverse * up
    return out


def _curved_uv(surfaces: CurvedSurfaces, prim: Ints, point: Floats) -> Floats:
    return surfaces.uv(prim, point)


def _curved_dpduv(surfaces: CurvedSurfaces, prim: Ints, point: Floats) -> Floats:
    return surfaces.dpduv(prim, point)


def _curved_color(surfaces: CurvedSurfaces, prim: Ints, point: Floats) -> Floats:
    return surfaces.color(prim, point)


def _per_vertex(
    title: str,
    default: tuple[float, ...],
    array_of: Callable[[Mesh], Doubles | None],
    on_curved: Callable[[CurvedSurfaces, Ints, Floats], Floats],
) -> Attribute:
    def corners(mesh: Mesh) -> Doubles:
        values = array_of(mesh)
        assert values is not None
        return values[mesh.faces]

    return Attribute(title, default, array_of, corners, on_curved)


UV, UV1 = "texture coordinates (uvs)", "second texture coordinates (uvs1)"
NONE = (0.0,) * 6
ATTRIBUTES = {
    "uv": _per_vertex(UV, (0, 0), lambda mesh: mesh.uvs, _curved_uv),
    "uv1": _per_vertex(UV1, (0, 0), lambda mesh: mesh.uvs1, _curved_uv),
    "color": _per_vertex("vertex colors (colors)", (1, 1, 1, 1), lambda mesh: mesh.colors, _curved_color),
    "dpduv": Attribute(
        UV, NONE, lambda mesh: mesh.uvs, lambda mesh: mesh_dpduv(mesh, mesh.uvs), _curved_dpduv, True
    ),
    "dpduv1": Attribute(
        UV1, NONE, lambda mesh: mesh.uvs1, lambda mesh: mesh_dpduv(mesh, mesh.uvs1), _curved_dpduv, True
    ),
    "tangent_frame": Attribute(
        UV, NONE, lambda mesh: mesh.uvs, lambda mesh: mesh_tangent_frame(mesh, mesh.uvs), _curved_dpduv, True
    ),
    "tangent_frame1": Attribute(
        UV1,
        NONE,
        lambda mesh: mesh.uvs1,
        lambda mesh: mesh_tangent_frame(mesh, mesh.uvs1),
        _curved_dpduv,
        True,
    ),
}


def corner_values(name: str, meshes: Sequence[Mesh]) -> Corners:
    """Return the values of an attribute at the three corners of all triangles, 3 × (width, m)."""
    attribute = ATTRIBUTES[name]
    width = len(attribute.default)
    corners = np.empty((3, width, sum(len(mesh.faces) for mesh in meshes)), f4)
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        if attribute.array_of(mesh) is None:
            corners[:, :, start:end] = np.array(attribute.default).reshape(1, width, 1)
        else:
            corners[:, :, start:end] = attribute.corners(mesh).transpose(1, 2, 0)
        start = end
    return corners[0], corners[1], corners[2]

"""The triangles of a scene as flat arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, f4, length, spans
from ..shapes import Mesh

AT_ONCE = 1 << 14  # triangles per batch: their float64 data fit the cache


def boxes_of_groups(low: Doubles, high: Doubles, group: Ints, count: int) -> tuple[Doubles, Doubles]:
    """Return the corners (count, 3) of the boxes of groups (m,), given those (m, 3) of their members."""
    lows, highs = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lows, group, low)
    np.maximum.at(highs, group, high)
    return lows, highs


def same_as_next(*of_triangles: Ints) -> Bools:
    """Return a mask (m,) of the triangles that have the same numbers (m,) as the next one."""
    same = np.zeros(of_triangles[0].size, np.bool_)
    same[:-1] = np.logical_and.reduce([np.diff(numbers) == 0 for numbers in of_triangles])
    return same


def gather_triangles(meshes: Sequence[Mesh], vertices: Sequence[Doubles]) -> tuple[Floats, Floats]:
    """Return the triangles (m, 3, 3) of meshes in float32, and their unit normals (3, m).

    `vertices` (n, 3) of each mesh are relative to where its triangles are traced.
    """
    count = sum(len(mesh.faces) for mesh in meshes)
    triangles, normals = np.empty((count, 3, 3), f4), np.empty((3, count), f4)
    end = 0
    for mesh, points in zip(meshes, vertices, strict=True):
        for span in spans(len(mesh.faces), AT_ONCE):
            corners = points.take(mesh.faces[span], 0)
            start, end = end, end + len(corners)
            triangles[start:end] = corners
            normals[:, start:end] = compute_face_normals(corners)
    return triangles, normals


def compute_face_normals(triangles: Doubles) -> Floats:
    """Return the unit normals (3, m) of triangles (m, 3, 3); 0 where a triangle is degenerate."""
    a, b, c = np.ascontiguousarray(triangles.transpose(1, 2, 0))
    normal = cross(b - a, c - a)
    size = length(normal)
    return (normal / np.where(size > 0, size, 1)).astype(f4)


def compute_corner_normals(meshes: Sequence[Mesh], normals: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Return the shading normals at the three corners, 3 × (3, m); None if no mesh has vertex normals.

    Meshes without vertex normals, and normals of length 0, get the face normal.
    """
    if all(mesh.normals is None for mesh in meshes):
        return None
    corners = normals.copy(), normals.copy(), normals.copy()
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        if mesh.normals is not None:
            vertex_normals = np.ascontiguousarray(mesh.normals.T)
            size = length(vertex_normals)
            vertex_normals = (vertex_normals / np.where(size > 0, size, 1)).astype(f4)
            for corner, vertex in zip(corners, mesh.faces.T, strict=True):
                np.copyto(corner[:, start:end], vertex_normals.take(vertex, 1), where=size.take(vertex) > 0)
        start = end
    return corners

"""Normals of vertices that point to the back of nearly all faces."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles, Ints
from ..core.errors import warn_caller

LOOKED_AT = 4096  # faces, from which a mesh is judged at first
NEARLY = 0.98  # part of the faces
CLOSED = 1e-6  # area that is left over, relative to the whole


def settled(name: str, vertices: Doubles, faces: Ints, normals: Doubles) -> tuple[Ints, Doubles]:
    """Return faces (m, 3) and normals (n, 3) that agree on the front, where nearly all of them do not.

    Some programs, such as scikit-image's marching_cubes, give faces that run the other way round than their
    normals say. The normals are turned; or the faces, if these enclose a space and all face its inside. A
    warning says which.
    """
    sample = faces[:: max(1, len(faces) // LOOKED_AT)]
    if not (_opposes(vertices, sample, normals) and _opposes(vertices, faces, normals)):
        return faces, normals
    said = f"{name}: the normals point to the back of the faces"
    if _faces_inwards(vertices, faces):
        warn_caller(f"{said}; the faces, which face inwards, are turned")
        return np.ascontiguousarray(faces[:, ::-1]), normals
    warn_caller(f"{said}; the normals are turned")
    return faces, -normals


def _areas(vertices: Doubles, faces: Ints) -> Doubles:
    """Return twice the area times the normal of each face, (m, 3)."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def _opposes(vertices: Doubles, faces: Ints, normals: Doubles) -> bool:
    """Return whether the normals of nearly all faces (m, 3) with an area oppose them."""
    with np.errstate(over="ignore", invalid="ignore"):
        along = (_areas(vertices, faces) * normals[faces].sum(1)).sum(1)
    back, sloped = int((along < 0).sum()), int((along != 0).sum())
    return back > 0 and back >= NEARLY * sloped


def _faces_inwards(vertices: Doubles, faces: Ints) -> bool:
    """Return whether faces enclose a space, and all face its inside."""
    areas = _areas(vertices, faces)
    if np.abs(areas.sum(0)).max() > CLOSED * np.abs(areas).sum():
        return False
    middle = vertices[faces[:, 0]] - vertices[faces[:, 0]].mean(0)
    return float((middle * areas).sum()) < 0

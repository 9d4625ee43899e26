"""Affine transforms of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError

Matrix = NDArray[np.float64]  # (4, 4), or several

IDENTITY = np.eye(4)


def moved_tangents(matrix: np.ndarray, tangents: np.ndarray | None) -> np.ndarray | None:
    """Apply a (4, 4) affine matrix to tangents (n, 4); a reflection changes their handedness.

    Tangents that become zero stay zero.
    """
    if tangents is None or (matrix == IDENTITY).all():
        return tangents
    along = tangents[:, :3] @ matrix[:3, :3].T
    size = np.linalg.norm(along, axis=1, keepdims=True)
    hand = -tangents[:, 3:] if np.linalg.det(matrix[:3, :3]) < 0 else tangents[:, 3:]
    return np.hstack([along / np.where(size > 0, size, 1), hand])


def moved(
    matrix: np.ndarray, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Apply a (4, 4) affine matrix; a reflection also reverses the faces, to keep their front sides."""
    linear, shift = matrix[:3, :3], matrix[:3, 3]
    if (matrix == IDENTITY).all():
        return vertices, faces, normals
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise SceneError(f"transform has the last row {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
    mirrored = np.linalg.det(linear) < 0
    if mirrored:
        faces = faces[:, ::-1]
    if normals is not None:
        # the matrix of cofactors transforms normals also if the scale along them is 0
        a, b, c = linear.T
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        normals = normals @ (-cofactors if mirrored else cofactors).T
    return vertices @ linear.T + shift, faces, normals

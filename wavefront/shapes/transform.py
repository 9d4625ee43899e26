"""Affine transforms of shapes."""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles, Floats, Ints, cross
from ..core.errors import SceneError, as_array, finite_array, number, one_of, shape_of

Matrix = Doubles  # (4, 4), or several

IDENTITY = np.eye(4)
EVEN = 2.0**-20  # relative difference of the scales along two axes that float32 hardly shows


def affine(name: str, value: ArrayLike) -> Matrix:
    """Return an affine matrix (4, 4).

    Raises
    ------
    SceneError
        If it has another shape, an element that is not finite, or another last row.
    """
    matrix = finite_array(name, value, (4, 4))
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise SceneError(f"{name} has the last row {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
    return matrix


def similarities(name: str, value: ArrayLike) -> tuple[Matrix, Doubles]:
    """Return matrices (n, 4, 4) that keep shapes, of one (4, 4) or of n, and the factors of lengths (n,).

    Raises
    ------
    SceneError
        If a matrix is malformed, or scales lengths along one direction more than along another.
    """
    shape = (4, 4) if as_array(name, value).ndim == 2 else (None, 4, 4)
    matrices = finite_array(name, value, shape).reshape(-1, 4, 4)
    scales = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    bad = np.flatnonzero((matrices[:, 3] != (0, 0, 0, 1)).any(1))
    if bad.size:
        raise SceneError(f"{name} has the last row {matrices[bad[0], 3].tolist()}; it must be [0, 0, 0, 1]")
    bad = np.flatnonzero(~((scales[:, 2] > 0) & (scales[:, 0] - scales[:, 2] <= EVEN * scales[:, 0])))
    if bad.size:
        most, _, least = scales[bad[0]]
        raise SceneError(
            f"{name} stretches by {least:.6g} along one axis and {most:.6g} along another; only "
            "meshes can be placed so, others need one factor above 0"
        )
    squares = np.square(matrices[:, :3, :3]).reshape(-1, 9).T
    return matrices, np.sqrt(reduce(np.add, squares) / 3)  # in order, for the same bits on any machine


def is_even(matrices: Matrix, most: float) -> bool:
    """Return whether matrices (n, 4, 4) scale alike in all directions, up to a relative difference."""
    scales = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    return bool((scales[:, 0] - scales[:, 2] <= most * scales[:, 0]).all())


def points_by(matrices: Matrix, points: Doubles) -> Doubles:
    """Return points (k, 3), transformed by each of n matrices (n, 4, 4): (n·k, 3)."""
    return (points @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]).reshape(-1, 3)


def moved_tangents(matrix: Matrix, tangents: Doubles | None) -> Doubles | None:
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
    matrix: Matrix, vertices: Doubles, faces: Ints, normals: Doubles | None
) -> tuple[Doubles, Ints, Doubles | None]:
    """Apply a (4, 4) affine matrix to the arrays of a mesh.

    A reflection also reverses the faces, to keep their front sides. The lengths of normals have no meaning.

    Raises
    ------
    SceneError
        If the last row of the matrix is not that of an affine one.
    """
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
        cofactors = cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
        normals = _rows_by(-cofactors if mirrored else cofactors, normals)
    return _rows_by(linear, vertices) + shift, faces, normals


def _rows_by(linear: Floats, rows: Doubles) -> Doubles:
    """Return rows (n, 3), each multiplied by a matrix (3, 3).

    Component by component: the threads of BLAS, which has other bits elsewhere, wait for each other on a busy
    machine.
    """
    x, y, z = rows.T
    return np.stack([a * x + b * y + c * z for a, b, c in linear], 1)


def translation(name: str, offset: ArrayLike) -> Matrix:
    """Return the matrix (4, 4) that moves by an offset (3,), which `name` names in messages."""
    matrix = IDENTITY.copy()
    matrix[:3, 3] = finite_array(name, offset, (3,))
    return matrix


def rotation(name: str, axis: ArrayLike, degrees: float, about: ArrayLike) -> Matrix:
    """Return the matrix (4, 4) that turns a shape, called `name`, about an axis through a point (3,)."""
    if isinstance(axis, str):
        direction = np.eye(3)["xyz".index(one_of(f"{name}: axis", axis, ("x", "y", "z")))]
    else:
        direction = finite_array(f"{name}: axis", axis, (3,))
    if not direction.any():
        raise SceneError(f"{name}: axis is {direction.tolist()}; it must not be zero")
    x, y, z = unit = direction / np.linalg.norm(direction)
    sin, cos = sin_cos_turns(np.array([number(f"{name}: degrees", degrees) / 360]))
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = IDENTITY.copy()
    matrix[:3, :3] = cos * np.eye(3) + (1 - cos) * np.outer(unit, unit) + sin * skew
    point = finite_array(f"{name}: about", about, (3,))
    matrix[:3, 3] = point - matrix[:3, :3] @ point
    return matrix


def scaling(name: str, factor: ArrayLike) -> Matrix:
    """Return the matrix (4, 4) that multiplies lengths by one factor, or by one for each axis."""
    factors = finite_array(name, factor, () if shape_of(factor) == () else (3,))
    if not factors.all():
        raise SceneError(f"{name} is {factors.tolist()}; none may be 0")
    return np.diag([*np.broadcast_to(factors, 3), 1.0])

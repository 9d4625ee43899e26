"""Views of cameras: matrices, poses and angles of view."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.elementary import arctan2, sin_cos
from ...arrays.vec import Doubles
from ...camera import Camera
from ...core.errors import SceneError
from ...sampling.filters import BoxFilter, TentFilter
from ...shapes.transform import Matrix

FILTERS: dict[str, Any] = {"box": BoxFilter, "tent": TentFilter}


def filter_setting(name: str, radius: float) -> Any:
    """Return the setting of a filter: its name, where it has its usual radius."""
    kind = FILTERS[name]
    return name if radius == kind.radius else kind(radius)


def half_tangent(degrees: float) -> float:
    """Return the tangent of half an angle."""
    sin, cos = sin_cos(np.float64(np.radians(degrees) / 2))
    return float(sin / cos)


def angle_of(tangent: float) -> float:
    """Return the angle whose half has this tangent."""
    return float(2 * np.degrees(arctan2(np.float64(tangent), np.float64(1))))


def looking(name: str, origin: np.ndarray, target: np.ndarray, up: np.ndarray) -> Matrix:
    """Return the matrix of an object at `origin` whose z axis points at `target`, and whose y axis is up."""
    ahead = target - origin
    size = np.linalg.norm(ahead)
    if not size > 0:
        raise SceneError(f"{name}: origin and target are both {origin.tolist()}")
    ahead = ahead / size
    if not up.any():
        up = frame(ahead)[:, 0]
    left = np.cross(up, ahead)
    size = np.linalg.norm(left)
    if not size > 1e-12 * np.linalg.norm(up):
        raise SceneError(f"{name}: up is {up.tolist()}, the direction of the view")
    left = left / size
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(ahead, left), ahead, origin], 1)
    return matrix


def frame(axis: Doubles) -> Doubles:
    """Return axes (3, 3) as columns, the third along `axis`, by the rule of Mitsuba (Duff et al. 2017)."""
    x, y, z = axis / np.linalg.norm(axis)
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    return np.array([[1 + sign * x * x * a, b, x], [sign * b, sign + y * y * a, y], [-sign * x, -y, z]])


def camera_at(matrix: Matrix, fov: float, size: tuple[int, int]) -> Camera:
    """Return a camera from its matrix to world space (it looks along -z, y is up), fov in degrees."""
    origin, target, up = pose_of(matrix)
    return Camera.look_at(origin, target, up, fov=fov, size=size)


def pose_of(matrix: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return the origin, target and up vector of a camera; the scale of its node has no effect."""
    origin, backward, up = matrix[:3, 3], _near_one(matrix[:3, 2]), _near_one(matrix[:3, 1])
    return origin, origin - backward / (np.linalg.norm(backward) or 1.0), up


def _near_one(vector: Matrix) -> Matrix:
    """Return a vector multiplied by a power of two, so that its size is about 1 and it can be squared."""
    _, exponent = np.frexp(np.abs(vector).max())
    return np.ldexp(vector, -exponent)

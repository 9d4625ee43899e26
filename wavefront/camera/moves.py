"""Cameras that move: around a point, and from camera to camera."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import arctan2, sin_cos
from ..arrays.vec import Doubles
from ..core.errors import SceneError, finite_array, in_brief, iterable, number
from ..core.suggestions import suggests_keywords
from .base import Camera, check_camera, upward


@suggests_keywords
def orbit(camera: Camera, center: ArrayLike, degrees: float, up: ArrayLike = "y") -> Camera:
    """Return the camera turned around a vertical line.

    Parameters
    ----------
    camera
        The camera to turn.
    center
        (3,) a point of the line, scene units.
    degrees
        Angle; counterclockwise, seen from above.
    up
        Direction of the line: (3,), or the name of an axis.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0))
    >>> wf.orbit(camera, (0, 0, 0), 90).origin.round(6) + 0.0
    array([4., 0., 0.])
    """
    if check_camera("camera", camera) is None:
        raise SceneError("camera is None; it must be a wf.Camera")
    middle = finite_array("center", center, (3,))
    turn = _rotation(upward("up", up), np.radians(number("degrees", degrees)))
    if camera.moves:
        around = np.eye(4)
        around[:3, :3], around[:3, 3] = turn, middle - turn @ middle
        return camera.transformed(around)
    return _placed(camera, middle + turn @ (camera.origin - middle), turn @ camera.rotation)


@suggests_keywords
def interpolate_cameras(cameras: Sequence[Camera], n: int) -> list[Camera]:
    """Return n cameras along a smooth path through some cameras.

    Positions follow a Catmull-Rom spline, in equal parts between one camera and the next; rotations take
    the shortest way at constant speed. The projection and the size are those of the first camera.

    Parameters
    ----------
    cameras
        At least two.
    n
        At least two; the first and the last are those given.

    Raises
    ------
    SceneError
        If there are too few.

    Notes
    -----
    Sources: E. Catmull and R. Rom, "A Class of Local Interpolating Splines", 1974; K. Shoemake, "Animating
    Rotation with Quaternion Curves", SIGGRAPH 1985.

    Examples
    --------
    >>> ends = [wf.Camera.look_at((x, 0, 4), (x, 0, 0)) for x in (0, 1)]
    >>> path = wf.interpolate_cameras(ends, 5)
    >>> path[2].origin
    array([0.5, 0. , 4. ])
    """
    cameras = list(iterable("cameras", cameras, "cameras"))
    if len(cameras) < 2 or not all(isinstance(camera, Camera) for camera in cameras):
        raise SceneError(f"cameras is {in_brief(cameras)}; it must be at least 2 of wf.Camera")
    if not isinstance(n, int | np.integer) or n < 2:
        raise SceneError(f"n is {in_brief(n)}; it must be a whole number of at least 2")
    places = np.array([camera.origin for camera in cameras])
    # beyond both ends the path goes straight on
    ends = 2 * places[:1] - places[1:2], 2 * places[-1:] - places[-2:-1]
    points = np.concatenate([ends[0], places, ends[1]])
    out = []
    for at in np.linspace(0, len(cameras) - 1, n):
        first = min(int(at), len(cameras) - 2)
        t = float(at) - first
        before, after = cameras[first].rotation, cameras[first + 1].rotation
        axis, angle = _axis_angle(after @ before.T)
        out.append(
            _placed(
                cameras[0],
                _catmull_rom(points[first : first + 4], t),
                _rotation(axis, angle * t) @ before if angle else before,
            )
        )
    return out


def _placed(camera: Camera, origin: Doubles, rotation: Doubles) -> Camera:
    """Return a still camera at another place, with the same projection, size and window."""
    moved = copy(camera)
    moved.origin, moved.rotation = origin, rotation
    for name in ("motion", "course"):
        vars(moved).pop(name, None)
    return moved


def _catmull_rom(points: Doubles, t: float) -> Doubles:
    """Return the point (3,) of the spline through the second and third of four points (4, 3), t in [0, 1]."""
    a, b, c, d = points
    return np.asarray(
        b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))), np.float64
    )


def _rotation(axis: Doubles, angle: float) -> Doubles:
    """Return the matrix (3, 3) of a rotation about an axis (3,) of any length (Rodrigues' formula)."""
    sin, cos = sin_cos(np.float64(angle))
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    outer = np.outer((x, y, z), (x, y, z))
    return np.asarray(cos * np.eye(3) + sin * cross + (1 - cos) * outer)


def _axis_angle(rotation: Doubles) -> tuple[Doubles, float]:
    """Return the axis (3,) and the angle, radians in [0, π], of a rotation matrix (3, 3)."""
    r = rotation
    twice = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sin2, cos2 = float(np.linalg.norm(twice)), float(np.trace(r)) - 1
    angle = float(arctan2(np.float64(sin2), np.float64(cos2)))
    if sin2 > 1e-6:
        return twice, angle
    # a half turn: the axis is the largest column of (R + 1) / 2
    columns = (r + np.eye(3)) / 2
    return np.asarray(columns[:, int(np.diag(columns).argmax())]), angle if cos2 < 0 else 0.0

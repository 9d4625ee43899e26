"""Cameras: a point of the film becomes a ray."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError, finite_array, number
from .vec import Floats, column, f4, normalize

MAX_SIDE = 65_536  # pixels; a row-major pixel index then fits in 32 bits


class Camera:
    """A pinhole camera. Use `Camera.look_at`.

    Attributes
    ----------
    origin
        (3,) position, scene units.
    rotation
        (3, 3) columns: right, up and backward in world space.
    size
        (width, height) in pixels.
    fov
        Vertical field of view, degrees.
    """

    def __init__(
        self, origin: NDArray[np.float64], rotation: NDArray[np.float64], fov: float, size: tuple[int, int]
    ) -> None:
        self.origin, self.rotation, self.size = origin, rotation, image_size(size)
        self.fov = number("Camera fov", fov, lambda x: 0 < x < 180, "above 0 and below 180 degrees")

    @classmethod
    def look_at(
        cls,
        origin: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0, 1, 0),
        *,
        fov: float = 40,
        size: tuple[int, int] = (512, 512),
    ) -> Camera:
        """Place a camera at `origin` that looks at `target`.

        Parameters
        ----------
        origin, target, up
            (3,) position, the point in the middle of the picture, and what is up in it.
        fov
            Vertical field of view, degrees.
        size
            (width, height) in pixels.

        Raises
        ------
        SceneError
            If origin and target coincide, up is parallel to the view, or an argument is out of range.
        """
        eye = finite_array("Camera origin", origin, (3,))
        backward = eye - finite_array("Camera target", target, (3,))
        if not np.linalg.norm(backward) > 0:
            raise SceneError(f"Camera origin and target are both {eye.tolist()}; they must differ")
        backward = backward / np.linalg.norm(backward)
        upward = finite_array("Camera up", up, (3,))
        right = np.cross(upward, backward)
        if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(upward):
            raise SceneError(f"Camera up {upward.tolist()} must not be zero or parallel to the view")
        right = right / np.linalg.norm(right)
        return cls(eye, np.stack([right, np.cross(backward, right), backward], 1), fov, size)

    def resized(self, size: tuple[int, int]) -> Camera:
        """Return the same camera for another (width, height)."""
        return Camera(self.origin, self.rotation, self.fov, size)

    def rays(self, x: Floats, y: Floats, centre: NDArray[np.float64]) -> tuple[Floats, Floats]:
        """Return origins and unit directions (3, n) of rays through film points.

        Parameters
        ----------
        x, y
            (n,) film position in pixels, from the left and from the top.
        centre
            (3,) the scene's centre, to which the origins are relative.
        """
        width, height = self.size
        half = np.tan(np.radians(self.fov) / 2)
        across = (x - f4(width / 2)) * f4(2 * half / height)
        upward = (f4(height / 2) - y) * f4(2 * half / height)
        right, up, backward = (column(axis) for axis in self.rotation.T)
        direction = normalize(right * across + up * upward - backward)
        origin = np.repeat(column(self.origin - centre), x.size, 1)
        return origin, direction


def image_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return (width, height) as ints.

    Raises
    ------
    SceneError
        If they are not two whole numbers from 1 to 65536.
    """
    try:
        width, height = size
        whole = int(width) == width and int(height) == height
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"size must be (width, height), got {size!r}") from error
    if not whole or not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"size is {size!r}; both must be whole numbers from 1 to {MAX_SIDE}")
    return int(width), int(height)

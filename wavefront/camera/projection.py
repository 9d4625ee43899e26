"""Projections: maps from film points to rays, one class for each kind of lens.

Camera space has x to the right, y up and z backward: the camera looks along -z. Film points are
in pixels of the whole picture, x from the left and y from the top; pixel (column, row) covers
[column, column + 1] × [row, row + 1], so that its center lies at + 0.5.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from ..arrays.elementary import arctan2, sin_cos, sin_cos_turns
from ..arrays.vec import Doubles, Floats, column, f4
from ..core.errors import SceneError, finite_array, number
from ..core.parameter import Parametrized
from ..sampling.warp import uniform_disk
from .distortion import GRID, Distortion

Size = tuple[int, int]
CHECKED = 5  # points along each side of a film, at which a projection is checked
INVERSE = 1e-3  # distance between a film point and where its ray is projected to, relative to the larger side


class Projection(Parametrized, ABC):
    """Base class of projections: maps from points of the film to rays in camera space, and back.

    Camera space has x to the right, y up and z backward: the camera looks along -z. Film points are in pixels
    of the whole picture, x from the left and y from the top.

    Attributes
    ----------
    uses_lens
        Whether rays start at sampled points of a lens.
    sees_all
        Whether every point of the film has a ray. Where not, `rays` returns NaN as directions, and the
        picture is black.

    Examples
    --------
    >>> class Cylindrical(wf.Projection):
    ...     def rays(self, x, y, size, lens):
    ...         angle = (x - np.float32(size[0] / 2)) * np.float32(2 / size[1])
    ...         up = np.float32(1) - y * np.float32(2 / size[1])
    ...         return None, np.stack([np.sin(angle), up, -np.cos(angle)])
    ...     def project(self, points, size):
    ...         x, y, z = points
    ...         across = np.hypot(x, z)
    ...         film = [size[0] + size[1] * np.arctan2(x, -z), size[1] * (1 - y / across)]
    ...         return np.stack(film) / 2, across
    >>> camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(96, 32)).replace(projection=Cylindrical())
    >>> image = wf.render(wf.Scene([wf.Box((0, 0, 0), 1)], camera=camera), 1)
    """

    uses_lens: bool = False
    sees_all: bool = True

    def scaled(self, factor: float) -> Projection:
        """Return the projection for a scene scaled by `factor`: itself, unless it has lengths."""
        return self

    def replaced(self, **changes: Any) -> Projection:
        """Return the projection with other values of some parameters.

        Raises
        ------
        SceneError
            If it has no such parameter, or a value is out of range.
        """
        for name in changes:
            if name not in vars(self):
                raise SceneError(
                    f"Camera {name} is {changes[name]!r}; a {type(self).__name__} camera has none"
                )
        values = {name: vars(self)[name] for name in inspect.signature(type(self)).parameters}
        return type(self)(**{**values, **changes})

    @abstractmethod
    def rays(self, x: Floats, y: Floats, size: Size, lens: Floats | None) -> tuple[Floats | None, Floats]:
        """Return the origins and directions of rays in camera space.

        Parameters
        ----------
        x, y
            (n,) film position in pixels.
        size
            (width, height) of the whole picture in pixels.
        lens
            (2, n) numbers in [0, 1) that select the point on the lens; None for its center.

        Returns
        -------
        offset
            (3, n) origins relative to the camera, scene units; None if all are at the camera.
        direction
            (3, n) or (3, 1), of any length above 0; NaN where nothing is seen (`sees_all`).
        """

    @abstractmethod
    def project(self, points: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Return the film positions of points, the inverse of `rays` through the center of the lens.

        Parameters
        ----------
        points
            (3, n) in camera space, scene units.
        size
            (width, height) of the whole picture in pixels.

        Returns
        -------
        pixels
            (2, n) film position in pixels; NaN where a point cannot be seen by a picture of any size.
        depth
            (n,) scene units.
        """

    def in_focus(self, points: Doubles, offset: Doubles) -> Doubles:
        """Return the points (3, n) that a ray through the center of the lens meets at the same film points.

        Rays through the points (3, n) start at `offset` (3, n), a point on the lens; camera space. Here: the
        points themselves, as all rays of one film point start at one place.
        """
        return points

    def check(self, size: Size) -> None:
        """Check that points of the film have rays, and that these are projected to the points.

        Raises
        ------
        SceneError
            If not.
        """
        width, height = size
        fractions = np.linspace(0, 1, CHECKED + 2)[1:-1]
        x, y = (grid.ravel().astype(f4) for grid in np.meshgrid(fractions * width, fractions * height))
        seen = _checked_rays(self, x, y, size)
        pixels, depth = self.project(seen, size)
        name = type(self).__name__
        if np.shape(pixels) != (2, len(x)) or np.shape(depth) != (len(x),):
            raise SceneError(
                f"{name}.project returns shapes {np.shape(pixels)} and {np.shape(depth)} for {len(x)} "
                f"points; they must be (2, {len(x)}) and ({len(x)},)"
            )
        off = np.abs(pixels - np.stack([x, y])).max(0)
        off[np.isnan(seen[0])] = 0
        if not off.max() <= INVERSE * max(size):
            at = int(np.nan_to_num(off, nan=np.inf).argmax())
            raise SceneError(
                f"{name}.project takes a point on the ray of film point ({x[at]:g}, {y[at]:g}) to "
                f"({pixels[0, at]:g}, {pixels[1, at]:g}); it must be the inverse of rays"
            )


def _checked_rays(projection: Projection, x: Floats, y: Floats, size: Size) -> Doubles:
    """Return a point (3, n) on the ray of each film point (n,), NaN where there is none.

    Raises
    ------
    SceneError
        If the result of a class is malformed, or a ray is missing that must be there.
    """
    offset, direction = projection.rays(x, y, size, None)
    name, shapes = type(projection).__name__, ((3, len(x)), (3, 1))
    for what, vectors in (("origins", offset), ("directions", direction)):
        if vectors is not None and np.shape(vectors) not in shapes:
            raise SceneError(
                f"{name}.rays returns {what} of shape {np.shape(vectors)}; it must be {shapes[0]}"
            )
    toward = np.broadcast_to(np.asarray(direction, np.float64), shapes[0])
    lost = ~(np.isfinite(toward).all(0) & toward.any(0))
    if lost.any() and (projection.sees_all or not np.isnan(toward[:, lost]).all()):
        at = int(np.flatnonzero(lost)[0])
        raise SceneError(
            f"{name}.rays returns the direction {toward[:, at].tolist()} for film point ({x[at]:g}, "
            f"{y[at]:g}); where nothing is seen it must be NaN, and sees_all of the class False"
        )
    return toward if offset is None else toward + offset


class Perspective(Projection):
    """A pinhole, or a thin lens that is in focus at one distance.

    Parameters
    ----------
    fov
        Vertical field of view, degrees.
    shift
        How far the film is moved in its plane, (right, up), as fractions of its width and height:
        with (0.5, 0) the view axis meets the left edge of the picture.
    pixel_aspect
        Width of a pixel over its height.
    aperture
        Diameter of the lens, scene units; 0 is a pinhole.
    focus
        Distance of the sharp plane, measured along the view axis, scene units.
    skew
        K[0][1]/K[0][0] of a calibrated camera.
    distortion
        Of the lens; None for a lens without distortion.

    Notes
    -----
    A point at distance z from a lens of diameter A that is in focus at f is spread in the plane of
    focus over a disk of diameter A·|z − f|/z, the circle of confusion.

    Raises
    ------
    SceneError
        If an argument is out of range.
    """

    def __init__(
        self,
        fov: float,
        *,
        shift: Sequence[float] = (0.0, 0.0),
        pixel_aspect: float = 1.0,
        aperture: float = 0.0,
        focus: float | None = None,
        skew: float = 0.0,
        distortion: Distortion | None = None,
    ) -> None:
        self.fov = number("Camera fov", fov, lambda x: 0 < x < 180, "above 0 and below 180 degrees")
        self.shift = finite_array("Camera shift", shift, (2,))
        self.pixel_aspect = number("Camera pixel_aspect", pixel_aspect, lambda x: x > 0, "above 0")
        self.aperture = number("Camera aperture", aperture, lambda x: x >= 0, "at least 0")
        if focus is None and self.aperture > 0:
            raise SceneError(f"Camera aperture is {aperture!r}; a lens needs a focus distance: give focus")
        self.focus = 1.0 if focus is None else number("Camera focus", focus, lambda x: x > 0, "above 0")
        self.skew = number("Camera skew", skew)
        self.distortion = distortion
        self.uses_lens = self.aperture > 0

    def scaled(self, factor: float) -> Perspective:
        """Return the lens for a scene whose lengths were multiplied by `factor`."""
        lens = copy(self)
        lens.aperture, lens.focus = self.aperture * factor, self.focus * factor
        return lens

    def rays(self, x: Floats, y: Floats, size: Size, lens: Floats | None) -> tuple[Floats | None, Floats]:
        """Return rays through the film, or from lens points to the points in focus."""
        width, height = size
        sin, cos = sin_cos(np.float64(np.radians(self.fov) / 2))
        pitch = 2 * (sin / cos) / height
        direction = np.empty((3, len(x)), f4)
        np.multiply(x - f4(width * (0.5 - self.shift[0])), f4(pitch * self.pixel_aspect), out=direction[0])
        np.multiply(f4(height * (0.5 + self.shift[1])) - y, f4(pitch), out=direction[1])
        direction[2] = -1
        if self.skew != 0 or self.distortion is not None:
            direction[0], direction[1] = self._undistorted(x.astype(np.float64), y.astype(np.float64), size)
        if lens is None or not self.uses_lens:
            return None, direction
        offset = np.zeros_like(direction)
        np.multiply(uniform_disk(lens), f4(self.aperture / 2), out=offset[:2])
        direction[:2] -= offset[:2] * f4(1 / self.focus)
        return offset, direction

    def project(self, points: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Return perspective projections with distortion, and depths."""
        depth = -points[2]
        ahead = np.where(depth > 0, depth, np.nan)
        x, y = points[0] / ahead, -points[1] / ahead
        if self.distortion is not None:
            seen = self.distortion.invertible(x, y)
            x, y = self.distortion.apply(np.where(seen, x, np.nan), np.where(seen, y, np.nan))
        middle, focal = self._intrinsics(size)
        return np.stack([(x + self.skew * y) * focal[0] + middle[0], y * focal[1] + middle[1]]), depth

    def in_focus(self, points: Doubles, offset: Doubles) -> Doubles:
        """Return the points where rays from lens points through points meet the plane of focus."""
        if not self.uses_lens:
            return points
        ahead = np.where(points[2] < 0, -points[2], np.nan)
        return np.asarray(offset + (points - offset) * (self.focus / ahead))

    def matrix(self, size: Size) -> Doubles:
        """Return the intrinsic matrix (3, 3), in pixels with centers at .5; distortion is no part of it."""
        (cx, cy), (fx, fy) = self._intrinsics(size)
        return np.array([[fx, self.skew * fx, cx], [0, fy, cy], [0, 0, 1]])

    def check(self, size: Size) -> None:
        """Check that the distortion is invertible at a grid of film points."""
        if self.distortion is None:
            return
        width, height = size
        at = np.stack(np.meshgrid(np.linspace(0, width, GRID), np.linspace(0, height, GRID))).reshape(2, -1)
        x, y = self._seen(at[0], at[1], size)
        self.distortion.check(x, y, lambda k: f"the film point ({at[0, k]:.4g}, {at[1, k]:.4g})")

    def _intrinsics(self, size: Size) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the film point on the axis, and the focal lengths, (x, y) in pixels."""
        width, height = size
        sin, cos = sin_cos(np.float64(np.radians(self.fov) / 2))
        focal = float(height / 2 * cos / sin)
        middle = width * (0.5 - self.shift[0]), height * (0.5 + self.shift[1])
        return middle, (focal / self.pixel_aspect, focal)

    def _seen(self, x: Doubles, y: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Convert film points in pixels to distorted points of the plane at distance 1, y down."""
        middle, focal = self._intrinsics(size)
        down = (y - middle[1]) / focal[1]
        return (x - middle[0]) / focal[0] - self.skew * down, down

    def _undistorted(self, x: Doubles, y: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Convert film points in pixels to points of the plane at distance 1, y up, without distortion."""
        right, down = self._seen(x, y, size)
        if self.distortion is not None:
            right, down = self.distortion.undo(right, down)
        return right, -down


class Orthographic(Projection):
    """Parallel rays.

    Parameters
    ----------
    height
        Of the picture, scene units.

    Raises
    ------
    SceneError
        If the height is not above 0.
    """

    def __init__(self, height: float) -> None:
        self.height = number("Camera height", height, lambda x: x > 0, "above 0")

    def check(self, size: Size) -> None:
        """Check nothing: every point has a ray."""

    def scaled(self, factor: float) -> Orthographic:
        """Return the film for a scene whose lengths were multiplied by `factor`."""
        return Orthographic(self.height * factor)

    def rays(self, x: Floats, y: Floats, size: Size, lens: Floats | None) -> tuple[Floats | None, Floats]:
        """Return rays that start on the film, along the view axis."""
        width, height = size
        pitch = f4(self.height / height)
        offset = np.zeros((3, len(x)), f4)
        np.multiply(x - f4(width / 2), pitch, out=offset[0])
        np.multiply(f4(height / 2) - y, pitch, out=offset[1])
        return offset, column((0, 0, -1))

    def project(self, points: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Return parallel projections, and depths."""
        width, height = size
        depth, pitch = -points[2], self.height / height
        x, y = np.where(depth >= 0, points[:2], np.nan)
        return np.stack([x / pitch + width / 2, height / 2 - y / pitch]), depth


class Panorama(Projection):
    """All directions, by longitude and latitude: 360° across and 180° down the picture.

    It is the mapping of `wf.Environment`: the render of a camera that looks along +z is an environment.
    """

    def check(self, size: Size) -> None:
        """Check nothing: every point has a ray."""

    def rays(self, x: Floats, y: Floats, size: Size, lens: Floats | None) -> tuple[Floats | None, Floats]:
        """Return directions by longitude, to the right, and latitude, up."""
        width, height = size
        sin, cos = sin_cos_turns((x - f4(width / 2)) * f4(1 / width))  # of the longitude
        height_up, level = sin_cos_turns((f4(height / 2) - y) * f4(0.5 / height))  # of the latitude
        direction = np.empty((3, len(x)), f4)
        np.multiply(sin, level, out=direction[0])
        direction[1] = height_up
        np.multiply(cos, -level, out=direction[2])
        return None, direction

    def project(self, points: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Return longitude and latitude in pixels, and distances as depths."""
        width, height = size
        x, y, z = points
        distance = np.sqrt(x * x + y * y + z * z)
        somewhere = np.where(distance > 0, 1, np.nan)
        longitude, latitude = (
            angle * somewhere for angle in (arctan2(x, -z), arctan2(y, np.sqrt(x * x + z * z)))
        )
        pixels = [longitude * (width / (2 * np.pi)) + width / 2, height / 2 - latitude * (height / np.pi)]
        return np.stack(pixels), distance

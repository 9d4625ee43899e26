"""Fisheye lenses: film points by the angle between a ray and the view axis."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import arctan2, sin_cos
from ..arrays.vec import Doubles, Floats, f4
from ..core.errors import SceneError, finite_array, number, one_of
from ..core.suggestions import suggests_keywords
from ..sampling.warp import uniform_disk
from .mappings import MAPPINGS, LensMapping, Polynomial
from .projection import Projection, Size


class Fisheye(Projection):
    """A fisheye lens, which shows a ray at angle θ to the view axis at a distance r(θ) from the axis.

    Parameters
    ----------
    fov
        Angle that the height of the picture spans, degrees, up to 360; by default 180.
    mapping
        With f the focal length: "equidistant", r = f·θ; "equisolid", r = 2f·sin(θ/2), as of most lenses for
        photographs; "stereographic", r = 2f·tan(θ/2); "orthographic", r = f·sin θ.
    distortion
        k1, k2, k3, k4 of OpenCV's model (Kannala and Brandt), r = f·(θ + k1·θ³ + k2·θ⁵ + k3·θ⁷ + k4·θ⁹), of
        the mapping "equidistant".
    shift, pixel_aspect, aperture, focus, skew
        As of `Camera.look_at` and of K. The lens is a disk across the axis; in focus is what is at that
        distance from it, in all directions.
    focal
        Focal length in heights of the picture, in place of `fov`.

    Raises
    ------
    SceneError
        If an argument is out of range.

    Notes
    -----
    Where the mapping ends, at 180°, or where its polynomial folds, the picture is black.

    Examples
    --------
    >>> camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=64)
    >>> wide = camera.replace(projection=wf.Fisheye(180, mapping="equisolid"))
    >>> wide.project([(4, 0, 4)])[0].round(6)  # at 90° to the right: at the edge
    array([[64., 32.]])
    """

    sees_all = False

    @suggests_keywords
    def __init__(
        self,
        fov: float | None = None,
        *,
        mapping: str = "equidistant",
        distortion: ArrayLike | None = None,
        shift: Sequence[float] = (0.0, 0.0),
        pixel_aspect: float = 1.0,
        aperture: float = 0.0,
        focus: float | None = None,
        skew: float = 0.0,
        focal: float | None = None,
    ) -> None:
        self.mapping = one_of("Fisheye mapping", mapping, tuple(MAPPINGS))
        self.distortion = None if distortion is None else finite_array("Fisheye distortion", distortion, (4,))
        self.shift = finite_array("Fisheye shift", shift, (2,))
        self.pixel_aspect = number("Fisheye pixel_aspect", pixel_aspect, lambda x: x > 0, "above 0")
        self.skew = number("Fisheye skew", skew)
        self.aperture = number("Fisheye aperture", aperture, lambda x: x >= 0, "at least 0")
        if focus is None and self.aperture > 0:
            raise SceneError(f"Fisheye aperture is {aperture!r}; a lens needs a focus distance: give focus")
        least = self.aperture / 2
        self.focus = (
            None
            if focus is None
            else number(
                "Fisheye focus", focus, lambda x: x > least, f"above {least:g}, the radius of the lens"
            )
        )
        self.uses_lens = self.aperture > 0
        self._lens = self._checked_mapping()
        if fov is not None and focal is not None:
            raise SceneError("Fisheye fov and focal are both given; one follows from the other")
        self.focal = None if focal is None else number("Fisheye focal", focal, lambda x: x > 0, "above 0")
        self.fov = self._checked_fov(180.0 if fov is None else fov) if focal is None else None

    def _checked_mapping(self) -> LensMapping:
        """Return the mapping with its distortion."""
        if self.distortion is None or not self.distortion.any():
            return MAPPINGS[self.mapping]
        if self.mapping != "equidistant":
            raise SceneError(
                f"Fisheye mapping is {self.mapping!r} and distortion {self.distortion.tolist()}; the "
                "distortion is one of the mapping 'equidistant'"
            )
        return Polynomial(self.distortion)

    def _checked_fov(self, fov: float) -> float:
        most = 2 * float(np.degrees(self._lens.limit))
        below = self.mapping == "stereographic"  # 360 degrees would be at infinity
        return number(
            "Fisheye fov",
            fov,
            lambda x: 0 < x < most or (x == most and not below),
            f"above 0 and {'below' if below else 'at most'} {most:.6g} degrees, which this mapping shows",
        )

    def replaced(self, **changes: Any) -> Projection:
        """Return the projection with other values; another `fov` or `focal` replaces both."""
        if changes.keys() & {"fov", "focal"}:
            changes = {"fov": None, "focal": None, **changes}
        return super().replaced(**changes)

    def scaled(self, factor: float) -> Fisheye:
        """Return the lens for a scene whose lengths were multiplied by `factor`."""
        lens = copy(self)
        lens.aperture = self.aperture * factor
        lens.focus = None if self.focus is None else self.focus * factor
        return lens

    def rays(self, x: Floats, y: Floats, size: Size, lens: Floats | None) -> tuple[Floats | None, Floats]:
        """Return rays through the film, or from lens points to the points in focus; NaN outside."""
        (cx, cy), (fx, fy) = self.intrinsics(size)
        down = (y.astype(np.float64) - cy) / fy
        right = (x.astype(np.float64) - cx) / fx - self.skew * down
        radius = np.sqrt(right * right + down * down)
        seen = radius <= self._lens.largest
        sin, cos = sin_cos(self._lens.angle(np.where(seen, radius, 0)))
        factor = np.where(seen, sin / np.where(radius > 0, radius, 1), np.nan)
        factor[radius == 0] = 1
        direction = np.stack([right * factor, -down * factor, np.where(seen, -cos, np.nan)]).astype(f4)
        if lens is None or self.focus is None or not self.uses_lens:
            return None, direction
        offset = np.zeros_like(direction)
        np.multiply(uniform_disk(lens), f4(self.aperture / 2), out=offset[:2])
        return offset, direction - offset * f4(1 / self.focus)

    def project(self, points: Doubles, size: Size) -> tuple[Doubles, Doubles]:
        """Return the film positions of points, and their distances as depths."""
        (cx, cy), (fx, fy) = self.intrinsics(size)
        right, down, ahead = points[0], -points[1], -points[2]
        across = np.sqrt(right * right + down * down)
        distance = np.sqrt(across * across + ahead * ahead)
        angle = np.asarray(arctan2(across, ahead))
        seen = (distance > 0) & (angle <= self._lens.limit) & ((across > 0) | (ahead > 0))
        radius = self._lens.radius(np.where(seen, angle, 0))
        factor = np.where(seen, radius / np.where(across > 0, across, 1), np.nan)
        u, v = right * factor, down * factor
        return np.stack([(u + self.skew * v) * fx + cx, v * fy + cy]), distance

    def in_focus(self, points: Doubles, offset: Doubles) -> Doubles:
        """Return the points where rays from lens points through points meet the sphere of focus."""
        if not self.uses_lens or self.focus is None:
            return points
        way = points - offset
        a, b = (way * way).sum(0), (way * offset).sum(0)
        c = (offset * offset).sum(0) - self.focus * self.focus
        a = np.where(a > 0, a, np.nan)
        return np.asarray(offset + way * ((np.sqrt(b * b - a * c) - b) / a))

    def intrinsics(self, size: Size) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the film point on the axis, and the focal lengths, (x, y) in pixels."""
        width, height = size
        focal = self.focal
        if focal is None:
            assert self.fov is not None
            focal = 0.5 / float(self._lens.radius(np.array([np.radians(self.fov) / 2]))[0])
        middle = width * (0.5 - float(self.shift[0])), height * (0.5 + float(self.shift[1]))
        return middle, (focal * height / self.pixel_aspect, focal * height)

    def matrix(self, size: Size) -> Doubles:
        """Return OpenCV's matrix K (3, 3), in pixels with centers at .5."""
        (cx, cy), (fx, fy) = self.intrinsics(size)
        return np.array([[fx, self.skew * fx, cx], [0, fy, cy], [0, 0, 1]])

"""Lens distortion by the Brown-Conrady model, with OpenCV's parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Bools, Doubles
from ..core.errors import SceneError
from ..core.plural import plural

NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
COUNTS = (4, 5, 8, 12, 14)  # of OpenCV's coefficients; those after the eighth must be 0
STEPS = 10  # of Newton's method; four are enough for most lenses
TOLERANCE = 1e-9  # of undistorted points, in focal lengths
GRID = 65  # points along each side of the picture where the inverse is checked
PATH_POINTS = 32  # points between the axis and a point where the model is checked for folds


class Distortion:
    """Radial and tangential distortion of a lens.

    A point (x, y) of the plane at distance 1, x to the right and y down, is seen where a lens without
    distortion sees (x·R + 2·p1·x·y + p2·(r² + 2x²), y·R + p1·(r² + 2y²) + 2·p2·x·y), with
    R = (1 + k1·r² + k2·r⁴ + k3·r⁶) / (1 + k4·r² + k5·r⁴ + k6·r⁶). Source: D. Brown 1966, "Decentering
    Distortion of Lenses"; the denominator, the order and the signs are OpenCV's.

    Parameters
    ----------
    coefficients
        (k1, k2, p1, p2), with k3, or with k3, k4, k5, k6, of any shape.

    Raises
    ------
    SceneError
        If they are not numeric or not finite, or their number is wrong.
    """

    def __init__(self, coefficients: ArrayLike) -> None:
        try:
            numbers = np.asarray(coefficients, np.float64).ravel()
        except (TypeError, ValueError) as error:
            raise SceneError(f"distortion must be numeric, got {coefficients!r}") from error
        if numbers.size not in COUNTS:
            raise SceneError(
                f"distortion has {plural(numbers.size, 'number')}; it must have 4, 5 or 8: {', '.join(NAMES)}"
            )
        if not np.isfinite(numbers).all():
            raise SceneError(f"distortion is {numbers.tolist()}; it must be finite")
        if numbers[8:].any():
            raise SceneError(
                f"distortion[8:] is {numbers[8:].tolist()}; thin prisms and tilted sensors are not supported"
            )
        self.coefficients = np.zeros(8)
        self.coefficients[: min(numbers.size, 8)] = numbers[:8]

    def __repr__(self) -> str:
        """Name the coefficients that are not 0."""
        named = zip(NAMES, self.coefficients, strict=True)
        return f"Distortion({', '.join(f'{name}={value:g}' for name, value in named if value)})"

    def apply(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """Return the distorted coordinates of points (n,), (n,) each."""
        _, _, p1, p2, *_ = self.coefficients
        r2 = x * x + y * y
        ratio, _, _ = self._radial(r2)
        return (
            x * ratio + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * ratio + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def undo(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """Return the points (n,) whose distorted coordinates are x, y (n,), by Newton's method.

        The number of steps is fixed, so that a point does not depend on the others.
        """
        u, v = x, y
        with np.errstate(all="ignore"):  # of points outside the picture that have no inverse
            for _ in range(STEPS):
                seen_u, seen_v = self.apply(u, v)
                du, dv = x - seen_u, y - seen_v
                a, b, c, det, _ = self._slopes(u, v)
                u, v = u + (c * du - b * dv) / det, v + (a * dv - b * du) / det
        return u, v

    def invertible(self, x: Doubles, y: Doubles) -> Bools:
        """Return a mask (n,) of the points between which and the axis the model does not fold."""
        way = np.arange(1, PATH_POINTS + 1)[:, None] / PATH_POINTS
        with np.errstate(all="ignore"):
            _, _, _, det, bottom = self._slopes(way * x, way * y)
            return np.asarray(((det > 0) & (bottom > 0)).all(0))

    def check(self, x: Doubles, y: Doubles, name: Callable[[int], str]) -> None:
        """Check that points (n,) of the picture can be undistorted.

        Parameters
        ----------
        x, y
            (n,) distorted coordinates.
        name
            Returns the name of a point, given its number, for the message.

        Raises
        ------
        SceneError
            If a point cannot be.
        """
        u, v = self.undo(x, y)
        with np.errstate(all="ignore"):
            seen_u, seen_v = self.apply(u, v)
            off = np.hypot(seen_u - x, seen_v - y) / (1 + np.hypot(x, y))
        bad = np.flatnonzero(~((off <= TOLERANCE) & self.invertible(u, v)))
        if bad.size:
            near = bad[np.argmin(np.hypot(x[bad], y[bad]))]
            raise SceneError(
                f"{self!r} cannot be undone inside the picture: near {name(near)} it folds, so that one "
                "pixel sees several points. Does it belong to this size and focal length?"
            )

    def _radial(self, r2: Doubles) -> tuple[Doubles, Doubles, Doubles]:
        """Return the ratio R, its derivative by r², and its denominator."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        top = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        bottom = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        top_slope = k1 + r2 * (2 * k2 + r2 * (3 * k3))
        bottom_slope = k4 + r2 * (2 * k5 + r2 * (3 * k6))
        ratio = top / bottom
        return ratio, (top_slope - ratio * bottom_slope) / bottom, bottom

    def _slopes(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles, Doubles, Doubles, Doubles]:
        """Return ∂x'/∂x, ∂x'/∂y = ∂y'/∂x and ∂y'/∂y, their determinant, and the denominator of R."""
        _, _, p1, p2, *_ = self.coefficients
        ratio, slope, bottom = self._radial(x * x + y * y)
        a = ratio + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
        b = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        c = ratio + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
        return a, b, c, a * c - b * b, bottom

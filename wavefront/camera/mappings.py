"""Mappings of fisheye lenses: the distance from the axis of a ray's image, by its angle to the view axis.

Distances are in focal lengths, angles in radians. Source of the polynomial: J. Kannala and S. Brandt, "A
Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and Fish-Eye Lenses", IEEE PAMI
28(8), 2006, with OpenCV's parameters (`cv2.fisheye`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ..arrays.elementary import arcsin, arctan2, sin_cos
from ..arrays.vec import Doubles

KNOTS = 1025  # angles from 0 to the limit of a polynomial, between which Newton's method begins
STEPS = 6  # of it; three are enough where the polynomial is steep
HALVINGS = 60  # of the interval that holds the limit


class LensMapping(ABC):
    """The mapping of a lens.

    Attributes
    ----------
    limit
        Angle up to which rays are seen, at most π.
    """

    limit: float = np.pi

    @abstractmethod
    def radius(self, angle: Doubles) -> Doubles:
        """Return the distances (n,) of angles (n,) in [0, limit]; they rise."""

    @abstractmethod
    def angle(self, radius: Doubles) -> Doubles:
        """Return the angles (n,) of distances (n,) up to that of the limit: the inverse of `radius`."""

    @property
    def largest(self) -> float:
        """The distance at the limit: outside of this circle a picture is black."""
        return float(self.radius(np.array([self.limit]))[0])


class Equidistant(LensMapping):
    """r = θ."""

    def radius(self, angle: Doubles) -> Doubles:
        """Return the angles themselves."""
        return angle

    def angle(self, radius: Doubles) -> Doubles:
        """Return the distances themselves."""
        return radius


class Equisolid(LensMapping):
    """r = 2·sin(θ/2): equal solid angles have equal areas."""

    def radius(self, angle: Doubles) -> Doubles:
        """Return 2·sin(θ/2)."""
        return np.asarray(2 * sin_cos(angle / 2)[0])

    def angle(self, radius: Doubles) -> Doubles:
        """Return 2·arcsin(r/2)."""
        return np.asarray(2 * arcsin(np.minimum(radius / 2, 1)))


class Stereographic(LensMapping):
    """r = 2·tan(θ/2): angles between lines stay."""

    def radius(self, angle: Doubles) -> Doubles:
        """Return 2·tan(θ/2)."""
        sin, cos = sin_cos(angle / 2)
        return np.asarray(2 * sin / np.where(cos > 0, cos, np.nan))

    @property
    def largest(self) -> float:
        """Infinity: every point of the film has a ray."""
        return np.inf

    def angle(self, radius: Doubles) -> Doubles:
        """Return 2·arctan(r/2)."""
        return np.asarray(2 * arctan2(radius / 2, np.ones_like(radius)))


class OrthographicFisheye(LensMapping):
    """r = sin θ: the projection of a hemisphere along the axis."""

    limit = np.pi / 2

    def radius(self, angle: Doubles) -> Doubles:
        """Return sin θ."""
        return np.asarray(sin_cos(angle)[0])

    def angle(self, radius: Doubles) -> Doubles:
        """Return arcsin r."""
        return np.asarray(arcsin(np.minimum(radius, 1)))


class Polynomial(LensMapping):
    """r = θ·(1 + k1·θ² + k2·θ⁴ + k3·θ⁶ + k4·θ⁸), up to the angle where it stops to rise.

    Parameters
    ----------
    coefficients
        k1, k2, k3, k4.
    """

    def __init__(self, coefficients: Doubles) -> None:
        self.coefficients = coefficients
        self.limit = self._turning()
        self._knots = np.linspace(0, self.limit, KNOTS)
        self._radii = self.radius(self._knots)

    def radius(self, angle: Doubles) -> Doubles:
        """Return the polynomial."""
        k1, k2, k3, k4 = self.coefficients
        t = angle * angle
        return np.asarray(angle * (1 + t * (k1 + t * (k2 + t * (k3 + t * k4)))))

    def slope(self, angle: Doubles) -> Doubles:
        """Return its derivative."""
        k1, k2, k3, k4 = self.coefficients
        t = angle * angle
        return np.asarray(1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * (9 * k4)))))

    def angle(self, radius: Doubles) -> Doubles:
        """Return the inverse by Newton's method, kept between the knots around it."""
        after = np.clip(np.searchsorted(self._radii, radius), 1, KNOTS - 1)
        low, high = self._knots[after - 1], self._knots[after]
        below, span = self._radii[after - 1], self._radii[after] - self._radii[after - 1]
        angle = low + (high - low) * np.clip((radius - below) / np.where(span > 0, span, 1), 0, 1)
        for _ in range(STEPS):  # always as many, so that no angle depends on the others
            slope = self.slope(angle)
            step = (radius - self.radius(angle)) / np.where(slope > 0, slope, np.inf)
            angle = np.clip(angle + step, low, high)
        return np.asarray(angle)

    def _turning(self) -> float:
        """Return the least angle where the slope is not above 0, at most π."""
        angles = np.linspace(0, np.pi, KNOTS)
        flat = np.flatnonzero(self.slope(angles) <= 0)
        if not flat.size:
            return float(np.pi)
        low, high = angles[flat[0] - 1], angles[flat[0]]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.slope(middle) > 0 else (low, middle)
        return float(low)


MAPPINGS: dict[str, LensMapping] = {
    "equidistant": Equidistant(),
    "equisolid": Equisolid(),
    "stereographic": Stereographic(),
    "orthographic": OrthographicFisheye(),
}

"""Uniform sampling of the solid angle that a rectangle covers."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.elementary import arctan2, sin_cos
from ..arrays.soa import soa
from ..arrays.vec import Floats, cross, dot, f4, normalize


@soa
class SphericalRectangle:
    """Rectangles, each seen from one point, sampled uniformly in solid angle.

    It prepares the values that a sample and its density share, a column per lane.

    In the rectangle's frame, at distance z, the part up to x covers F(x) − F(x₀) with
    F = asin(b₁c) − asin(b₀c), c = x/√(x² + z²), bᵢ = yᵢ/√(yᵢ² + z²); solved for c this is
    c = sin F/√(b₀² + b₁² − 2b₀b₁ cos F). F is a small difference where the rectangle is seen edge-on and
    then needs float64; otherwise float32 is enough, in two fifths of the time.

    Source: C. Ureña, M. Fajardo, A. King, An Area-Preserving Parametrization for Spherical
    Rectangles, EGSR 2013, with a form of its eq. 8 that needs no case for the sign of x.
    """

    x_axis: Floats  # (3, n or 1) unit vector along the first edge
    y_axis: Floats  # (3, n or 1) unit vector along the second edge
    z_axis: Floats  # (3, n or 1) unit normal
    height: Floats  # (n,) signed distance of the plane along z_axis
    x: tuple[Floats, Floats]  # (n,) each: bounds along x_axis
    y: tuple[Floats, Floats]  # (n,) each: bounds along y_axis
    z: Floats  # (n,) distance of the plane
    b: tuple[Floats, Floats]  # (n,) each: yᵢ/√(yᵢ² + z²)
    start: Floats  # (n,) F at the lower bound of x
    angle: Floats  # (n,) solid angle, sr

    @classmethod
    def of(
        cls, corner: Floats, edge_u: Floats, edge_v: Floats, dtype: type[np.floating] = np.float64
    ) -> Self:
        """Return rectangles.

        Parameters
        ----------
        corner
            (3, n) vector from the point to one corner.
        edge_u, edge_v
            (3, n) or (3, 1) perpendicular edges from that corner.
        dtype
            Of the calculation: float64, or float32.
        """
        x_axis, y_axis = normalize(edge_u), normalize(edge_v)
        z_axis = cross(x_axis, y_axis)
        height = dot(corner, z_axis)
        x0, y0 = _dot(corner, x_axis, dtype), _dot(corner, y_axis, dtype)
        x = (x0, x0 + _dot(edge_u, x_axis, dtype))
        y = (y0, y0 + _dot(edge_v, y_axis, dtype))
        z = np.abs(height.astype(dtype, copy=False))
        b = (_sine(y[0], z), _sine(y[1], z))
        start = _swept(b, _sine(x[0], z))
        angle = np.where(z > 0, _swept(b, _sine(x[1], z)) - start, 0.0)
        return cls(x_axis, y_axis, z_axis, height, x, y, z, b, start, angle)

    @property
    def solid_angle(self) -> Floats:
        """Solid angle, (n,), sr."""
        return self.angle.astype(f4, copy=False)

    def pdf(self) -> Floats:
        """Density within the rectangle, (n,), 1/sr; 0 where its solid angle is 0."""
        return _reciprocal(self.solid_angle)

    def sample(self, u: Floats) -> Floats:
        """Return vectors (3, n) from the point to points of the rectangle, for u (2, n)."""
        swept = self.start + u[0] * self.angle
        b0, b1 = self.b
        sin, cos = sin_cos(0.5 * swept)
        size = np.sqrt((b1 - b0) ** 2 + 4 * b0 * b1 * sin * sin)
        x = _from_sine(2 * sin * cos / np.where(size > 0, size, 1.0), self.z, self.x)
        depth = np.sqrt(x * x + self.z * self.z)
        h0, h1 = _sine(self.y[0], depth), _sine(self.y[1], depth)
        y = _from_sine(h0 + u[1] * (h1 - h0), depth, self.y)
        x, y = x.astype(f4, copy=False), y.astype(f4, copy=False)
        return x * self.x_axis + y * self.y_axis + self.height * self.z_axis

    def inverse(self, w: Floats) -> Floats:
        """Return the u (2, n) that `sample` maps to vectors along w (3, n)."""
        x, y, z = (_dot(w, axis, np.float64) for axis in (self.x_axis, self.y_axis, self.z_axis))
        scale = self.z / np.abs(z)
        x, y = x * scale, y * scale
        depth = np.sqrt(x * x + self.z * self.z)
        h0, h1 = _sine(self.y[0], depth), _sine(self.y[1], depth)
        out = np.empty((2, w.shape[1]), f4)
        out[0] = (_swept(self.b, _sine(x, self.z)) - self.start) / self.angle
        out[1] = (_sine(y, depth) - h0) / (h1 - h0)
        return out


def _reciprocal(x: Floats) -> Floats:
    """Return 1/x, 0 where x (n,) is not positive."""
    return np.where(x > 0, f4(1) / np.where(x > 0, x, f4(1)), f4(0))


def _dot(a: Floats, b: Floats, dtype: type[np.floating]) -> Floats:
    """Return the dot products (n,) of vectors (3, n), computed in `dtype`."""
    return dot(a.astype(dtype, copy=False), b.astype(dtype, copy=False))


def _sine(side: Floats, height: Floats) -> Floats:
    """Return side/√(side² + height²), (n,), 0 where both are 0."""
    size = np.sqrt(side * side + height * height)
    return side / np.where(size > 0, size, 1.0)


def _from_sine(sine: Floats, height: Floats, bounds: tuple[Floats, Floats]) -> Floats:
    """Return the side (n,) with this sine at `height`, clipped to `bounds` against rounding."""
    cosine = np.sqrt(np.maximum(1 - sine * sine, np.finfo(sine.dtype).tiny))
    return np.clip(sine * height / cosine, bounds[0], bounds[1])


def _swept(b: tuple[Floats, Floats], c: Floats) -> Floats:
    """Return the signed solid angle F (n,) between x = 0 and x, where c = x/√(x² + z²)."""
    one = c.dtype.type(1)
    s0, s1 = b[0] * c, b[1] * c
    c0, c1 = np.sqrt((one - s0) * (one + s0)), np.sqrt((one - s1) * (one + s1))
    return arctan2(s1 * c0 - s0 * c1, c1 * c0 + s1 * s0)

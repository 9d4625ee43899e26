"""Spheres as primitives: a float32 filter by matrix products, and the exact roots in float64."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, dot, f4, normalize
from ..shapes import Sphere, Spheres
from ..shapes.attributes import sphere_dpduv, sphere_uv
from .bvh import Ball
from .primitives import CurvedPrimitives
from .triangle import ROUNDOFF


@soa
class SpherePrimitives(CurvedPrimitives):
    """k spheres."""

    shapes = (Sphere, Spheres)

    centers: Floats  # (3, k)
    radii: Floats  # (k,)
    # (9, k) the columns of each rotation from a sphere's own space, where longitude and latitude count
    turns: Floats | None = None

    def __len__(self) -> int:
        """Return the number of spheres."""
        return self.radii.size

    @classmethod
    def from_shapes(cls, shapes: Sequence[Any], center: Doubles) -> SpherePrimitives:
        """Return the spheres of shapes relative to `center` (3,)."""
        centers = np.concatenate([shape.centers - center for shape in shapes])
        radii = np.concatenate([np.broadcast_to(shape.radii, shape.count) for shape in shapes])
        turns = None
        if any(getattr(shape, "transform", None) is not None for shape in shapes):
            transforms = [getattr(shape, "transform", None) for shape in shapes]
            rows = [np.eye(3) if turn is None else turn for turn in transforms]
            counts = [shape.count for shape in shapes]
            turns = np.repeat([row.T.ravel() for row in rows], counts, 0).T.astype(f4)
        return cls(np.ascontiguousarray(centers.T, f4), radii.astype(f4), turns)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners, (3, k) each."""
        return self.centers - self.radii, self.centers + self.radii

    @property
    def balls(self) -> tuple[Floats, Floats]:
        """The spheres: centers (3, k) and radii (k,)."""
        return self.centers, self.radii

    def filter_rows(self, ball: Ball) -> Floats:
        """Return the rows (1, k, 11) of `sphere_rows`."""
        centers, radii = self.centers.astype(np.float64), self.radii.astype(np.float64)
        return sphere_rows(centers, radii, ball.center, ball.radius)[None]

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the numbers (11, n) that the rows are multiplied by."""
        return line_features(line[:3], line[3:])

    def distance(self, prim: Ints, origin: Doubles, direction: Doubles, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays (3, n) hit spheres, inf on a miss."""
        center = self.centers.take(prim, 1).astype(np.float64)
        return sphere_distance(center, self.radii.take(prim).astype(np.float64), origin, direction, leaves)

    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the outward normals (3, n), and move the points onto the spheres; their errors hold."""
        center = self.centers.take(prim, 1)
        normal = normalize(point - center)
        np.add(center, normal * self.radii.take(prim), out=point)
        return normal

    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return longitude and latitude, (2, n)."""
        return sphere_uv(self._own(prim, point))

    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return the derivatives of the point by longitude and latitude, (6, n)."""
        derivatives = sphere_dpduv(self._own(prim, point), self.radii.take(prim))
        if self.turns is None:
            return derivatives
        x, y, z = self.turns.take(prim, 1).reshape(3, 3, -1)
        turned = [x * v[0] + y * v[1] + z * v[2] for v in (derivatives[:3], derivatives[3:])]
        return np.concatenate(turned)

    def _own(self, prim: Ints, point: Floats) -> Floats:
        """Return the outward normals (3, n) in the spheres' own space."""
        normal = normalize(point - self.centers.take(prim, 1))
        if self.turns is None:
            return normal
        axes = self.turns.take(prim, 1).reshape(3, 3, -1)
        return np.stack([dot(axis, normal) for axis in axes])


def sphere_rows(centers: Doubles, radii: Doubles, center: Floats, radius: float) -> Floats:
    """Return the filter's rows for k spheres, (k, 11) float32.

    A line with unit direction d and moment m about `center` passes a sphere at c (relative to
    `center`) at a squared distance of |m - c × d|², so

        r² - |m|² + 2 c·(d × m) - |c|² + (c·d)²

    is not negative on a hit. It is linear in the eleven numbers of `line_features`. Rows are scaled so
    that the product of a hit is at least -1. `radius` is that of a ball about `center` around all spheres.
    """
    c = centers - np.asarray(center, np.float64)[:, None]
    x, y, z = c
    size2 = x * x + y * y + z * z
    one = np.ones_like(radii)
    rows = np.stack(
        [radii**2 - size2, -one, 2 * x, 2 * y, 2 * z, x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], 1
    )
    error = 150 * ROUNDOFF * radius * radius
    return (rows / error).astype(f4)


def line_features(direction: Floats, moment: Floats) -> Floats:
    """Return the numbers (11, n) of lines that `sphere_rows` multiplies."""
    dx, dy, dz = direction
    mx, my, mz = moment
    out = np.empty((11, dx.size), f4)
    out[0] = 1 + 0 * dx  # NaN for invalid lines
    out[1] = mx * mx + my * my + mz * mz
    out[2] = dy * mz - dz * my
    out[3] = dz * mx - dx * mz
    out[4] = dx * my - dy * mx
    out[5], out[6], out[7] = dx * dx, dy * dy, dz * dz
    out[8], out[9], out[10] = dx * dy, dx * dz, dy * dz
    return out


def sphere_distance(
    center: Doubles, radius: Doubles, origin: Doubles, direction: Doubles, leaves: Bools
) -> Doubles:
    """Return the least t > 0 (k,) at which rays (3, k) hit spheres, inf on a miss.

    A ray that starts on its sphere (`leaves`) has one root at exactly 0; the other one is returned.
    """
    first, second, nearest = sphere_roots(center, radius, origin, direction)
    t = np.where(first > 0, first, second)
    t = np.where(leaves, 2 * nearest, t)
    return np.where(t > 0, t, np.inf)


def sphere_roots(
    center: Doubles, radius: Doubles, origin: Doubles, direction: Doubles
) -> tuple[Doubles, Doubles, Doubles]:
    """Return where lines (3, k) enter and leave spheres, NaN on a miss, and are nearest to their centers.

    Haines et al., "Precision improvements for ray/sphere intersection", Ray Tracing Gems, chapter 7:
    the discriminant from the distance between line and center, and the smaller root from the product of
    the two.
    """
    fx, fy, fz = origin - center
    dx, dy, dz = direction
    a = dx * dx + dy * dy + dz * dz
    b = -(fx * dx + fy * dy + fz * dz)
    nearest = b / a
    rx, ry, rz = fx + nearest * dx, fy + nearest * dy, fz + nearest * dz
    discriminant = radius * radius - (rx * rx + ry * ry + rz * rz)
    c = fx * fx + fy * fy + fz * fz - radius * radius
    q = b + np.copysign(np.sqrt(a * discriminant), b)  # NaN on a miss
    near, far = c / q, q / a
    return np.minimum(near, far), np.maximum(near, far), nearest

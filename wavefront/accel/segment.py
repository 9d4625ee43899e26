"""Primitives around straight segments: the common base of cylinders and capsules.

Lines are cut in the plane perpendicular to the axis, where a cylinder is a circle, with the discriminant from
the distance between line and axis as for spheres (Haines et al., "Precision improvements for ray/sphere
intersection", Ray Tracing Gems, chapter 7). So a cylinder may be far away, long and thin. All of it is in
float64, so a line that is parallel to the axis up to rounding needs no special case.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays.elementary import arctan2
from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, dot, f4, highest, length
from .bvh import PAIRS, Ball, quadric_rows
from .primitives import CurvedPrimitives

FILTER_SCALE = 2.0**20  # of quadrics, which are not negative on a hit; values of the filter are above -1
# Points are computed in float64 and rounded once; this is eight times as much.
ROUNDED = f4(2**-21)
LEAST_SLOPE = 1e-6  # 1 − (n·axis)² below which a surface counts as perpendicular to the axis


@soa
class Cut(SoA):
    """Rays and the segments that they may hit, k pairs."""

    along_origin: Floats  # (k,) origin along the axis, from the start
    along_direction: Floats  # (k,) direction along the axis
    enter: Doubles  # (k,) where the line enters the endless cylinder, NaN on a miss
    leave: Doubles  # (k,) where the line leaves it


@soa
class SegmentPrimitives(CurvedPrimitives):
    """k primitives of one radius about a segment each."""

    round_ends: ClassVar[bool]  # whether the ends are half spheres beyond the segment

    start: Doubles  # (3, k)
    axis: Doubles  # (3, k) unit vectors from start to end
    across: Doubles  # (3, k) unit vectors perpendicular to the axis, where u is 0.5
    length: Doubles  # (k,)
    radius: Doubles  # (k,)
    caps: Bools  # (k,) whether the ends are closed

    def __len__(self) -> int:
        """Return the number of primitives."""
        return self.radius.size

    @classmethod
    def from_shapes(cls, shapes: Sequence[Any], center: Doubles) -> Self:
        """Return the primitives of shapes relative to `center` (3,)."""
        start = np.concatenate([shape.starts for shape in shapes]).T
        span = np.concatenate([shape.ends for shape in shapes]).T - start
        size: Doubles = np.sqrt(dot(span, span))
        point = size == 0  # a capsule without length is a sphere; any axis will do
        axis = np.where(point, np.array([[0.0], [1.0], [0.0]]), span / np.where(point, 1, size))
        least = np.eye(3)[:, np.abs(axis).argmin(0)]
        across = cross(least, axis)
        return cls(
            start - center[:, None],
            axis,
            across / length(across),
            size,
            np.concatenate([np.broadcast_to(shape.radii, shape.count) for shape in shapes]),
            np.concatenate([np.full(shape.count, shape.caps) for shape in shapes]),
        )

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners, (3, k) each."""
        end = self.start + self.axis * self.length
        slope = 1.0 if self.round_ends else np.sqrt(np.maximum(1 - self.axis * self.axis, 0))
        low, high = np.minimum(self.start, end) - self.radius * slope, np.maximum(self.start, end)
        return low.astype(f4), (high + self.radius * slope).astype(f4)

    def hull(self) -> Floats:
        """Return the corners (8, 3, k) of boxes along the axes."""
        beyond = self.axis * (self.radius if self.round_ends else 0)
        u, v = self.across * self.radius, cross(self.axis, self.across) * self.radius
        ends = self.start - beyond, self.start + self.axis * self.length + beyond
        return np.stack([end + i * u + j * v for end in ends for i in (-1, 1) for j in (-1, 1)]).astype(f4)

    def filter_rows(self, ball: Ball) -> Floats:
        """Return quadrics of ellipsoids around the primitives, (1, k, 21).

        Half axes √(2(h² + r²)), or √2 h with flat ends, and twice √2 r hold a segment of half length h.
        """
        half, radius = self.length / 2, self.radius
        middle = self.start + self.axis * half - ball.center[:, None]
        longest = np.sqrt(2 * (half * half + (radius * radius if self.round_ends else 0)))
        sides = np.sqrt(2) * radius
        shape = np.empty((1, len(self), 12))
        shape[0, :, :3] = middle.T
        columns = self.axis * longest, self.across * sides, cross(self.axis, self.across) * sides
        shape[0, :, 3:] = np.stack(columns, 1).transpose(2, 0, 1).reshape(-1, 9)
        shape /= ball.radius
        shape[..., 3:] *= 1 + 1e-6
        return quadric_rows(shape, np.zeros((1, 3)), np.ones(1)) * f4(FILTER_SCALE)

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the products of two Plücker coordinates, (21, n), in units of the ball's radius."""
        scaled = line.copy()
        scaled[3:] *= f4(1 / ball.radius)
        return np.stack([scaled[i] * scaled[j] for i, j in PAIRS])

    def cut(self, prim: Ints, origin: Doubles, direction: Doubles) -> Cut:
        """Cut lines (3, n) by the endless cylinders about segments `prim` (n,)."""
        axis, radius = self.axis.take(prim, 1), self.radius.take(prim)
        from_start = origin - self.start.take(prim, 1)
        position, slope = cross(from_start, axis), cross(direction, axis)
        slope2 = dot(slope, slope)
        parallel = slope2 == 0
        nearest = np.where(parallel, 0, -dot(position, slope) / slope2)
        foot = position + nearest * slope
        inside2 = radius * radius - dot(foot, foot)
        half = np.sqrt(np.where(parallel, np.where(inside2 >= 0, np.inf, np.nan), inside2 / slope2))
        return Cut(dot(from_start, axis), dot(direction, axis), nearest - half, nearest + half)

    def slab(self, prim: Ints, cut: Cut) -> tuple[Doubles, Doubles]:
        """Return where lines (n,) enter and leave the slabs between the ends of segments `prim` (n,)."""
        low = -cut.along_origin / cut.along_direction
        high = (self.length.take(prim) - cut.along_origin) / cut.along_direction
        return np.minimum(low, high), np.maximum(low, high)

    def local(self, prim: Ints, point: Floats) -> tuple[Doubles, Floats]:
        """Return points (3, n) relative to the starts of segments, (3, n), and their part along the axes."""
        from_start = point - self.start.take(prim, 1)
        return from_start, dot(from_start, self.axis.take(prim, 1))

    def put_points(self, prim: Ints, from_start: Doubles, point: Floats, error: Floats) -> None:
        """Write points (3, n), relative to the starts of segments, to `point`, and bounds to `error` (n,)."""
        point[...] = from_start + self.start.take(prim, 1)
        error[...] = ROUNDED * highest(np.abs(point))

    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return the turn about the axis and the height along it, both from 0 to 1, (2, n)."""
        from_start, along = self.local(prim, point)
        across, axis = self.across.take(prim, 1), self.axis.take(prim, 1)
        beyond = self.radius.take(prim) * self.round_ends
        x, y = dot(from_start, across), dot(from_start, cross(axis, across))
        uv = np.empty((2, prim.size), f4)
        uv[0] = arctan2(y.astype(f4), x.astype(f4)) * f4(0.5 / np.pi) + f4(0.5)
        uv[1] = np.clip((along + beyond) / (self.length.take(prim) + 2 * beyond), 0, 1)
        return uv

    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return the derivatives of the point by `uv`, (6, n); 0 on caps and at the ends of the axis."""
        from_start, _ = self.local(prim, point)
        axis = self.axis.take(prim, 1)
        normal = self.surface(prim, point.copy(), np.empty(prim.size, f4)).astype(np.float64)
        beyond = self.radius.take(prim) * self.round_ends
        slope = dot(normal, axis)
        flat = 1 - slope * slope
        level = flat < LEAST_SLOPE
        height = (self.length.take(prim) + 2 * beyond) / np.where(level, 1, flat)
        values = np.concatenate([2 * np.pi * cross(axis, from_start), (axis - slope * normal) * height])
        return np.where(level, 0, values).astype(f4)

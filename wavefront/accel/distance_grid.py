"""Cells of grids of signed distances as primitives.

A ray is cut by the planes of the grid at numbers that all cells share, and the values there have the same
bits from both sides. So where a ray changes sides, one of the cells has a root, and none leaks between cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, Lanes, cross, dot, f4, highest, length, normalize, take
from ..shapes import SignedDistanceGrid
from .bvh import Ball
from .primitives import CurvedPrimitives
from .segment import ROUNDED
from .sphere import line_features, sphere_rows

LEAST = 1e-300  # in place of a component 0 of a direction, so that a ray along a plane has one side of it
STEPS = 60  # most of the search for a root: as many bisections find it, and Newton's method in a few
CORNER = f4(2**-20)  # at exactly 0 the fields of a texture that repeats meet
NEAR = 2.0**-44  # of a root, where the search ends


@soa
class DistanceGridPrimitives(CurvedPrimitives):
    """k cells that surfaces cross, of g grids."""

    shapes = (SignedDistanceGrid,)
    shading_normals = True

    low: Floats  # (3, k) lower corners of boxes around the surface in each cell
    high: Floats  # (3, k) their upper corners
    grid: Ints  # (k,) which grid the cell is in
    cell: Ints  # (3, k) its lowest corner, along x, y and z
    distances: Floats  # (m,) of all grids, x the fastest
    first: Ints  # (g,) where the values of each grid begin
    size: Ints  # (3, g) values along x, y and z
    steps: Doubles  # (9, g) matrices from the grid to the scene, row by row
    inverse: Doubles  # (9, g) matrices from the scene to the grid
    origin: Doubles  # (3, g) place of the first value
    smooth: Bools  # (g,) whether shading normals are interpolated

    def __len__(self) -> int:
        """Return the number of cells."""
        return self.grid.size

    def take(self, index: Lanes) -> Self:
        """Return some of the cells, with all grids."""
        return replace(
            self, **{name: take(getattr(self, name), index) for name in ("low", "high", "grid", "cell")}
        )

    @classmethod
    def from_shapes(cls, shapes: Sequence[Any], center: Doubles) -> Self:
        """Return the cells of shapes relative to `center` (3,); those that share values share them here."""
        shared = {id(shape.values): shape.values for shape in shapes}
        ends = np.cumsum([0, *(values.size for values in shared.values())])
        begins = dict(zip(shared, ends.tolist(), strict=False))
        boxes, frames = [shape.boxes() for shape in shapes], [shape.frame for shape in shapes]
        middle = np.concatenate([box[0] for box in boxes], 1) - center[:, None]
        half = np.concatenate([box[1] for box in boxes], 1)
        steps = np.stack([frame[0] for frame in frames], 2)
        x, y, z = steps.transpose(1, 0, 2)
        return cls(
            low=(middle - half).astype(f4),
            high=(middle + half).astype(f4),
            grid=np.repeat(np.arange(len(shapes)), [shape.count for shape in shapes]),
            cell=np.concatenate([shape.cells for shape in shapes], 1),
            distances=np.concatenate([values.ravel() for values in shared.values()]),
            first=np.array([begins[id(shape.values)] for shape in shapes], np.intp),
            size=np.array([shape.values.shape[::-1] for shape in shapes], np.intp).T,
            steps=steps.reshape(9, -1),
            inverse=np.concatenate([cross(y, z), cross(z, x), cross(x, y)]) / dot(x, cross(y, z)),
            origin=np.stack([frame[1] for frame in frames], 1) - center[:, None],
            smooth=np.array([shape.smooth for shape in shapes], np.bool_),
        )

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners, (3, k) each."""
        return self.low, self.high

    def filter_rows(self, ball: Ball) -> Floats:
        """Return the rows (1, k, 11) of balls around the boxes."""
        centers, radii = (array.astype(np.float64) for array in self.balls)
        return sphere_rows(centers, radii, ball.center, ball.radius)[None]

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the numbers (11, n) that the rows are multiplied by."""
        return line_features(line[:3], line[3:])

    def distance(self, prim: Ints, origin: Doubles, direction: Doubles, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays (3, n) meet the surface in cells, inf on a miss.

        A ray that leaves the surface starts on the side to which the value changes along it, whichever side
        its origin is rounded to.
        """
        grid, cell = self.grid.take(prim), self.cell.take(prim, 1)
        start, along = self._to_grid(grid, origin), _times(_of(self.inverse, grid), direction)
        along[along == 0] = LEAST
        planes = (cell - start) / along, (cell + 1 - start) / along
        enter, leave = np.minimum(*planes), np.maximum(*planes)
        begin, end = np.maximum(highest(enter), 0), np.minimum(np.minimum(leave[0], leave[1]), leave[2])
        met = np.flatnonzero(begin <= end)
        grid, cell = grid.take(met), take(cell, met)
        start, along, begin, end, enter, leave = (
            take(array, met) for array in (start, along, begin, end, enter, leave)
        )
        ahead = along > 0
        near = np.where(enter == begin, ~ahead, np.clip(start + begin * along - cell, 0, 1))
        far = np.where(leave == end, ahead, np.clip(start + end * along - cell, 0, 1))
        cubic = _along_diagonal(self._corners(grid, cell), near, far)
        outside = np.where(leaves.take(met) & (begin == 0), cubic[1] >= cubic[0], cubic[0] >= 0)
        t = np.full(prim.size, np.inf)
        t[met] = begin + _first_root(cubic, outside) * (end - begin)
        return t

    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the unit normals (3, n) of the outside, and move the points onto the surface in their cells.

        By Newton's method; the error grows by the length of its last step.
        """
        grid, cell = self.grid.take(prim), self.cell.take(prim, 1)
        corners, inverse = self._corners(grid, cell), _of(self.inverse, grid)
        at, reach = np.clip(self._to_grid(grid, point) - cell, 0, 1), 2 * error.astype(np.float64)
        for last in (False, False, True):
            slope = _transposed_times(inverse, np.stack([_within(corners, at, axis) for axis in range(3)]))
            steep = length(slope)
            steep += steep == 0
            normal = slope / steep
            height = np.clip(_within(corners, at) / steep, -reach, reach)
            if not last:
                at = np.clip(at - _times(inverse, normal * height), 0, 1)
        point[...] = _times(_of(self.steps, grid), cell + at) + _of(self.origin, grid)
        error[...] = ROUNDED * highest(np.abs(point)) + np.abs(height)
        return normal.astype(f4)

    def shading(self, prim: Ints, point: Floats, normal: Floats) -> Floats:
        """Return shading normals (3, n): between the eight cells around a corner, those of the cells.

        The slope of a cell along an axis is that through the point, from face to face. Normals are weighted
        in the unit cube, and bent no further than 90° from the `normal` (3, n) of the surface.

        Source: Hansson-Söderlund et al. 2022, section 5.
        """
        grid = self.grid.take(prim)
        place, last = self._to_grid(grid, point), _of(self.size, grid) - 2
        nearest = np.rint(place)
        weight, sides = (
            place - nearest + 0.5,
            [np.clip(nearest + i, 0, last).astype(np.intp) for i in (-1, 0)],
        )
        slopes = [[self._slope(grid, place, axis, side[axis]) for side in sides] for axis in range(3)]
        total = np.zeros_like(place)
        for i, j, k in product((0, 1), repeat=3):
            share = np.prod([w if side else 1 - w for side, w in zip((i, j, k), weight, strict=True)], 0)
            total += share * normalize(np.stack([slopes[0][i], slopes[1][j], slopes[2][k]]) * (last + 1))
        bent = normalize(_transposed_times(_of(self.inverse, grid), total / (last + 1))).astype(f4)
        return np.where(_of(self.smooth, grid) & (dot(bent, normal) > 0), bent, normal)

    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return a place just inside of the corner at 0, (2, n)."""
        return np.full((2, prim.size), CORNER, f4)

    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return 0, (6, n)."""
        return np.zeros((6, prim.size), f4)

    def _to_grid(self, grid: Ints, point: Floats) -> Doubles:
        """Return points (3, n) in steps of grids (n,) from their first values."""
        return _times(_of(self.inverse, grid), point - _of(self.origin, grid))

    def _corners(self, grid: Ints, cell: Ints) -> Doubles:
        """Return the values (2, 2, 2, n) at the corners of cells (3, n) of grids (n,), by z, y and x."""
        width, height, _ = _of(self.size, grid)
        x, y, z = cell
        first = _of(self.first, grid) + x + width * (y + height * z)
        offset = np.arange(2)[:, None]
        index = first + offset + width * (offset[:, None] + height * offset[:, None, None])
        return self.distances.take(index).astype(np.float64)

    def _slope(self, grid: Ints, place: Doubles, axis: int, cell: Ints) -> Doubles:
        """Return the differences (n,) between both faces across an axis of cells `cell` (n,) there."""
        cells = np.clip(np.floor(place), 0, _of(self.size, grid) - 2).astype(np.intp)
        at = place - cells
        cells[axis] = cell
        return _within(self._corners(grid, cells), at, axis)


def _of(table: Any, number: Ints) -> Any:
    """Return columns `number` (n,) of a table (..., g); the only one as it is."""
    return table if table.shape[-1] == 1 else take(table, number)


def _times(m: Doubles, v: Doubles) -> Doubles:
    """Return the products of matrices (9, n), row by row, and vectors (3, n)."""
    return np.stack([m[i] * v[0] + m[i + 1] * v[1] + m[i + 2] * v[2] for i in (0, 3, 6)])


def _transposed_times(m: Doubles, v: Doubles) -> Doubles:
    """Return the products of transposed matrices and vectors."""
    return np.stack([m[i] * v[0] + m[i + 3] * v[1] + m[i + 6] * v[2] for i in range(3)])


def _lerp(a: Doubles, b: Doubles, fraction: Doubles) -> Doubles:
    """Interpolate; exactly a at 0 and b at 1."""
    return a * (1 - fraction) + b * fraction


def _within(corners: Doubles, at: Doubles, along: int | None = None) -> Doubles:
    """Return values (n,) at points (3, n) of cells with corners (2, 2, 2, n), or their slopes by an axis."""
    for axis, fraction in enumerate(at):
        a, b = corners[..., 0, :], corners[..., 1, :]
        corners = b - a if axis == along else _lerp(a, b, fraction)
    return corners


def _along_diagonal(corners: Doubles, near: Doubles, far: Doubles) -> Doubles:
    """Return the Bernstein coefficients (4, n) of the values from `near` to `far` (3, n) of cells.

    They are the polar form: means of the values at the corners of the box of which that is a diagonal.
    """
    for axis in range(3):
        a, b = corners[:, :, 0], corners[:, :, 1]
        corners = np.stack([_lerp(a, b, near[axis]), _lerp(a, b, far[axis])])
    second = (corners[1, 0, 0] + corners[0, 1, 0] + corners[0, 0, 1]) / 3
    third = (corners[1, 1, 0] + corners[1, 0, 1] + corners[0, 1, 1]) / 3
    return np.stack([corners[0, 0, 0], second, third, corners[1, 1, 1]])


def _cubic(b: Doubles, s: Doubles) -> tuple[Doubles, Doubles]:
    """Return values (n,) and slopes of cubics by their Bernstein coefficients (4, n), by de Casteljau."""
    b = _lerp(b[:-1], b[1:], s)
    low, high = _lerp(b[:-1], b[1:], s)
    return _lerp(low, high, s), 3 * (high - low)


def _first_root(b: Doubles, outside: Bools) -> Doubles:
    """Return where cubics (4, n) first change sign between 0 and 1, (n,), inf where they do not.

    Between the points where the slope is 0 there is at most one root (Marmitt et al. 2004, "Fast and Accurate
    Ray-Voxel Intersection Techniques for Iso-Surface Ray Tracing").

    Parameters
    ----------
    outside
        (n,) whether the value at 0 counts as at least 0.
    """
    root = np.full(outside.size, np.inf)
    lanes = np.flatnonzero(((b >= 0) != outside).any(0))
    b, outside = take(b, lanes), outside.take(lanes)
    first, middle, last = np.diff(b, axis=0)
    q = middle * middle - first * last
    half = middle - first
    q = -(half + np.copysign(np.sqrt(q), half))
    turns = np.stack([q / (last - middle + first - middle), first / q])
    turns = np.sort(np.where((turns > 0) & (turns < 1), turns, 1), axis=0)
    ends = np.stack([np.zeros(lanes.size), *turns, np.ones(lanes.size)])
    sides = np.stack([outside, _cubic(b, turns[0])[0] >= 0, _cubic(b, turns[1])[0] >= 0, b[3] >= 0])
    changes = sides[1:] != sides[:-1]
    crossed = np.flatnonzero(changes.any(0))
    piece = changes.argmax(0).take(crossed)
    low, high, outside = ends[piece, crossed], ends[piece + 1, crossed], sides[piece, crossed]
    b, lanes = take(b, crossed), lanes.take(crossed)
    s = (low + high) / 2
    for _ in range(STEPS):
        value, slope = _cubic(b, s)
        before = (value >= 0) == outside
        low, high = np.where(before, s, low), np.where(before, high, s)
        better = s - value / slope
        better = np.where((better >= low) & (better <= high), better, (low + high) / 2)
        root[lanes] = better
        more = np.flatnonzero(np.abs(better - s) > NEAR)
        if not more.size:
            break
        lanes, outside = lanes.take(more), outside.take(more)
        b, low, high, s = (take(array, more) for array in (b, low, high, better))
    return root

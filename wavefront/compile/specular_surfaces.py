"""Specular surfaces: those that light leaves by delta lobes alone, such as smooth glass and mirrors.

Paths from lights (integrators/light_tracing.py) begin at points on them, which are drawn uniformly by area.
Those that move while a shutter is open are where they are at the time of a path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..accel.quads import find_quads
from ..accel.sphere import SpherePrimitives
from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, f4, interpolate, length
from ..motion.steps import growth_of, inverse_linear, linear_times, moved_back
from ..sampling.warp import uniform_sphere, uniform_triangle
from .curved import CurvedTable
from .instances import InstanceTable
from .materials import MaterialTable
from .motion import MotionTable


@soa
class SpecularPoints(SoA):
    """Points on specular surfaces."""

    point: Floats  # (3, n) scene units
    prim: Ints  # (n,) primitive id
    b1: Floats  # (n,) barycentric weight of the second vertex, of a triangle
    b2: Floats  # (n,) and of the third
    area: Floats  # (n,) inverse of the density of the point, scene units²


@soa
class MovingSpecular:
    """Which specular surfaces move, and how."""

    column: Ints  # (c,) of the `InstanceTable`, of each specular primitive; 0 for those that stay
    row: Ints  # (c,) of the scene's tables
    of_column: Bools  # (p,) whether a column is of a specular surface that moves
    second: Bools  # (rows,) the second triangles of flat quadrilaterals
    instances: InstanceTable
    motion: MotionTable


@soa
class SpecularSurfaces:
    """The specular surfaces of a scene: its triangles and spheres whose materials have only delta lobes."""

    # (m + k + 1,) whether each primitive id is one that stays; False at the end, for others and a miss
    of_prim: Bools
    # (m + k,) the lowest primitive id that a ray may report for a hit of each: that of the first triangle
    # of a flat quadrilateral, or its own
    found_as: Ints
    prim: Ints  # (c,) their primitive ids, triangles first
    corners: Floats  # (t, 3, 3) of the triangles
    centers: Floats  # (3, c - t) of the spheres
    radii: Floats  # (c - t,)
    cumulative: Doubles  # (c,) sums of areas, scene units²; of those that move in the middle of the time
    moving: MovingSpecular | None = None

    def includes(self, prim: Ints) -> Bools:
        """Return whether primitives are specular surfaces, (n,), given their ids (n,); -1 is no primitive."""
        stays = self.of_prim.take(np.minimum(prim, self.of_prim.size - 1))
        if self.moving is None:
            return stays
        return stays | self.moving.of_column.take(self.moving.instances.locate(prim)[1])

    @property
    def area(self) -> float:
        """Their area, scene units²; of those that move in the middle of the time."""
        return float(self.cumulative[-1])

    def lowest(self, prim: Ints) -> Ints:
        """Return the lowest ids (n,) that a ray may report for hits of primitives (n,) of these surfaces."""
        if self.moving is None:
            return self.found_as.take(prim)
        row, column = self.moving.instances.locate(prim)
        moves, stays = self.moving.of_column.take(column), np.minimum(prim, self.found_as.size - 1)
        return np.where(moves, prim - self.moving.second.take(row), self.found_as.take(stays))

    def sample(self, u_choice: Doubles, u: Floats, time: Doubles | None = None) -> SpecularPoints:
        """Draw points uniformly by area, with u_choice (n,) and u (2, n) in [0, 1), at times (n,)."""
        which = self.cumulative.searchsorted(u_choice * self.area, side="right")
        which = np.minimum(which, self.prim.size - 1)
        flat = np.flatnonzero(which < len(self.corners))
        round_ = np.flatnonzero(which >= len(self.corners))
        point, weights = np.empty((3, which.size), f4), np.zeros((2, which.size), f4)
        weights[:, flat] = uniform_triangle(u[:, flat])
        a, b, c = self.corners.take(which.take(flat), 0).transpose(1, 2, 0)
        point[:, flat] = interpolate(a, b, c, *weights[:, flat])
        ball = which.take(round_) - len(self.corners)
        directions = uniform_sphere(u[:, round_])
        point[:, round_] = self.centers.take(ball, 1) + directions * self.radii.take(ball)
        b1, b2 = weights
        found = SpecularPoints(point, self.prim.take(which), b1, b2, np.full(which.size, self.area, f4))
        if self.moving is not None and time is not None:
            self._move(self.moving, found, which, time)
        return found

    def _move(self, moving: MovingSpecular, points: SpecularPoints, which: Ints, time: Doubles) -> None:
        """Move points on primitives `which` (n,) to where these are at times (n,), in place."""
        lanes = np.flatnonzero(moving.column.take(which))
        which, time = which.take(lanes), time.take(lanes)
        column, row = moving.column.take(which), moving.row.take(which)
        matrix = moving.motion.matrices(column, time)
        own, linear = points.point.take(lanes, 1).astype(np.float64), inverse_linear(matrix)
        flat, part = np.flatnonzero(which < len(self.corners)), np.empty(lanes.size)
        corners = self.corners.take(which.take(flat), 0).astype(np.float64)
        for deforming, at in moving.motion.deformation_of(row.take(flat)):
            corners[at] = deforming.corners_at(row.take(flat.take(at)), time.take(flat.take(at)))
        a, b, c = corners.transpose(1, 2, 0)
        of_flat = lanes.take(flat)
        own[:, flat] = interpolate(a, b, c, points.b1.take(of_flat), points.b2.take(of_flat))
        sides = [linear_times(linear.take(flat, 1), side) for side in (b - a, c - a)]
        area = np.diff(self.cumulative, prepend=0)
        part[flat] = length(cross(*sides)) / (2 * area.take(which.take(flat)))
        ball = np.flatnonzero(which >= len(self.corners))
        own[:, ball] += moving.motion.ways(row.take(ball), time.take(ball))
        part[ball] = growth_of(linear.take(ball, 1))
        points.point[:, lanes] = moved_back(matrix, own)
        points.area[lanes] = (points.area.take(lanes) * part).astype(f4)


def find_specular_surfaces(
    triangles: Floats,
    once: int,
    curved: CurvedTable,
    still: int,
    material_of: Ints,
    light_of: Ints,
    materials: MaterialTable,
    counts: Sequence[int] = (),
    instances: InstanceTable | None = None,
    motion: MotionTable | None = None,
) -> SpecularSurfaces | None:
    """Return the specular surfaces of a scene; None if it has none.

    Cylinders, capsules and instances that share their arrays and stay do not count, nor do spheres that
    shine: no light sample tells whether a point on such a sphere is lit from the other side of the same
    sphere.

    Parameters
    ----------
    triangles
        (m, 3, 3), of which no instance shares the first `once`.
    curved
        The k curved primitives, whose rows follow those of the triangles.
    still
        How many of their kinds, the first ones, do not move.
    material_of, light_of
        (m + k,) material of each of these primitives, and its light, -1 for none.
    counts
        (p,) the numbers of primitives of columns of the table of instances.
    instances, motion
        Where anything moves.
    """
    delta = np.array([bsdf.specular for bsdf in materials.groups], np.bool_)[materials.group_of]
    of_row, m = delta.take(material_of), len(triangles)
    of_row[m:] &= _spheres_among(curved) & (light_of[m:] < 0)
    of_prim = np.concatenate([of_row[:once], of_row[m:], [False]])
    of_prim[once + sum(map(len, curved.kinds[:still])) :] = False
    parts = [(0, np.flatnonzero(of_prim[:once])), (0, np.flatnonzero(of_prim[once:]) + m)]
    if instances is not None and motion is not None:
        parts += _moving_parts(delta, of_row, counts, instances, motion)
    parts.sort(key=lambda part: part[1][:1].max(initial=0) >= m)  # triangles first, in their order
    column, row = (np.concatenate(each) for each in zip(*(_filled(*part) for part in parts), strict=True))
    prim = np.where(row < m, row, row - m + once)
    corners = triangles.take(row[row < m], 0)
    centers, radii = _spheres(curved, row[row >= m] - m)
    area = np.append(_areas(corners), 4 * np.pi * radii.astype(np.float64) ** 2)
    found_as, moving = np.arange(of_prim.size - 1), None
    found_as[find_quads(triangles[:once]) + 1] -= 1
    if instances is not None and motion is not None and column.any():
        prim = np.where(column > 0, row + instances.shift.take(column), prim)
        area *= motion.growth(column)
        of_column = np.isin(np.arange(instances.first.size), column[column > 0])
        moving = MovingSpecular(
            column, row, of_column, _second_halves(triangles, parts, of_row.size), instances, motion
        )
    cumulative = np.cumsum(area)
    if not cumulative.size or not cumulative[-1] > 0:
        return None
    return SpecularSurfaces(of_prim, found_as, prim, corners, centers, radii, cumulative, moving)


def _filled(column: int, rows: Ints) -> tuple[Ints, Ints]:
    """Return a column for each of some rows (n,), and the rows."""
    return np.full(rows.size, column), rows


def _moving_parts(
    delta: Bools, of_row: Bools, counts: Sequence[int], instances: InstanceTable, motion: MotionTable
) -> Iterator[tuple[int, Ints]]:
    """Yield the columns of specular shapes that move, and the rows (n,) of each.

    Parameters
    ----------
    delta, of_row
        Which materials are specular, and which rows, by the materials of meshes.
    """
    for column in np.flatnonzero(motion.mover >= 0).tolist():
        rows = np.arange(counts[column]) + (instances.first[column] - instances.shift[column])
        replaced = -1 if instances.material is None else int(instances.material[column])
        if of_row[rows].all() if replaced < 0 else delta[replaced]:
            yield column, rows


def _second_halves(triangles: Floats, parts: Sequence[tuple[int, Ints]], rows: int) -> Bools:
    """Return which rows are the second triangles of flat quadrilaterals of meshes that move, (rows,)."""
    second = np.zeros(rows, np.bool_)
    for column, of_part in parts:
        if column and of_part[0] < len(triangles):
            second[of_part[0] + find_quads(triangles.take(of_part, 0)) + 1] = True
    return second


def _areas(corners: Floats) -> Doubles:
    """Return the areas (t,) of triangles (t, 3, 3)."""
    edge, other = (corners[:, k].astype(np.float64) - corners[:, 0] for k in (1, 2))
    return np.asarray(np.linalg.norm(np.cross(edge, other), axis=1) / 2)


def _spheres(curved: CurvedTable, number: Ints) -> tuple[Floats, Floats]:
    """Return the centers (3, n) and radii (n,) of spheres, by their numbers (n,) in the table."""
    centers, radii = np.zeros((3, number.size), f4), np.zeros(number.size, f4)
    for kind, first in zip(curved.kinds, curved.first, strict=True):
        at = np.flatnonzero((number >= first) & (number < first + len(kind)))
        if isinstance(kind, SpherePrimitives) and at.size:
            centers[:, at] = kind.centers.take(number.take(at) - first, 1)
            radii[at] = kind.radii.take(number.take(at) - first)
    return centers, radii


def _spheres_among(curved: CurvedTable) -> Bools:
    """Return whether each curved primitive is a sphere, (k,)."""
    return np.concatenate(
        [np.zeros(0, np.bool_)]
        + [np.full(len(kind), isinstance(kind, SpherePrimitives)) for kind in curved.kinds]
    )

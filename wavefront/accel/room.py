"""Shadow rays within a room, most of which nothing can block.

Polygons on the hull of the scene, such as walls, have all of it on one side, so none of them is between two
points on that side. The contents of the room lie in a few boxes, one around each thing. A ray is clear if
the box around its two ends is apart from all of these; the others are tested against the contents. A thing
that is one polygon, such as a lamp, is not between two points on one side of it, nor where a ray ends on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.record import record
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4
from .brute_force import BruteForceTriangles
from .bvh import Ball, end_points, lengths, scratch, start_points
from .coplanar import connected_parts
from .primitives import CurvedPrimitives
from .triangle import PolygonPlanes, TriangleTable

FLAT = 1e-5  # of the radius: how far behind a wall there may be corners, and by how much boxes are larger
NEAR = 100  # radii of the ball: longest rays whose ends need not be moved to the ball
MOST_THINGS = 8  # each is tested against each ray


@record
class Thing:
    """A connected part of the contents of a room."""

    low: Floats  # (3,) corners of a box around it
    high: Floats
    polygon: int | None = None  # its number among all of the contents, if it is one polygon


@record
class Room:
    """The walls of a scene, and what is within them."""

    walls: int  # number of walls
    planes: PolygonPlanes  # of the walls, positive within, and then of things that are one polygon
    contents: BruteForceTriangles  # all other triangles
    things: list[Thing]  # these in connected parts, and curved primitives
    ball: Ball

    @classmethod
    def of(
        cls,
        triangles: BruteForceTriangles,
        table: TriangleTable,
        curved: Sequence[CurvedPrimitives],
        ball: Ball,
    ) -> Room | None:
        """Find the walls among all triangles of a scene; None if there are none."""
        kinds = triangles.polygons
        points = np.concatenate([kind.corners.reshape(-1, 3) for kind in kinds] or [np.zeros((0, 3), f4)])
        sides = [side_of(points, table.plane.take(kind.prim, 1), FLAT * ball.radius) for kind in kinds]
        if not any(side.any() for side in sides):
            return None
        side = np.concatenate(sides)
        plane, deviation = (np.concatenate(parts, -1) for parts in zip(*triangles.planes, strict=True))
        contents = triangles.only([each == 0 for each in sides])
        things = _things(contents, curved, ball)
        walls, others = np.flatnonzero(side), np.flatnonzero(side == 0)
        alone = [others[each.polygon] for each in things if each.polygon is not None]
        rows = np.array([*walls, *alone], np.intp)
        sign = np.where(side, side, 1.0)
        planes = PolygonPlanes((plane * sign).take(rows, 1), deviation.take(rows))
        return cls(walls.size, planes, contents, things, ball)

    def unclear(self, origin: Floats, direction: Floats, distance: Floats) -> Ints | None:
        """Return which of the shadow rays (3, n) may be blocked; None if some are not within the walls.

        Points on two walls next to a corner are on both. No wall is between two such points.
        """
        start, far = start_points(origin, self.ball)
        end = None if far else self._ends(start, direction, distance)
        if end is None:
            return None
        extents = [(points[:3].min(1), points[:3].max(1)) for points in (start, end)]
        rows = self.planes.rows(*(np.maximum(-low, high) for low, high in extents))
        if not all(map(self._within, rows, (start, end), extents)):
            return None
        low = np.minimum(start[:3], end[:3], out=scratch("low", (3, distance.size)))
        high = np.maximum(start[:3], end[:3], out=scratch("high", (3, distance.size)))
        sides = [each[self.walls :] @ points for each, points in zip(rows, (start, end), strict=True)]
        alone = zip(*sides, strict=True)
        clear = np.ones(distance.size, np.bool_)
        for thing in self.things:
            apart = _apart(low, high, thing)
            if thing.polygon is not None:
                at_start, at_end = next(alone)
                apart |= (at_start > 1) & (at_end >= -1)
                apart |= (at_start < -1) & (at_end <= 1)
            clear &= apart
        return np.flatnonzero(~clear)

    def _ends(self, start: Floats, direction: Floats, distance: Floats) -> Floats | None:
        """Return what `end_points` does, faster where all are near enough; None if not all are finite."""
        if not distance.max(initial=0) < NEAR * self.ball.radius:
            return end_points(start, direction, lengths(direction), distance, self.ball)
        end = scratch("end", start.shape)
        np.multiply(direction, distance, out=end[:3])
        end[:3] += start[:3]
        end[3] = 1
        return end

    def _within(self, rows: Floats, points: Floats, extent: tuple[Floats, Floats]) -> bool:
        """Return whether points (4, n), between low and high coordinates (3,), are within the walls."""
        walls = rows[: self.walls]
        least = np.minimum(*(walls[:, :3] * each for each in extent)).sum(1) + walls[:, 3]
        if (least >= -1).all():
            return True
        sides = np.matmul(walls, points, out=scratch("side", (len(walls), points.shape[1])))
        return bool(sides.min() >= -1)


def side_of(points: Floats, planes: Doubles, margin: float) -> Doubles:
    """Return on which side of planes (4, m), normal and offset, points (n, 3) are: 1, -1, or 0 for both.

    Points less than `margin` away are on neither side.
    """
    distance = (points @ planes[:3] - planes[3]) / np.sqrt(np.square(planes[:3]).sum(0))
    above, below = distance.max(0, initial=0) > margin, distance.min(0, initial=0) < -margin
    return above.astype(float) - below


def _things(contents: BruteForceTriangles, curved: Sequence[CurvedPrimitives], ball: Ball) -> list[Thing]:
    """Return the parts of what is in a room, relative to the center of the ball; one if there are many."""
    things = _connected([each for kind in contents.polygons for each in kind.corners.transpose(1, 0, 2)])
    things += [Thing(low.min(1), high.max(1)) for low, high in (kind.bounds for kind in curved if len(kind))]
    if len(things) > MOST_THINGS:
        things = [_around(things)]
    margin = f4(FLAT * ball.radius)
    return [
        Thing(each.low - ball.center - margin, each.high - ball.center + margin, each.polygon)
        for each in things
    ]


def _connected(polygons: list[Floats]) -> list[Thing]:
    """Return the connected parts of polygons (corners, 3), which share corners."""
    if not polygons:
        return []
    owner = np.repeat(np.arange(len(polygons)), [len(polygon) for polygon in polygons])
    _, corner = np.unique(np.concatenate(polygons), axis=0, return_inverse=True)
    order = np.argsort(corner.reshape(-1), kind="stable")
    same = np.diff(corner.reshape(-1).take(order)) == 0
    part = connected_parts(len(polygons), owner.take(order[:-1][same]), owner.take(order[1:][same]))
    singles = [Thing(polygon.min(0), polygon.max(0), number) for number, polygon in enumerate(polygons)]
    return [_around([singles[k] for k in np.flatnonzero(part == one)]) for one in sorted(set(part.tolist()))]


def _around(things: list[Thing]) -> Thing:
    """Return some things as one."""
    if len(things) == 1:
        return things[0]
    low = np.minimum.reduce([thing.low for thing in things])
    return Thing(low, np.maximum.reduce([thing.high for thing in things]))


def _apart(low: Floats, high: Floats, thing: Thing) -> Bools:
    """Return which boxes, with corners (3, n), are certainly apart from a thing; NaN is not."""
    apart = low[0] > thing.high[0]
    apart |= high[0] < thing.low[0]
    for axis in (1, 2):
        apart |= low[axis] > thing.high[axis]
        apart |= high[axis] < thing.low[axis]
    return apart

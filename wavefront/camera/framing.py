"""The place of a camera of a given direction whose picture shapes fill.

Objects are spheres, mostly points: a picture contains what their convex hull contains.
"""

from __future__ import annotations

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles

FILL = 0.85  # of the picture's width or height, whichever objects fill first
STEPS = 8  # of Newton's method; it ends where no other ball touches the edge, mostly after three
LEVELS = 256  # of the profile of objects that turn
SIDES = 32  # of the polygons about its circles

Balls = tuple[Doubles, Doubles]  # centers (n, 3) and radii (n,)


def fitting_offset(balls: Balls, axes: Doubles, tangents: tuple[float, float]) -> Doubles:
    """Return the place (3,), from the origin along its axes, of a pinhole camera that sees all balls.

    All that touches an edge of the picture lies in a plane through the camera, whose place follows from the
    farthest ball along the plane's normal. The two planes of the width and those of the height each give a
    least distance; the larger one counts, and the balls are centered along the other axis.

    Parameters
    ----------
    balls
        Centers (n, 3) and radii (n,) of the balls that are seen.
    axes
        (3, 3) columns: right, up and backward.
    tangents
        Tangents of half the angles across and up that the balls may fill.
    """
    centers, radii = balls
    rows = np.ascontiguousarray(centers.T)
    across, up, depth = (rows[0] * x + rows[1] * y + rows[2] * z for x, y, z in axes.T)
    pairs = [(_Side(row, depth, radii), _Side(-row, depth, radii)) for row in (across, up)]
    least = [(a.reach(t) + b.reach(t)) / (2 * t) for (a, b), t in zip(pairs, tangents, strict=True)]
    distance = max(float((depth + radii).max()), *least)
    middles = [_middle(a, b, t, distance) for (a, b), t in zip(pairs, tangents, strict=True)]
    return np.array([*middles, distance])


class _Side:
    """The balls seen from one edge of the picture."""

    def __init__(self, offset: Doubles, depth: Doubles, radii: Doubles) -> None:
        self._offset, self._depth, self._radii = offset, depth, radii

    def touching(self, tangent: float) -> tuple[float, float]:
        """Return offset and depth of the point that the plane of an edge touches first."""
        slant = np.sqrt(1 + tangent * tangent)
        farthest = int((self._offset + tangent * self._depth + slant * self._radii).argmax())
        reach = self._radii[farthest] / slant
        return float(self._offset[farthest] + reach), float(self._depth[farthest] + tangent * reach)

    def reach(self, tangent: float) -> float:
        """Return offset + tangent · depth of that point."""
        offset, depth = self.touching(tangent)
        return offset + tangent * depth


def _middle(side: _Side, other: _Side, tangent: float, distance: float) -> float:
    """Return the offset from which balls reach equally far to both sides, at a distance."""
    narrow = 0.0
    for _ in range(STEPS):  # for the tangent at which both planes meet at that distance
        (a, depth_a), (b, depth_b) = side.touching(narrow), other.touching(narrow)
        room = distance - (depth_a + depth_b) / 2
        if not (a + b > 0 and room > 0):
            break
        narrow = min(tangent, (a + b) / 2 / room)
    middle = (side.reach(narrow) - other.reach(narrow)) / 2
    least, most = side.reach(tangent) - tangent * distance, tangent * distance - other.reach(tangent)
    return min(max(middle, least), max(most, least))


def turned_balls(balls: Balls, axes: Doubles) -> Balls:
    """Return balls that hold what others cover in a whole turn about the line of the second axis.

    Parameters
    ----------
    balls
        Centers relative to a point of the line, and radii.
    axes
        (3, 3) columns, at right angles; the second is the line's direction.
    """
    centers, radii = balls
    rows = np.ascontiguousarray(centers.T)
    x, height, z = (rows[0] * a + rows[1] * b + rows[2] * c for a, b, c in axes.T)
    largest = max(float(np.abs(rows).max()), np.finfo(float).tiny)
    ring = largest * np.sqrt((x / largest) ** 2 + (z / largest) ** 2) + radii
    low, high = height - radii, height + radii
    span = float(high.max() - low.min()) or 1.0
    level = np.minimum((LEVELS * ((height - low.min()) / span)).astype(np.intp), LEVELS - 1)
    widest, lowest, highest = np.zeros(LEVELS), np.full(LEVELS, np.inf), np.full(LEVELS, -np.inf)
    np.maximum.at(widest, level, ring)
    np.minimum.at(lowest, level, low)
    np.maximum.at(highest, level, high)
    used = np.flatnonzero(lowest <= highest)
    sin, cos = sin_cos_turns(np.arange(SIDES) / SIDES)
    _, inner = sin_cos_turns(np.float64(0.5 / SIDES))
    circles = np.repeat(widest[used] / inner, 2)[:, None]
    levels = np.stack([lowest[used], highest[used]], 1).reshape(-1, 1)
    local = np.stack(np.broadcast_arrays(circles * sin, levels, circles * cos)).reshape(3, -1)
    points = np.stack([local[0] * x + local[1] * y + local[2] * z for x, y, z in axes], 1)
    return points, np.zeros(len(points))

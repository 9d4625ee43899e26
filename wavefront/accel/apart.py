"""A few triangles that move apart from the many that stand still, whose tree is kept from frame to frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..arrays.vec import ALL, Bools, Floats, Ints, Lanes, take
from .balls import BoundingBalls
from .base import Accelerator, Geometry, Intersections
from .coplanar import find_overlaps
from .duplicates import first_of_equals
from .triangle import has_area, triangle_table

LEAST = 1 << 17  # triangles that stand still; a second search costs 2 % of a render, their tree 0.2 s
SHARE = 4  # and as many for each one that moves
ROOM = 2.0**-20  # margin of the box of those that move, relative to its coordinates


class ApartAccelerator:
    """Asks one accelerator, and another one where rays come near to its part of the primitives.

    Parameters
    ----------
    most, rest
        The accelerators, and the primitives (k,) of each, ascending.
    ball
        Around the second part; None if there is none.
    """

    def __init__(
        self, most: tuple[Accelerator, Ints], rest: tuple[Accelerator, Ints], ball: BoundingBalls | None
    ) -> None:
        (self._most, most_prims), (self._rest, rest_prims) = most, rest
        self.name, self._ball = self._most.name, ball
        count = most_prims.size + rest_prims.size
        self._prims = np.append(most_prims, -1), np.append(rest_prims, -1)
        self._numbers = tuple(np.full(count + 1, -1) for _ in self._prims)  # in its part; -1 if elsewhere
        for number, prims in zip(self._numbers, (most_prims, rest_prims), strict=True):
            number[prims] = np.arange(prims.size)

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0; at equal t the lowest primitive id."""
        hits = self._most.closest(origin, direction, self._numbers[0].take(exclude_prim))
        hits.prim = self._prims[0].take(hits.prim)
        lanes = self._near(origin, direction)
        excluded = self._numbers[1].take(take(exclude_prim, lanes))
        others = self._rest.closest(take(origin, lanes), take(direction, lanes), excluded)
        others.prim = self._prims[1].take(others.prim)
        t, prim = take(hits.t, lanes), take(hits.prim, lanes)
        closer = np.flatnonzero((others.t < t) | ((others.t == t) & (others.prim < prim)))
        nearer = closer if isinstance(lanes, slice) else lanes.take(closer)
        hits.t[nearer], hits.prim[nearer] = others.t.take(closer), others.prim.take(closer)
        hits.b1[nearer], hits.b2[nearer] = others.b1.take(closer), others.b2.take(closer)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        blocked = self._most.occluded(origin, direction, distance, self._numbers[0].take(exclude_prim))
        lanes = self._near(origin, direction)
        rays = take(origin, lanes), take(direction, lanes), take(distance, lanes)
        blocked[lanes] |= self._rest.occluded(*rays, self._numbers[1].take(take(exclude_prim, lanes)))
        return blocked

    def _near(self, origin: Floats, direction: Floats) -> Lanes:
        """Return the lanes of rays (3, n) that may hit the second part."""
        if self._ball is None:
            return ALL
        return self._ball.near(origin, direction, np.zeros(0, np.intp))


def build_apart(
    make: Callable[[Geometry], Accelerator], moves: Bools | None, geometry: Geometry
) -> Accelerator:
    """Build an accelerator; where few triangles move beside many others, these have one of their own.

    `moves` says which triangles do, of all that there are; the last ones may be missing in the geometry.
    """
    still = None if moves is None else still_triangles(geometry.triangles, moves[: len(geometry.triangles)])
    if still is None:
        return make(geometry)
    most, rest = _part(geometry, still, curved=False), _part(geometry, ~still, curved=True)
    others = np.append(np.flatnonzero(~still), np.arange(still.size, geometry.count))
    ball = None if any(map(len, rest.curved)) else BoundingBalls.around(rest.triangles)
    return ApartAccelerator((make(most), np.flatnonzero(still)), (make(rest), others), ball)


def _part(geometry: Geometry, chosen: Bools, curved: bool) -> Geometry:
    """Return some of the triangles of a geometry, and perhaps its curved primitives."""
    same = geometry.interchangeable
    if same is not None:
        same = (same & np.append(chosen[1:], False)).compress(chosen)
    return replace(
        geometry,
        triangles=geometry.triangles.compress(chosen, 0),
        curved=geometry.curved if curved else (),
        interchangeable=same,
    )


def still_triangles(triangles: Floats, moves: Bools) -> Bools | None:
    """Return which of triangles (m, 3, 3) stand still and overlap none of the others in a plane, (m,).

    None if they are not many more than the others, or one has the same corners as one that moves.
    """
    apart, low, high = moves, triangles.min(1), triangles.max(1)
    while are_few(apart):
        near = _near(low, high, apart)
        grown = _with_overlapping(triangles.take(near, 0), apart.take(near))
        if grown is None:
            return None
        if (grown == apart.take(near)).all():
            return ~apart
        apart = apart.copy()
        apart[near] = grown
    return None


def are_few(moves: Bools) -> bool:
    """Return whether few triangles move beside so many others that these should have a tree of their own."""
    count = int(moves.sum())
    return 0 < SHARE * count <= moves.size - count and are_many(moves.size - count)


def are_many(triangles: int) -> bool:
    """Return whether a tree of so many triangles is worth to be kept."""
    return triangles >= LEAST


def _near(low: Floats, high: Floats, apart: Bools) -> Ints:
    """Return the triangles, boxes (m, 3), that meet the box of those apart."""
    lowest, highest = low.compress(apart, 0).min(0), high.compress(apart, 0).max(0)
    room = ROOM * np.maximum(np.abs(lowest), np.abs(highest))
    return np.flatnonzero(((low <= highest + room) & (high >= lowest - room)).all(1))


def _with_overlapping(triangles: Floats, apart: Bools) -> Bools | None:
    """Return those triangles (m, 3, 3) apart, and all that overlap them in a plane, (m,).

    None if one of those apart has the same corners as one of the others.
    """
    first = first_of_equals(triangles)
    for part in (apart, ~apart):
        if (first.compress(part) != first_of_equals(triangles.compress(part, 0))).any():
            return None
    ids = np.flatnonzero(first & has_area(triangles))
    overlaps = find_overlaps(triangles, ids, triangle_table(triangles, False).plane)
    if overlaps is None:
        return apart
    joined = np.zeros(overlaps.face.size, np.bool_)
    joined[overlaps.group.compress(apart.take(overlaps.face))] = True
    grown = apart.copy()
    grown[overlaps.face.compress(joined.take(overlaps.group))] = True
    return grown

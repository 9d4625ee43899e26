"""Few triangles, without a tree: all rays against all, as one matrix product.

Pairs of triangles that make a quadrilateral are tested as one: four edges and one plane for two times
three and two. Most rays need no list of candidates. One that meets a single polygon, and surely, gets its
distance in turn with its neighbors; a shadow ray that surely meets a polygon between its ends is
blocked, and one that surely meets none is free. The others are decided pair by pair.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..record import record
from ..vec import Bools, Floats, Ints, f4
from . import triangle
from .base import Geometry
from .bvh import Ball, RayBatch, flat_true, scratch
from .exact import TriangleDecisions
from .hits import AnyHit, Candidates, HitRecord
from .quads import are_parallelograms, corners, diagonal_planes, find_quads, planes
from .triangle import Sides, TriangleTable, one_sign, pairs_of_one_sign

CHUNK = 1 << 19  # elements of one product
Bytes = NDArray[np.uint8]


@record
class Polygons:
    """Polygons of one kind, as matrices."""

    rows: Floats  # (edges * m, 6) see triangle.edge_rows
    at: slice  # their places among all polygons
    parallelograms: bool

    def test(self, line: Floats, side: Floats | None, out: Floats) -> None:
        """Test lines (6, k): above 1 in `out` (m, k) where they surely pass inside, not below -1 if they do.

        Sides (m, k) of points, where there are any, are multiplied by an edge function.
        """
        m, k = out.shape
        edges = np.matmul(self.rows, line, out=scratch("product", (len(self.rows), k))).reshape(1, -1, m, k)
        if side is not None:
            side *= edges[0, 1]
        (pairs_of_one_sign if self.parallelograms else one_sign)(edges, out[None])


class BruteForceTriangles:
    """Those triangles of `geometry` that have the `ids` (k,).

    Quadrilaterals get one plane in `table`: theirs differ by the rounding of their corners.
    """

    tree = None

    def __init__(self, table: TriangleTable, geometry: Geometry, ids: Ints, ball: Ball) -> None:
        self._table = table
        triangles = geometry.triangles
        primitives = len(triangles) + geometry.radii.size
        first = find_quads(triangles)
        first = first[np.isin(first, ids) & np.isin(first + 1, ids)]
        single = ids[~np.isin(ids, [first, first + 1])]
        quads = corners(triangles, first)
        table.plane[:, first] = table.plane[:, first + 1] = planes(quads)
        # The last column of these is for no primitive, -1.
        self._partner = np.full(primitives + 1, -1)
        self._partner[first] = first + 1
        same = geometry.interchangeable
        differ = np.ones(first.size, np.bool_) if same is None else ~same.take(first)
        self._diagonal: Floats | None = None
        if differ.any():
            self._diagonal = np.zeros((4, primitives + 1), f4)
            self._diagonal[:, first[differ]] = diagonal_planes(quads[:, differ])
        parallel = are_parallelograms(quads, ball.radius)
        self._gather(
            [
                (quads[:, parallel], first[parallel]),
                (quads[:, ~parallel], first[~parallel]),
                (triangles.take(single, 0).transpose(1, 0, 2), single),
            ],
            ball,
        )

    def _gather(self, kinds: list[tuple[Floats, Ints]], ball: Ball) -> None:
        """Make matrices of parallelograms, other quadrilaterals and triangles: corners, triangle ids."""
        self._polygons, begin = [], 0
        sides, ahead = [], []
        for number, (corner, prim) in enumerate(kinds):
            if prim.size:
                rows = triangle.edge_rows(corner, ball.center, ball.radius).reshape(-1, 6)
                self._polygons.append(Polygons(rows, slice(begin, begin + prim.size), number == 0))
                ahead.append(triangle.side_rows(corner, ball.center, ball.radius))
                sides.append(triangle.sides(self._table, prim, corner, ball.center))
                begin += prim.size
        self._count = begin
        self._rows = sum(len(polygons.rows) for polygons in self._polygons)
        self._number = np.arange(1, begin + 1, dtype=np.uint8)[:, None]
        # Of these, the first is for no polygon.
        self._prim = np.concatenate([[-1], *(prim for _, prim in kinds)])
        self._named = np.maximum(self._prim, 0)  # distances to none are NaN
        self._plane = np.full((4, begin + 1), np.nan)
        self._plane[:, 1:] = self._table.plane.take(self._prim[1:], 1)
        self._slot = np.zeros(self._partner.size, np.intp)
        self._slot[self._prim] = np.arange(begin + 1)
        half = np.flatnonzero(self._partner.take(self._prim) >= 0)
        self._slot[self._partner.take(self._prim.take(half))] = half
        if begin:
            self._ahead = np.concatenate(ahead)
            self._sides = Sides(*(np.concatenate(parts, -1) for parts in zip(*sides, strict=True)))

    def search(self, lanes: RayBatch, found: HitRecord) -> None:
        """Give all hits that may matter to `found`; those of a quadrilateral as hits of its first half."""
        if not self._count:
            return
        decisions = TriangleDecisions(self._table, lanes, found, self._partner)
        more: list[tuple[Ints, Bytes]] = []
        for part, exclude_prim in self._parts(lanes):
            value, met = self._filter(lanes, part, exclude_prim)
            sure = np.greater(value, 1, out=scratch("sure", met.shape, np.bool_))
            sure &= met
            hits = _sum(sure)
            self._doubt(met, sure, np.flatnonzero(hits != _sum(met)), decisions, part.start)
            number = sure.view(np.uint8)
            number *= self._number
            highest = np.maximum.reduce(number, 0).astype(np.intp)
            t = triangle.plane_distance(self._plane, highest, lanes.origin[:, part], lanes.direction[:, part])
            found.add_each(part, self._named.take(highest), t)
            several = np.flatnonzero(hits > 1)
            number = number.take(several, 1)
            number[highest.take(several) - 1, np.arange(several.size)] = 0
            more.append((several + part.start, number))
        self._decide_more(more, lanes, found)
        decisions.finish()

    def _doubt(
        self, met: Bools, sure: Bools, lane: Ints, decisions: TriangleDecisions, first_lane: int
    ) -> None:
        """Leave it to `decisions` whether some lanes (c,) hit what of (m, k) they have met, not surely."""
        if lane.size:
            unsure = met.take(lane, 1) > sure.take(lane, 1)
            slot, place = np.divmod(flat_true(unsure), lane.size)
            decisions.doubt(self._prim.take(slot + 1), lane.take(place) + first_lane)

    def _decide_more(self, more: list[tuple[Ints, Bytes]], lanes: RayBatch, found: HitRecord) -> None:
        """Decide how far other sure hits are: lanes (c,), and numbers (m, c) of polygons, 0 for none."""
        lane = np.concatenate([lane for lane, _ in more])
        number = np.concatenate([number for _, number in more], 1)
        origin, direction = lanes.origin.take(lane, 1), lanes.direction.take(lane, 1)
        while lane.size:
            chosen = np.maximum.reduce(number, 0).astype(np.intp)
            left = np.flatnonzero(chosen)
            if left.size < lane.size:
                lane, number, chosen = lane.take(left), number.take(left, 1), chosen.take(left)
                origin, direction = origin.take(left, 1), direction.take(left, 1)
            t = triangle.plane_distance(self._plane, chosen, origin, direction)
            found.add(lane, self._prim.take(chosen), t)
            number[chosen - 1, np.arange(lane.size)] = 0

    def block(self, lanes: RayBatch, found: AnyHit) -> None:
        """Tell `found` which lanes are blocked."""
        if lanes.start is None or lanes.end is None or not self._count:
            return self.search(lanes, found)
        decisions = TriangleDecisions(self._table, lanes, found, self._partner)
        unsure = Candidates(decisions.decide)
        start_rows, end_rows = self._sides.rows(lanes.start, lanes.end)
        for part, exclude_prim in self._parts(lanes):
            value = self._lines(lanes, part, None)
            m, k = value.shape
            start = np.matmul(start_rows, lanes.start[:, part], out=scratch("side", (m, k)))
            end = np.matmul(end_rows, lanes.end[:, part], out=scratch("end side", (m, k)))
            padded = scratch("least", (m + 1, k))  # the first row: of no polygon
            # Above 1: the line surely passes inside, and the ends are surely on different sides.
            least = np.maximum(start, end, out=padded[1:])
            np.minimum(least, value, out=least)
            lower = np.minimum(start, end, out=start)
            np.minimum(least, np.negative(lower, out=lower), out=least)
            if exclude_prim is not None:
                padded.reshape(-1)[exclude_prim] = -2
            most = np.maximum.reduce(least, 0)
            blocked = most > 1
            found.blocked[part] |= blocked
            rest = np.flatnonzero((most >= -1) > blocked)
            slot, place = np.divmod(flat_true(least.take(rest, 1) >= -1), max(rest.size, 1))
            lane = rest.take(place)
            unsure.add(self._prim.take(slot + 1), lane + part.start, value.reshape(-1).take(slot * k + lane))
        unsure.flush()
        decisions.finish()
        return None

    def _parts(self, lanes: RayBatch) -> Iterator[tuple[slice, Ints | None]]:
        """Yield equal parts of the lanes, and where in (m + 1, k) the polygons are that they leave, flat."""
        n = lanes.count
        left = self._slot.take(lanes.exclude_prim) if lanes.exclude_prim.max(initial=-1) >= 0 else None
        parts = -(-n * self._rows // CHUNK)
        step = -(-n // parts)
        step += -step % 16
        for at in range(0, n, step):
            part = slice(at, min(at + step, n))
            if left is None:
                yield part, None
                continue
            k = part.stop - at
            flat = left[part] * k
            flat += np.arange(k)
            yield part, flat

    def _filter(self, lanes: RayBatch, part: slice, exclude_prim: Ints | None) -> tuple[Floats, Bools]:
        """Test lines against all polygons -> how sure (m, k), and which ones the rays may meet (m, k)."""
        if lanes.start is None:
            value = least = self._lines(lanes, part, None)
        else:
            points = lanes.start[:, part]
            side = np.matmul(self._ahead, points, out=scratch("side", (self._count, points.shape[1])))
            value = self._lines(lanes, part, side)
            least = np.minimum(value, side, out=side)
        met = scratch("met", (self._count + 1, value.shape[1]), np.bool_)  # the first row: of no polygon
        np.greater_equal(least, -1, out=met[1:])
        if exclude_prim is not None:
            met.reshape(-1)[exclude_prim] = False
        return value, met[1:]

    def _lines(self, lanes: RayBatch, part: slice, side: Floats | None) -> Floats:
        line = lanes.line[:, part]
        value = scratch("value", (self._count, line.shape[1]))
        for polygons in self._polygons:
            polygons.test(line, None if side is None else side[polygons.at], value[polygons.at])
        return value

    def halves(self, prim: Ints, lanes: RayBatch, t: Floats) -> Ints:
        """Tell which half of a quadrilateral was hit at t (n,): primitives (n,), -1 for a miss.

        Of halves that look alike the first is as good.
        """
        if self._diagonal is None:
            return prim
        px, py, pz = lanes.origin + lanes.direction * t
        x, y, z, offset = (row.take(prim) for row in self._diagonal)
        return prim + (x * px + y * py + z * pz + offset > 0)


def _sum(bytes_: NDArray[Any]) -> Bytes:
    """Add up bytes (m, k) of each column."""
    return np.add.reduce(bytes_.view(np.uint8), 0, dtype=np.uint8)

"""Tests of all rays against all triangles, for scenes of few triangles: one matrix product without a tree.

Two triangles that form a quadrilateral are tested as one polygon, by four edges and one plane. Most rays
need no list of candidates: a ray that certainly hits exactly one polygon gets its distance in a vectorized
step, and a shadow ray is decided if it certainly hits a polygon between its ends, or certainly hits none.
All other pairs are tested one by one (exact.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Bools, Bytes, Floats, Ints, f4
from . import triangle
from .base import Geometry
from .bvh import Ball, RayBatch, flat_true, scratch
from .coplanar import share_planes
from .exact import TriangleTests
from .hits import AnyHit, Candidates, HitAccumulator
from .quads import are_parallelograms, corners, diagonal_planes, find_quads, planes
from .triangle import PolygonPlanes, TriangleTable, least_adjacent_product, least_opposite_product

CHUNK = 1 << 19  # elements of one product


@soa
class Polygons:
    """Flat polygons of one kind."""

    corners: Floats  # (e, m, 3)
    prim: Ints  # (m,) triangles, of quadrilaterals the first one
    parallelograms: bool


@soa
class EdgeMatrix:
    """Polygons of one kind as a matrix."""

    rows: Floats  # (edges * m, 6) Plücker rows of the edges, see triangle.edge_rows
    at: slice  # their range among all polygons
    parallelograms: bool

    def test(self, line: Floats, side: Floats | None, out: Floats) -> None:
        """Test lines (6, k) against the polygons.

        `out` (m, k) becomes above 1 where a line certainly passes inside, and below -1 only where it does
        not. `side` (m, k), if given, is multiplied by an edge function in place, for `triangle.side_rows`.
        """
        m, k = out.shape
        edges = np.matmul(self.rows, line, out=scratch("product", (len(self.rows), k))).reshape(1, -1, m, k)
        if side is not None:
            side *= edges[0, 1]
        (least_opposite_product if self.parallelograms else least_adjacent_product)(edges, out[None])


class BruteForceTriangles:
    """Some of the triangles of a table, as polygons.

    Parameters
    ----------
    table
        Of all triangles.
    polygons
        Those to test, by kind: triangles and quadrilaterals.
    partner
        (primitives + 1,) second triangle of the quadrilateral whose first triangle this is, -1 for none.
    diagonal
        (4, primitives + 1) planes through the diagonals of quadrilaterals whose triangles differ; None if
        there are none.
    ball
        Around the scene.
    """

    tree = None  # there is none: see `PrimitiveTree`

    def __init__(
        self,
        table: TriangleTable,
        polygons: list[Polygons],
        partner: Ints,
        diagonal: Floats | None,
        ball: Ball,
    ) -> None:
        polygons = [kind for kind in polygons if kind.prim.size]
        self._table, self._partner, self._diagonal = table, partner, diagonal
        self._matrices, begin = [], 0
        plane_parts, side_rows = [], []
        away = table.deviation
        for kind in polygons:
            corner, prim = kind.corners, kind.prim
            deviation = np.zeros(prim.size) if away is None else away.take(prim)
            rows = triangle.edge_rows(corner, ball.center, ball.radius).reshape(-1, 6)
            self._matrices.append(EdgeMatrix(rows, slice(begin, begin + prim.size), kind.parallelograms))
            side_rows.append(triangle.side_rows(corner, ball.center, ball.radius, deviation))
            plane_parts.append(triangle.polygon_planes(table, prim, corner, ball.center, deviation))
            begin += prim.size
        self._count = begin
        self._rows = sum(len(matrix.rows) for matrix in self._matrices)
        self._number = np.arange(1, begin + 1, dtype=np.uint8)[:, None]  # there are at most `SMALL` triangles
        # Index 0 is for no polygon.
        self._prim = np.concatenate([[-1], *(kind.prim for kind in polygons)])
        self._prim_or_first = np.maximum(self._prim, 0)  # index 0 has t = NaN, a miss
        self._plane = np.full((4, begin + 1), np.nan)
        self._plane[:, 1:] = table.plane.take(self._prim[1:], 1)
        self._slot = np.zeros(partner.size, np.intp)
        self._slot[self._prim] = np.arange(begin + 1)
        half = np.flatnonzero(partner.take(self._prim) >= 0)
        self._slot[partner.take(self._prim.take(half))] = half
        if begin:
            self._side_rows = np.concatenate(side_rows)
            self._planes = PolygonPlanes(
                *(np.concatenate(parts, -1) for parts in zip(*plane_parts, strict=True))
            )

    @classmethod
    def of(cls, table: TriangleTable, geometry: Geometry, ids: Ints, ball: Ball) -> Self:
        """Find the quadrilaterals among the triangles `ids` (k,) of `geometry`.

        The two triangles of each get one common plane in `table`.
        """
        triangles = geometry.triangles
        primitives = geometry.count
        first = find_quads(triangles)
        first = first[np.isin(first, ids) & np.isin(first + 1, ids)]
        single = ids[~np.isin(ids, [first, first + 1])]
        quads = corners(triangles, first)
        table.plane[:, first] = table.plane[:, first + 1] = planes(quads)
        share_planes(table, triangles, ids, first)
        # Index -1, the last one, is for misses.
        partner = np.full(primitives + 1, -1)
        partner[first] = first + 1
        same = geometry.interchangeable
        differ = np.ones(first.size, np.bool_) if same is None else ~same.take(first)
        diagonal: Floats | None = None
        if differ.any():
            diagonal = np.zeros((4, primitives + 1), f4)
            diagonal[:, first[differ]] = diagonal_planes(quads[:, differ])
        parallel = are_parallelograms(quads, ball.radius)
        polygons = [
            Polygons(quads[:, parallel], first[parallel], True),
            Polygons(quads[:, ~parallel], first[~parallel], False),
            Polygons(triangles.take(single, 0).transpose(1, 0, 2), single, False),
        ]
        return cls(table, polygons, partner, diagonal, ball)

    def find_hits(self, batch: RayBatch, accumulator: HitAccumulator) -> None:
        """Add all hits to `accumulator`; those of a quadrilateral as hits of its first triangle."""
        if not self._count:
            return
        tests = TriangleTests(self._table, batch, accumulator, self._partner)
        further: list[tuple[Ints, Bytes]] = []
        for lanes, exclude_prim in self._lane_slices(batch):
            value, met = self._filter(batch, lanes, exclude_prim)
            certain = np.greater(value, 1, out=scratch("certain", met.shape, np.bool_))
            certain &= met
            hits = _sum(certain)
            self._add_uncertain(met, certain, np.flatnonzero(hits != _sum(met)), tests, lanes.start)
            number = certain.view(np.uint8)
            number *= self._number
            highest = np.maximum.reduce(number, 0).astype(np.intp)
            t = triangle.plane_distance(
                self._plane, highest, batch.origin[:, lanes], batch.direction[:, lanes]
            )
            accumulator.add_slice(lanes, self._prim_or_first.take(highest), t)
            several = np.flatnonzero(hits > 1)
            number = number.take(several, 1)
            number[highest.take(several) - 1, np.arange(several.size)] = 0
            further.append((several + lanes.start, number))
        self._add_further_hits(further, batch, accumulator)
        tests.finish()

    def _add_uncertain(
        self, met: Bools, certain: Bools, lane: Ints, tests: TriangleTests, first_lane: int
    ) -> None:
        """Pass uncertain pairs of lanes (c,) to `tests`, by masks (m, k) of possible and certain hits."""
        if lane.size:
            uncertain = met.take(lane, 1) > certain.take(lane, 1)
            slot, place = np.divmod(flat_true(uncertain), lane.size)
            tests.add_uncertain(self._prim.take(slot + 1), lane.take(place) + first_lane)

    def _add_further_hits(
        self, further: list[tuple[Ints, Bytes]], batch: RayBatch, accumulator: HitAccumulator
    ) -> None:
        """Add the remaining certain hits: lanes (c,), and numbers (m, c) of their polygons, 0 for none."""
        lane = np.concatenate([lane for lane, _ in further])
        number = np.concatenate([number for _, number in further], 1)
        origin, direction = batch.origin.take(lane, 1), batch.direction.take(lane, 1)
        while lane.size:
            chosen = np.maximum.reduce(number, 0).astype(np.intp)
            left = np.flatnonzero(chosen)
            if left.size < lane.size:
                lane, number, chosen = lane.take(left), number.take(left, 1), chosen.take(left)
                origin, direction = origin.take(left, 1), direction.take(left, 1)
            t = triangle.plane_distance(self._plane, chosen, origin, direction)
            accumulator.add(lane, self._prim.take(chosen), t)
            number[chosen - 1, np.arange(lane.size)] = 0

    def find_blocked(self, batch: RayBatch, accumulator: AnyHit) -> None:
        """Mark the blocked lanes in `accumulator`."""
        if batch.start is None or batch.end is None or not self._count:
            return self.find_hits(batch, accumulator)
        tests = TriangleTests(self._table, batch, accumulator, self._partner)
        uncertain = Candidates(tests.add)
        start_rows, end_rows = self._planes.rows(
            *(np.maximum(points[:3].max(1), -points[:3].min(1)) for points in (batch.start, batch.end))
        )
        for lanes, exclude_prim in self._lane_slices(batch):
            value = self._lines(batch, lanes, None)
            m, k = value.shape
            start = np.matmul(start_rows, batch.start[:, lanes], out=scratch("side", (m, k)))
            end = np.matmul(end_rows, batch.end[:, lanes], out=scratch("end side", (m, k)))
            padded = scratch("least", (m + 1, k))  # the first row is for no polygon
            # Above 1: the line certainly passes inside, and the ends are certainly on different sides.
            least = np.maximum(start, end, out=padded[1:])
            np.minimum(least, value, out=least)
            lower = np.minimum(start, end, out=start)
            np.minimum(least, np.negative(lower, out=lower), out=least)
            if exclude_prim is not None:
                padded.reshape(-1)[exclude_prim] = -2
            most = np.maximum.reduce(least, 0)
            blocked = most > 1
            accumulator.blocked[lanes] |= blocked
            rest = np.flatnonzero((most >= -1) > blocked)
            slot, place = np.divmod(flat_true(least.take(rest, 1) >= -1), max(rest.size, 1))
            lane = rest.take(place)
            uncertain.add(
                self._prim.take(slot + 1), lane + lanes.start, value.reshape(-1).take(slot * k + lane)
            )
        uncertain.flush()
        tests.finish()
        return None

    def _lane_slices(self, batch: RayBatch) -> Iterator[tuple[slice, Ints | None]]:
        """Yield slices of the batch, and the flat indices of their excluded polygons in (m + 1, k)."""
        n = batch.count
        excluded = self._slot.take(batch.exclude_prim) if batch.exclude_prim.max(initial=-1) >= 0 else None
        parts = -(-n * self._rows // CHUNK)
        step = -(-n // parts)
        step += -step % 16
        for at in range(0, n, step):
            lanes = slice(at, min(at + step, n))
            if excluded is None:
                yield lanes, None
                continue
            k = lanes.stop - at
            flat = excluded[lanes] * k
            flat += np.arange(k)
            yield lanes, flat

    def _filter(self, batch: RayBatch, lanes: slice, exclude_prim: Ints | None) -> tuple[Floats, Bools]:
        """Return the filter's values (m, k) of a slice of the batch, and a mask (m, k) of possible hits."""
        if batch.start is None:
            value = least = self._lines(batch, lanes, None)
        else:
            points = batch.start[:, lanes]
            side = np.matmul(self._side_rows, points, out=scratch("side", (self._count, points.shape[1])))
            value = self._lines(batch, lanes, side)
            least = np.minimum(value, side, out=side)
        met = scratch("met", (self._count + 1, value.shape[1]), np.bool_)  # the first row is for no polygon
        np.greater_equal(least, -1, out=met[1:])
        if exclude_prim is not None:
            met.reshape(-1)[exclude_prim] = False
        return value, met[1:]

    def _lines(self, batch: RayBatch, lanes: slice, side: Floats | None) -> Floats:
        """Return the values (m, k) of `EdgeMatrix.test` for a slice of the batch."""
        line = batch.line[:, lanes]
        value = scratch("value", (self._count, line.shape[1]))
        for matrix in self._matrices:
            matrix.test(line, None if side is None else side[matrix.at], value[matrix.at])
        return value

    def resolve_quads(self, prim: Ints, batch: RayBatch, t: Floats) -> Ints:
        """Return the triangles (n,) that were hit at t (n,), given the first triangle of each quadrilateral.

        A miss is -1. Of triangles that are interchangeable, the first one is returned.
        """
        if self._diagonal is None:
            return prim
        px, py, pz = batch.origin + batch.direction * t
        x, y, z, offset = (row.take(prim) for row in self._diagonal)
        return prim + (x * px + y * py + z * pz + offset > 0)


def _sum(bytes_: NDArray[Any]) -> Bytes:
    """Return the sums of bytes (m, k) over each column."""
    return np.add.reduce(bytes_.view(np.uint8), 0, dtype=np.uint8)

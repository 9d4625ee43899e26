"""Triangles as primitives, with exact tests in float64 for the pairs that the filters have not ruled out."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Floats, Ints, Lanes
from . import triangle
from .bvh import Ball, RayBatch
from .hits import Candidates, HitAccumulator
from .primitives import Primitives
from .triangle import TriangleTable


@soa
class TrianglePrimitives(Primitives):
    """m triangles."""

    rows = 3

    corners: Floats  # (m, 3, 3) vertices: triangle, corner, xyz
    table: TriangleTable

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.corners)

    def take(self, index: Lanes) -> TrianglePrimitives:
        """Return some of the triangles."""
        chosen = self.corners[index] if isinstance(index, slice) else self.corners.take(index, 0)
        return TrianglePrimitives(chosen, self.table)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners, (3, m) each."""
        a, b, c = self.corners.transpose(1, 2, 0)
        return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)

    def hull(self) -> Floats:
        """Return the vertices, (3, 3, m)."""
        return np.ascontiguousarray(self.corners.transpose(1, 2, 0))

    def filter_rows(self, ball: Ball) -> Floats:
        """Return the Plücker rows of the edges, (3, m, 6)."""
        return triangle.edge_rows(self.corners.transpose(1, 0, 2), ball.center, ball.radius)

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the lines' Plücker coordinates (6, n), as they are."""
        return line

    def values(self, products: Floats, out: Floats) -> Floats:
        """Return the least products of two edge functions: above 1 where a line certainly hits."""
        return triangle.least_adjacent_product(products, out)

    def tests(self, batch: RayBatch, accumulator: HitAccumulator, first: int) -> TriangleTests:
        """Return the exact tests of a batch; triangles have the first ids of a scene."""
        return TriangleTests(self.table, batch, accumulator)


class TriangleTests:
    """Tests of one batch of rays; hits are added to `accumulator`.

    Parameters
    ----------
    table
        The triangles.
    batch, accumulator
        The rays, and their hits so far.
    partner
        (m,) the second triangle of the quadrilateral whose first triangle this is, -1 for none. None if
        the filter tests no quadrilaterals.
    """

    def __init__(
        self, table: TriangleTable, batch: RayBatch, accumulator: HitAccumulator, partner: Ints | None = None
    ) -> None:
        self.table, self.batch, self.accumulator, self.partner = table, batch, accumulator, partner
        # Not a bound method: a reference cycle would keep all rays until the garbage collector runs.
        self._uncertain = Candidates(partial(_test_uncertain, table, batch, accumulator))

    def add(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Add candidates: triangles (k,), lanes (k,) and the filter's values (k,).

        A value above 1 is certainly a hit, but for the triangle that a ray starts on.
        """
        others = np.flatnonzero(prim != self.batch.exclude_prim.take(lane))
        prim, lane, value = prim.take(others), lane.take(others), value.take(others)
        uncertain = np.flatnonzero(value <= 1)
        if uncertain.size:
            self.add_uncertain(prim.take(uncertain), lane.take(uncertain))
            certain = np.flatnonzero(~(value <= 1))
            prim, lane = prim.take(certain), lane.take(certain)
        origin, direction = self.batch.origin.take(lane, 1), self.batch.direction.take(lane, 1)
        self.accumulator.add(lane, prim, triangle.plane_distance(self.table.plane, prim, origin, direction))

    def add_uncertain(self, prim: Ints, lane: Ints) -> None:
        """Add candidates for the exact test: triangles (k,) and lanes (k,), none that its ray starts on.

        The first triangle of a quadrilateral stands for both.
        """
        self._uncertain.add(prim, prim, lane)
        if self.partner is not None:
            other = self.partner.take(prim)
            halves = np.flatnonzero(other >= 0)
            self._uncertain.add(other.take(halves), prim.take(halves), lane.take(halves))

    def finish(self) -> None:
        """Test the remaining candidates."""
        self._uncertain.flush()


def _test_uncertain(
    table: TriangleTable, batch: RayBatch, accumulator: HitAccumulator, prim: Ints, first: Ints, lane: Ints
) -> None:
    """Test the pairs (k,) that the filter has left open.

    A hit of triangle `prim` (k,) of a quadrilateral is recorded as a hit of its `first` triangle (k,);
    `BruteForceTriangles.resolve_quads` finds out which of the two was hit.
    """
    origin = batch.origin.take(lane, 1).astype(np.float64)
    direction = batch.direction.take(lane, 1).astype(np.float64)
    vertices = triangle.vertices_from(table, prim, origin)
    t = triangle.plane_distance(table.plane, prim, origin, direction)
    deviation = None if table.deviation is None else table.deviation.take(prim)
    t = triangle.clamp_to_triangle(t, vertices, direction, deviation)
    accumulator.add(lane, first, np.where(triangle.hits_watertight(vertices, direction), t, np.inf))

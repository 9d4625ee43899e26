"""Decide element by element which candidates of the triangles' filters are hits, and where."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..vec import Floats, Ints
from . import triangle
from .bvh import RayBatch
from .hits import Candidates, HitRecord
from .triangle import TriangleTable


class TriangleDecisions:
    """Decisions of one batch of rays; hits go to `found`.

    Parameters
    ----------
    table
        The triangles.
    lanes, found
        The rays, and what they have found.
    partner
        (m,) the other half of the quadrilateral that starts with a triangle, -1 for none. Absent where
        the filter knows no quadrilaterals.
    """

    def __init__(
        self, table: TriangleTable, lanes: RayBatch, found: HitRecord, partner: Ints | None = None
    ) -> None:
        self.table, self.lanes, self.found, self.partner = table, lanes, found, partner
        # not a method of this: a cycle of references would keep all rays until the garbage collector runs
        self._doubts = Candidates(partial(_decide_doubts, table, lanes, found))

    def decide(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Decide candidates: triangles (k,), lanes (k,) and the filter's values (k,), sure hits above 1.

        Triangles that the rays leave must not be among them.
        """
        unsure = np.flatnonzero(value <= 1)
        if unsure.size:
            self.doubt(prim.take(unsure), lane.take(unsure))
            sure = np.flatnonzero(~(value <= 1))
            prim, lane = prim.take(sure), lane.take(sure)
        origin, direction = self.lanes.origin.take(lane, 1), self.lanes.direction.take(lane, 1)
        self.found.add(lane, prim, triangle.plane_distance(self.table.plane, prim, origin, direction))

    def doubt(self, prim: Ints, lane: Ints) -> None:
        """Take unsure candidates: triangles (k,), the first ones of quadrilaterals, and lanes (k,)."""
        self._doubts.add(prim, prim, lane)
        if self.partner is not None:
            other = self.partner.take(prim)
            halves = np.flatnonzero(other >= 0)
            self._doubts.add(other.take(halves), prim.take(halves), lane.take(halves))

    def finish(self) -> None:
        """Decide what is left."""
        self._doubts.flush()


def _decide_doubts(
    table: TriangleTable, lanes: RayBatch, found: HitRecord, prim: Ints, first: Ints, lane: Ints
) -> None:
    """Decide the few pairs (k,) that the filter cannot.

    The halves `prim` (k,) of a quadrilateral count as hits of its `first`: which half is told later, in
    one way for hits of both kinds.
    """
    origin = lanes.origin.take(lane, 1).astype(np.float64)
    direction = lanes.direction.take(lane, 1).astype(np.float64)
    vertices = triangle.vertices_from(table, prim, origin)
    t = triangle.plane_distance(table.plane, prim, origin, direction)
    t = triangle.clamp_to_triangle(t, vertices, direction)
    found.add(lane, first, np.where(triangle.hits_watertight(vertices, direction), t, np.inf))

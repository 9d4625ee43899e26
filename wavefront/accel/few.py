"""Few triangles, without a tree: all rays against all, as one matrix product.

Pairs of triangles that make a quadrilateral are tested as one: four edges and one plane for two times
three and two. Rays with an end are tested against the planes from there as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..vec import Floats, Ints, f4
from . import triangle
from .decide import TriangleDecisions
from .found import Candidates, Found
from .quads import corners, diagonal_planes, find_quads, planes
from .traverse import Ball, Lanes, flat_true, scratch
from .triangle import TriangleTable, one_sign

CHUNK = 1 << 19  # elements of one product


@dataclass(slots=True)
class Polygons:
    """Polygons of one number of edges, as matrices."""

    rows: Floats  # (edges * m, 6) see triangle.edge_rows
    ahead: Floats  # (m, 4) see triangle.side_rows
    behind: Floats  # (m, 4) its negative
    prim: Ints  # (m,) their first triangle
    slot: Ints  # (primitives + 1,) the polygon of each primitive, and at the end that of none: m for none


class FewTriangles:
    """Triangles `ids` (k,) of all `triangles` (m, 3, 3), of a scene with so many `primitives`.

    Quadrilaterals get one plane in `table`: theirs differ by the rounding of their corners.
    """

    tree = None

    def __init__(
        self, table: TriangleTable, triangles: Floats, ids: Ints, primitives: int, ball: Ball
    ) -> None:
        self._table = table
        first = find_quads(triangles)
        first = first[np.isin(first, ids) & np.isin(first + 1, ids)]
        single = np.setdiff1d(ids, np.concatenate([first, first + 1]))
        quads = corners(triangles, first)
        table.plane[:, first] = table.plane[:, first + 1] = planes(quads)
        groups = [(quads, first), (triangles.take(single, 0).transpose(1, 0, 2), single)]
        # The last column of these is for no primitive, -1.
        self._partner = np.full(primitives + 1, -1)
        self._partner[first] = first + 1
        self._groups = [_polygons(corner, prim, self._partner, ball) for corner, prim in groups if prim.size]
        self._diagonal = np.zeros((4, primitives + 1), f4)
        self._diagonal[:, first] = diagonal_planes(quads)

    def search(self, lanes: Lanes, found: Found) -> None:
        """Give all hits that may matter to `found`; those of a quadrilateral as hits of its first half."""
        decisions = TriangleDecisions(self._table, lanes, found, self._partner)
        for polygons in self._groups:
            _search(polygons, lanes, decisions)
        decisions.finish()

    def halves(self, prim: Ints, lanes: Lanes, t: Floats) -> Ints:
        """Tell which half of a quadrilateral was hit at t (n,): primitives (n,), -1 for a miss."""
        px, py, pz = lanes.origin + lanes.direction * t
        x, y, z, offset = (row.take(prim) for row in self._diagonal)
        return prim + (x * px + y * py + z * pz + offset > 0)


def _polygons(corner: Floats, prim: Ints, partner: Ints, ball: Ball) -> Polygons:
    rows = triangle.edge_rows(corner, ball.center, ball.radius).reshape(-1, 6)
    side = triangle.side_rows(corner, ball.center, ball.radius)
    slot = np.full(partner.size, prim.size)
    slot[prim] = np.arange(prim.size)
    halves = np.flatnonzero(partner.take(prim) >= 0)
    slot[partner.take(prim.take(halves))] = halves
    return Polygons(rows, side, -side, prim, slot)


def _search(polygons: Polygons, lanes: Lanes, decisions: TriangleDecisions) -> None:
    """Test all lanes against all polygons."""
    m = polygons.prim.size
    edges = len(polygons.rows) // m
    step = max(64, CHUNK // len(polygons.rows))
    batch = Candidates(decisions.decide)
    leaving = polygons.slot.take(lanes.leaving) if (lanes.leaving >= 0).any() else None
    for at in range(0, lanes.count, step):
        k = min(step, lanes.count - at)
        part = slice(at, at + k)
        w = np.matmul(polygons.rows, lanes.line[:, part], out=scratch("product", (edges * m, k)))
        value = one_sign(w.reshape(1, edges, m, k), scratch("value", (1, m, k)))[0]
        least = value
        padded = scratch("least", (m + 1, k))  # with a row for rays that leave none of these polygons
        for rows, points in ((polygons.ahead, lanes.start), (polygons.behind, lanes.end)):
            if points is not None:
                side = np.matmul(rows, points[:, part], out=scratch("side", (m, k)))
                side *= w[m : 2 * m]
                least = np.minimum(least, side, out=padded[:-1])
        if leaving is not None:
            if least is value:
                least = padded[:-1]
                np.copyto(least, value)
            left = leaving[part] * k
            left += np.arange(k)
            padded.reshape(-1)[left] = -2
        hit = flat_true(np.greater_equal(least, -1, out=scratch("mask", (m, k), np.bool_)))
        slot, lane = np.divmod(hit, k)
        batch.add(polygons.prim.take(slot), lane + at, value.reshape(-1).take(hit))
    batch.flush()

"""The accelerator in NumPy: float32 filters by matrix products, then exact tests of the candidates."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Bools, Floats, Ints, f4
from . import triangle
from .base import Geometry, Intersections
from .brute_force import BruteForceTriangles
from .bvh import Ball, Codes, RayBatch, bounding_ball, prepare
from .coplanar import share_planes
from .duplicates import that_can_be_hit
from .exact import TrianglePrimitives
from .hits import AnyHit, ClosestHit, unpack_prim, unpack_t
from .primitives import CurvedPrimitives
from .search import PrimitiveList, PrimitiveTree

BATCH = 1 << 16  # rays traced at a time without a tree
SMALL = 128  # up to this number of primitives, all are tested without a tree
LARGE, HUGE = 1 << 17, 1 << 19  # between these numbers of primitives, smaller leaves are faster


def leaf_size_for(primitives: int) -> int:
    """Return the number of primitives of a leaf, by measurement (docs/performance.md)."""
    return 16 if LARGE <= primitives < HUGE else 32


def batch_size(leaves: int) -> int:
    """Return the number of rays to trace at a time: enough to fill blocks, few enough for the cache."""
    if not leaves:
        return BATCH
    return 1 << 15 if leaves < 256 else 1 << 16 if leaves < 2048 else 1 << 18


def _ball_of(geometry: Geometry) -> Ball:
    """Return a bounding ball of all primitives."""
    corners = [corner.T for kind in geometry.curved if len(kind) for corner in kind.bounds]
    corners += [geometry.triangles.reshape(-1, 3)] if len(geometry.triangles) else []
    if not corners:
        return Ball(np.zeros(3, f4), 1.0)
    low, high = np.stack([rows.min(0) for rows in corners], 1), np.stack([rows.max(0) for rows in corners], 1)
    return bounding_ball(low, high)


class NumpyAccelerator:
    """Ray queries in NumPy alone; see base.Accelerator."""

    name = "numpy"

    def __init__(self, geometry: Geometry, leaf_size: int | None = None) -> None:
        triangles = geometry.triangles
        self._first_curved = len(triangles)
        self._weights = geometry.weights
        self._ball = _ball_of(geometry)
        self._triangles: BruteForceTriangles | PrimitiveTree | None = None
        with np.errstate(all="ignore"):
            if len(triangles):
                self._table = triangle.triangle_table(triangles, self._weights)
                self._triangles = self._search_triangles(geometry, leaf_size)
            first, self._curved = self._first_curved, []
            for kind in geometry.curved:
                self._curved.append(self._search_curved(kind, first, leaf_size))
                first += len(kind)
        searches = [self._triangles, *self._curved]
        trees = [search.tree for search in searches if search is not None]
        self._batch = batch_size(sum(len(tree.leaves) for tree in trees if tree))

    def _search_triangles(
        self, geometry: Geometry, leaf_size: int | None
    ) -> BruteForceTriangles | PrimitiveTree:
        ids = that_can_be_hit(geometry.triangles)
        if ids.size <= SMALL:
            return BruteForceTriangles.of(self._table, geometry, ids, self._ball)
        share_planes(self._table, geometry.triangles, ids)
        primitives = TrianglePrimitives(geometry.triangles, self._table)
        return PrimitiveTree(primitives, ids, self._ball, 0, leaf_size or leaf_size_for(ids.size))

    def _search_curved(
        self, kind: CurvedPrimitives, first: int, leaf_size: int | None
    ) -> PrimitiveList | PrimitiveTree:
        if len(kind) <= SMALL:
            return PrimitiveList(kind, self._ball, first)
        ids = np.arange(len(kind))
        return PrimitiveTree(kind, ids, self._ball, first, leaf_size or leaf_size_for(ids.size))

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0; at equal t the lowest primitive id."""
        n = origin.shape[1]
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.empty(n, f4), np.empty(n, f4))
        for at in range(0, n, self._batch):
            lanes = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                batch = prepare(origin[:, lanes], direction[:, lanes], exclude_prim[lanes], self._ball)
                accumulator = ClosestHit(batch, self._ball)
                if self._triangles is not None:
                    self._triangles.find_hits(batch, accumulator)
                for curved in self._curved:
                    curved.find_hits(batch, accumulator)
                self._unpack(batch, accumulator.packed, hits, lanes)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        n = origin.shape[1]
        blocked = np.zeros(n, bool)
        for at in range(0, n, self._batch):
            lanes = slice(at, at + self._batch)
            rays = origin[:, lanes], direction[:, lanes], exclude_prim[lanes]
            with np.errstate(all="ignore"):
                batch = prepare(*rays, self._ball, distance[lanes])
                accumulator = AnyHit(batch, self._ball, distance[lanes])
                if self._triangles is not None:
                    self._triangles.find_blocked(batch, accumulator)
                for curved in self._curved:
                    curved.find_hits(batch, accumulator)
            blocked[lanes] = accumulator.blocked
        return blocked

    def _unpack(self, batch: RayBatch, packed: Codes, hits: Intersections, lanes: slice) -> None:
        """Write packed hits (n,), and barycentrics of triangles, to the slice `lanes` of `hits`."""
        hits.t[lanes] = t = unpack_t(packed)
        prim = unpack_prim(packed)
        if self._triangles is not None:
            prim = self._triangles.resolve_quads(prim, batch, t)
        hits.prim[lanes] = prim
        b1, b2 = hits.b1[lanes], hits.b2[lanes]
        b1[...] = 0
        b2[...] = 0
        if not self._weights or self._triangles is None:
            return
        on = np.flatnonzero((prim >= 0) & (prim < self._first_curved))
        everywhere = on.size == packed.size
        origin = (batch.origin if everywhere else batch.origin.take(on, 1)).astype(np.float64)
        direction = (batch.direction if everywhere else batch.direction.take(on, 1)).astype(np.float64)
        b1[on], b2[on] = triangle.barycentrics(self._table, prim.take(on), origin, direction)

"""The accelerator in NumPy: float32 filters by matrix products, then exact tests of the candidates."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..vec import Bools, Floats, Ints, f4
from . import sphere, triangle
from .base import Geometry, Intersections
from .brute_force import BruteForceTriangles
from .bvh import (
    BLOCK,
    BLOCK_SHIFT,
    CHUNK,
    Ball,
    Codes,
    RayBatch,
    blocks,
    bounding_ball,
    build_bvh,
    flat_true,
    prepare,
    scratch,
    trace,
)
from .exact import TriangleTests
from .hits import AnyHit, Candidates, ClosestHit, HitAccumulator, unpack_prim, unpack_t
from .triangle import TriangleTable, least_adjacent_product

BATCH = 1 << 16  # rays traced at a time without a tree
SMALL = 128  # up to this number of primitives, all are tested without a tree
WIDTH = 32  # children of a node
LARGE, HUGE = 1 << 17, 1 << 19  # between these numbers of primitives, smaller leaves are faster


class TriangleTree:
    """A tree over triangles `ids` (k,) of all `triangles` (m, 3, 3)."""

    def __init__(
        self, table: TriangleTable, triangles: Floats, ids: Ints, ball: Ball, leaf_size: int
    ) -> None:
        solid = triangles.take(ids, 0)
        self._table = table
        self.tree = build_bvh(np.ascontiguousarray(solid.transpose(1, 2, 0)), leaf_size, WIDTH, ball)
        rows = triangle.edge_rows(solid.transpose(1, 0, 2), ball.center, ball.radius)
        slot = self.tree.prim.reshape(-1, leaf_size)
        leaves = rows.take(np.maximum(slot, 0), 1)  # (3, leaves, leaf_size, 6)
        leaves[:, slot < 0] = np.nan
        self.tree.leaves = np.ascontiguousarray(leaves.transpose(1, 0, 2, 3)).reshape(len(slot), -1, 6)
        self._slots = ids.take(self.tree.prim)

    def find_hits(self, batch: RayBatch, found: HitAccumulator) -> None:
        """Add all hits to `found`."""
        tests = TriangleTests(self._table, batch, found)
        trace(self.tree, batch, found.t_far, partial(self._visit, batch, tests))
        tests.finish()

    def find_blocked(self, batch: RayBatch, found: AnyHit) -> None:
        """Mark the blocked lanes in `found`."""
        self.find_hits(batch, found)

    def resolve_quads(self, prim: Ints, batch: RayBatch, t: Floats) -> Ints:
        """Return the primitives (n,) unchanged: the tree tests no quadrilaterals."""
        return prim

    def _visit(self, batch: RayBatch, tests: TriangleTests, leaf: Ints, lane: Ints) -> None:
        """Test pairs of leaf and lane, and pass the candidates to `tests`."""
        size = self.tree.leaf_size
        leaves, block_lanes = blocks(leaf, lane, batch.count)

        def add_candidates(at: Ints, value: Floats) -> None:
            """Pass on candidates at flat indices `at` (k,) of the product (blocks, leaf size, BLOCK)."""
            pair = at >> BLOCK_SHIFT
            block = pair // size
            slot = leaves.take(block) * size + (pair & (size - 1))
            lane = block_lanes.take((block << BLOCK_SHIFT) + (at & (BLOCK - 1)))
            prim = self._slots.take(slot)
            others = np.flatnonzero(prim != batch.exclude_prim.take(lane))
            tests.add(prim.take(others), lane.take(others), value.take(others))

        step = max(1, CHUNK // (3 * size * BLOCK))
        candidates = Candidates(add_candidates)
        for start in range(0, leaves.size, step):
            chosen = leaves[start : start + step]
            shape = (chosen.size, 3 * size, BLOCK)
            matrices = np.take(self.tree.leaves, chosen, 0, scratch("leaves", (*shape[:2], 6)), "clip")
            some = block_lanes[start * BLOCK : (start + chosen.size) * BLOCK]
            rays = scratch("rays", (chosen.size, 6, BLOCK))
            for row in range(6):
                rays[:, row] = batch.line[row].take(some).reshape(-1, BLOCK)
            edges = np.matmul(matrices, rays, out=scratch("product", shape))
            value = least_adjacent_product(
                edges.reshape(-1, 3, size, BLOCK), scratch("value", (chosen.size, size, BLOCK))
            )
            at = flat_true(np.greater_equal(value, -1, out=scratch("mask", value.shape, np.bool_)))
            value = value.reshape(-1).take(at)
            at += start * (size * BLOCK)
            candidates.add(at, value)
        candidates.flush()


class SphereFilter:
    """Spheres behind a filter and, where there are many, a tree; their primitive ids start at `first`."""

    def __init__(self, centers: Floats, radii: Floats, ball: Ball, first: int, leaf_size: int) -> None:
        self.centers, self.radii = centers.astype(np.float64), radii.astype(np.float64)
        self.ball, self.first = ball, first
        rows = sphere.sphere_rows(self.centers, self.radii, ball.center, ball.radius)
        self.tree = None
        self.rows = rows
        if radii.size <= SMALL:
            return
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(8, 3, 1)
        self.tree = build_bvh((self.centers + signs * self.radii).astype(f4), leaf_size, WIDTH, ball)
        slot = self.tree.prim.reshape(-1, leaf_size)
        leaves = rows.take(np.maximum(slot, 0), 0)
        leaves[slot < 0] = np.nan
        self.tree.leaves = leaves

    def find_hits(self, batch: RayBatch, found: HitAccumulator) -> None:
        """Add all hits to `found`."""
        if not self.radii.size:
            return
        features = sphere.line_features(batch.line[:3, :-1], batch.line[3:, :-1])
        if self.tree is None:
            n, k = batch.direction_length.size, self.radii.size
            step = max(64, CHUNK // k)
            for at in range(0, n, step):
                value = self.rows @ features[:, at : at + step]
                hit = flat_true(value >= -1)
                slot, lane = np.divmod(hit, value.shape[-1])
                self._test(batch, found, slot, lane + at)
            return
        tree = self.tree
        columns = np.full((batch.count + 1, 12), np.nan, f4)
        columns[:-1, :11] = features.T

        def visit(leaf: Ints, lane: Ints) -> None:
            size = tree.leaf_size
            leaves, block_lanes = blocks(leaf, lane, batch.count)
            rays = columns.take(block_lanes, 0).reshape(-1, BLOCK, 12)[:, :, :11].transpose(0, 2, 1)
            step = max(1, CHUNK // (size * BLOCK))
            for start in range(0, leaves.size, step):
                chosen = leaves[start : start + step]
                value = np.matmul(tree.leaves.take(chosen, 0), rays[start : start + step])
                at = flat_true(value >= -1)
                pair = at >> BLOCK_SHIFT
                block = pair // size
                slot = chosen.take(block) * size + (pair & (size - 1))
                lane = block_lanes.take(((block + start) << BLOCK_SHIFT) + (at & (BLOCK - 1)))
                self._test(batch, found, tree.prim.take(slot), lane)

        trace(tree, batch, found.t_far, visit)

    def _test(self, batch: RayBatch, found: HitAccumulator, prim: Ints, lane: Ints) -> None:
        """Test candidates: spheres (k,) and lanes (k,)."""
        origin = batch.origin.take(lane, 1).astype(np.float64)
        direction = batch.direction.take(lane, 1).astype(np.float64)
        ids = prim + self.first
        center, radius = sphere.spheres_of(self.centers, self.radii, prim)
        leaves = batch.exclude_prim.take(lane) == ids
        t = sphere.sphere_distance(center, radius, origin, direction, leaves)
        found.add(lane, ids, t)


def leaf_size_for(primitives: int) -> int:
    """Return the number of primitives of a leaf, by measurement (docs/performance.md)."""
    return 16 if LARGE <= primitives < HUGE else 32


def _batch_size(leaves: int) -> int:
    """Return how many rays to trace at a time: enough to fill blocks of rays, few enough for the cache."""
    if not leaves:
        return BATCH
    return 1 << 15 if leaves < 256 else 1 << 16 if leaves < 2048 else 1 << 18


class NumpyAccelerator:
    """Ray queries in NumPy alone; see base.Accelerator."""

    name = "numpy"

    def __init__(self, geometry: Geometry, leaf_size: int | None = None) -> None:
        triangles, centers, radii = geometry.triangles, geometry.centers, geometry.radii
        self._first_sphere = len(triangles)
        self._weights = geometry.weights
        corners = np.concatenate([triangles.reshape(-1, 3).T, centers - radii, centers + radii], 1)
        self._ball = bounding_ball(corners, corners) if corners.size else Ball(np.zeros(3, f4), 1.0)
        with np.errstate(all="ignore"):
            self._table = triangle.triangle_table(triangles)
            ids = np.flatnonzero(triangle.has_area(triangles))
            self._triangles: BruteForceTriangles | TriangleTree
            if ids.size <= SMALL:
                self._triangles = BruteForceTriangles(self._table, geometry, ids, self._ball)
            else:
                size = leaf_size or leaf_size_for(ids.size)
                self._triangles = TriangleTree(self._table, triangles, ids, self._ball, size)
            size = leaf_size or leaf_size_for(radii.size)
            self._spheres = SphereFilter(centers, radii, self._ball, len(triangles), size)
        trees = self._triangles.tree, self._spheres.tree
        self._batch = _batch_size(sum(len(tree.leaves) for tree in trees if tree))

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits with t > 0 of rays (3, n); of equal distances, the lowest primitive id."""
        n = origin.shape[1]
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.empty(n, f4), np.empty(n, f4))
        for at in range(0, n, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                batch = prepare(origin[:, part], direction[:, part], exclude_prim[part], self._ball)
                found = ClosestHit(batch, self._ball)
                self._triangles.find_hits(batch, found)
                self._spheres.find_hits(batch, found)
                self._unpack(batch, found.packed, hits, part)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,) of the rays that hit anything with 0 < t < `distance` (n,)."""
        blocked = np.empty(origin.shape[1], bool)
        for at in range(0, blocked.size, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                ends = distance[part]
                batch = prepare(origin[:, part], direction[:, part], exclude_prim[part], self._ball, ends)
                found = AnyHit(batch, self._ball, ends)
                self._triangles.find_blocked(batch, found)
                self._spheres.find_hits(batch, found)
            blocked[part] = found.blocked
        return blocked

    def _unpack(self, batch: RayBatch, packed: Codes, hits: Intersections, part: slice) -> None:
        """Write packed hits (n,), and barycentrics of triangles, to the slice `part` of `hits`."""
        hits.t[part] = t = unpack_t(packed)
        hits.prim[part] = prim = self._triangles.resolve_quads(unpack_prim(packed), batch, t)
        b1, b2 = hits.b1[part], hits.b2[part]
        b1[...] = 0
        b2[...] = 0
        if not self._weights:
            return
        on = np.flatnonzero((prim >= 0) & (prim < self._first_sphere))
        everywhere = on.size == packed.size
        origin = (batch.origin if everywhere else batch.origin.take(on, 1)).astype(np.float64)
        direction = (batch.direction if everywhere else batch.direction.take(on, 1)).astype(np.float64)
        b1[on], b2[on] = triangle.barycentrics(self._table, prim.take(on), origin, direction)

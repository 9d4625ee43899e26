"""The accelerator in NumPy: triangles and spheres by matrix products, decisions element by element."""

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
from .exact import TriangleDecisions
from .hits import AnyHit, Candidates, ClosestHit, HitRecord, distances, prims
from .triangle import TriangleTable, one_sign

BATCH = 1 << 16  # rays traced at a time without a tree
SMALL = 128  # up to so many primitives, all are tested without a tree
WIDTH = 32  # children of a node
LARGE, HUGE = 1 << 17, 1 << 19  # primitives: between them, smaller leaves are worth their longer build


class _TriangleTree:
    """Triangles `ids` (k,) of all `triangles` (m, 3, 3), behind a tree."""

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

    def search(self, lanes: RayBatch, found: HitRecord) -> None:
        """Give all hits that may matter to `found`."""
        decisions = TriangleDecisions(self._table, lanes, found)
        trace(self.tree, lanes, found.reach, partial(self._visit, lanes, decisions))
        decisions.finish()

    def block(self, lanes: RayBatch, found: AnyHit) -> None:
        """Tell `found` which lanes are blocked."""
        self.search(lanes, found)

    def halves(self, prim: Ints, lanes: RayBatch, t: Floats) -> Ints:
        """Return the primitives (n,) as they are: each was tested by itself."""
        return prim

    def _visit(self, lanes: RayBatch, decisions: TriangleDecisions, leaf: Ints, lane: Ints) -> None:
        """Test pairs of leaf and lane."""
        size = self.tree.leaf_size
        leaves, block_lanes = blocks(leaf, lane, lanes.count)

        def decide(at: Ints, value: Floats) -> None:
            """Decide candidates at flat places `at` (k,) of the product (blocks, leaf size, BLOCK)."""
            pair = at >> BLOCK_SHIFT
            block = pair // size
            slot = leaves.take(block) * size + (pair & (size - 1))
            lane = block_lanes.take((block << BLOCK_SHIFT) + (at & (BLOCK - 1)))
            prim = self._slots.take(slot)
            others = np.flatnonzero(prim != lanes.exclude_prim.take(lane))
            decisions.decide(prim.take(others), lane.take(others), value.take(others))

        step = max(1, CHUNK // (3 * size * BLOCK))
        batch = Candidates(decide)
        for start in range(0, leaves.size, step):
            chosen = leaves[start : start + step]
            shape = (chosen.size, 3 * size, BLOCK)
            matrices = np.take(self.tree.leaves, chosen, 0, scratch("leaves", (*shape[:2], 6)), "clip")
            some = block_lanes[start * BLOCK : (start + chosen.size) * BLOCK]
            rays = scratch("rays", (chosen.size, 6, BLOCK))
            for row in range(6):
                rays[:, row] = lanes.line[row].take(some).reshape(-1, BLOCK)
            edges = np.matmul(matrices, rays, out=scratch("product", shape))
            value = one_sign(edges.reshape(-1, 3, size, BLOCK), scratch("value", (chosen.size, size, BLOCK)))
            at = flat_true(np.greater_equal(value, -1, out=scratch("mask", value.shape, np.bool_)))
            value = value.reshape(-1).take(at)
            at += start * (size * BLOCK)
            batch.add(at, value)
        batch.flush()


class _Spheres:
    """Spheres behind a filter and perhaps a tree; primitive ids start at `first`."""

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

    def search(self, lanes: RayBatch, found: HitRecord) -> None:
        """Give all hits that may matter to `found`."""
        if not self.radii.size:
            return
        features = sphere.line_features(lanes.line[:3, :-1], lanes.line[3:, :-1])
        if self.tree is None:
            n, k = lanes.speed.size, self.radii.size
            step = max(64, CHUNK // k)
            for at in range(0, n, step):
                value = self.rows @ features[:, at : at + step]
                hit = flat_true(value >= -1)
                slot, lane = np.divmod(hit, value.shape[-1])
                self._decide(lanes, found, slot, lane + at)
            return
        tree = self.tree
        columns = np.full((lanes.count + 1, 12), np.nan, f4)
        columns[:-1, :11] = features.T

        def visit(leaf: Ints, lane: Ints) -> None:
            size = tree.leaf_size
            leaves, block_lanes = blocks(leaf, lane, lanes.count)
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
                self._decide(lanes, found, tree.prim.take(slot), lane)

        trace(tree, lanes, found.reach, visit)

    def _decide(self, lanes: RayBatch, found: HitRecord, prim: Ints, lane: Ints) -> None:
        """Decide candidates: spheres (k,) and lanes (k,)."""
        origin = lanes.origin.take(lane, 1).astype(np.float64)
        direction = lanes.direction.take(lane, 1).astype(np.float64)
        ids = prim + self.first
        center, radius = sphere.spheres_of(self.centers, self.radii, prim)
        leaves = lanes.exclude_prim.take(lane) == ids
        t = sphere.sphere_distance(center, radius, origin, direction, leaves)
        found.add(lane, ids, t)


def leaf_size_for(primitives: int) -> int:
    """Primitives of a leaf, by measurement (docs/performance.md)."""
    return 16 if LARGE <= primitives < HUGE else 32


def _batch_size(leaves: int) -> int:
    """Rays to trace at a time: enough to fill the blocks of each leaf, few enough for the cache."""
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
            self._triangles: BruteForceTriangles | _TriangleTree
            if ids.size <= SMALL:
                self._triangles = BruteForceTriangles(self._table, geometry, ids, self._ball)
            else:
                size = leaf_size or leaf_size_for(ids.size)
                self._triangles = _TriangleTree(self._table, triangles, ids, self._ball, size)
            size = leaf_size or leaf_size_for(radii.size)
            self._spheres = _Spheres(centers, radii, self._ball, len(triangles), size)
        trees = self._triangles.tree, self._spheres.tree
        self._batch = _batch_size(sum(len(tree.leaves) for tree in trees if tree))

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n); ties go to the lowest id."""
        n = origin.shape[1]
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.empty(n, f4), np.empty(n, f4))
        for at in range(0, n, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                lanes = prepare(origin[:, part], direction[:, part], exclude_prim[part], self._ball)
                found = ClosestHit(lanes, self._ball)
                self._triangles.search(lanes, found)
                self._spheres.search(lanes, found)
                self._report(lanes, found.key, hits, part)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""
        blocked = np.empty(origin.shape[1], bool)
        for at in range(0, blocked.size, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                ends = distance[part]
                lanes = prepare(origin[:, part], direction[:, part], exclude_prim[part], self._ball, ends)
                found = AnyHit(lanes, self._ball, ends)
                self._triangles.block(lanes, found)
                self._spheres.search(lanes, found)
            blocked[part] = found.blocked
        return blocked

    def _report(self, lanes: RayBatch, key: Codes, hits: Intersections, part: slice) -> None:
        """Unpack keys (n,) and compute the barycentrics of triangles."""
        hits.t[part] = t = distances(key)
        hits.prim[part] = prim = self._triangles.halves(prims(key), lanes, t)
        b1, b2 = hits.b1[part], hits.b2[part]
        b1[...] = 0
        b2[...] = 0
        if not self._weights:
            return
        on = np.flatnonzero((prim >= 0) & (prim < self._first_sphere))
        everywhere = on.size == key.size
        origin = (lanes.origin if everywhere else lanes.origin.take(on, 1)).astype(np.float64)
        direction = (lanes.direction if everywhere else lanes.direction.take(on, 1)).astype(np.float64)
        b1[on], b2[on] = triangle.barycentrics(self._table, prim.take(on), origin, direction)

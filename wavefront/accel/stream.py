"""The accelerator in NumPy: triangles and spheres by matrix products, decisions element by element."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vec import Bools, Floats, Ints, f4
from . import sphere, triangle
from .base import Geometry, Intersections
from .traverse import (
    BLOCK,
    BLOCK_SHIFT,
    CHUNK,
    NO_HIT,
    Ball,
    Lanes,
    Words,
    blocks,
    bounding_ball,
    flat_true,
    prepare,
    scratch,
    stream_tree,
    trace,
)
from .triangle import ROUNDOFF, Doubles

BATCH = 1 << 16  # rays traced at a time without a tree
DECIDE = 1 << 14  # candidates decided at a time
SMALL_CHUNK = 1 << 19  # elements of one product there: with small ones, threads wait for each other
SMALL = 128  # up to so many primitives, all are tested without a tree
WIDTH = 32  # children of a node
LEAF_SIZE = 32  # triangles or spheres of a leaf


class Candidates:
    """Collects small arrays of candidates, so that they are decided a few thousand at a time."""

    def __init__(self, decide: Callable[..., None]) -> None:
        self.decide = decide
        self.parts: list[tuple[NDArray[Any], ...]] = []
        self.count = 0

    def add(self, *columns: NDArray[Any]) -> None:
        """Add candidates, arrays of (k,) each."""
        self.parts.append(columns)
        self.count += columns[0].size
        if self.count >= DECIDE:
            self.flush()

    def flush(self) -> None:
        """Decide what has been collected."""
        if self.count:
            self.decide(*(np.concatenate(column) for column in zip(*self.parts, strict=True)))
        self.parts, self.count = [], 0


class _Closest:
    """The nearest hit of each lane so far, as one sortable word: bits of t, then the primitive."""

    def __init__(self, lanes: Lanes, ball: Ball) -> None:
        self.lanes, self.scale = lanes, f4(1 / ball.radius)
        self.key = np.full(lanes.count + 1, NO_HIT, np.int64)
        self.reach = np.full(lanes.count + 1, np.inf, f4)  # how far lanes still look, as trace wants it

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Record hits of lanes (k,) at t; those with t <= 0, NaN or inf are none."""
        rounded = t.astype(f4)
        valid = (rounded > 0) & (rounded < np.inf)
        key = (rounded.view(np.int32).astype(np.int64) << 32) | prim
        np.minimum.at(self.key, lane, np.where(valid, key, NO_HIT))
        nearest = (self.key.take(lane) >> 32).astype(np.int32).view(f4)
        self.reach[lane] = _reach(
            nearest, self.lanes.speed.take(lane), self.lanes.begin.take(lane), self.scale
        )


class _Occluded:
    """Which lanes are blocked so far."""

    def __init__(self, lanes: Lanes, ball: Ball, distance: Floats) -> None:
        self.distance = distance
        self.reach = np.append(_reach(distance, lanes.speed, lanes.begin, f4(1 / ball.radius)), f4(0))
        self.blocked = np.zeros(distance.size, bool)

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Block the lanes (k,) with 0 < t < distance."""
        rounded = t.astype(f4)
        lane = lane.compress((rounded > 0) & (rounded < self.distance.take(lane)))
        self.blocked[lane] = True
        self.reach[lane] = -np.inf  # looks no further


def _reach(t: Floats, speed: Floats, begin: Floats | Doubles, scale: np.float32) -> Floats:
    """Turn t into distances from the point next to the centre, in units of the ball's radius; rounded up."""
    far = t * speed
    return ((far + begin + 8 * ROUNDOFF * (far + np.abs(begin))) * scale + f4(1e-6)).astype(f4)


class _Triangles:
    """Triangles (m, 3, 3) without degenerate ones, behind a filter and perhaps a tree."""

    def __init__(self, triangles: Floats, ball: Ball, leaf_size: int) -> None:
        self.table = triangle.triangle_table(triangles)
        self.ids = np.flatnonzero(triangle.has_area(triangles))
        self.ball = ball
        solid = triangles.take(self.ids, 0)
        self.tree = None
        if len(solid) <= SMALL:
            self.rows = triangle.edge_rows(solid, ball.center, ball.radius).reshape(-1, 6)
            self.side = triangle.side_rows(solid, ball.center, ball.radius)
            self.slots = self.ids
            return
        self.tree = stream_tree(np.ascontiguousarray(solid.transpose(1, 2, 0)), leaf_size, WIDTH, ball)
        rows = triangle.edge_rows(solid, ball.center, ball.radius)
        slot = self.tree.prim.reshape(-1, leaf_size)
        leaves = rows.take(np.maximum(slot, 0), 1)  # (3, leaves, leaf_size, 6)
        leaves[:, slot < 0] = np.nan
        self.tree.leaves = np.ascontiguousarray(leaves.transpose(1, 0, 2, 3)).reshape(len(slot), -1, 6)
        self.slots = self.ids.take(self.tree.prim)

    def search(self, lanes: Lanes, found: _Closest | _Occluded) -> None:
        """Give all hits that may matter to `found`."""
        doubts = Candidates(partial(self._decide_doubts, lanes, found))
        if self.tree is None:
            self._search_all(lanes, found, doubts)
        else:
            trace(self.tree, lanes, found.reach, partial(self._visit, lanes, found, doubts))
        doubts.flush()

    def _visit(
        self,
        lanes: Lanes,
        found: _Closest | _Occluded,
        doubts: Candidates,
        leaf: Ints,
        lane: Ints,
    ) -> None:
        """Test pairs of leaf and lane."""
        tree = self.tree
        assert tree is not None
        size = tree.leaf_size
        leaves, block_lanes = blocks(leaf, lane, lanes.count)
        step = max(1, CHUNK // (3 * size * BLOCK))
        batch = Candidates(partial(self._decide_pairs, lanes, found, doubts, leaves, block_lanes))
        for start in range(0, leaves.size, step):
            chosen = leaves[start : start + step]
            shape = (chosen.size, 3 * size, BLOCK)
            matrices = np.take(tree.leaves, chosen, 0, scratch("leaves", (*shape[:2], 6)), "clip")
            some = block_lanes[start * BLOCK : (start + chosen.size) * BLOCK]
            rays = scratch("rays", (chosen.size, 6, BLOCK))
            for row in range(6):
                rays[:, row] = lanes.line[row].take(some).reshape(-1, BLOCK)
            edges = np.matmul(matrices, rays, out=scratch("product", shape))
            value = _one_sign(edges.reshape(-1, 3, size, BLOCK), scratch("value", (chosen.size, size, BLOCK)))
            at = flat_true(np.greater_equal(value, -1, out=scratch("mask", value.shape, np.bool_)))
            value = value.reshape(-1).take(at)
            at += start * (size * BLOCK)
            batch.add(at, value)
        batch.flush()

    def _decide_pairs(
        self,
        lanes: Lanes,
        found: _Closest | _Occluded,
        doubts: Candidates,
        leaves: Ints,
        block_lanes: Ints,
        at: Ints,
        value: Floats,
    ) -> None:
        """Decide candidates at flat places `at` (k,) of the product (blocks, leaf size, BLOCK)."""
        assert self.tree is not None
        size = self.tree.leaf_size
        pair = at >> BLOCK_SHIFT
        block = pair // size
        slot = leaves.take(block) * size + (pair & (size - 1))
        lane = block_lanes.take((block << BLOCK_SHIFT) + (at & (BLOCK - 1)))
        self._decide(lanes, found, doubts, slot, lane, value)

    def _search_all(self, lanes: Lanes, found: _Closest | _Occluded, doubts: Candidates) -> None:
        if not self.ids.size:
            return
        n, m = lanes.speed.size, self.ids.size
        batch = Candidates(partial(self._decide, lanes, found, doubts))
        step = max(64, SMALL_CHUNK // (3 * m))
        for at in range(0, n, step):
            k = min(step, n - at)
            line = lanes.line[:, at : at + k]
            edges = np.matmul(self.rows, line, out=scratch("product", (3 * m, k)))
            value = _one_sign(edges.reshape(1, 3, m, k), scratch("value", (1, m, k)))[0]
            if lanes.local is not None:
                side = np.matmul(self.side, lanes.local[:, at : at + k], out=scratch("side", (m, k)))
                side *= edges[m : 2 * m]
                np.minimum(value, side, out=value)
            hit = flat_true(np.greater_equal(value, -1, out=scratch("mask", (m, k), np.bool_)))
            slot, lane = np.divmod(hit, k)
            batch.add(slot, lane + at, value.reshape(-1).take(hit))
        batch.flush()

    def _decide(
        self,
        lanes: Lanes,
        found: _Closest | _Occluded,
        doubts: Candidates,
        slot: Ints,
        lane: Ints,
        value: Floats,
    ) -> None:
        """Decide candidates: slots (k,) of the filter, lanes (k,) and the filter's values (k,)."""
        prim = self.slots.take(slot)
        origin = lanes.origin.take(lane, 1).astype(np.float64)
        direction = lanes.direction.take(lane, 1).astype(np.float64)
        t = triangle.plane_distance(self.table, prim, origin, direction)
        left = prim == lanes.leaving.take(lane)
        t[left] = np.inf
        unsure = np.flatnonzero((value <= 1) & ~left)
        if unsure.size:
            doubts.add(prim.take(unsure), lane.take(unsure))
            t[unsure] = np.inf
        found.add(lane, prim, t)

    def _decide_doubts(self, lanes: Lanes, found: _Closest | _Occluded, prim: Ints, lane: Ints) -> None:
        """Decide the few pairs (k,) that the filter cannot."""
        origin = lanes.origin.take(lane, 1).astype(np.float64)
        direction = lanes.direction.take(lane, 1).astype(np.float64)
        rays = prim, origin, direction
        t = triangle.plane_distance(self.table, *rays)
        t = triangle.clamp_to_triangle(self.table, *rays, t)
        found.add(lane, prim, np.where(triangle.hits_watertight(self.table, *rays), t, np.inf))


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
        self.tree = stream_tree((self.centers + signs * self.radii).astype(f4), leaf_size, WIDTH, ball)
        slot = self.tree.prim.reshape(-1, leaf_size)
        leaves = rows.take(np.maximum(slot, 0), 0)
        leaves[slot < 0] = np.nan
        self.tree.leaves = leaves

    def search(self, lanes: Lanes, found: _Closest | _Occluded) -> None:
        """Give all hits that may matter to `found`."""
        if not self.radii.size:
            return
        features = sphere.line_features(lanes.line[:3, :-1], lanes.line[3:, :-1])
        if self.tree is None:
            n, k = lanes.speed.size, self.radii.size
            step = max(64, SMALL_CHUNK // k)
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

    def _decide(self, lanes: Lanes, found: _Closest | _Occluded, prim: Ints, lane: Ints) -> None:
        """Decide candidates: spheres (k,) and lanes (k,)."""
        origin = lanes.origin.take(lane, 1).astype(np.float64)
        direction = lanes.direction.take(lane, 1).astype(np.float64)
        ids = prim + self.first
        center, radius = sphere.spheres_of(self.centers, self.radii, prim)
        leaves = lanes.leaving.take(lane) == ids
        t = sphere.sphere_distance(center, radius, origin, direction, leaves)
        found.add(lane, ids, t)


def _one_sign(edges: Floats, out: Floats) -> Floats:
    """Edge functions (b, 3, m, k) -> min(w0 w1, w1 w2): above 0 where the three have one sign.

    Overwrites the first and last.
    """
    first = np.multiply(edges[:, 0], edges[:, 1], out=edges[:, 0])
    last = np.multiply(edges[:, 1], edges[:, 2], out=edges[:, 2])
    return np.minimum(first, last, out=out)


def _batch_size(leaves: int) -> int:
    """Rays to trace at a time: enough to fill the blocks of each leaf, few enough for the cache."""
    if not leaves:
        return BATCH
    return 1 << 15 if leaves < 256 else 1 << 16 if leaves < 2048 else 1 << 18


class NumpyAccelerator:
    """Ray queries in NumPy alone; see base.Accelerator."""

    name = "numpy"

    def __init__(self, geometry: Geometry, leaf_size: int = LEAF_SIZE) -> None:
        triangles, centers, radii = geometry.triangles, geometry.centers, geometry.radii
        self._first_sphere = len(triangles)
        self._weights = geometry.weights
        corners = np.concatenate([triangles.reshape(-1, 3).T, centers - radii, centers + radii], 1)
        self._ball = bounding_ball(corners, corners) if corners.size else Ball(np.zeros(3, f4), 1.0)
        with np.errstate(all="ignore"):
            self._triangles = _Triangles(triangles, self._ball, leaf_size)
            self._spheres = _Spheres(centers, radii, self._ball, len(triangles), leaf_size)
        leaves = sum(len(part.tree.leaves) for part in (self._triangles, self._spheres) if part.tree)
        self._batch = _batch_size(leaves)

    def closest(self, origin: Floats, direction: Floats, leaving: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n); ties go to the lowest id."""
        n = origin.shape[1]
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.empty(n, f4), np.empty(n, f4))
        for at in range(0, n, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                lanes = prepare(origin[:, part], direction[:, part], leaving[part], self._ball)
                found = _Closest(lanes, self._ball)
                self._triangles.search(lanes, found)
                self._spheres.search(lanes, found)
                self._report(lanes, found.key[:-1], hits, part)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, leaving: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""
        blocked = np.empty(origin.shape[1], bool)
        for at in range(0, blocked.size, self._batch):
            part = slice(at, at + self._batch)
            with np.errstate(all="ignore"):
                lanes = prepare(origin[:, part], direction[:, part], leaving[part], self._ball)
                found = _Occluded(lanes, self._ball, distance[part])
                self._triangles.search(lanes, found)
                self._spheres.search(lanes, found)
            blocked[part] = found.blocked
        return blocked

    def _report(self, lanes: Lanes, key: Words, hits: Intersections, part: slice) -> None:
        """Unpack keys (n,) and compute the barycentrics of triangles."""
        hits.t[part] = (key >> 32).astype(np.int32).view(f4)
        prim = key & 0xFFFFFFFF
        missed = key == NO_HIT
        b1, b2 = hits.b1[part], hits.b2[part]
        b1[...] = 0
        b2[...] = 0
        hits.prim[part] = np.where(missed, -1, prim)
        if not self._weights:
            return
        on = np.flatnonzero((prim < self._first_sphere) & ~missed)
        everywhere = on.size == key.size
        origin = (lanes.origin if everywhere else lanes.origin.take(on, 1)).astype(np.float64)
        direction = (lanes.direction if everywhere else lanes.direction.take(on, 1)).astype(np.float64)
        b1[on], b2[on] = triangle.barycentrics(self._triangles.table, prim.take(on), origin, direction)

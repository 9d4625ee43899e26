"""The search for hits among the primitives of one kind: behind the filter alone, or behind a tree, too."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import Self

import numpy as np

from ..arrays.vec import Floats, Ints, f4, spans
from .bvh import BLOCK, BLOCK_SHIFT, CHUNK, Ball, RayBatch, blocks, build_bvh, flat_true, scratch, trace
from .hits import AnyHit, Candidates, HitAccumulator
from .primitives import Primitives, PrimitiveTests

WIDTH = 32  # children of a node
AT_ONCE = 1 << 14  # primitives per batch: their rows fit the cache


class PrimitiveList:
    """Few primitives: all lines are filtered by all of them. Their ids start at `first`."""

    tree = None  # there is none: see `PrimitiveTree`

    def __init__(self, primitives: Primitives, ball: Ball, first: int) -> None:
        self._primitives, self._ball, self._first = primitives, ball, first
        rows = primitives.filter_rows(ball)
        self._rows = rows.reshape(-1, rows.shape[-1])

    def find_hits(self, batch: RayBatch, accumulator: HitAccumulator) -> None:
        """Add all hits to `accumulator`."""
        count = len(self._primitives)
        if not count:
            return
        tests = self._primitives.tests(batch, accumulator, self._first)
        features = self._primitives.features(batch.line[:, :-1], self._ball)
        n = batch.count
        step = max(64, CHUNK // len(self._rows))
        for at in range(0, n, step):
            products = self._rows @ features[:, at : at + step]
            shape = 1, self._primitives.rows, count, products.shape[1]
            value = self._primitives.values(products.reshape(shape), np.empty((1, *shape[2:]), f4))
            hit = flat_true(value >= -1)
            slot, lane = np.divmod(hit, shape[3])
            tests.add(slot, lane + at, value.reshape(-1).take(hit))
        tests.finish()


class PrimitiveTree:
    """A tree over primitives `ids` (m,) of all `primitives`, whose ids in the scene start at `first`."""

    def __init__(self, primitives: Primitives, ids: Ints, ball: Ball, first: int, leaf_size: int) -> None:
        self._primitives, self._ball, self._first = primitives, ball, first
        self.tree = build_bvh(primitives, ids, leaf_size, WIDTH, ball)
        self._slots = ids.take(self.tree.prim)
        self.tree.leaves = self._leaf_matrices(leaf_size)

    def of(self, primitives: Primitives) -> Self:
        """Return the same tree over other states of the primitives, which it bounds, too."""
        rebound = copy(self)
        rebound._primitives = primitives
        return rebound

    def _leaf_matrices(self, leaf_size: int) -> Floats:
        """Return the rows of the filter, (leaves, rows * leaf_size, columns); NaN where a leaf has none."""
        empty = (self.tree.prim < 0).reshape(-1, leaf_size)
        leaves = np.empty((0, 0, 0), f4)
        for span in spans(len(empty), max(1, AT_ONCE // leaf_size)):
            slots = self._slots.reshape(-1, leaf_size)[span]
            rows = self._primitives.take(slots.reshape(-1)).filter_rows(self._ball)
            rows = rows.reshape(len(rows), *slots.shape, -1)  # (rows, leaves, leaf_size, columns)
            rows[:, empty[span]] = np.nan
            if not leaves.size:
                leaves = np.empty((len(empty), len(rows) * leaf_size, rows.shape[3]), f4)
            leaves[span] = rows.transpose(1, 0, 2, 3).reshape(slots.shape[0], -1, rows.shape[3])
        return leaves

    def find_hits(self, batch: RayBatch, accumulator: HitAccumulator) -> None:
        """Add all hits to `accumulator`."""
        tests = self._primitives.tests(batch, accumulator, self._first)
        features = self._primitives.features(batch.line, self._ball)
        self._trace(batch, accumulator, partial(self._visit, batch.count, features, tests))
        tests.finish()

    def _trace(
        self, batch: RayBatch, accumulator: HitAccumulator, visit: Callable[[Ints, Ints], None]
    ) -> None:
        """Traverse the tree, and have `visit` test pairs of leaf and lane."""
        trace(self.tree, batch, accumulator.t_far, visit)

    def _gather(self, features: Floats, lanes: Ints, out: Floats) -> None:
        """Write the features of lanes (blocks * BLOCK,) to `out` (blocks, columns, BLOCK)."""
        for row in range(out.shape[1]):
            out[:, row] = features[row].take(lanes).reshape(-1, BLOCK)

    def find_blocked(self, batch: RayBatch, accumulator: AnyHit) -> None:
        """Mark the blocked lanes in `accumulator`."""
        self.find_hits(batch, accumulator)

    def resolve_quads(self, prim: Ints, batch: RayBatch, t: Floats) -> Ints:
        """Return the primitives (n,) unchanged: the tree tests no quadrilaterals."""
        return prim

    def _visit(self, n: int, features: Floats, tests: PrimitiveTests, leaf: Ints, lane: Ints) -> None:
        """Test pairs of leaf and lane, and pass the candidates to `tests`."""
        size, rows, columns = self.tree.leaf_size, self._primitives.rows, self.tree.leaves.shape[2]
        leaves, block_lanes = blocks(leaf, lane, n)

        def add_candidates(at: Ints, value: Floats) -> None:
            """Pass on candidates at flat indices `at` (k,) of the product (blocks, leaf size, BLOCK)."""
            pair = at >> BLOCK_SHIFT
            block = pair // size
            slot = leaves.take(block) * size + (pair & (size - 1))
            lane = block_lanes.take((block << BLOCK_SHIFT) + (at & (BLOCK - 1)))
            tests.add(self._slots.take(slot), lane, value)

        step = max(1, CHUNK // (rows * size * BLOCK))
        candidates = Candidates(add_candidates)
        for start in range(0, leaves.size, step):
            chosen = leaves[start : start + step]
            shape = (chosen.size, rows * size, BLOCK)
            matrices = np.take(self.tree.leaves, chosen, 0, scratch("leaves", (*shape[:2], columns)), "clip")
            chunk = block_lanes[start * BLOCK : (start + chosen.size) * BLOCK]
            rays = scratch("rays", (chosen.size, columns, BLOCK))
            self._gather(features, chunk, rays)
            products = np.matmul(matrices, rays, out=scratch("product", shape))
            value = self._primitives.values(
                products.reshape(-1, rows, size, BLOCK), scratch("value", (chosen.size, size, BLOCK))
            )
            at = flat_true(np.greater_equal(value, -1, out=scratch("mask", value.shape, np.bool_)))
            value = value.reshape(-1).take(at)
            at += start * (size * BLOCK)
            candidates.add(at, value)
        candidates.flush()

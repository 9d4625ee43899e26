"""Trace streams of rays through a tree whose nodes are matrices.

A node is a matrix, and its rays are the columns of another. An inner node's product gives the distances
at which the rays enter and leave the slabs of its children's boxes; a leaf's product gives the edge
functions of its triangles. Pairs of (node, ray) are sorted by node, cut into blocks of `BLOCK` rays, and
all blocks go through one batched product, so that the number of NumPy calls does not grow with the
number of nodes. The root's children are taken nearest first, each ray in its own order, so that rays
that have found their hit drop out before the next round.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vec import Bools, Floats, Ints, f4
from .build import Tree, build_tree
from .triangle import ROUNDOFF, Doubles

BLOCK = 32  # rays that share one copy of a node's matrix
BLOCK_SHIFT = 5
CHUNK = 1 << 18  # elements of one product
ROUNDS = 8  # children of the root that a ray takes one at a time; then all that are left
SLAB, LINE = slice(0, 9), slice(9, 15)  # columns of Lanes.table
NO_HIT = (0x7F800000 << 32) | 0x7FFFFFFF  # key of a miss: t = inf

Words = NDArray[np.int64]
# Called with the leaf slots (k,), the lanes (k,) and the filter's values (k,) of candidates.
Decide = Callable[[Ints, Ints, Floats], None]


_memory = threading.local()


def scratch(name: str, shape: tuple[int, ...], dtype: type = f4) -> NDArray[Any]:
    """Return this thread's buffer `name`, uninitialised; its last use ends here."""
    size = math.prod(shape)
    held = getattr(_memory, name, None)
    if held is None or held.size < size:
        held = np.empty(size, dtype)
        setattr(_memory, name, held)
    return held[:size].reshape(shape)


def flat_true(mask: Bools) -> Ints:
    """Return the flat indices of what is true in a contiguous mask."""
    return mask.reshape(-1).nonzero()[0]


@dataclass(slots=True)
class Ball:
    """A ball around everything that can be hit."""

    center: Floats  # (3,) float32
    radius: float


def bounding_ball(low: Floats, high: Floats) -> Ball:
    """Return a ball around boxes `low`, `high` (3, m)."""
    lowest, highest = low.min(1).astype(np.float64), high.max(1).astype(np.float64)
    center = ((lowest + highest) / 2).astype(f4)
    reach = np.maximum(highest - center, center - lowest)
    return Ball(center, max(float(np.sqrt((reach * reach).sum())) * (1 + 1e-6), 1e-37))


@dataclass(slots=True)
class Lanes:
    """A batch of n rays, prepared."""

    origin: Floats  # (3, n) as given
    direction: Floats  # (3, n) as given
    leaving: Ints  # (n,)
    line: Floats  # (6, n) Plücker coordinates: unit direction d, then (o - center) × d
    speed: Floats  # (n,) length of `direction`
    local: Floats | None  # (4, n) o - center, 1; None if some origin is far away
    begin: Doubles | None  # (n,) where the slab distances start, None if none is (see prepare)


def prepare(origin: Floats, direction: Floats, leaving: Ints, ball: Ball) -> Lanes:
    """Compute Plücker coordinates of rays (3, n) about the ball's centre.

    They are float32 while all origins are within two radii. Beyond, o - center loses what matters, and
    they are computed in float64; as distances from far away lose it too, those rays' slab distances
    count from two radii before the point nearest to the centre.
    """
    center = ball.center[:, None]
    local: NDArray[Any] = origin - center
    d: NDArray[Any] = direction
    far = local.size and not float(np.abs(local).max()) * 3**0.5 <= 2 * ball.radius
    if far:
        local, d = origin.astype(np.float64) - center, direction.astype(np.float64)
    speed = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    line = np.empty((6, speed.size), f4)
    ux, uy, uz = d / speed
    x, y, z = local
    line[0], line[1], line[2] = ux, uy, uz
    line[3] = y * uz - z * uy
    line[4] = z * ux - x * uz
    line[5] = x * uy - y * ux
    if far:
        begin = -(x * ux + y * uy + z * uz) - 2 * ball.radius
        return Lanes(origin, direction, leaving, line, speed.astype(f4), None, begin)
    homogeneous = np.ones((4, speed.size), f4)
    homogeneous[:3] = local
    return Lanes(origin, direction, leaving, line, speed, homogeneous, None)


def slab_table(lanes: Lanes, ball: Ball) -> Floats:
    """Return one row of 16 numbers per ray, and a last row of NaN for the unused places of blocks.

    1/d, |1/d|, -o/d for slabs; d and moment for edges. Columns of zero direction become tiny ones: the
    boxes are padded by far more than such a ray drifts.
    """
    n = lanes.speed.size
    table = np.empty((n + 1, 16), f4)
    unit = lanes.line[:3]
    safe = np.where(np.abs(unit) < 1e-12, np.copysign(f4(1e-12), unit), unit)
    inverse = 1 / safe
    if lanes.begin is None:
        local = lanes.origin - ball.center[:, None]
    else:
        local = lanes.origin.astype(np.float64) - ball.center[:, None] + lanes.begin * unit
    table[:n, 0:3] = inverse.T
    table[:n, 3:6] = np.abs(inverse).T
    table[:n, 6:9] = (-local * inverse).T
    table[:n, 9:15] = lanes.line.T
    table[:n, 15] = 0
    table[n] = np.nan
    return table


@dataclass(slots=True)
class StreamTree:
    """A tree as matrices."""

    slabs: Floats  # (nodes, 6 width, 9) near x, y, z and far x, y, z of each child
    child: Ints  # (nodes * width,) child codes as in build.Tree
    leaves: Floats  # (leaves, rows, columns) the filter's matrices
    prim: Ints  # (leaves * leaf size,) primitive of each leaf slot
    width: int
    leaf_size: int
    cost: float


def stream_tree(low: Floats, high: Floats, leaf_size: int, width: int, ball: Ball) -> tuple[StreamTree, Tree]:
    """Build the tree and its slab matrices; the caller fills in `leaves`."""
    tree = build_tree(low, high, leaf_size, width)
    absent = tree.low > tree.high
    middle = np.where(absent, 0, (tree.low.astype(np.float64) + tree.high) / 2 - ball.center)
    pad = 64 * ROUNDOFF * ball.radius
    half = np.where(absent, -8 * ball.radius, (tree.high.astype(np.float64) - tree.low) / 2 + pad)
    slabs = np.zeros((len(tree.low), 2, 3, width, 9), f4)
    for axis in range(3):
        for side, sign in enumerate((-1, 1)):
            slabs[:, side, axis, :, axis] = middle[..., axis]
            slabs[:, side, axis, :, 3 + axis] = sign * half[..., axis]
            slabs[:, side, axis, :, 6 + axis] = 1
    result = StreamTree(
        slabs.reshape(-1, 6 * width, 9),
        tree.child.ravel().astype(np.intp),
        np.empty((0, 0, 0), f4),
        tree.prim.ravel(),
        width,
        leaf_size,
        tree.cost,
    )
    return result, tree


def trace(
    tree: StreamTree,
    table: Floats,
    bound: Callable[[Ints], Floats],
    visit: Callable[[Ints, Ints], None],
) -> None:
    """Take rays through the tree, near children of the root first.

    `bound(lanes)` returns how far (unit direction) rays still look; `visit(leaves, lanes)` tests.
    """
    n = len(table) - 1
    code, lane, near = _root_pairs(tree, table, bound(np.arange(n)))
    bits = near.view(np.int32).astype(np.int64)
    key = (lane << 32) | (bits & ~np.int64(tree.width - 1)) | code
    key.sort()
    owner = key >> 32
    first = _firsts(owner)
    last = np.append(first[1:], key.size)
    at = first
    for round_ in range(ROUNDS + 1):
        if not at.size:
            return
        if round_ == ROUNDS:
            at = np.arange(int((last - at).sum())) + np.repeat(
                at - np.cumsum(last - at) + (last - at), last - at
            )
        chosen = key.take(at)
        lanes = chosen >> 32
        close = (chosen & 0xFFFFFFFF & ~np.int64(tree.width - 1)).astype(np.int32).view(f4)
        looking = np.flatnonzero(close <= bound(lanes))
        codes = tree.child.take(chosen.take(looking) & (tree.width - 1))
        _descend(tree, table, codes, lanes.take(looking), bound, visit)
        if round_ == ROUNDS:
            return
        more = looking.compress(at.take(looking) + 1 < last.take(looking))
        at, last = at.take(more) + 1, last.take(more)


def _root_pairs(tree: StreamTree, table: Floats, far: Floats) -> tuple[Ints, Ints, Floats]:
    """All rays against the root's children -> child slot, lane, near distance of pairs."""
    n, width = len(table) - 1, tree.width
    step = max(1, CHUNK // (6 * width))
    parts = []
    for at in range(0, n, step):
        stop = min(n, at + step)
        planes = np.matmul(
            tree.slabs[0], table[at:stop, SLAB].T, out=scratch("product", (6 * width, stop - at))
        ).reshape(1, 6, width, -1)
        hit, near = _boxes_met(planes, far[None, at:stop])
        slot, lane = np.divmod(hit, stop - at)
        parts.append((slot, lane + at, near.reshape(-1).take(hit)))
    if not parts:
        empty = np.zeros(0, np.intp)
        return empty, empty, np.zeros(0, f4)
    slots, lanes, nears = zip(*parts, strict=True)
    return np.concatenate(slots), np.concatenate(lanes), np.concatenate(nears)


def _boxes_met(planes: Floats, far: Floats) -> tuple[Ints, Floats]:
    """Slab distances (blocks, 6, width, rays) -> flat indices of met boxes, near distances."""
    near, leave = planes[:, 0], planes[:, 3]
    np.maximum(near, planes[:, 1], out=near)
    np.maximum(near, planes[:, 2], out=near)
    np.maximum(near, f4(0), out=near)
    np.minimum(leave, planes[:, 4], out=leave)
    np.minimum(leave, planes[:, 5], out=leave)
    np.minimum(leave, far[:, None], out=leave)
    met = np.less_equal(near, leave, out=scratch("mask", near.shape, np.bool_))
    return flat_true(met), near


def _descend(
    tree: StreamTree,
    table: Floats,
    code: Ints,
    lane: Ints,
    bound: Callable[[Ints], Floats],
    visit: Callable[[Ints, Ints], None],
) -> None:
    """Take pairs of child code and lane down to the leaves, level by level."""
    leaf_codes, leaf_lanes = [], []
    while code.size:
        is_leaf = code < 0
        at = np.flatnonzero(is_leaf)
        leaf_codes.append(-1 - code.take(at))
        leaf_lanes.append(lane.take(at))
        at = np.flatnonzero(~is_leaf)
        if not at.size:
            break
        code, lane = _expand(tree, table, code.take(at), lane.take(at), bound)
    if leaf_codes:
        visit(np.concatenate(leaf_codes), np.concatenate(leaf_lanes))


def _expand(
    tree: StreamTree, table: Floats, node: Ints, lane: Ints, bound: Callable[[Ints], Floats]
) -> tuple[Ints, Ints]:
    """Pairs of inner node and lane -> pairs of met child's code and lane."""
    width = tree.width
    nodes, block_lanes = blocks(node, lane, len(table) - 1)
    rays = table.take(block_lanes, 0).reshape(-1, BLOCK, 16)[:, :, SLAB].transpose(0, 2, 1)
    far = bound(block_lanes).reshape(-1, BLOCK)
    step = max(1, CHUNK // (6 * width * BLOCK))
    hits = []
    for start in range(0, nodes.size, step):
        part = slice(start, start + step)
        shape = (nodes[part].size, 6 * width, BLOCK)
        matrices = np.take(tree.slabs, nodes[part], 0, scratch("nodes", (*shape[:2], 9)), "clip")
        planes = np.matmul(matrices, rays[part], out=scratch("product", shape))
        hit, _ = _boxes_met(planes.reshape(-1, 6, width, BLOCK), far[part])
        hit += start * (width * BLOCK)
        hits.append(hit)
    hit = np.concatenate(hits)
    pair = hit >> BLOCK_SHIFT
    block = pair // width
    code = tree.child.take(nodes.take(block) * width + (pair & (width - 1)))
    return code, block_lanes.take((block << BLOCK_SHIFT) + (hit & (BLOCK - 1)))


def blocks(node: Ints, lane: Ints, unused: int) -> tuple[Ints, Ints]:
    """Sort pairs by node and cut them into blocks of one node and BLOCK lanes each.

    Returns the nodes (b,) and lanes (b * BLOCK,); places that are left over hold lane `unused`.
    """
    key = (node << 32) | lane
    key.sort()
    node, lane = key >> 32, key & 0xFFFFFFFF
    first = _firsts(node)
    count = np.diff(first, append=node.size)
    needed = (count + (BLOCK - 1)) >> BLOCK_SHIFT
    begin = np.cumsum(needed) - needed
    place = np.arange(node.size) + np.repeat((begin << BLOCK_SHIFT) - first, count)
    lanes = np.full(int(needed.sum()) * BLOCK, unused)
    lanes[place] = lane
    return np.repeat(node.take(first), needed), lanes


def _firsts(values: Ints) -> Ints:
    """Return where runs of equal values begin."""
    begins = np.empty(values.size, bool)
    begins[:1] = True
    np.not_equal(values[1:], values[:-1], out=begins[1:])
    return flat_true(begins)

"""Trace streams of rays through a tree whose nodes are matrices.

A node is a matrix, and its rays are the columns of another. Around each child lies an ellipsoid, and a line
meets an ellipsoid where a quadratic form in its Plücker coordinates is not negative: an inner node's
product has one row per child, on the 21 products of two coordinates. A leaf's product gives the edge
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
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vec import Bools, Floats, Ints, f4
from .build import build_tree
from .triangle import ROUNDOFF, Doubles

BLOCK = 32  # rays that share one copy of a node's matrix
BLOCK_SHIFT = 5
CHUNK = 1 << 18  # elements of one product
ROUNDS = (1, 1, 1, 2)  # children of the root that a ray takes in each round; then all that are left
TOP = 128  # children of the root at most: those of its children join it while so many fit
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
    line: Floats  # (6, n + 1) Plücker coordinates: unit direction d, then (o - center) × d; the last is NaN
    speed: Floats  # (n,) length of `direction`
    start: Floats | None  # (4, n) o - center, 1; None if some origin is far away
    end: Floats | None  # (4, n) the same of where rays end; None if they have no end, or start is None
    begin: Floats | Doubles  # (n,) where rays start, as a distance from the point next to the centre

    @property
    def count(self) -> int:
        """Number of rays."""
        return self.speed.size


def prepare(
    origin: Floats, direction: Floats, leaving: Ints, ball: Ball, distance: Floats | None = None
) -> Lanes:
    """Compute Plücker coordinates of rays (3, n) about the ball's centre, which end at `distance` (n,).

    They are float32 while all origins are within two radii. Beyond, o - center loses what matters, and
    they are computed in float64.
    """
    center = ball.center[:, None]
    local: NDArray[Any] = origin - center
    d: NDArray[Any] = direction
    far = local.size and not float(np.abs(local).max()) * 3**0.5 <= 2 * ball.radius
    if far:
        local, d = origin.astype(np.float64) - center, direction.astype(np.float64)
    speed = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    line = np.empty((6, speed.size + 1), f4)
    line[:, -1] = np.nan
    part = line[:, :-1]
    ux, uy, uz = d / speed
    x, y, z = local
    part[0], part[1], part[2] = ux, uy, uz
    part[3] = y * uz - z * uy
    part[4] = z * ux - x * uz
    part[5] = x * uy - y * ux
    begin = x * ux + y * uy + z * uz
    if far:
        return Lanes(origin, direction, leaving, line, speed.astype(f4), None, None, begin)
    start = np.ones((4, speed.size), f4)
    start[:3] = local
    end = None
    if distance is not None:
        end = np.ones((4, speed.size), f4)
        np.multiply(part[:3], np.minimum(distance * speed, f4(3 * ball.radius)), out=end[:3])
        end[:3] += local
    return Lanes(origin, direction, leaving, line, speed, start, end, begin)


@dataclass(slots=True)
class StreamTree:
    """A tree as matrices. Lengths are in units of the ball's radius, places relative to its centre."""

    root: Floats  # (top, 21) quadrics of the root's children, see quadric_rows
    top: Ints  # (top,) their slots
    quadrics: Floats  # (nodes, width, 21) quadrics of each child, about the node's centre
    center: Floats  # (nodes, 3) where a node's moments are taken about
    ball: Floats  # (nodes * width, 4) centre and radius of a ball around each child
    child: Ints  # (nodes * width,) child codes as in build.Tree
    leaves: Floats  # (leaves, rows, columns) the filter's matrices
    prim: Ints  # (leaves * leaf size,) primitive of each leaf slot
    width: int
    leaf_size: int
    cost: float
    scale: np.float32  # 1 / the ball's radius


def stream_tree(points: Floats, leaf_size: int, width: int, ball: Ball) -> StreamTree:
    """Build the tree and its quadrics over primitives within points (corners, 3, m).

    The caller fills in `leaves`.
    """
    low, high = points.min(0), points.max(0)
    local = ((points - ball.center[:, None].astype(np.float64)) / ball.radius).astype(f4)
    tree = build_tree(low, high, leaf_size, width, partial(fit_ellipsoids, local))
    assert tree.shape is not None
    absent = tree.low[..., 0] > tree.high[..., 0]
    nodes = len(absent)
    center = np.zeros((nodes, 3))
    inner = np.flatnonzero(~absent & (tree.child >= 0))
    shapes = tree.shape.reshape(-1, 12)
    center[tree.child.ravel()[inner]] = shapes[inner, :3]
    reach = np.ones(nodes)
    reach[tree.child.ravel()[inner]] = np.linalg.norm(shapes[inner, 3:], axis=1)
    quadrics = quadric_rows(tree.shape, center, reach)
    quadrics[absent] = 0
    for axis in range(3):
        quadrics[absent, PAIRS.index((axis, axis))] = -1
    balls = np.empty((nodes * width, 4), f4)
    balls[:, :3] = shapes[:, :3]
    axes = shapes[:, 3:].reshape(-1, 3, 3)
    balls[:, 3] = np.sqrt((axes * axes).sum(1).max(1)) * (1 + 1e-6) + 2e-5
    top = np.flatnonzero(~absent[0])
    child = tree.child.ravel().astype(np.intp)
    while True:
        inside = child.take(top) > 0
        below = (child.take(top[inside])[:, None] * width + np.arange(width)).ravel()
        wider = np.concatenate([top[~inside], below[~absent.ravel()[below]]])
        if not inside.any() or wider.size > TOP:
            break
        top = wider
    root = quadric_rows(shapes[None, top], np.zeros((1, 3)), np.ones(1))[0]
    scale = f4(1 / ball.radius)
    leaves = np.empty((0, 0, 0), f4)
    return StreamTree(
        root, top, quadrics, center.astype(f4), balls, child, leaves, tree.prim.ravel(), width, leaf_size,
        tree.cost, scale,
    )  # fmt: skip


def fit_ellipsoids(points: Floats, order: Ints, start: Ints) -> Doubles:
    """Fit ellipsoids around segments of primitives within points (corners, 3, m) -> (segments, 12).

    Centre, then the three half axes, as columns of a matrix: the principal axes of the points, scaled to
    their extent along each, and then until all points are inside.
    """
    count = np.diff(start, append=order.size)
    owner = np.repeat(np.arange(start.size), count)
    chosen = points.take(order, 2)
    weight = 1 / (count * len(points))
    mean = np.add.reduceat(chosen.sum(0, dtype=np.float64), start, 1) * weight
    chosen -= mean.astype(f4).take(owner, 1)
    spread = np.empty((start.size, 3, 3))
    for i in range(3):
        for j in range(i + 1):
            product = (chosen[:, i] * chosen[:, j]).sum(0)
            spread[:, i, j] = spread[:, j, i] = np.add.reduceat(product, start) * weight
    axes = np.linalg.eigh(spread)[1]  # columns
    along = []
    half = np.empty((3, start.size))
    shift = np.empty((3, start.size))
    for axis in range(3):
        x, y, z = axes[:, :, axis].astype(f4).T.take(owner, 1)
        value = chosen[:, 0] * x + chosen[:, 1] * y + chosen[:, 2] * z
        low = np.minimum.reduceat(value.min(0), start)
        high = np.maximum.reduceat(value.max(0), start)
        shift[axis] = middle = ((low + high) / 2).astype(f4)
        half[axis] = (high - low) / 2 + 2e-6
        value -= middle.astype(f4).take(owner)
        along.append(value)
    half = np.maximum(half, np.maximum(0.02 * half.max(0), 1e-5))
    norm: Floats = np.zeros(chosen.shape[::2], f4)
    for axis in range(3):
        value = along[axis]
        value *= (1 / half[axis]).astype(f4).take(owner)
        value *= value
        norm = norm + value
    grow = np.sqrt(np.maximum.reduceat(norm.max(0), start).astype(np.float64)) * (1 + 2e-4)
    shape = np.empty((start.size, 12))
    shape[:, :3] = mean.T.astype(f4) + np.einsum("sij,js->si", axes, shift)
    shape[:, 3:] = (axes * (half * grow).T[:, None]).reshape(-1, 9)
    return shape


PAIRS = [(i, j) for i in range(6) for j in range(i, 6)]


def quadric_rows(shape: Doubles, center: Doubles, reach: Doubles) -> Floats:
    """Quadratic forms in Plücker coordinates: not below 0 where a line meets an ellipsoid.

    With half axes S and centre c: |adj(S) d|² - |Sᵀ (m - c × d)|² >= 0, as the map that turns the
    ellipsoid into the unit ball turns directions d into S⁻¹ d and moments m by the cofactors of S⁻¹.
    `shape` (nodes, width, 12), as in fit_ellipsoids; moments are about `center` (nodes, 3), and lines pass it
    within `reach`. Rows are enlarged by a bound of the error of float32, so that no line is lost.
    """
    c = shape[..., :3] - center[:, None]
    s = shape[..., 3:].reshape(*shape.shape[:2], 3, 3)
    size2 = (s * s).sum(-2)
    size = np.sort(np.sqrt(size2), -1)
    unit = 1 / (size[..., 1] * size[..., 2])  # rows are scaled for |adj(S) d| <= 1
    spread = s @ s.swapaxes(-1, -2) * (unit * unit)[..., None, None]
    adjoint = np.cross(s[..., [1, 2, 0]], s[..., [2, 0, 1]], axis=-2) * unit[..., None, None]
    cross = np.zeros_like(s)  # c × d = cross @ d
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., i, j], cross[..., j, i] = -c[..., k], c[..., k]
    form = np.empty((*s.shape[:2], 6, 6))
    form[..., :3, :3] = adjoint @ adjoint.swapaxes(-1, -2) - cross.swapaxes(-1, -2) @ spread @ cross
    form[..., 3:, 3:] = -spread
    form[..., 3:, :3] = spread @ cross
    form[..., :3, 3:] = form[..., 3:, :3].swapaxes(-1, -2)
    moment = np.ones((len(s), 6)) * reach[:, None] * 1.01 + 1e-5
    moment[:, :3] = 1
    magnitude = (np.abs(form) * moment[:, None, :, None] * moment[:, None, None, :]).sum((-1, -2))
    largest = size[..., 2] * unit
    moment_error = 50 * ROUNDOFF
    rounding = 30 * ROUNDOFF * magnitude + 2 * largest * moment_error + (largest * moment_error) ** 2
    rounding += 2 * (1 + np.linalg.norm(c, axis=-1) * largest) * 4 * ROUNDOFF
    rows = np.stack([form[..., i, j] * (1 if i == j else 2) for i, j in PAIRS], -1)
    for i in range(3):
        rows[..., PAIRS.index((i, i))] += 1.1 * rounding
    return rows.astype(f4)


def trace(
    tree: StreamTree, lanes: Lanes, reach_now: Callable[[], Floats], visit: Callable[[Ints, Ints], None]
) -> None:
    """Take rays through the tree, near children of the root first.

    `reach_now()` (n + 1,) is how far rays still look, less after `visit(leaves, lanes)`, which tests.
    """
    reach = reach_now()
    line = lanes.line.copy()
    line[3:] *= tree.scale
    begin = np.append((lanes.begin * tree.scale - np.abs(lanes.begin * tree.scale) * 1e-6).astype(f4), f4(0))
    codes = tree.child.take(tree.top)
    mask = (1 << (tree.top.size - 1).bit_length()) - 1
    slot, lane, near = _root_pairs(tree, line, begin, reach)
    bits = near.view(np.int32).astype(np.int64)
    bits &= ~mask
    bits |= slot
    bits |= lane << 32
    key = bits
    key.sort()
    owner = key >> 32
    at = _firsts(owner)
    last = np.append(at[1:], key.size)
    for taken in (*ROUNDS, 1 << 30):
        if not at.size:
            return
        count = np.minimum(last - at, taken)
        ends = np.cumsum(count)
        place = at
        if taken > 1:
            place = np.arange(int(ends[-1])) + np.repeat(at - ends + count, count)
        chosen = key.take(place)
        lane = chosen >> 32
        close = (chosen & (0xFFFFFFFF ^ mask)).astype(np.int32).view(f4) - OFFSET
        looking = np.flatnonzero(close <= reach.take(lane))
        code = codes.take(chosen.take(looking) & mask)
        _descend(tree, line, begin, reach, code, lane.take(looking), visit)
        reach = reach_now()
        at = at + count
        more = np.flatnonzero(at < last)
        at, last = at.take(more), last.take(more)


OFFSET = f4(4)  # makes distances positive, so that their bits sort like numbers


def _root_pairs(tree: StreamTree, line: Floats, begin: Floats, reach: Floats) -> tuple[Ints, Ints, Floats]:
    """All rays against the root's children -> child, lane, near distance + OFFSET of pairs."""
    n, width = line.shape[1] - 1, tree.top.size
    step = max(256, CHUNK // width)
    parts = []
    balls = np.ascontiguousarray(tree.ball.take(tree.top, 0))
    for at in range(0, n, step):
        k = min(n - at, step)
        part = line[:, at : at + k]
        features = scratch("features", (21, k))
        _features(part, features)
        value = np.matmul(tree.root, features, out=scratch("product", (width, k)))
        hit = flat_true(np.greater_equal(value, 0, out=scratch("mask", value.shape, np.bool_)))
        along = np.matmul(balls[:, :3], part[:3], out=value).reshape(-1).take(hit)
        slot = hit // k
        lane = hit - slot * k + at
        radius = balls[:, 3].take(slot)
        near = along - radius
        met = np.flatnonzero((along + radius >= begin.take(lane)) & (near <= reach.take(lane)))
        near += OFFSET
        parts.append((slot.take(met), lane.take(met), near.take(met)))
    if not parts:
        empty = np.zeros(0, np.intp)
        return empty, empty, np.zeros(0, f4)
    slots, lanes, nears = zip(*parts, strict=True)
    return np.concatenate(slots), np.concatenate(lanes), np.concatenate(nears)


def _features(line: Floats, out: Floats) -> None:
    """Products of all pairs of Plücker coordinates (6, ...) -> (21, ...)."""
    for row, (i, j) in enumerate(PAIRS):
        np.multiply(line[i], line[j], out=out[row])


def _descend(
    tree: StreamTree,
    line: Floats,
    begin: Floats,
    reach: Floats,
    code: Ints,
    lane: Ints,
    visit: Callable[[Ints, Ints], None],
) -> None:
    """Take pairs of child code and lane down to the leaves, level by level."""
    leaf_codes, leaf_lanes = [], []
    while code.size:
        is_leaf = code < 0
        at = np.flatnonzero(is_leaf)
        if at.size == code.size:
            leaf_codes.append(-1 - code)
            leaf_lanes.append(lane)
            break
        if at.size:
            leaf_codes.append(-1 - code.take(at))
            leaf_lanes.append(lane.take(at))
            at = np.flatnonzero(~is_leaf)
            code, lane = code.take(at), lane.take(at)
        code, lane = _expand(tree, line, begin, reach, code, lane)
    if leaf_codes:
        visit(np.concatenate(leaf_codes), np.concatenate(leaf_lanes))


def _expand(
    tree: StreamTree, line: Floats, begin: Floats, reach: Floats, node: Ints, lane: Ints
) -> tuple[Ints, Ints]:
    """Pairs of inner node and lane -> pairs of met child's code and lane."""
    width = tree.width
    nodes, block_lanes = blocks(node, lane, line.shape[1] - 1)
    step = max(1, CHUNK // (width * BLOCK))
    codes, lanes = [], []
    for start in range(0, nodes.size, step):
        chosen = nodes[start : start + step]
        k = chosen.size
        some = block_lanes[start * BLOCK : (start + k) * BLOCK]
        rays = scratch("rays", (6, k, BLOCK))
        for row in range(6):
            np.take(line[row], some, 0, rays[row].reshape(-1), "clip")
        dx, dy, dz = rays[:3]
        cx, cy, cz = tree.center.take(chosen, 0).T[:, :, None]
        rays[3] -= cy * dz - cz * dy
        rays[4] -= cz * dx - cx * dz
        rays[5] -= cx * dy - cy * dx
        features = scratch("features", (k, 21, BLOCK))
        _features(rays, features.transpose(1, 0, 2))
        matrices = np.take(tree.quadrics, chosen, 0, scratch("nodes", (k, width, 21)), "clip")
        value = np.matmul(matrices, features, out=scratch("product", (k, width, BLOCK)))
        hit = flat_true(np.greater_equal(value, 0, out=scratch("mask", value.shape, np.bool_)))
        pair = hit >> BLOCK_SHIFT
        block = pair // width
        slot = chosen.take(block) * width + (pair & (width - 1))
        place = (block << BLOCK_SHIFT) + (hit & (BLOCK - 1))
        lane = some.take(place)
        x, y, z, radius = tree.ball.take(slot, 0).T
        flat = rays.reshape(6, -1)
        along = x * flat[0].take(place) + y * flat[1].take(place) + z * flat[2].take(place)
        met = (along + radius >= begin.take(lane)) & (along - radius <= reach.take(lane))
        met_at = np.flatnonzero(met)
        codes.append(tree.child.take(slot.take(met_at)))
        lanes.append(lane.take(met_at))
    return np.concatenate(codes), np.concatenate(lanes)


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

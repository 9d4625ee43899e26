"""A bounding volume hierarchy for batches of rays, traversed by matrix products.

Each child of a node is bounded by an ellipsoid. A line meets an ellipsoid where a quadratic form in its
Plücker coordinates is not negative, so an inner node is a matrix of one row per child, which multiplies the
21 products of two coordinates of each ray. The matrix of a leaf gives the edge functions of its triangles.
Pairs of node and ray are sorted by node and split into blocks of `BLOCK` rays, and one batched product
tests all blocks, so that the number of NumPy calls does not grow with the number of nodes. Each ray visits
the children of the root in the order of their distance; rays that have a nearer hit leave out the rest.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import TINY, Bools, Doubles, Floats, Ints, f4, spans
from .build import build_tree, stable_order
from .triangle import ROUNDOFF

BLOCK = 32  # rays that share one copy of a node's matrix
BLOCK_SHIFT = 5
CHUNK = 1 << 18  # elements of one product
AT_ONCE = 1 << 15  # primitives per batch: their bounds fit the cache
NEAR_ROUNDS = 3  # rounds in which each ray visits its nearest child of the root; then it visits all others
TOP = 128  # most children of the root: inner children are replaced by their own while these fit

PAIRS = [(i, j) for i in range(6) for j in range(i, 6)]  # of Plücker coordinates
BOX_MARGIN = 4e-6  # added to boxes on all sides, for the rounding of lines
OFFSET = f4(4)  # makes distances positive, so that their bits sort like numbers

Codes = NDArray[np.int64]

_memory = threading.local()


def scratch(name: str, shape: tuple[int, ...], dtype: type = f4) -> NDArray[Any]:
    """Return this thread's buffer `name`, uninitialized; earlier arrays from it become invalid.

    A name must always be used with the same type.
    """
    size = math.prod(shape)
    buffer = getattr(_memory, name, None)
    if buffer is None or buffer.size < size:
        buffer = np.empty(size, dtype)
        setattr(_memory, name, buffer)
    return buffer[:size].reshape(shape)


def flat_true(mask: Bools) -> Ints:
    """Return the flat indices of the true elements of a contiguous mask."""
    return mask.reshape(-1).nonzero()[0]


@soa
class Ball:
    """A bounding ball of all primitives."""

    center: Floats  # (3,) float32
    radius: float


def bounding_ball(low: Floats, high: Floats) -> Ball:
    """Return a bounding ball of boxes `low`, `high` (3, m)."""
    lowest, highest = low.min(1).astype(np.float64), high.max(1).astype(np.float64)
    center = ((lowest + highest) / 2).astype(f4)
    extent = np.maximum(highest - center, center - lowest)
    return Ball(center, max(float(np.sqrt((extent * extent).sum())) * (1 + 1e-6), 1e-37))


@dataclass
class RayBatch:
    """A batch of n rays with their Plücker coordinates."""

    origin: Floats  # (3, n) as given
    direction: Floats  # (3, n) as given
    exclude_prim: Ints  # (n,)
    line: Floats  # (6, n + 1) Plücker coordinates: unit direction d, then (o - center) × d; the last is NaN
    direction_length: Floats  # (n,) length of `direction`
    local: Floats | Doubles  # (3, n) o - center
    start: Floats | None  # (4, n) o - center, 1; None if some origin is far away, or some end is not finite
    end: Floats | None  # (4, n) the same of the rays' end points; None if they have none, or start is None

    @property
    def count(self) -> int:
        """Number of rays."""
        return self.direction_length.size

    @cached_property
    def begin(self) -> Floats | Doubles:
        """Signed distance of the origins (n,) along the line, from its point nearest to the center."""
        x, y, z = self.local
        ux, uy, uz = self.line[:3, :-1]
        return x * ux + y * uy + z * uz


def prepare(
    origin: Floats, direction: Floats, exclude_prim: Ints, ball: Ball, distance: Floats | None = None
) -> RayBatch:
    """Compute Plücker coordinates of rays (3, n) about the ball's center.

    `distance` (n,) is where shadow rays end. The coordinates are computed in float32 if all origins are
    within two radii of the center, and else in float64, because o - center would lose too many digits.
    """
    n = origin.shape[1]
    start, far = start_points(origin, ball)
    direction_length = lengths(direction)
    line = scratch("line", (6, n + 1))
    line[:, -1] = np.nan
    unit, moment = line[:3, :-1], line[3:, :-1]
    np.divide(direction, direction_length, out=unit)
    if far:
        wide = scratch("wide", (8, n), np.float64)
        local = np.subtract(origin, ball.center[:, None], out=wide[:3], dtype=np.float64)
        np.divide(_cross(local, direction, wide[3:]), direction_length, out=moment, casting="same_kind")
        squared = np.multiply(moment, moment, out=scratch("work", (3, n)))
        # A line outside the ball hits nothing; the error bounds of the filters do not hold for it.
        line[:, np.flatnonzero(squared[0] + squared[1] + squared[2] > (1.01 * ball.radius) ** 2)] = np.nan
        return RayBatch(origin, direction, exclude_prim, line, direction_length, local, None, None)
    local = start[:3]
    moment[:] = _cross(local, unit, scratch("moment", (5, n)))
    end = None
    if distance is not None:
        end = end_points(start, direction, direction_length, distance, ball)
        if end is None:
            return RayBatch(origin, direction, exclude_prim, line, direction_length, local, None, None)
    return RayBatch(origin, direction, exclude_prim, line, direction_length, local, start, end)


def start_points(origin: Floats, ball: Ball) -> tuple[Floats, bool]:
    """Return o - center and a row of ones, (4, n), and whether some origin is far away from the ball."""
    start = scratch("start", (4, origin.shape[1]))
    start[3] = 1
    local = np.subtract(origin, ball.center[:, None], out=start[:3])
    furthest = np.maximum(local.max(initial=0), -local.min(initial=0))
    return start, not float(furthest) * 3**0.5 <= 2 * ball.radius


def lengths(direction: Floats) -> Floats:
    """Return the lengths (n,) of directions (3, n)."""
    squared = np.multiply(direction, direction, out=scratch("work", direction.shape))
    length = np.add(squared[0], squared[1], out=scratch("direction_length", squared[2].shape))
    length += squared[2]
    return np.sqrt(length, out=length)


def end_points(
    start: Floats, direction: Floats, direction_length: Floats, distance: Floats, ball: Ball
) -> Floats | None:
    """Return the ends of shadow rays, as `start_points` does their origins; None if not all are finite.

    Rays that reach beyond the ball end behind it.
    """
    length = np.divide(f4(3.01 * ball.radius), direction_length, out=scratch("length", distance.shape))
    np.minimum(distance, length, out=length)
    np.maximum(length, f4(0), out=length)
    end = _with_one("end", direction)
    end[:3] *= length
    end[:3] += start[:3]
    return end if np.isfinite(end.max(initial=0) + direction_length.max(initial=0)) else None


def _cross(a: NDArray[Any], b: NDArray[Any], work: NDArray[Any]) -> NDArray[Any]:
    """Return cross products of vectors (3, n), in the first rows of `work` (5, n)."""
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=work[3])
        np.multiply(a[j], b[i], out=work[4])
        np.subtract(work[3], work[4], out=work[axis])
    return work[:3]


def _with_one(name: str, points: Floats) -> Floats:
    """Append a row of ones to points (3, n), in the buffer `name`."""
    out = scratch(name, (4, points.shape[1]))
    out[:3] = points
    out[3] = 1
    return out


@soa
class Bvh:
    """A tree as matrices. Lengths are in units of the ball's radius, positions relative to its center."""

    root: Floats  # (top, 21) quadrics of the root's children, see quadric_rows
    top: Ints  # (top,) columns of the root's children in `box` and `child`
    quadrics: Floats  # (nodes, width, 21) quadrics of each child, about the node's center
    center: Floats  # (nodes, 3) reference points of the moments
    box: Floats  # (6, nodes * width) lower and upper corner of each child's box
    child: Ints  # (nodes * width,) child codes as in build.Tree
    leaves: Floats  # (leaves, rows, columns) the filter's matrices
    prim: Ints  # (leaves * leaf size,) primitive of each leaf slot
    width: int
    leaf_size: int
    cost: float
    scale: np.float32  # 1 / the ball's radius


class Bounded(Protocol):
    """Primitives within the convex hulls of points."""

    def take(self, index: Ints) -> Bounded:
        """Return some of the primitives."""

    def hull(self) -> Floats:
        """Return the points of m primitives, (corners, 3, m)."""


def build_bvh(primitives: Bounded, ids: Ints, leaf_size: int, width: int, ball: Ball) -> Bvh:
    """Build the tree and its quadrics over primitives `ids` (m,).

    The caller fills in `leaves`.
    """

    def fit(order: Ints, start: Ints) -> Doubles:
        points = primitives.take(ids.take(order)).hull()
        local = ((points - ball.center[:, None].astype(np.float64)) / ball.radius).astype(f4)
        return fit_ellipsoids(local, start)

    tree = build_tree(*_boxes(primitives, ids), leaf_size, width, fit)
    assert tree.shape is not None
    absent = tree.low[..., 0] > tree.high[..., 0]
    child = tree.child.ravel().astype(np.intp)
    quadrics, center = _inner_quadrics(tree.shape, child, absent)
    top = _top_children(child, absent)
    corners = np.concatenate([tree.low.reshape(-1, 3).T, tree.high.reshape(-1, 3).T]).astype(np.float64)
    box = (corners - np.tile(ball.center, 2)[:, None]) / ball.radius
    box += np.repeat([-BOX_MARGIN, BOX_MARGIN], 3)[:, None]
    return Bvh(
        root=quadric_rows(tree.shape.reshape(1, -1, 12)[:, top], np.zeros((1, 3)), np.ones(1))[0],
        top=top,
        quadrics=quadrics,
        center=center.astype(f4),
        box=box.astype(f4),
        child=child,
        leaves=np.empty((0, 0, 0), f4),
        prim=tree.prim.ravel(),
        width=width,
        leaf_size=leaf_size,
        cost=tree.cost,
        scale=f4(1 / ball.radius),
    )


def _boxes(primitives: Bounded, ids: Ints) -> tuple[Floats, Floats]:
    """Return the lower and upper corners (3, m) of the boxes of primitives `ids` (m,)."""
    low, high = np.empty((3, ids.size), f4), np.empty((3, ids.size), f4)
    for span in spans(ids.size, AT_ONCE):
        points = primitives.take(ids[span]).hull()
        low[:, span], high[:, span] = points.min(0), points.max(0)
    return low, high


def _inner_quadrics(shape: Doubles, child: Ints, absent: Bools) -> tuple[Floats, Doubles]:
    """Return the quadrics of the children of all nodes, and the points (nodes, 3) that they are about.

    Parameters
    ----------
    shape
        (nodes, width, 12) their ellipsoids, as of `fit_ellipsoids`.
    child
        (nodes * width,) child codes.
    absent
        (nodes, width) where there is no child; no line meets its quadric.
    """
    nodes, width = absent.shape
    inner = np.flatnonzero(~absent.ravel() & (child >= 0))
    of_child = shape.reshape(-1, 12)[inner]
    center, radius = np.zeros((nodes, 3)), np.ones(nodes)
    center[child[inner]] = of_child[:, :3]
    radius[child[inner]] = np.linalg.norm(of_child[:, 3:], axis=1)
    quadrics = np.empty((nodes, width, len(PAIRS)), f4)
    for span in spans(nodes, AT_ONCE // width):
        quadrics[span] = quadric_rows(shape[span], center[span], radius[span])
    quadrics[absent] = 0
    for axis in range(3):
        quadrics[absent, PAIRS.index((axis, axis))] = -1
    return quadrics, center


def _top_children(child: Ints, absent: Bools) -> Ints:
    """Return the slots (top,) of the children of the root, with inner ones replaced while at most `TOP`."""
    width = absent.shape[1]
    top = np.flatnonzero(~absent[0])
    while True:
        inside = child.take(top) > 0
        below = (child.take(top[inside])[:, None] * width + np.arange(width)).ravel()
        wider = np.concatenate([top[~inside], below[~absent.ravel()[below]]])
        if not inside.any() or wider.size > TOP:
            return top
        top = wider


def fit_ellipsoids(points: Floats, start: Ints) -> Doubles:
    """Fit a bounding ellipsoid to each segment of primitives with points (corners, 3, m), overwriting them.

    `start` is where segments begin.

    Returns (segments, 12): the center, then the three half axes as columns of a matrix. These are the
    principal axes of the points, scaled to the extent along each, and then until all points are inside.
    """
    count = np.diff(start, append=points.shape[2])
    owner = np.repeat(np.arange(start.size), count)
    weight = 1 / (count * len(points))
    mean = np.add.reduceat(points.sum(0, dtype=np.float64), start, 1) * weight
    points -= mean.astype(f4).take(owner, 1)
    spread = np.empty((start.size, 3, 3))
    for i in range(3):
        for j in range(i + 1):
            product = (points[:, i] * points[:, j]).sum(0)
            spread[:, i, j] = spread[:, j, i] = np.add.reduceat(product, start) * weight
    axes = np.linalg.eigh(spread)[1]  # columns
    along = []
    half = np.empty((3, start.size))
    shift = np.empty((3, start.size))
    for axis in range(3):
        x, y, z = axes[:, :, axis].astype(f4).T.take(owner, 1)
        value = points[:, 0] * x + points[:, 1] * y + points[:, 2] * z
        low = np.minimum.reduceat(value.min(0), start)
        high = np.maximum.reduceat(value.max(0), start)
        shift[axis] = middle = ((low + high) / 2).astype(f4)
        half[axis] = (high - low) / 2 + 2e-6
        value -= middle.astype(f4).take(owner)
        along.append(value)
    half = np.maximum(half, np.maximum(0.02 * half.max(0), 1e-5))
    norm: Floats = np.zeros(points.shape[::2], f4)
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


def quadric_rows(shape: Doubles, center: Doubles, radius: Doubles) -> Floats:
    """Return quadratic forms in Plücker coordinates, not negative where a line meets an ellipsoid.

    With half axes S and center c: |adj(S) d|² - |Sᵀ (m - c × d)|² >= 0, as the map that turns the
    ellipsoid into the unit ball turns directions d into S⁻¹ d and moments m by the cofactors of S⁻¹.
    `shape` (nodes, width, 12) is as in `fit_ellipsoids`. Moments are about `center` (nodes, 3), and
    lines pass it within `radius` (nodes,). Rows include a bound of the float32 error: no hit is missed.
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
    moment = np.ones((len(s), 6)) * radius[:, None] * 1.01 + 1e-5
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
    tree: Bvh,
    batch: RayBatch,
    t_far_now: Callable[[], Floats],
    visit: Callable[[Ints, Ints], None],
    boxes: MovingBoxes | None = None,
) -> None:
    """Traverse the tree, near children of the root first.

    Parameters
    ----------
    batch
        n rays.
    t_far_now
        Returns the largest distance at which a hit still matters, (n + 1,). It decreases with the hits that
        `visit` finds. Distances count along the line from its point nearest to the ball's center, in units
        of the ball's radius.
    visit
        Tests pairs of leaves (k,) and lanes (k,).
    boxes
        Those of children that move, in place of the tree's.
    """
    t_far = t_far_now()
    rays = _lines(batch, tree.scale, boxes)
    codes = tree.child.take(tree.top)
    slot, lane, near = _root_pairs(tree, rays, t_far)
    for last in (*[False] * NEAR_ROUNDS, True):
        chosen = np.arange(lane.size) if last else _nearest_of_each(lane, near, batch.count)
        _descend(tree, rays, t_far, codes.take(slot.take(chosen)), lane.take(chosen), visit)
        t_far = t_far_now()
        left = near <= t_far.take(lane)
        left[chosen] = False
        rest = np.flatnonzero(left)
        if not rest.size:
            return
        slot, lane, near = slot.take(rest), lane.take(rest), near.take(rest)


@soa
class MovingBoxes:
    """Boxes of the children of a tree that go from one place to another, and parts of their way for rays."""

    change: Floats  # (6, nodes * width) from the tree's boxes, which are those at the beginning, to the end
    part: Floats  # (n + 1,) of the way that is over at the times of n rays


@soa
class _Lines:
    """The lines of n rays in units of the ball's radius, about its center, and one that meets nothing."""

    line: Floats  # (6, n + 1) Plücker coordinates
    foot: Floats  # (3, n + 1) point of the line nearest to the center; distances count from it
    inverse: Floats  # (3, n + 1) 1 / direction
    begin: Floats  # (n + 1,) distances of the origins
    boxes: MovingBoxes | None  # where the boxes move

    def span(self, box: Floats, slot: Ints, lane: Ints) -> tuple[Floats, Floats]:
        """Return the entry and exit distances of lanes (k,) at boxes `slot` (k,) of `box` (6, slots)."""
        enter, leave = self.begin.take(lane), np.full(lane.size, np.inf, f4)
        part = None if self.boxes is None else self.boxes.part.take(lane)
        for axis in range(3):
            foot, inverse = self.foot[axis].take(lane), self.inverse[axis].take(lane)
            low, high = box[axis].take(slot), box[axis + 3].take(slot)
            if part is not None and self.boxes is not None:
                low += self.boxes.change[axis].take(slot) * part
                high += self.boxes.change[axis + 3].take(slot) * part
            first = (low - foot) * inverse
            second = (high - foot) * inverse
            np.maximum(enter, np.minimum(first, second), out=enter)
            np.minimum(leave, np.maximum(first, second), out=leave)
        return enter, leave


def _lines(batch: RayBatch, scale: np.float32, boxes: MovingBoxes | None) -> _Lines:
    line = batch.line.copy()
    line[3:] *= scale
    dx, dy, dz, mx, my, mz = line
    foot = np.stack([dy * mz - dz * my, dz * mx - dx * mz, dx * my - dy * mx])
    inverse = f4(1) / np.where(line[:3] == 0, TINY, line[:3])  # 0 times the inverse must not be NaN
    begin = batch.begin * scale
    begin = np.append((begin - np.abs(begin) * 1e-6 - 1e-6).astype(f4), f4(np.inf))
    return _Lines(line, foot, inverse, begin, boxes)


def _nearest_of_each(lane: Ints, near: Floats, count: int) -> Ints:
    """Return the index of the nearest pair of each lane that has one."""
    key = (near + OFFSET).view(np.int32).astype(np.int64) << 32
    key |= np.arange(lane.size)
    none = np.iinfo(np.int64).max
    least = np.full(count, none, np.int64)
    np.minimum.at(least, lane, key)
    return least.compress(least != none) & 0xFFFFFFFF


def _root_pairs(tree: Bvh, rays: _Lines, t_far: Floats) -> tuple[Ints, Ints, Floats]:
    """Return child, lane and entry distance of the pairs of ray and root's child that meet."""
    n, width, moving = rays.begin.size - 1, tree.top.size, rays.boxes is not None
    step, box = max(256, CHUNK // width), tree.box if moving else tree.box.take(tree.top, 1)
    parts = []
    for at in range(0, n, step):
        k = min(n - at, step)
        features = scratch("features", (21, k))
        _features(rays.line[:, at : at + k], features)
        value = np.matmul(tree.root, features, out=scratch("product", (width, k)))
        hit = flat_true(np.greater_equal(value, 0, out=scratch("mask", value.shape, np.bool_)))
        slot, lane = np.divmod(hit, k)
        lane += at
        near, far = rays.span(box, tree.top.take(slot) if moving else slot, lane)
        met = np.flatnonzero(near <= np.minimum(far, t_far.take(lane)))
        parts.append((slot.take(met), lane.take(met), near.take(met)))
    if not parts:
        empty = np.zeros(0, np.intp)
        return empty, empty, np.zeros(0, f4)
    slots, lanes, nears = zip(*parts, strict=True)
    return np.concatenate(slots), np.concatenate(lanes), np.concatenate(nears)


def _features(line: Floats, out: Floats) -> None:
    """Write the products of all pairs of Plücker coordinates (6, ...) to `out` (21, ...)."""
    for row, (i, j) in enumerate(PAIRS):
        np.multiply(line[i], line[j], out=out[row])


def _descend(
    tree: Bvh,
    rays: _Lines,
    t_far: Floats,
    code: Ints,
    lane: Ints,
    visit: Callable[[Ints, Ints], None],
) -> None:
    """Traverse the subtrees of pairs of child code and lane, level by level, and visit the leaves."""
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
        code, lane = _expand(tree, rays, t_far, code, lane)
    if leaf_codes:
        visit(np.concatenate(leaf_codes), np.concatenate(leaf_lanes))


def _expand(tree: Bvh, rays: _Lines, t_far: Floats, node: Ints, lane: Ints) -> tuple[Ints, Ints]:
    """Test pairs of inner node and lane; return the codes and lanes of the children that are met."""
    width = tree.width
    nodes, block_lanes = blocks(node, lane, rays.begin.size - 1)
    step = max(1, CHUNK // (width * BLOCK))
    codes, lanes = [], []
    for start in range(0, nodes.size, step):
        chosen = nodes[start : start + step]
        k = chosen.size
        chunk = block_lanes[start * BLOCK : (start + k) * BLOCK]
        line = scratch("rays", (6, k, BLOCK))
        for row in range(6):
            np.take(rays.line[row], chunk, 0, line[row].reshape(-1), "clip")
        dx, dy, dz = line[:3]
        cx, cy, cz = tree.center.take(chosen, 0).T[:, :, None]
        line[3] -= cy * dz - cz * dy
        line[4] -= cz * dx - cx * dz
        line[5] -= cx * dy - cy * dx
        features = scratch("features", (k, 21, BLOCK))
        _features(line, features.transpose(1, 0, 2))
        matrices = np.take(tree.quadrics, chosen, 0, scratch("nodes", (k, width, 21)), "clip")
        value = np.matmul(matrices, features, out=scratch("product", (k, width, BLOCK)))
        hit = flat_true(np.greater_equal(value, 0, out=scratch("mask", value.shape, np.bool_)))
        pair = hit >> BLOCK_SHIFT
        block = pair // width
        slot = chosen.take(block) * width + (pair & (width - 1))
        place = (block << BLOCK_SHIFT) + (hit & (BLOCK - 1))
        lane = chunk.take(place)
        near, far = rays.span(tree.box, slot, lane)
        met_at = np.flatnonzero(near <= np.minimum(far, t_far.take(lane)))
        codes.append(tree.child.take(slot.take(met_at)))
        lanes.append(lane.take(met_at))
    return np.concatenate(codes), np.concatenate(lanes)


def blocks(node: Ints, lane: Ints, unused: int) -> tuple[Ints, Ints]:
    """Sort pairs by node and split them into blocks of one node and BLOCK lanes each.

    Returns the nodes (b,) and lanes (b * BLOCK,), padded with lane `unused`.
    """
    order = stable_order(node)
    node, lane = node.take(order), lane.take(order)
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

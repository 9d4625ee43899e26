"""Ray queries of what deforms: corners and centers go from one place to another, nearly along lines.

The boxes of the tree go along with its primitives: those of a node are found at the beginning and the end of
the way, and interpolated for each ray. Ellipsoids hold all places of primitives. What the filter of still
primitives multiplies by the numbers of a ray, such as the Plücker coordinates of edges, are polynomials
of degree two in time here. So this filter is one matrix product, too: of rows with the Bernstein coefficients
of these polynomials, and of the ray's numbers times the Bernstein polynomials at its time. What it does not
rule out is tested in float64, where it is at the time of the ray.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, Lanes, cross, dot, f4
from ..motion.steps import step_at
from . import triangle
from .base import Accelerator, Intersections
from .bvh import BLOCK, BOX_MARGIN, Ball, MovingBoxes, RayBatch, bounding_ball, prepare, trace
from .hits import AnyHit, Candidates, ClosestHit, HitAccumulator, unpack_prim, unpack_t
from .numpy_accel import batch_size, leaf_size_for
from .primitives import Primitives
from .search import PrimitiveTree
from .sphere import line_features, sphere_distance, sphere_rows
from .triangle import ROUNDOFF

MARGIN = 1.25 * BOX_MARGIN  # added to boxes that move, which are rounded once more
NEARLY = 0.05  # edges by which corners may be beside lines on average: more pairs need exact tests then


class Swept(Primitives):
    """Primitives that move from one place to another, each point nearly along a line."""

    triangular: ClassVar[bool] = False  # whether hits have barycentric weights
    part: Doubles | None  # (n,) of the way that is over at the times of n rays

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners, (3, m) each."""
        points = self.hull()
        return points.min(0), points.max(0)

    @abstractmethod
    def ends(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the corners (3, m) of boxes: lower and upper at the beginning, and the same at the end.

        Each primitive is always in the box that goes from one to the other along lines.
        """

    def with_weights(self, numbers: Floats) -> Floats:
        """Return numbers (c, n) of lines, and the Bernstein polynomials at their times, (c + 3, n)."""
        assert self.part is not None
        part = np.zeros(numbers.shape[1])  # a last line meets nothing
        part[: self.part.size] = self.part
        left = 1 - part
        weights = np.stack([left * left, 2 * left * part, part * part])
        return np.concatenate([numbers, weights.astype(f4)])

    @abstractmethod
    def at(self, part: Doubles) -> Swept:
        """Return the primitives for rays after parts (n,) of the way."""


@soa
class SweptTriangles(Swept):
    """m triangles that move from one place to another, each corner nearly along a line."""

    rows = 3
    triangular = True

    forms: Floats  # (k + 1, m, 3, 3) corners at some times, between which they go along lines
    times: Doubles  # (k + 1,) as parts of the way, from 0 to 1
    part: Doubles | None = None  # (n,) of the way that is over at the times of n rays
    step: Ints | None = None  # (n,) between which times that is
    fraction: Doubles | None = None  # (n,) after what part of the way between these

    def __len__(self) -> int:
        """Return the number of triangles."""
        return self.forms.shape[1]

    def take(self, index: Lanes) -> SweptTriangles:
        """Return some of the triangles."""
        forms = self.forms[:, index] if isinstance(index, slice) else self.forms.take(index, 1)
        return SweptTriangles(forms, self.times)

    def hull(self) -> Floats:
        """Return the corners at all times, (3 k + 3, 3, m)."""
        points = self.forms.transpose(0, 2, 3, 1).reshape(-1, 3, len(self))
        return np.ascontiguousarray(points)

    def off_lines(self) -> Doubles:
        """Return how far corners are from lines between both ends at most, (corner, xyz, m)."""
        first, last = (self.forms[at].astype(np.float64) for at in (0, -1))
        off = np.zeros(first.shape)
        for form, time in zip(self.forms[1:-1], self.times[1:-1].tolist(), strict=True):
            np.maximum(off, np.abs(form - (first + (last - first) * time)), out=off)
        return off.transpose(1, 2, 0)

    def ends(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return boxes at both ends, see `Swept.ends`."""
        room, first, last = self.off_lines().max(0).astype(f4), self.forms[0], self.forms[-1]
        boxes = [(form.min(1).T - room, form.max(1).T + room) for form in (first, last)]
        return *boxes[0], *boxes[1]

    def filter_rows(self, ball: Ball) -> Floats:
        """Return the Bernstein coefficients of the Plücker rows of the edges, (3, m, 18)."""
        first, last = (self.forms[at].transpose(1, 0, 2) for at in (0, -1))
        off = np.sqrt((self.off_lines() ** 2).sum(1)).max(0)
        return swept_edge_rows(first, last, ball, off)

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the Plücker coordinates (6, n) of lines, and the Bernstein polynomials, (9, n)."""
        return self.with_weights(line)

    def values(self, products: Floats, out: Floats) -> Floats:
        """Return the least products of two edge functions: above 1 where a line certainly hits."""
        return triangle.least_adjacent_product(products, out)

    def tests(self, batch: RayBatch, found: HitAccumulator, first: int) -> SweptTests:
        """Return the exact tests of a batch."""
        return SweptTests(self, batch, found)

    def at(self, part: Doubles) -> SweptTriangles:
        """Return the triangles for rays after parts (n,) of the way."""
        step, fraction = step_at(self.times, part)
        return SweptTriangles(self.forms, self.times, part, step, fraction)

    def corners(self, prim: Ints, lane: Ints) -> Doubles:
        """Return the corners of triangles (k,) at the times of rays (k,): (corner, axis, k)."""
        assert self.step is not None
        assert self.fraction is not None
        rows, corners = self.step.take(lane) * len(self) + prim, self.forms.reshape(-1, 3, 3)
        ends = corners.take(rows, 0), corners.take(rows + len(self), 0)
        return corners_between(*ends, self.fraction.take(lane))


def joined_steps(times: Doubles, forms: Sequence[Floats]) -> tuple[Doubles, list[SweptTriangles]]:
    """Return steps (k,) in which corners go nearly along lines, and the times (k + 1,) between these.

    Parameters
    ----------
    times
        (n,) s, between which they go along lines.
    forms
        The corners (m, 3, 3) of triangles at these times.
    """
    first = forms[0].astype(np.float64)
    edge = np.sqrt(((first - np.roll(first, 1, 1)) ** 2).sum(2)).mean()
    ends, found, stack = [times[0]], list[SweptTriangles](), [(0, times.size - 1)]
    while stack:
        begin, end = stack.pop()
        parts = (times[begin : end + 1] - times[begin]) / (times[end] - times[begin])
        step = SweptTriangles(np.stack(forms[begin : end + 1]), parts)
        if end > begin + 1 and np.sqrt((step.off_lines() ** 2).sum(1)).mean() > NEARLY * edge:
            middle = (begin + end) // 2
            stack += [(middle, end), (begin, middle)]
        else:
            found.append(step)
            ends.append(times[end])
    return np.array(ends), found


def corners_between(first: Floats, last: Floats, part: Doubles) -> Doubles:
    """Return the corners of triangles (k, 3, 3) after parts (k,) of their way: (corner, axis, k)."""
    begin = triangle.vertices(first)
    return begin + (triangle.vertices(last) - begin) * part


def swept_edge_rows(first: Floats, last: Floats, ball: Ball, off: Doubles) -> Floats:
    """Return the rows (3, m, 18) of the edges of triangles that move, corners (3, m, 3) at both ends.

    As `triangle.edge_rows`; the bounds of errors and areas hold at all times. Each sum has 18 terms in
    place of 6, whose factors are rounded twice more. Corners are up to `off` (m,) beside the lines between
    both ends: where a line meets a triangle, its edge functions are off by that times the two sides from
    there to the ends of the edge.
    """
    begin, end = (corners.astype(np.float64) - ball.center for corners in (first, last))
    begin_next, end_next = np.roll(begin, -1, 0), np.roll(end, -1, 0)
    moments = (
        np.cross(begin, begin_next),
        (np.cross(begin, end_next) + np.cross(end, begin_next)) / 2,
        np.cross(end, end_next),
    )
    spans = begin_next - begin, (begin_next - begin + end_next - end) / 2, end_next - end
    moment, span = (np.max([np.linalg.norm(each, axis=2) for each in of], 0) for of in (moments, spans))
    error = ROUNDOFF * (36 * moment + 120 * ball.radius * span).max(0)
    error += 2 * off * (span.max(0) + 2 * off)
    with np.errstate(all="ignore"):
        scale = 1 / np.sqrt(error * (_twice_largest_area(begin, end) + 3 * error))
    rows = [np.concatenate(pair, 2) for pair in zip(moments, spans, strict=True)]
    return (np.concatenate(rows, 2) * scale[:, None]).astype(f4)


def _twice_largest_area(begin: Doubles, end: Doubles) -> Doubles:
    """Return a bound (m,) of twice the area of triangles that move, corners (3, m, 3) at both ends."""
    a, b = begin[1] - begin[0], begin[2] - begin[0]
    c, d = end[1] - end[0], end[2] - end[0]
    normals = np.cross(a, b), (np.cross(a, d) + np.cross(c, b)) / 2, np.cross(c, d)
    return np.max([np.linalg.norm(normal, axis=1) for normal in normals], 0)


class SweptTests:
    """Tests of one batch of rays; hits are added to `found`."""

    def __init__(self, triangles: SweptTriangles, batch: RayBatch, found: HitAccumulator) -> None:
        self._triangles, self._batch, self._found = triangles, batch, found
        # Not a bound method: a reference cycle would keep all rays until the garbage collector runs.
        self._uncertain = Candidates(partial(_test_uncertain, triangles, batch, found))

    def add(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Add candidates: triangles (k,), lanes (k,), and the filter's values (k,): above 1 for hits."""
        others = np.flatnonzero(prim != self._batch.exclude_prim.take(lane))
        prim, lane, value = prim.take(others), lane.take(others), value.take(others)
        certain = value > 1
        uncertain = np.flatnonzero(~certain)
        if uncertain.size:
            self._uncertain.add(prim.take(uncertain), lane.take(uncertain))
            some = np.flatnonzero(certain)
            prim, lane = prim.take(some), lane.take(some)
        origin, direction = _rays(self._batch, lane)
        self._found.add(lane, prim, _plane_distance(self._triangles.corners(prim, lane), origin, direction))

    def finish(self) -> None:
        """Test the remaining candidates."""
        self._uncertain.flush()


def _rays(batch: RayBatch, lane: Ints) -> tuple[Doubles, Doubles]:
    return batch.origin.take(lane, 1).astype(np.float64), batch.direction.take(lane, 1).astype(np.float64)


def _test_uncertain(
    triangles: SweptTriangles, batch: RayBatch, found: HitAccumulator, prim: Ints, lane: Ints
) -> None:
    """Test the pairs (k,) that the filter has left open."""
    origin, direction = _rays(batch, lane)
    corners = triangles.corners(prim, lane)
    t = _plane_distance(corners, origin, direction)
    local = corners - origin
    t = triangle.clamp_to_triangle(t, local, direction, None)
    found.add(lane, prim, np.where(triangle.hits_watertight(local, direction), t, np.inf))


def _plane_distance(corners: Doubles, origin: Doubles, direction: Doubles) -> Doubles:
    """Return the distances (k,) along rays (3, k) of the planes of triangles (corner, axis, k)."""
    a, b, c = corners
    normal = cross(b - a, c - a)
    return dot(normal, a - origin) / dot(normal, direction)


def weights_on(corners: Doubles, point: Doubles) -> tuple[Floats, Floats]:
    """Return the weights (k,) of the second and third corner of triangles at points (3, k) on them."""
    a, b, c = corners
    normal = cross(b - a, c - a)
    size2 = dot(normal, normal)
    away = point - a
    second = (dot(cross(c - a, normal), away) / size2).astype(f4).clip(0, 1)
    third = (dot(cross(normal, b - a), away) / size2).astype(f4).clip(0, 1)
    return second, np.minimum(third, 1 - second)


class SweptTree(PrimitiveTree):
    """A tree whose boxes move with its primitives."""

    def __init__(self, primitives: Swept, ids: Ints, ball: Ball, first: int, leaf_size: int) -> None:
        super().__init__(primitives, ids, ball, first, leaf_size)
        ends = [corners.take(ids, 1) for corners in primitives.ends()]
        begin, end = (self._boxes(*ends[side : side + 2]) for side in (0, 2))
        self.tree.box, self._change = begin, end - begin

    def _boxes(self, low: Floats, high: Floats) -> Floats:
        """Return the boxes (6, nodes * width) of all children, from those of primitives (3, m)."""
        tree, ball = self.tree, self._ball
        nothing = np.full((6, 1), np.inf)
        least = np.concatenate([np.concatenate([low, -high]), nothing], 1)
        leaf = least[:, tree.prim].reshape(6, -1, tree.leaf_size).min(2)
        box, child = np.zeros((6, tree.child.size)), tree.child.reshape(-1, tree.width)
        on_leaf = np.flatnonzero(tree.child < 0)
        box[:, on_leaf] = leaf[:, -1 - tree.child[on_leaf]]
        absent = tree.child == 0
        box[:, absent] = np.inf
        levels, level = list[Ints](), np.zeros(1, np.intp)
        while level.size:
            slots = np.flatnonzero(child[level] > 0)
            slots = level.take(slots // tree.width) * tree.width + slots % tree.width
            levels.append(slots)
            level = tree.child.take(slots)
        for slots in reversed(levels):
            box[:, slots] = box.reshape(6, -1, tree.width)[:, tree.child.take(slots)].min(2)
        box[:, absent] = 0
        box[3:] *= -1
        box = (box - np.tile(ball.center, 2)[:, None]) / ball.radius
        box += np.repeat([-MARGIN, MARGIN], 3)[:, None]
        return box.astype(f4)

    def _trace(
        self, batch: RayBatch, accumulator: HitAccumulator, visit: Callable[[Ints, Ints], None]
    ) -> None:
        assert isinstance(self._primitives, Swept)
        assert self._primitives.part is not None
        part = np.append(self._primitives.part, 0).astype(f4)
        trace(self.tree, batch, accumulator.t_far, visit, MovingBoxes(self._change, part))

    def _gather(self, features: Floats, lanes: Ints, out: Floats) -> None:
        """Write the products of numbers of lines and Bernstein polynomials, see `PrimitiveTree._gather`."""
        count = out.shape[1] // 3
        for row in range(count):
            out[:, row] = features[row].take(lanes).reshape(-1, BLOCK)
        first, second, third = (features[count + row].take(lanes).reshape(-1, 1, BLOCK) for row in range(3))
        np.multiply(out[:, :count], second, out=out[:, count : 2 * count])
        np.multiply(out[:, :count], third, out=out[:, 2 * count :])
        out[:, :count] *= first


class SweptAccelerator:
    """Primitives that move once from one place to another; rays come after parts of their way."""

    name = "numpy"

    def __init__(self, primitives: Swept, weights: bool) -> None:
        self._weights = weights and primitives.triangular
        self._primitives, ids = primitives, np.arange(len(primitives))
        self._ball = bounding_ball(*primitives.bounds)
        with np.errstate(all="ignore"):
            self._tree = SweptTree(primitives, ids, self._ball, 0, leaf_size_for(ids.size))
        self._batch = batch_size(len(self._tree.tree.leaves))

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints, part: Doubles) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0; at equal t the lowest primitive id."""
        n = part.size
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.zeros(n, f4), np.zeros(n, f4))
        for lanes in self._batches(n):
            with np.errstate(all="ignore"):
                batch = prepare(origin[:, lanes], direction[:, lanes], exclude_prim[lanes], self._ball)
                found = ClosestHit(batch, self._ball)
                primitives = self._find(batch, part[lanes], found)
                hits.t[lanes], hits.prim[lanes] = unpack_t(found.packed), unpack_prim(found.packed)
                if self._weights:
                    assert isinstance(primitives, SweptTriangles)
                    _write_weights(primitives, batch, hits, lanes)
        return hits

    def occluded(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints, part: Doubles
    ) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        blocked = np.zeros(part.size, np.bool_)
        for lanes in self._batches(part.size):
            rays = origin[:, lanes], direction[:, lanes], exclude_prim[lanes]
            with np.errstate(all="ignore"):
                batch = prepare(*rays, self._ball, distance[lanes])
                found = AnyHit(batch, self._ball, distance[lanes])
                self._find(batch, part[lanes], found)
            blocked[lanes] = found.blocked
        return blocked

    def _batches(self, n: int) -> Iterator[slice]:
        return (slice(at, at + self._batch) for at in range(0, n, self._batch))

    def _find(self, batch: RayBatch, part: Doubles, found: HitAccumulator) -> Swept:
        """Add all hits to `found`, and return the primitives, bound to the rays."""
        primitives = self._primitives.at(part)
        self._tree.of(primitives).find_hits(batch, found)
        return primitives


def _write_weights(triangles: SweptTriangles, batch: RayBatch, hits: Intersections, lanes: slice) -> None:
    """Write the barycentric weights of hits in some lanes."""
    on = np.flatnonzero(hits.prim[lanes] >= 0)
    origin, direction = _rays(batch, on)
    corners = triangles.corners(hits.prim[lanes].take(on), on)
    point = origin + direction * _plane_distance(corners, origin, direction)
    hits.b1[lanes][on], hits.b2[lanes][on] = weights_on(corners, point)


@soa
class SweptSpheres(Swept):
    """k spheres that move from one place to another along lines."""

    first: Floats  # (3, k) centers at the beginning
    last: Floats  # (3, k) at the end
    radii: Floats  # (k,)
    part: Doubles | None = None  # (n,) of the way that is over at the times of n rays

    def __len__(self) -> int:
        """Return the number of spheres."""
        return self.radii.size

    def take(self, index: Lanes) -> SweptSpheres:
        """Return some of the spheres."""
        return SweptSpheres(self.first[:, index], self.last[:, index], self.radii[index])

    def hull(self) -> Floats:
        """Return the corners of boxes at both ends, (16, 3, k)."""
        sides = np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(8, 3, 1).astype(f4) * self.radii
        return np.concatenate([self.first + sides, self.last + sides])

    def ends(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return boxes at both ends, see `Swept.ends`."""
        radii, first, last = self.radii, self.first, self.last
        return first - radii, first + radii, last - radii, last + radii

    def filter_rows(self, ball: Ball) -> Floats:
        """Return the Bernstein coefficients of the rows of `sphere_rows`, (1, k, 33)."""
        begin, end = self.first.astype(np.float64), self.last.astype(np.float64)
        radii, middle = self.radii.astype(np.float64), (begin + end) / 2
        rows = [sphere_rows(each, radii, ball.center, ball.radius) for each in (begin, middle, end)]
        between = 2 * rows[1] - (rows[0] + rows[2]) / 2  # a parabola by its values at 0, 1/2 and 1
        return np.concatenate([rows[0], between, rows[2]], 1)[None] / f4(3)  # errors of three times the terms

    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return the numbers of lines, and the Bernstein polynomials, (14, n)."""
        return self.with_weights(line_features(line[:3], line[3:]))

    def tests(self, batch: RayBatch, found: HitAccumulator, first: int) -> SphereTests:
        """Return the exact tests of a batch."""
        return SphereTests(self, batch, found)

    def at(self, part: Doubles) -> SweptSpheres:
        """Return the spheres for rays after parts (n,) of the way."""
        return SweptSpheres(self.first, self.last, self.radii, part)


class SphereTests:
    """Tests of one batch of rays; hits are added to `found`."""

    def __init__(self, spheres: SweptSpheres, batch: RayBatch, found: HitAccumulator) -> None:
        self._spheres, self._batch, self._found = spheres, batch, found

    def add(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Test spheres (k,) and lanes (k,)."""
        assert self._spheres.part is not None
        origin, direction = _rays(self._batch, lane)
        begin = self._spheres.first.take(prim, 1).astype(np.float64)
        center = begin + (self._spheres.last.take(prim, 1) - begin) * self._spheres.part.take(lane)
        radius = self._spheres.radii.take(prim).astype(np.float64)
        leaves = self._batch.exclude_prim.take(lane) == prim
        self._found.add(lane, prim, sphere_distance(center, radius, origin, direction, leaves))

    def finish(self) -> None:
        """Everything has been tested."""


class DeformingAccelerator:
    """What deforms in steps that are linear in time.

    Parameters
    ----------
    times
        (k + 1,) s, rising, at least two.
    steps
        The primitives in each of k steps.
    weights
        Whether barycentric weights are needed.
    """

    name = "numpy"

    def __init__(self, times: Doubles, steps: Sequence[Swept], weights: bool) -> None:
        self.times = times
        self._steps = [SweptAccelerator(step, weights) for step in steps]

    def at(self, time: Doubles) -> Accelerator:
        """Return the accelerator of rays at times (n,)."""
        return _Bound(self._steps, *step_at(self.times, time))


class _Bound:
    """The mesh for rays in some steps (n,), after some parts (n,) of them."""

    name = "numpy"

    def __init__(self, steps: Sequence[SweptAccelerator], step: Ints, part: Doubles) -> None:
        self._steps, self._step, self._part = steps, step, part

    def _by_step(self) -> Iterator[tuple[SweptAccelerator, Any]]:
        """Yield each step that occurs, and its lanes."""
        if len(self._steps) == 1:
            yield self._steps[0], slice(None)
            return
        for number, accelerator in enumerate(self._steps):
            lanes = np.flatnonzero(self._step == number)
            if lanes.size:
                yield accelerator, lanes

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n), as `Accelerator.closest`."""
        n = self._part.size
        hits = Intersections(np.empty(n, f4), np.empty(n, np.intp), np.empty(n, f4), np.empty(n, f4))
        for accelerator, lanes in self._by_step():
            rays = origin[:, lanes], direction[:, lanes], exclude_prim[lanes], self._part[lanes]
            found = accelerator.closest(*rays)
            hits.t[lanes], hits.prim[lanes] = found.t, found.prim
            hits.b1[lanes], hits.b2[lanes] = found.b1, found.b2
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return which rays (3, n) are blocked, as `Accelerator.occluded`."""
        blocked = np.zeros(self._part.size, np.bool_)
        for accelerator, lanes in self._by_step():
            rays = origin[:, lanes], direction[:, lanes], distance[lanes], exclude_prim[lanes]
            blocked[lanes] = accelerator.occluded(*rays, self._part[lanes])
        return blocked

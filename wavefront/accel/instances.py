"""Ray queries in scenes with instances: one accelerator for each mesh, and rays in the mesh's coordinates.

A tree over the bounding boxes of the instances gives the pairs of ray and instance that may meet. Each ray
visits its instances in the order of their distance. In every round the rays of all pairs are transformed
to the coordinates of their meshes and traced there, with one call for each distinct mesh; then instances
beyond a ray's nearest hit are dropped. Transformed directions are not normalized, so that t stays the
distance in the scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import ALL, Bools, Doubles, Floats, Ints, Lanes, f4, spans, take
from .base import Accelerator, Intersections
from .build import build_tree

WIDTH = 8  # children of a node
CHUNK = 1 << 16  # boxes tested at a time
LANE_BITS = 16  # at most 2^LANE_BITS rays traverse the tree at a time
PAIRS = 1 << 20  # pairs held at a time; a batch that has more is halved
ROUNDING = f4(1e-6)  # bound of the relative error of distances to boxes


@soa
class Placements:
    """The transforms and bounding boxes of the instances, one column each."""

    mesh: Ints  # (k,) index of the mesh
    first: Ints  # (k,) primitive id of its first triangle, ascending
    to_local: Doubles  # (12, k) the (3, 4) matrix from the scene to the mesh's coordinates, row by row
    low: Floats  # (3, k) lower corner of the bounding box, enlarged for rounding, scene units
    high: Floats  # (3, k) upper corner


class InstanceAccelerator:
    """Instances, and all primitives that are not instanced; see base.Accelerator.

    Parameters
    ----------
    single
        The accelerator of the primitives that are not instanced; their ids come first.
    meshes
        The accelerators of the distinct meshes, each in the mesh's coordinates.
    placements
        The instances.
    """

    def __init__(self, single: Accelerator, meshes: Sequence[Accelerator], placements: Placements) -> None:
        self.name = single.name
        self._single, self._meshes, self.placements = single, meshes, placements
        self._first = int(placements.first[0])
        self._count = np.diff(placements.first, append=np.iinfo(np.intp).max)  # (k,) primitive ids of each
        tree = build_tree(placements.low, placements.high, 1, WIDTH)
        self._width = int(np.flatnonzero(tree.child.any(0)).max(initial=0)) + 1  # few instances need less
        self._low, self._high = (
            np.ascontiguousarray(box[:, : self._width].transpose(2, 1, 0)) for box in (tree.low, tree.high)
        )
        self._child = tree.child[:, : self._width].astype(np.intp)
        self._instance = tree.prim[:, 0]

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0; at equal t the lowest primitive id."""
        hits = self._single.closest(origin, direction, self._exclude_single(exclude_prim))
        for lane, instance in self._rounds(origin, direction, hits.t):
            for number, at in self._by_mesh(instance):
                lanes, instances = take(lane, at), take(instance, at)
                rays = self._local(origin, direction, exclude_prim, lanes, instances)
                mesh_hits = self._mesh(number, lanes).closest(*rays)
                mesh_hits.prim += np.where(mesh_hits.prim >= 0, self.placements.first.take(instances), 0)
                _update_closest(hits, lanes, mesh_hits)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        blocked = self._single.occluded(origin, direction, distance, self._exclude_single(exclude_prim))
        t_far = np.where(blocked, f4(-1), distance)
        for lane, instance in self._rounds(origin, direction, t_far):
            for number, at in self._by_mesh(instance):
                lanes, instances = take(lane, at), take(instance, at)
                start, along, excluded = self._local(origin, direction, exclude_prim, lanes, instances)
                met = self._mesh(number, lanes).occluded(start, along, distance.take(lanes), excluded)
                lanes = lanes.compress(met)
                blocked[lanes] = True
                t_far[lanes] = -1  # ends the search
        return blocked

    def _mesh(self, number: int, lanes: Ints) -> Accelerator:
        """Return the accelerator of a mesh, for rays `lanes` (p,)."""
        return self._meshes[number]

    def _exclude_single(self, exclude_prim: Ints) -> Ints:
        """Return the excluded primitives (n,), -1 for those of instances."""
        return np.where(exclude_prim < self._first, exclude_prim, -1)

    def _local(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, lane: Ints, instance: Ints
    ) -> tuple[Floats, Floats, Ints]:
        """Return rays `lane` (p,) in mesh coordinates of `instance` (p,): origin, direction, exclude_prim."""
        points, ways = origin.take(lane, 1), direction.take(lane, 1)
        start, along = np.empty((3, lane.size), f4), np.empty((3, lane.size), f4)
        entries = iter(self._matrices(lane, instance))
        for axis in range(3):
            *row, shift = islice(entries, 4)
            start[axis] = _product(row, points) + shift
            along[axis] = _product(row, ways)
        prim = exclude_prim.take(lane) - self.placements.first.take(instance)
        prim[(prim < 0) | (prim >= self._count.take(instance))] = -1  # of another instance, or none
        return start, along, prim

    def _matrices(self, lane: Ints, instance: Ints) -> Iterable[Doubles | np.float64]:
        """Return the matrices (12, p) from the scene to the coordinates of `instance` (p,), row by row.

        A row may be one number, the same for all rays.
        """
        return self._still(instance)

    def _still(self, instance: Ints) -> Doubles:
        """Return the matrices (12, p) of instances (p,) that stand still."""
        return self.placements.to_local.take(instance, 1)

    def _by_mesh(self, instance: Ints) -> Iterator[tuple[int, Lanes]]:
        """Yield each distinct mesh of `instance` (p,), and the indices of its instances there."""
        if len(self._meshes) == 1:
            yield 0, ALL
            return
        mesh = self.placements.mesh.take(instance)
        order = np.argsort(mesh, kind="stable")
        numbers, begins = np.unique(mesh.take(order), return_index=True)
        yield from zip(numbers.tolist(), np.split(order, begins[1:]), strict=True)

    def _rounds(self, origin: Floats, direction: Floats, t_far: Floats) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs of lane and instance to trace, round by round.

        `t_far` (n,) is the largest distance at which a hit still matters; the caller lowers it.
        """
        n = origin.shape[1]
        if self.placements.mesh.size == 1:
            yield self._alone(origin, direction, t_far)
            return
        parts = [(at, min(at + (1 << LANE_BITS), n)) for at in range(0, n, 1 << LANE_BITS)]
        while parts:
            begin, end = parts.pop()
            span = slice(begin, end)
            pairs = self._pairs(origin[:, span], direction[:, span], t_far[span])
            if pairs is not None:
                for lane, instance in _nearest_first(pairs, t_far[span], self._instance_bits):
                    yield lane + begin, instance
            else:
                middle = (begin + end) // 2
                parts += [(middle, end), (begin, middle)]

    def _alone(self, origin: Floats, direction: Floats, t_far: Floats) -> tuple[Ints, Ints]:
        """Return the lanes that may meet the only instance there is, and its number for each."""
        met = [
            self._met(origin[:, part], direction[:, part], t_far[part]) + part.start
            for part in spans(t_far.size, CHUNK)
        ]
        lane = met[0] if len(met) == 1 else np.concatenate([np.zeros(0, np.intp), *met])
        return lane, np.zeros_like(lane)

    def _met(self, origin: Floats, direction: Floats, t_far: Floats) -> Ints:
        """Return which rays (3, n) meet the box of the only instance, as `_children_met` finds them."""
        near, far = np.zeros(t_far.size, f4), t_far * (1 + ROUNDING)
        with np.errstate(all="ignore"):
            inverse = f4(1) / direction
            for axis in range(3):
                first, second = (
                    (box[axis, 0, 0] - origin[axis]) * inverse[axis] for box in (self._low, self._high)
                )
                np.maximum(near, np.minimum(first, second), out=near)
                np.minimum(far, np.maximum(first, second), out=far)
            return np.flatnonzero(~(near * (1 - ROUNDING) > far * (1 + ROUNDING)))

    @property
    def _instance_bits(self) -> int:
        return max(1, (self.placements.mesh.size - 1).bit_length())

    def _pairs(self, origin: Floats, direction: Floats, t_far: Floats) -> NDArray[np.int64] | None:
        """Return the packed pairs of ray and instance that may meet, sorted; None if more than PAIRS."""
        with np.errstate(all="ignore"):
            inverse = f4(1) / direction
        code, lane = np.zeros(t_far.size, np.intp), np.arange(t_far.size)
        packed = [np.zeros(0, np.int64)]
        total = 0
        while code.size:
            codes, lanes = [], []
            for span in spans(code.size, CHUNK // self._width):
                child, lane_met, near = self._children_met(code[span], lane[span], origin, inverse, t_far)
                leaf = np.flatnonzero(child < 0)
                instance = self._instance.take(-1 - child.take(leaf))
                packed.append(_pack(lane_met.take(leaf), near.take(leaf), instance, self._instance_bits))
                inner = np.flatnonzero(child > 0)
                codes.append(child.take(inner))
                lanes.append(lane_met.take(inner))
                total += child.size
                if total > PAIRS and t_far.size > 1:
                    return None
            code, lane = np.concatenate(codes), np.concatenate(lanes)
        return np.sort(np.concatenate(packed))

    def _children_met(
        self, node: Ints, lane: Ints, origin: Floats, inverse: Floats, t_far: Floats
    ) -> tuple[Ints, Ints, Floats]:
        """Test the boxes of the children of nodes (p,) against rays `lane` (p,).

        Returns child codes, lanes and entry distances of the boxes that are met. NaN, from a ray along the
        face of a box, counts as met.
        """
        near = np.zeros((self._width, node.size), f4)
        far = np.broadcast_to(t_far.take(lane) * (1 + ROUNDING), near.shape)
        with np.errstate(all="ignore"):
            for axis in range(3):
                start, scale = origin[axis].take(lane), inverse[axis].take(lane)
                first, second = ((box[axis].take(node, 1) - start) * scale for box in (self._low, self._high))
                near = np.maximum(near, np.minimum(first, second))
                far = np.minimum(far, np.maximum(first, second))
            met = np.flatnonzero(~(near * (1 - ROUNDING) > far * (1 + ROUNDING)))
        slot, pair = np.divmod(met, node.size)
        child = self._child[node.take(pair), slot]
        present = np.flatnonzero(child)
        entry = np.fmax(near.ravel().take(met.take(present)) * (1 - ROUNDING), f4(0)) + f4(0)  # never -0
        return child.take(present), lane.take(pair.take(present)), entry


def _product(row: Sequence[Doubles | np.float64], vectors: Floats) -> Doubles:
    """Return the products (p,) of a row of matrices, 3 × (p,), and vectors (3, p)."""
    terms = [
        factor * values for factor, values in zip(row, vectors, strict=True) if np.ndim(factor) or factor
    ]
    total = terms.pop(0)
    for term in terms:
        total += term
    return total


def _pack(lane: Ints, near: Floats, instance: Ints, bits: int) -> NDArray[np.int64]:
    """Pack pairs (p,) into integers that sort by lane, then distance, then instance.

    Distances lose low bits where there are many instances. The bits of floats that are not negative sort
    like the floats.
    """
    near_bits = _distance_bits(bits)
    distance = near.view(np.int32).astype(np.int64) >> (31 - near_bits)
    return (lane << (near_bits + bits)) | (distance << bits) | instance


def _distance_bits(bits: int) -> int:
    """Return the number of bits for a distance, beside `bits` for an instance and those of a lane."""
    return min(31, 63 - LANE_BITS - bits)


def _nearest_first(packed: NDArray[np.int64], t_far: Floats, bits: int) -> Iterator[tuple[Ints, Ints]]:
    """Yield lanes and instances of sorted pairs in rounds: one pair of each ray, then two, four ...

    Pairs that begin beyond the ray's current `t_far` are left out.
    """
    near_bits = _distance_bits(bits)
    instance = packed & ((1 << bits) - 1)
    near = (((packed >> bits) & ((1 << near_bits) - 1)) << (31 - near_bits)).astype(np.int32).view(f4)
    lane = packed >> (bits + near_bits)
    at = np.flatnonzero(np.append(True, lane[1:] != lane[:-1])[: lane.size])
    last = np.append(at[1:], lane.size)[: at.size]
    taken = 1
    while at.size:
        count = np.minimum(last - at, taken)
        ends = np.cumsum(count)
        place = np.arange(int(ends[-1])) + np.repeat(at - ends + count, count)
        place = place.compress(near.take(place) <= t_far.take(lane.take(place)))
        if place.size:
            yield lane.take(place), instance.take(place)
        at = at + count
        more = np.flatnonzero(at < last)
        more = more.compress(near.take(at.take(more)) <= t_far.take(lane.take(at.take(more))))
        at, last = at.take(more), last.take(more)
        taken *= 2


def _update_closest(hits: Intersections, lane: Ints, others: Intersections) -> None:
    """Replace hits on lanes (p,), of which some may be equal, by those of `others` that are nearer."""
    t, prim = hits.t.take(lane), hits.prim.take(lane)
    nearer = np.flatnonzero((others.t < t) | ((others.t == t) & (others.prim < prim) & (others.prim >= 0)))
    if (lane[1:] <= lane[:-1]).any():  # else each lane occurs once
        nearer = nearer.take(np.lexsort((others.prim.take(nearer), others.t.take(nearer), lane.take(nearer))))
        ordered = lane.take(nearer)
        nearer = nearer.compress(np.append(True, ordered[1:] != ordered[:-1])[: ordered.size])
    lane = lane.take(nearer)
    hits.t[lane], hits.prim[lane] = others.t.take(nearer), others.prim.take(nearer)
    hits.b1[lane], hits.b2[lane] = others.b1.take(nearer), others.b2.take(nearer)

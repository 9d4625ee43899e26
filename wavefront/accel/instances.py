"""Ray queries in scenes where a mesh is placed many times: built once, with rays brought to it.

Every instance has a box. A tree over the boxes gives the pairs of ray and instance that may meet, and each
ray takes its instances nearest first: in every round the rays of all pairs are turned into the frames of
their meshes and traced there together, one call for each distinct mesh, and instances that begin
beyond a ray's nearest hit drop out. Directions are not made unit in a mesh's frame, so that
distances stay those of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..record import record
from ..vec import Bools, Floats, Ints, f4
from .base import Accelerator, Intersections
from .build import build_tree

WIDTH = 8  # children of a node
CHUNK = 1 << 16  # boxes tested at a time
LANE_BITS = 16  # rays that look for their instances at a time: two to this power at most
PAIRS = 1 << 20  # pairs held at a time; where there are more, fewer rays are taken
ROUNDING = f4(1e-6)  # bound of the relative error of distances to boxes

Doubles = NDArray[np.float64]


@record
class Placements:
    """Where the instances stand, one column each."""

    mesh: Ints  # (k,) which of the meshes
    first: Ints  # (k,) primitive id of its first triangle, rising
    to_local: Doubles  # (12, k) (3, 4) matrix from the scene to the mesh's own frame, row by row
    low: Floats  # (3, k) lower corner of a box that has room for rounding, scene units
    high: Floats  # (3, k) upper corner


class InstanceAccelerator:
    """Instances, and beside them everything that is placed once; see base.Accelerator.

    Parameters
    ----------
    once
        Holds what is placed once; its primitive ids come first.
    meshes
        Hold the distinct meshes, each in its own frame.
    placements
        The instances.
    """

    def __init__(self, once: Accelerator, meshes: Sequence[Accelerator], placements: Placements) -> None:
        self.name = once.name
        self._once, self._meshes, self._placements = once, meshes, placements
        self._first = int(placements.first[0])
        tree = build_tree(placements.low, placements.high, 1, WIDTH)
        self._low, self._high = (
            np.ascontiguousarray(box.transpose(2, 1, 0)) for box in (tree.low, tree.high)
        )
        self._child = tree.child.astype(np.intp)
        self._instance = tree.prim[:, 0]

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n); ties go to the lowest id."""
        hits = self._once.closest(origin, direction, self._left_once(exclude_prim))
        left = self._left(exclude_prim)
        for lane, instance in self._rounds(origin, direction, hits.t):
            for number, at in self._by_mesh(instance):
                lanes, some = lane.take(at), instance.take(at)
                rays = self._local(origin, direction, left, lanes, some)
                found = self._meshes[number].closest(*rays)
                found.prim += np.where(found.prim >= 0, self._placements.first.take(some), 0)
                _keep_nearest(hits, lanes, found)
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""
        blocked = self._once.occluded(origin, direction, distance, self._left_once(exclude_prim))
        left = self._left(exclude_prim)
        reach = np.where(blocked, f4(-1), distance)
        for lane, instance in self._rounds(origin, direction, reach):
            for number, at in self._by_mesh(instance):
                lanes, some = lane.take(at), instance.take(at)
                start, along, leaves = self._local(origin, direction, left, lanes, some)
                met = self._meshes[number].occluded(start, along, distance.take(lanes), leaves)
                lanes = lanes.compress(met)
                blocked[lanes] = True
                reach[lanes] = -1  # looks no further
        return blocked

    def _left_once(self, exclude_prim: Ints) -> Ints:
        """Primitives that rays leave, -1 for those of instances."""
        return np.where(exclude_prim < self._first, exclude_prim, -1)

    def _left(self, exclude_prim: Ints) -> tuple[Ints, Ints]:
        """Instances that rays leave, -1 for none, and the triangles that they leave there."""
        instance = np.searchsorted(self._placements.first, exclude_prim, "right") - 1
        return instance, exclude_prim - self._placements.first.take(instance)

    def _local(
        self, origin: Floats, direction: Floats, left: tuple[Ints, Ints], lane: Ints, instance: Ints
    ) -> tuple[Floats, Floats, Ints]:
        """Rays `lane` (p,) in the frames of the meshes that are `instance` (p,) of."""
        m = self._placements.to_local.take(instance, 1).reshape(3, 4, -1)
        x, y, z = origin.take(lane, 1)
        dx, dy, dz = direction.take(lane, 1)
        start, along = np.empty((3, lane.size), f4), np.empty((3, lane.size), f4)
        for axis in range(3):
            a, b, c, shift = m[axis]
            start[axis] = a * x + b * y + c * z + shift
            along[axis] = a * dx + b * dy + c * dz
        leaves, triangle = (of_lane.take(lane) for of_lane in left)
        return start, along, np.where(leaves == instance, triangle, -1)

    def _by_mesh(self, instance: Ints) -> Iterator[tuple[int, Ints]]:
        """Yield each distinct mesh that occurs, and where."""
        mesh = self._placements.mesh.take(instance)
        order = np.argsort(mesh, kind="stable")
        numbers, begins = np.unique(mesh.take(order), return_index=True)
        yield from zip(numbers.tolist(), np.split(order, begins[1:]), strict=True)

    def _rounds(self, origin: Floats, direction: Floats, reach: Floats) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs of lane and instance to trace, round by round.

        `reach` (n,) is how far rays still look; the caller lowers it.
        """
        n = origin.shape[1]
        parts = [(at, min(at + (1 << LANE_BITS), n)) for at in range(0, n, 1 << LANE_BITS)]
        while parts:
            begin, end = parts.pop()
            part = slice(begin, end)
            pairs = self._pairs(origin[:, part], direction[:, part], reach[part])
            if pairs is not None:
                for lane, instance in _nearest_first(pairs, reach[part], self._instance_bits):
                    yield lane + begin, instance
            else:
                middle = (begin + end) // 2
                parts += [(middle, end), (begin, middle)]

    @property
    def _instance_bits(self) -> int:
        return max(1, (self._placements.mesh.size - 1).bit_length())

    def _pairs(self, origin: Floats, direction: Floats, reach: Floats) -> NDArray[np.int64] | None:
        """Find the pairs of ray and instance that may meet, as sortable keys; None if they are too many."""
        with np.errstate(all="ignore"):
            inverse = f4(1) / direction
        code, lane = np.zeros(reach.size, np.intp), np.arange(reach.size)
        keys = [np.zeros(0, np.int64)]
        total = 0
        while code.size:
            codes, lanes = [], []
            for at in range(0, code.size, CHUNK // WIDTH):
                some = lane[at : at + CHUNK // WIDTH]
                child, lane_met, near = self._children_met(
                    code[at : at + CHUNK // WIDTH], some, origin, inverse, reach
                )
                leaf = np.flatnonzero(child < 0)
                instance = self._instance.take(-1 - child.take(leaf))
                keys.append(_pack(lane_met.take(leaf), near.take(leaf), instance, self._instance_bits))
                inner = np.flatnonzero(child > 0)
                codes.append(child.take(inner))
                lanes.append(lane_met.take(inner))
                total += child.size
                if total > PAIRS and reach.size > 1:
                    return None
            code, lane = np.concatenate(codes), np.concatenate(lanes)
        return np.sort(np.concatenate(keys))

    def _children_met(
        self, node: Ints, lane: Ints, origin: Floats, inverse: Floats, reach: Floats
    ) -> tuple[Ints, Ints, Floats]:
        """Pairs of node and lane (p,) -> child codes, lanes and entry distances of the boxes that rays meet.

        NaN, from a ray along the face of a box, counts as met.
        """
        near = np.zeros((WIDTH, node.size), f4)
        far = np.broadcast_to(reach.take(lane) * (1 + ROUNDING), near.shape)
        with np.errstate(all="ignore"):
            for axis in range(3):
                start, scale = origin[axis].take(lane), inverse[axis].take(lane)
                first, second = ((box[axis].take(node, 1) - start) * scale for box in (self._low, self._high))
                near = np.maximum(near, np.minimum(first, second))
                far = np.minimum(far, np.maximum(first, second))
            met = np.flatnonzero(~(near * (1 - ROUNDING) > far * (1 + ROUNDING)))
        slot, pair = np.divmod(met, node.size)
        child = self._child[node.take(pair), slot]
        there = np.flatnonzero(child)
        entry = np.fmax(near.ravel().take(met.take(there)) * (1 - ROUNDING), f4(0)) + f4(0)  # never -0
        return child.take(there), lane.take(pair.take(there)), entry


def _pack(lane: Ints, near: Floats, instance: Ints, bits: int) -> NDArray[np.int64]:
    """Make keys that sort by lane, then distance, then instance; distances are rounded down to fit.

    Bits of floats that are not negative sort like the floats.
    """
    kept = _near_bits(bits)
    distance = near.view(np.int32).astype(np.int64) >> (31 - kept)
    return (lane << (kept + bits)) | (distance << bits) | instance


def _near_bits(bits: int) -> int:
    return min(31, 63 - LANE_BITS - bits)


def _nearest_first(keys: NDArray[np.int64], reach: Floats, bits: int) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of sorted keys in rounds: each ray's next one, then two, four and so on.

    Pairs whose instance begins beyond the ray's reach by then are left out.
    """
    kept = _near_bits(bits)
    instance = keys & ((1 << bits) - 1)
    near = (((keys >> bits) & ((1 << kept) - 1)) << (31 - kept)).astype(np.int32).view(f4)
    lane = keys >> (bits + kept)
    at = np.flatnonzero(np.append(True, lane[1:] != lane[:-1])[: lane.size])
    last = np.append(at[1:], lane.size)[: at.size]
    taken = 1
    while at.size:
        count = np.minimum(last - at, taken)
        ends = np.cumsum(count)
        place = np.arange(int(ends[-1])) + np.repeat(at - ends + count, count)
        place = place.compress(near.take(place) <= reach.take(lane.take(place)))
        if place.size:
            yield lane.take(place), instance.take(place)
        at = at + count
        more = np.flatnonzero(at < last)
        more = more.compress(near.take(at.take(more)) <= reach.take(lane.take(at.take(more))))
        at, last = at.take(more), last.take(more)
        taken *= 2


def _keep_nearest(hits: Intersections, lane: Ints, found: Intersections) -> None:
    """Record what was found on `lane` (p,), which may occur several times, where it is nearer."""
    t, prim = hits.t.take(lane), hits.prim.take(lane)
    nearer = np.flatnonzero((found.t < t) | ((found.t == t) & (found.prim < prim) & (found.prim >= 0)))
    nearer = nearer.take(np.lexsort((found.prim.take(nearer), found.t.take(nearer), lane.take(nearer))))
    lane = lane.take(nearer)
    first = np.flatnonzero(np.append(True, lane[1:] != lane[:-1])[: lane.size])
    lane, nearer = lane.take(first), nearer.take(first)
    hits.t[lane], hits.prim[lane] = found.t.take(nearer), found.prim.take(nearer)
    hits.b1[lane], hits.b2[lane] = found.b1.take(nearer), found.b2.take(nearer)

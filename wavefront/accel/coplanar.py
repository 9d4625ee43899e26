"""Faces that overlap in a plane without being equal, and the planes that they share.

Their corners are rounded, so each has a plane of its own, and rounding would decide which of them is nearest.
On a common plane they are at one distance, and the first of them is hit.

Candidates are found by hashing. Numbers that change little with a plane, and are the same for both of its
sides, are rounded to cells; each of `SHIFTS` grids of cells is shifted against the others, so that planes
that nearly agree share a cell in at least one of them. Of the faces of a cell, those whose boxes overlap are
found by sorting them along one axis, in strips along another. The rest is a test of two triangles.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, dot, f4, length, spans
from .duplicates import FACTORS, Keys, repeated
from .triangle import AXES, ROUNDOFF, TriangleTable

SHIFTS = 4  # one more than there are numbers of a plane
COARSEST = 1 / 8  # the greatest width of a cell
FLATNESS = 4 * ROUNDOFF  # largest distance from a common plane, relative to the coordinates
AT_ONCE = 1 << 15  # faces, or pairs of them, per batch: their numbers fit the cache
FARTHEST = 16.0  # distance beyond a triangle, in its heights, up to which its plane is precise
# Pairs that are tested, for each face and in all. The faces of cells that have more count as overlapping:
# they get one plane, or rays that hit them are traced twice. Both do no harm where they do not overlap.
DENSE, BUDGET = 64, 1 << 24
# A rotation, so that no usual plane is special to the components of its normal.
ROTATION = np.array([[0.61, 0.52, 0.5978], [-0.7923, 0.401, 0.4597], [-0.0007, -0.7541, 0.6568]])
NONE: Ints = np.zeros(0, np.intp)

HalfInts = NDArray[np.int32]  # numbers of faces, in half the memory of `Ints`


@soa
class Overlaps:
    """The faces that overlap others, (k,) columns in ascending order of the faces."""

    face: Ints  # (k,) their ids
    group: Ints  # (k,) faces of one group overlap each other, directly or through others of the group
    plane: Doubles  # (4, k) normal n and n·p: the same for a group, if it is flat
    deviation: Doubles  # (k,) largest distance of a corner of the face from that plane
    open: Bools  # (k,) whether another face may have to be hit where this one is found


def share_planes(table: TriangleTable, triangles: Floats, ids: Ints, joined: Ints = NONE) -> None:
    """Give triangles of the table that overlap in a plane a common one; parameters as for `find_overlaps`."""
    overlaps = find_overlaps(triangles, ids, table.plane, joined)
    if overlaps is not None:
        table.plane[:, overlaps.face] = overlaps.plane
        table.deviation = np.zeros(len(triangles))
        table.deviation[overlaps.face] = overlaps.deviation


def find_overlaps(triangles: Floats, ids: Ints, plane: Doubles, joined: Ints = NONE) -> Overlaps | None:
    """Find the triangles among `ids` (ascending) that overlap others in a plane; None without any.

    Parameters
    ----------
    triangles
        (m, 3, 3) vertices.
    ids
        (k,) those that have an area, each with other corners.
    plane
        (4, m) normal n of any length, and n·p.
    joined
        (q,) triangles that have one plane with the next one anyway.
    """
    with np.errstate(all="ignore"):
        pairs = np.concatenate([np.zeros((2, 0), np.intp), *_overlapping(triangles, ids, plane)], 1)
    if not pairs.size:
        return None
    later = np.unique(pairs.max(0))
    halves = np.stack([joined, joined + 1])
    pairs = np.concatenate([pairs, halves[:, np.isin(halves, pairs).any(0)]], 1)
    face, place = np.unique(pairs, return_inverse=True)
    group = connected_parts(face.size, *place.reshape(2, -1))
    common, deviation, flat = _common_planes(triangles.take(face, 0), group)
    return Overlaps(
        face,
        group,
        np.where(flat, common, plane.take(face, 1)),
        np.where(flat, deviation, 0.0),
        np.isin(face, later) | ~flat,
    )


def _overlapping(triangles: Floats, ids: Ints, plane: Doubles) -> Iterator[Ints]:
    """Yield pairs (2, p) of faces that overlap; some may come twice."""
    if ids.size < 2:
        return
    numbers = _plane_numbers(triangles, ids, plane)
    before: list[Keys] = []
    for shift in range(SHIFTS):
        keys = _cells(numbers, shift / SHIFTS, ids.size)
        member, start = repeated(keys)
        member, start = _without_parts(member, start, before)
        before.append(keys)
        yield from _overlapping_in_runs(triangles, ids.take(member), plane, start)


def _plane_numbers(triangles: Floats, ids: Ints, plane: Doubles) -> Floats:
    """Return three numbers (3, k) of planes, in cells: the same for both sides, and continuous.

    Normals of usual triangles of a mesh are certain to a quarter of a cell.
    """
    width = min(COARSEST, 0.5 / np.sqrt(ids.size))
    out = np.empty((3, ids.size), f4)
    farthest = 0.0
    for span in spans(ids.size, AT_ONCE):
        planes = plane.take(ids[span], 1)
        planes /= length(planes[:3])
        p, q, r = (row[0] * planes[0] + row[1] * planes[1] + row[2] * planes[2] for row in ROTATION)
        out[0, span] = p * q / width
        out[1, span] = (q * r - 0.7 * p * p) / width
        out[2, span] = planes[3] * (p + 0.6 * q + 0.3 * r)
        farthest = max(farthest, float(np.abs(triangles.take(ids[span], 0)).max()))
    out[2] *= f4(1 / (width * farthest))
    return out


def _cells(numbers: Floats, shift: float, count: int) -> Keys:
    """Return keys (k,) of the cells that numbers (3, k) are in."""
    keys = np.zeros(count, np.uint64)
    for span in spans(count, AT_ONCE):
        key = np.zeros(1, np.uint64)
        for cell, factor in zip(np.floor(numbers[:, span] + f4(shift)), FACTORS, strict=True):
            key = (key + cell.astype(np.int64).view(np.uint64)) * factor
            key = key ^ (key >> np.uint64(29))
        keys[span] = key * FACTORS[0]
    return keys


def _without_parts(member: Ints, start: Ints, before: list[Keys]) -> tuple[Ints, Ints]:
    """Leave out runs whose members were together in one cell of an earlier grid."""
    for keys in before:
        if not member.size:
            break
        member_keys = keys.take(member)
        new = np.minimum.reduceat(member_keys, start) != np.maximum.reduceat(member_keys, start)
        count = np.diff(start, append=member.size)
        member, count = member.compress(np.repeat(new, count)), count.compress(new)
        start = np.cumsum(count) - count
    return member, start


def _overlapping_in_runs(triangles: Floats, face: Ints, plane: Doubles, start: Ints) -> Iterator[Ints]:
    """Yield pairs (2, p) of faces (r,) that overlap, of the runs that begin at `start`."""
    if not face.size:
        return
    count = np.diff(start, append=face.size)
    corners, across = _flattened(triangles, face, plane, start, count)
    low, high = _extent(*corners.transpose(1, 2, 0))
    run: HalfInts = np.repeat(np.arange(count.size, dtype=np.int32), count)
    box, strip, first, following = _in_strips(low, high, run, start, count)
    pairs = np.asarray(np.bincount(run.take(box), following, count.size), np.float64)
    dense = _beyond_budget(pairs, DENSE * face.size + BUDGET)
    adjacent = np.flatnonzero(dense.take(run[1:]) & (run[1:] == run[:-1]))
    yield np.stack([face.take(adjacent), face.take(adjacent + 1)])
    following[dense.take(run.take(box))] = 0
    ends = np.cumsum(following)
    shift = np.arange(1, box.size + 1) + following - ends  # from a number of a pair to its second place
    for span in spans(int(ends[-1]), AT_ONCE):
        number = np.arange(span.start, span.stop)
        at = np.searchsorted(ends, number, "right")
        one, other = box.take(at), box.take(number + shift.take(at))
        # two boxes may share several strips: the lowest counts
        meet = np.maximum(first.take(one), first.take(other)) == strip.take(at)
        bottom = np.maximum(low[1].take(one), low[1].take(other))
        meet &= bottom < np.minimum(high[1].take(one), high[1].take(other))
        bottom = np.maximum(across[0].take(one), across[0].take(other))
        top = np.minimum(across[1].take(one), across[1].take(other))
        meet &= bottom - top <= FLATNESS * (np.abs(bottom) + np.abs(top))
        yield face.take(_that_overlap(triangles, face, corners, one.compress(meet), other.compress(meet)))


def _in_strips(
    low: Floats, high: Floats, run: HalfInts, start: Ints, count: Ints
) -> tuple[HalfInts, HalfInts, HalfInts, Ints]:
    """Sort boxes (2, r) of runs in strips along the first axis, as high as the boxes are on average.

    Returns columns (q,), one for each strip that a box is in: the box, the strip, and how many of those that
    follow in the strip overlap the box along the first axis; and the first strip (r,) of each box.
    """
    left, bottom = np.minimum.reduceat(low, start, 1)
    extent = np.maximum.reduceat(high[1], start) - bottom
    size = np.add.reduceat(high[1] - low[1], start, dtype=np.float64) / count
    height = np.maximum(size, extent / np.maximum(count // 16, 1)).astype(f4) + f4(1e-30)
    first, last = (
        ((edge - bottom.take(run)) / height.take(run)).astype(np.int32) for edge in (low[1], high[1])
    )
    strips = np.maximum.reduceat(last, start) + 1
    base = (np.cumsum(strips) - strips).astype(np.int32).take(run)
    first, last = first + base, last + base
    copies = last - first + 1
    box: HalfInts = np.repeat(np.arange(run.size, dtype=np.int32), copies)
    strip = np.arange(box.size, dtype=np.int32)
    strip += np.repeat(first - (np.cumsum(copies) - copies).astype(np.int32), copies)
    begin, end = (
        (edge - left.take(run)).view(np.uint32).take(box) | strip.astype(np.uint64) << np.uint64(32)
        for edge in (low[0], high[0])
    )  # the bits of floats that are not negative sort like the floats
    order = np.argsort(begin)
    begin, end = begin.take(order), end.take(order)
    following = np.searchsorted(begin, end) - np.arange(1, begin.size + 1)
    return box.take(order), strip.take(order), first, np.maximum(following, 0)


def _flattened(
    triangles: Floats, face: Ints, plane: Doubles, start: Ints, count: Ints
) -> tuple[Floats, Floats]:
    """Return the corners (r, 3, 2) of faces without the axis that is most across the first of each run.

    Also returns the least and the greatest coordinate of each face along that axis, (2, r).
    """
    axis = np.abs(plane[:3].take(face.take(start), 1)).argmax(0)
    axes = np.repeat(AXES.T.astype(np.int8).take(axis, 0), count, 0)
    out, across = np.empty((face.size, 3, 2), f4), np.empty((2, face.size), f4)
    for span in spans(face.size, AT_ONCE):
        corners = triangles.take(face[span], 0)
        turned = np.take_along_axis(corners, axes[span, None].astype(np.intp), 2)
        out[span] = turned[:, :, :2]
        across[:, span] = _extent(*turned[:, :, 2].T)
    return out, across


def _extent(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the least and the greatest of three arrays, (2, ...); much faster than `min` and `max`."""
    return np.stack([np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)])


def _beyond_budget(pairs: Doubles, budget: int) -> Bools:
    """Return a mask of the runs with most pairs (runs,), without which there are no more than the budget."""
    order = np.argsort(pairs, kind="stable")
    dense = np.zeros(pairs.size, np.bool_)
    dense[order] = np.cumsum(pairs.take(order)) > budget
    return dense


def _that_overlap(triangles: Floats, face: Ints, corners: Floats, first: Ints, second: Ints) -> Ints:
    """Return those (2, q) of the pairs of places (p,) in `face` that overlap, in nearly one plane.

    `corners` (r, 3, 2) are those of the faces in a plane that is not far from theirs.
    """
    pair = np.stack([first, second])
    flat = (np.ascontiguousarray(corners.take(places, 0).transpose(1, 2, 0), np.float64) for places in pair)
    pair = pair.compress(~_apart(*flat), 1)
    if pair.size:
        solid = (triangles.take(ids, 0).transpose(1, 2, 0) for ids in face.take(pair))
        pair = pair.compress(_coplanar(*solid), 1)
    return pair


def _apart(one: Doubles, other: Doubles) -> Bools:
    """Return a mask of the pairs of triangles (corner, 2, p) in a plane that have no area in common.

    Then all corners of one are beyond an edge of the other, which separates them.
    """
    apart = np.zeros(one.shape[2], np.bool_)
    tolerance = FLATNESS * np.maximum(np.abs(one).max((0, 1)), np.abs(other).max((0, 1)))
    left = np.arange(apart.size)
    for edge in range(3):
        for first, second in ((one, other), (other, one)):
            x, y = first.take(left, 2).transpose(1, 0, 2)
            u, v = second.take(left, 2).transpose(1, 0, 2)
            begin, end, third = edge, (edge + 1) % 3, (edge + 2) % 3
            dx, dy = x[end] - x[begin], y[end] - y[begin]
            inside = np.sign(dx * (y[third] - y[begin]) - dy * (x[third] - x[begin]))
            beyond = np.maximum.reduce(inside * (dx * (v - y[begin]) - dy * (u - x[begin])))
            separates = beyond <= tolerance.take(left) * (np.abs(dx) + np.abs(dy))
            apart[left.compress(separates)] = True
            left = left.compress(~separates)
    return apart


def _coplanar(one: Floats, other: Floats) -> Bools:
    """Return a mask of the pairs of triangles (corner, 3, p) whose planes agree within their rounding.

    Of the two, that with the greater height over its longest edge gives the plane.
    """
    tolerance = FLATNESS * np.maximum(np.abs(one).max((0, 1)), np.abs(other).max((0, 1)))
    heights, distances, sizes = [], [], []
    for first, second in ((one, other), (other, one)):
        a, b, c = first.astype(np.float64)
        normal = cross(b - a, c - a)
        area2 = length(normal)
        heights.append(area2 / np.maximum(np.maximum(length(b - a), length(c - b)), length(a - c)))
        away = [np.abs(dot(normal, corner - a)) for corner in second.astype(np.float64)]
        distances.append(np.maximum.reduce(away) / area2)
        sizes.append(np.ptp(first, axis=0).max(0))
    higher = heights[0] >= heights[1]
    # beyond a triangle its plane is less certain
    reach = np.where(higher, *sizes[::-1]) / np.maximum(*heights)
    return np.where(higher, *distances) <= tolerance * (1 + np.minimum(reach, FARTHEST))


def connected_parts(count: int, first: Ints, second: Ints) -> Ints:
    """Return the lowest member of the connected part that each of `count` nodes is in, by edges (p,)."""
    label = np.arange(count)
    while first.size:
        one, other = label.take(first), label.take(second)
        differ = one != other
        first, second, one, other = (ends.compress(differ) for ends in (first, second, one, other))
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while (label.take(label) != label).any():
            label = label.take(label)
    return label


def _common_planes(corners: Floats, group: Ints) -> tuple[Doubles, Doubles, Bools]:
    """Fit a plane to each group of faces (k, 3, 3).

    Returns the planes (4, k), the largest distances (k,) of corners, and a mask (k,) of groups that are flat.
    """
    a, b, c = corners.transpose(1, 2, 0).astype(np.float64)
    normal = cross(b - a, c - a)
    normal *= np.sign(dot(normal, normal.take(group, 1)))
    sums = [np.asarray(np.bincount(group, row, group.size), np.float64) for row in normal]
    normal = np.stack(sums).take(group, 1)
    normal /= length(normal)
    heights = np.stack([dot(normal, corner) for corner in (a, b, c)])
    low, high = np.full(group.size, np.inf), np.full(group.size, -np.inf)
    np.minimum.at(low, group, heights.min(0))
    np.maximum.at(high, group, heights.max(0))
    size = np.zeros(group.size)
    np.maximum.at(size, group, np.abs(corners).max((1, 2)))
    low, high = low.take(group), high.take(group)
    offset = (low + high) / 2
    flat = (high - low) / 2 <= FLATNESS * size.take(group)
    return np.concatenate([normal, offset[None]]), np.abs(heights - offset).max(0), flat

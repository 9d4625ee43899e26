"""Polygons of files as triangles: a fan where it covers the polygon, otherwise ears that are cut off.

Every reader of polygons calls `triangulate`, so what their corners have (normals, texture coordinates,
colors) follows the same triangles in every format.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from ..arrays.vec import FLOAT32_MAX, Bools, Doubles, Ints, cross, distinct, dot, spans

AT_ONCE = 1 << 14  # triangles that are looked at together, so that they fit the cache
# a triangle of a fan folds back if twice its signed area is below -FOLD times the squares of its sides at the
# first corner: positions are often float32, so corners of a straight side are on a line only up to rounding
FOLD = 2.0**-20
FLAT = 1e-14  # with the same squares; below, a triangle has no area
MOST = 2**16  # corners of a polygon that is cut by ears: the time grows with their square
OTHER_HALVES = np.array([[1, 2, 3], [3, 0, 1]])  # of a quad, beside those of its fan
Order: TypeAlias = Callable[[Ints], "Triangles"]


class Triangles(NamedTuple):
    """The triangles of polygons."""

    corner: Ints  # (m, 3) numbers of corners, counted through all polygons
    polygon: Ints  # (m,) of which each is a part


def fans(counts: Ints) -> Triangles:
    """Return fans about the first corners of polygons of `counts` (k,) corners, one after the other."""
    if len(counts) and counts.min() == counts.max() == 3:
        return Triangles(np.arange(3 * len(counts)).reshape(-1, 3), np.arange(len(counts)))
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    start = np.repeat(np.cumsum(counts) - counts, triangles)
    return Triangles(np.stack([start, start + step + 1, start + step + 2], 1), polygon)


def turned_fans(counts: Ints) -> Triangles:
    """Return the same with the second half of each quad turned, as trimesh has it."""
    corner, polygon = fans(counts)
    second = np.flatnonzero(counts[polygon] == 4)[1::2]
    corner[second] = corner[second][:, [1, 2, 0]]
    return Triangles(corner, polygon)


def fans_by_size(counts: Ints) -> Triangles:
    """Return the same in trimesh's order: triangles, first and second halves of quads, other polygons."""
    if len(counts) and counts.min() == counts.max() == 4:
        quad, number = np.arange(4 * len(counts)).reshape(-1, 4), np.arange(len(counts))
        return Triangles(np.concatenate([quad[:, [0, 1, 2]], quad[:, [2, 3, 0]]]), np.tile(number, 2))
    corner, polygon = turned_fans(counts)
    size = counts[polygon]
    quads = np.flatnonzero(size == 4)
    groups = [np.flatnonzero(size == 3), quads[::2], quads[1::2], np.flatnonzero(size > 4)]
    order = np.concatenate(groups)
    return Triangles(corner[order], polygon[order])


def triangulate(
    points: Doubles, corners: Ints, counts: Ints, order: Order = fans, holes: Ints | None = None
) -> Triangles:
    """Return the triangles of polygons, which wind as the polygons do.

    A polygon need not be plane or convex, and may touch itself, as one does that a seam joins with its hole.
    Triangles without an area, as at corners on a line, are left out of polygons that have one.

    Parameters
    ----------
    points
        Positions (n, 3).
    corners
        Their numbers at the corners of all polygons, one polygon after the other.
    counts
        Number of corners (k,) of each polygon.
    order
        Lists the triangles where fans cover their polygons.
    holes
        Numbers of polygons that are left out.
    """
    corner, polygon = triangles = order(counts) if (counts > 3).any() else fans(counts)
    if holes is not None and len(holes):
        shown = ~np.isin(polygon, holes)
        corner, polygon = triangles = Triangles(corner[shown], polygon[shown])
    with np.errstate(all="ignore"):
        rows = np.flatnonzero(_are_odd(points, corners, counts)[polygon])
        if not len(rows):
            return triangles
        owner = polygon[rows]
        area, size = _areas(points, corners[corner[rows]])
        normal: Doubles = np.stack([np.bincount(owner, component, len(counts)) for component in area])
        whole = dot(normal, normal)
        folded = dot(area, normal[:, owner]) < -FOLD * size * np.sqrt(whole[owner])
        thin = (dot(area, area) <= (FLAT * size) ** 2) & (whole[owner] > 0)
        cut = [
            _cut(points, corners, counts, normal, np.unique(owner[folded])),
            _broken(points, corners, counts, owner),
        ]
    keep = np.ones(len(corner), np.bool_)
    keep[rows[thin]] = False
    keep &= ~np.isin(polygon, np.concatenate([piece.polygon for piece in cut]))
    if keep.all():
        return triangles
    lists = zip((corner[keep], polygon[keep]), *cut, strict=True)
    return Triangles(*map(np.concatenate, lists))


def with_holes(rings: list[Doubles]) -> Ints:
    """Return the triangles (m, 3) of a polygon with holes, which wind as the polygon does.

    Parameters
    ----------
    rings
        The positions (n, 3) of the corners of the outer ring, and of each hole, which may wind either way.
        The triangles count the corners of all.
    """
    outer = rings[0]
    normal = np.asarray(np.cross(outer, np.roll(outer, -1, 0)).sum(0))
    return _ears(np.concatenate(rings), normal, np.cumsum([len(ring) for ring in rings]))


def _are_odd(points: Doubles, corners: Ints, counts: Ints) -> Bools:
    """Return a mask of the polygons (k,) whose fan has a triangle whose area is not clearly above 0."""
    odd, first = np.zeros(len(counts), np.bool_), np.cumsum(counts) - counts
    for size in distinct(counts[counts > 3]):
        chosen = np.flatnonzero(counts == size)
        for block in spans(len(chosen), max(AT_ONCE // size, 1)):
            members = chosen[block]
            places = points.take(corners[first[members] + np.arange(size)[:, None]], 0)  # (n, k, 3)
            side = np.ascontiguousarray((places[1:] - places[0]).transpose(2, 0, 1))
            area, square = cross(side[:, :-1], side[:, 1:]), dot(side, side)
            normal = area.sum(1)
            least = FOLD * np.sqrt(dot(normal, normal)) * (square[:-1] + square[1:])
            odd[members] = ~((dot(area, normal[:, None]) > least) & (square[1:] < FLOAT32_MAX**2)).all(0)
    return odd


def _areas(points: Doubles, triangles: Ints) -> tuple[Doubles, Doubles]:
    """Return twice the area of triangles (m, 3) as vectors (3, m), and the squares (m,) of their sides."""
    area, size = np.empty((3, len(triangles))), np.empty(len(triangles))
    for block in spans(len(triangles), AT_ONCE):
        a, b, c = np.ascontiguousarray(points.take(triangles[block], 0).transpose(1, 2, 0))
        area[:, block] = cross(b - a, c - a)
        size[block] = dot(b - a, b - a) + dot(c - a, c - a)
    return area, size


def _broken(points: Doubles, corners: Ints, counts: Ints, polygons: Ints) -> Triangles:
    """Return a triangle for each of `polygons` that has a corner beyond float32.

    All its corners are that corner, so that the whole polygon is left out where meshes are built.
    """
    sound: Bools = np.all(np.abs(points) <= FLOAT32_MAX, axis=1)  # false for NaN
    bad = np.flatnonzero(~sound[corners])
    polygon, first = np.unique(np.repeat(np.arange(len(counts)), counts)[bad], return_index=True)
    is_wanted = np.isin(polygon, polygons)
    return Triangles(np.repeat(bad[first[is_wanted]], 3).reshape(-1, 3), polygon[is_wanted])


def _cut(points: Doubles, corners: Ints, counts: Ints, normal: Doubles, concave: Ints) -> Triangles:
    """Return triangles of the polygons `concave`, given twice the areas (3, k) of all polygons as vectors.

    A polygon that crosses itself, or has too many corners, may have none.
    """
    first = np.cumsum(counts) - counts
    quads = concave[counts[concave] == 4]
    halves = first[quads, None, None] + OTHER_HALVES
    area, _ = _areas(points, corners[halves].reshape(-1, 3))
    sound = (dot(area, np.repeat(normal[:, quads], 2, 1)) > 0).reshape(-1, 2).all(1)
    corner, polygon = [halves[sound].reshape(-1, 3)], [np.repeat(quads[sound], 2)]
    for number in concave[counts[concave] > 4].tolist():
        ring = np.arange(first[number], first[number] + counts[number])
        corner.append(ring[_ears(points[corners[ring]], normal[:, number])])
        polygon.append(np.full(len(corner[-1]), number))
    return Triangles(np.concatenate(corner), np.concatenate(polygon))


def _ears(points: Doubles, normal: Doubles, ends: Ints | None = None) -> Ints:
    """Return the triangles (m, 3) of a polygon with corners at points (n, 3), seen along its normal.

    `ends` are those of its rings, the outer one and holes.
    """
    from mapbox_earcut import triangulate_float64

    axis = int(np.abs(normal).argmax())
    seen = (points - points[0])[:, [(axis + 1) % 3, (axis + 2) % 3][:: 1 if normal[axis] > 0 else -1]]
    scale = np.abs(seen).max()
    if not 0 < scale < np.inf or len(points) > MOST:
        return np.zeros((0, 3), np.intp)
    ends = np.array([len(points)]) if ends is None else ends
    triangles = triangulate_float64(np.ascontiguousarray(seen / scale), ends.astype(np.uint32))
    return triangles.astype(np.intp).reshape(-1, 3)

"""Faces of shapes with something inside that lie on faces of other such shapes, or back to back.

A ray meets only one of two surfaces at one place, and goes on behind both. So that its media are
known, it is told the other one, too.
"""

from __future__ import annotations

import numpy as np

from ..accel import Geometry
from ..accel.coplanar import find_overlaps
from ..accel.numpy_accel import NumpyAccelerator
from ..accel.triangle import has_area, triangle_table
from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, length
from .geometry import boxes_of_groups

FEW = 1 << 12  # triangles that are all compared, also with those of their own shape
MOST_SHAPES = 1 << 8  # whose boxes are compared with each other; of more, all faces are
ROOM = 2.0**-20  # margin of boxes, relative to the coordinates


@soa
class TouchingFaces:
    """The k triangles that may lie on one of another shape, or back to back on one of their own.

    Triangles of one shape that turn one way in a common plane are a layer. The layers that overlap each other
    have different numbers.
    """

    number: Ints  # (m,) which of the k each triangle of the scene is, -1 for none
    group: Ints  # (k,) the same for triangles that overlap in a plane
    layer: Ints  # (k,) number of the layer among those of the group
    material: Ints  # (k,) number of the material
    front: Floats  # (3, k) normal on the front side
    members: tuple[Ints, ...]  # for each number of a layer, the triangles (k',) that have it,
    accelerators: tuple[NumpyAccelerator, ...]  # and how rays meet them


def find_touching(triangles: Floats, shape: Ints, material: Ints, holds: Bools) -> TouchingFaces | None:
    """Find triangles that lie on one of another shape, or on one of their own, where both hold something.

    Parameters
    ----------
    triangles
        (m, 3, 3) corners.
    shape, material
        (m,) numbers of their shapes and materials.
    holds
        (m,) whether they are the boundary of something.
    """
    ids = np.flatnonzero(holds & has_area(triangles))
    if ids.size > FEW:
        ids = ids.compress(_near_others(triangles.take(ids, 0), shape.take(ids)))
    planes = triangle_table(triangles.take(ids, 0), False).plane
    overlaps = find_overlaps(triangles.take(ids, 0), np.arange(ids.size), planes)
    if overlaps is None:
        return None
    normal = planes[:3].take(overlaps.face, 1)
    face = ids.take(overlaps.face)
    layer = _layers(overlaps.group, shape.take(face), normal)
    number = np.full(len(triangles), -1)
    number[face] = np.arange(face.size)
    members = tuple(np.flatnonzero(layer == level) for level in range(layer.max() + 1))
    return TouchingFaces(
        number,
        overlaps.group,
        layer,
        material.take(face),
        (normal / length(normal)).astype(f4),
        members,
        tuple(NumpyAccelerator(Geometry(triangles.take(face.take(places), 0))) for places in members),
    )


def may_meet(low: Doubles, high: Doubles, moves: Bools) -> bool:
    """Return whether a box that holds all places of what moves meets another one, of boxes (n, 3)."""
    if len(low) > MOST_SHAPES:
        return bool(moves.any())
    room = ROOM * np.maximum(np.abs(low), np.abs(high)).max(initial=0)
    meets = ((low[:, None] <= high + room) & (high[:, None] >= low - room)).all(2)
    np.fill_diagonal(meets, False)
    return bool(meets[moves].any())


def _layers(group: Ints, shape: Ints, normal: Doubles) -> Ints:
    """Return the numbers (k,) of the layers of triangles, given their groups, shapes and normals (3, k)."""
    first = np.zeros(group.max() + 1, np.intp)
    first[group[::-1]] = np.arange(group.size)[::-1]
    turned = (normal * normal.take(first.take(group), 1)).sum(0) < 0
    layers, layer = np.unique(np.stack([group, shape, turned]), axis=1, return_inverse=True)
    starts = np.searchsorted(layers[0], layers[0])  # where the layers of each one's group begin
    return (np.arange(layers.shape[1]) - starts).take(layer.reshape(-1))


def _near_others(triangles: Floats, shape: Ints) -> Bools:
    """Return a mask (m,) of the triangles (m, 3, 3) whose boxes meet that of another shape (m,)."""
    low, high = triangles.min(1).astype(np.float64), triangles.max(1).astype(np.float64)
    names, of_shape = np.unique(shape, return_inverse=True)
    if names.size == 1:
        return np.zeros(shape.size, np.bool_)
    if names.size > MOST_SHAPES:
        return np.ones(shape.size, np.bool_)
    lows, highs = boxes_of_groups(low, high, of_shape, names.size)
    near = np.zeros(shape.size, np.bool_)
    for other in range(names.size):
        room = ROOM * max(float(np.abs(lows[other]).max()), float(np.abs(highs[other]).max()))
        meets = ((low <= highs[other] + room) & (high >= lows[other] - room)).all(1)
        near |= meets & (of_shape != other)
    return near

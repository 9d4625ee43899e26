"""Whether the media of a scene that only absorb need no `MediaTable`.

A ray that meets a surface from its back side has crossed the medium behind it. Where no path begins, ends or
scatters within that medium, it is enough to attenuate rays there: they need no record of the media that they
are in. That is so for a glass ball, a prism or a bottle by itself. The conditions for an absorbing shape are:

- It is closed, with two faces at each edge, and its front is outside. Connected parts do not overlap.
- It does not emit.
- Its bounding box contains no part of another shape, and no light that has a position.
- No shape and no light moves while a shutter is open (compile/scene.py).

Cameras and sensors may be inside, since every ray that they trace leaves through the surface. A shape that
lies on a flat side counts as inside, because rays hit both at one distance; one that only touches the box
does not. A connected surface that intersects itself is not detected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..accel.coplanar import connected_parts
from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Ints
from ..lights import Light
from ..lights.base import FarLight
from ..shapes import Cylinders, Instance, Mesh, Shape, Sphere
from ..shapes.instance import instance_bounds, kinds_of
from .geometry import boxes_of_groups

NEAR = 1e-6  # largest gap of boxes that touch, relative to their size
MOST_PARTS = 1 << 11  # of absorbers; with more, the table is taken without a search
MOST_FACES = 1 << 22  # of other shapes; likewise


@soa
class Boxes:
    """Boxes of absorbers; only flat sides can touch."""

    low: Doubles  # (k, 3)
    high: Doubles  # (k, 3)
    shape: Ints  # (k,) number of the shape that each is of

    def meet(self, low: Doubles, high: Doubles) -> Bools:
        """Return whether boxes with corners (n, 3) meet these, (k, n)."""
        return np.logical_and.reduce((self.low[:, None] < high) & (self.high[:, None] > low), 2)


def absorbs_alone(shapes: Sequence[Shape], lights: Sequence[Light], scale: float = 1.0) -> bool:
    """Return whether every absorber of a scene is alone, so that no table of media is needed.

    Parameters
    ----------
    shapes
        The shapes that are traced.
    lights
        Those of the scene, in its own unit: of `scale`, lengths are multiplied by it for the shapes.
    """
    kinds, kind = kinds_of(shapes)
    absorbers = np.flatnonzero(np.array([_absorbs(shape) for shape in kinds], np.bool_)[kind]).tolist()
    if not absorbers:
        return True
    if any(shapes[number].emission is not None for number in absorbers):
        return False
    boxes = _boxes(shapes, absorbers)
    if boxes is None:
        return False
    return not _holds_light(boxes, lights, scale) and not _holds_shape(boxes, shapes)


def _absorbs(shape: Shape) -> bool:
    interior = shape.material.interior
    return interior is not None and bool(interior.sigma_a.any())


def _boxes(shapes: Sequence[Shape], absorbers: Sequence[int]) -> Boxes | None:
    """Return the boxes of the parts of absorbers; None if one is open, inside out or within another."""
    parts: list[tuple[Doubles, Doubles]] = []
    for number in absorbers:
        bounds = _parts(shapes[number])
        if bounds is None or len(bounds[0]) > MOST_PARTS or len(parts) > MOST_PARTS:
            return None
        parts.append(bounds)
    low, high = (np.concatenate([pair[side] for pair in parts]) for side in (0, 1))
    if len(low) > MOST_PARTS:
        return None
    boxes = Boxes(low, high, np.repeat(absorbers, [len(pair[0]) for pair in parts]))
    meets = boxes.meet(boxes.low, boxes.high)
    np.fill_diagonal(meets, False)
    return None if meets.any() else boxes


def _parts(shape: Shape) -> tuple[Doubles, Doubles] | None:
    """Return the corners (k, 3) of the boxes of a shape's parts; None if one is not closed."""
    if isinstance(shape, Sphere):
        low, high = shape.bounds[:, None]
        room = NEAR * (high - low)
        return low + room, high - room
    if isinstance(shape, Cylinders) and shape.count == 1 and shape.caps:
        low, high = shape.bounds[:, None]
        room = NEAR * (high - low).max()
        return low - room, high + room
    if isinstance(shape, Mesh):
        return _parts_of_mesh(shape.vertices, shape.faces)
    if isinstance(shape, Instance):
        mesh = shape.to_mesh()
        return _parts_of_mesh(mesh.vertices, mesh.faces)
    return None


def _parts_of_mesh(vertices: Doubles, faces: Ints) -> tuple[Doubles, Doubles] | None:
    """Return the boxes of the connected parts of a mesh; None if it is open or a part is inside out."""
    points, number = np.unique(vertices.take(faces.ravel(), 0) + 0.0, axis=0, return_inverse=True)
    a, b, c = number.reshape(-1, 3).T
    solid = (a != b) & (b != c) & (c != a)
    a, b, c = (corner.compress(solid) for corner in (a, b, c))
    start, end = np.concatenate([a, b, c]), np.concatenate([b, c, a])
    count = len(points)
    edges = np.sort(start * count + end)
    if (edges[1:] == edges[:-1]).any() or not np.array_equal(edges, np.sort(end * count + start)):
        return None
    used, part_of = np.unique(connected_parts(count, start, end).take(a), return_inverse=True)
    corners = np.stack([points.take(corner, 0) for corner in (a, b, c)], 1)
    if not used.size or (_volumes(corners, part_of, used.size) <= 0).any():
        return None
    return _boxes_of_parts(corners, part_of, used.size)


def _volumes(corners: Doubles, part_of: Ints, parts: int) -> Doubles:
    """Return six times the volume of each part, of triangles (m, 3, 3) that turn their fronts outside."""
    u, v, w = (corners - corners[0, 0]).transpose(1, 0, 2)
    return np.asarray(np.bincount(part_of, (u * np.cross(v, w)).sum(1), parts), np.float64)


def _boxes_of_parts(corners: Doubles, part_of: Ints, parts: int) -> tuple[Doubles, Doubles]:
    """Return the boxes (parts, 3) of triangles (m, 3, 3), larger on flat sides and smaller on others."""
    least, most = corners.min(1), corners.max(1)
    low, high = boxes_of_groups(least, most, part_of, parts)
    room = NEAR * (high - low).max(1, keepdims=True)
    flat_low, flat_high = np.zeros((parts, 3), np.bool_), np.zeros((parts, 3), np.bool_)
    np.logical_or.at(flat_low, part_of, most <= (low + room).take(part_of, 0))
    np.logical_or.at(flat_high, part_of, least >= (high - room).take(part_of, 0))
    return low - np.where(flat_low, room, -room), high + np.where(flat_high, room, -room)


def _holds_light(boxes: Boxes, lights: Sequence[Light], scale: float) -> bool:
    """Return whether a light may have a place in one of the boxes."""
    for light in lights:
        if isinstance(light, FarLight):
            continue
        bounds = light.bounds
        if bounds is None or boxes.meet(bounds[:1] * scale, bounds[1:] * scale).any():
            return True
    return False


def _holds_shape(boxes: Boxes, shapes: Sequence[Shape]) -> bool:
    """Return whether part of a shape is in a box of another one."""
    left = MOST_FACES
    for numbers, bounds in _bounds(shapes):
        meets = boxes.meet(bounds[:, 0], bounds[:, 1]) & (boxes.shape[:, None] != numbers)
        for at in np.flatnonzero(meets.any(0)):
            shape = shapes[numbers[at]]
            if isinstance(shape, Instance):
                shape = shape.to_mesh()
            if not isinstance(shape, Mesh):
                return True
            near = np.flatnonzero(meets[:, at]).tolist()
            left -= len(shape.faces) * len(near)
            if left < 0 or any(_meets_faces(boxes, box, shape) for box in near):
                return True
    return False


def _bounds(shapes: Sequence[Shape]) -> Iterator[tuple[Ints, Doubles]]:
    """Yield the numbers (k,) of some shapes and their bounds (k, 2, 3)."""
    placed = [number for number, shape in enumerate(shapes) if isinstance(shape, Instance)]
    if placed:
        instances = [shape for shape in shapes if isinstance(shape, Instance)]
        yield np.array(placed), instance_bounds(instances)
    others = [number for number, shape in enumerate(shapes) if not isinstance(shape, Instance)]
    if others:
        yield np.array(others), np.stack([shapes[number].bounds for number in others])


def _meets_faces(boxes: Boxes, box: int, mesh: Mesh) -> bool:
    """Return whether a box may meet a face: whether their boxes do, and the box the face's plane."""
    low, high = boxes.low[box], boxes.high[box]
    corners = mesh.vertices.take(mesh.faces, 0)
    near = ((corners.min(1) < high) & (corners.max(1) > low)).all(1)
    a, b, c = corners.compress(near, 0).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    away = np.abs((normal * ((low + high) / 2 - a)).sum(1))
    return bool((away < (np.abs(normal) * (high - low) / 2).sum(1)).any())

"""Instances whose faces overlap those of other shapes in a plane.

Rounding in the coordinates of their meshes would decide which face a ray hits. So these become meshes of
their own, of which the first face is hit (`accel/coplanar.py`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..accel.coplanar import find_overlaps
from ..accel.triangle import has_area, triangle_table
from ..arrays.vec import Doubles, Floats, Ints, f4
from ..shapes import Instance, Mesh
from ..shapes.instance import instance_bounds
from ..shapes.transform import points_by

MOST_FACES = 1 << 18  # of instances, and of meshes beside them, among which overlaps are searched
ROOM = 2.0**-20  # margin of the box of all instances, relative to its coordinates


def overlapping_instances(instances: Sequence[Instance], meshes: Sequence[Mesh]) -> set[int]:
    """Return the identities of the instances with a face that overlaps one of another shape in a plane.

    Where there are more than `MOST_FACES` faces to compare, none is.
    """
    count = sum(len(instance.mesh.faces) for instance in instances)
    if not count or count > MOST_FACES:
        return set()
    boxes = instance_bounds(instances)
    low, high = boxes[:, 0].min(0), boxes[:, 1].max(0)
    room = ROOM * np.maximum(np.abs(low), np.abs(high))
    near = [_corners_between(mesh, low - room, high + room) for mesh in meshes]
    if count + sum(map(len, near)) > MOST_FACES:
        return set()
    corners, owner = _placed_corners(instances)
    middle = (low + high) / 2
    triangles: Floats = np.concatenate([(faces - middle).astype(f4) for faces in (*corners, *near)])
    of_meshes = np.repeat(np.arange(len(meshes)), [len(faces) for faces in near]) + len(instances)
    owner = np.concatenate([owner, of_meshes])
    overlaps = find_overlaps(
        triangles, np.flatnonzero(has_area(triangles)), triangle_table(triangles, False).plane
    )
    if overlaps is None:
        return set()
    of_face = owner.take(overlaps.face)
    lowest, highest = np.full(overlaps.face.size, owner.max() + 1), np.full(overlaps.face.size, -1)
    np.minimum.at(lowest, overlaps.group, of_face)
    np.maximum.at(highest, overlaps.group, of_face)
    several: Ints = np.unique(of_face.compress((lowest != highest).take(overlaps.group)))
    return {id(instances[number]) for number in several.tolist() if number < len(instances)}


def _corners_between(mesh: Mesh, low: Doubles, high: Doubles) -> Doubles:
    """Return the corners (k, 3, 3) of those faces of a mesh whose boxes meet a box."""
    corners = mesh.vertices.take(mesh.faces, 0)
    meets = (corners.min(1) <= high) & (corners.max(1) >= low)
    return corners.compress(meets.all(1), 0)


def _placed_corners(instances: Sequence[Instance]) -> tuple[list[Doubles], Ints]:
    """Return the corners of all faces, in parts (k, 3, 3), and which instance each face is of, (m,)."""
    members: dict[int, list[int]] = {}  # by mesh
    for number, instance in enumerate(instances):
        members.setdefault(id(instance.mesh), []).append(number)
    corners, owners = [], []
    for numbers in members.values():
        mesh = instances[numbers[0]].mesh
        transforms = np.stack([instances[number].transform for number in numbers])
        points = mesh.vertices.take(mesh.faces.ravel(), 0)
        corners.append(points_by(transforms, points).reshape(-1, 3, 3))
        owners.append(np.repeat(numbers, len(mesh.faces)))
    return corners, np.concatenate(owners)

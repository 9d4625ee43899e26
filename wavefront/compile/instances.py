"""Meshes that are placed several times: which are worth sharing, and what shading needs to know of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..accel import Placements
from ..errors import SceneError
from ..record import record
from ..shapes import Instance, Mesh, Shape, Sphere
from ..shapes.instance import instance_bounds
from ..state import SoA
from ..vec import Doubles, Floats, Ints, f4

SKEW = 1e3  # instances that are stretched more along one axis than along another are not shared
BOX_ROOM = 2.0**-20  # added to boxes on all sides, relative to their size and distance from the center


@record
class InstanceTable(SoA):
    """What shading needs of instances.

    One column for each "place": first what is placed once, its triangles and then its spheres, then the
    instances. Triangles of instances have primitive ids of their own, but share the rows of the
    scene's tables.
    """

    first: Ints  # (p,) first primitive id of each place, rising
    shift: Ints  # (p,) primitive id less its row
    linear: Floats  # (9, p) matrix that turns vectors of the mesh into the scene's, row by row
    normal: Floats  # (9, p) the same for normals, scaled so that their lengths are at most 1
    reach: Floats  # (p,) half the diagonal of the mesh's box, by the same factor; 0 for what is placed once
    material: Ints | None  # (p,) material in place of the mesh's, -1 for none; None if there is none at all

    def locate(self, prim: Ints) -> tuple[Ints, Ints]:
        """Primitive ids (n,) -> rows of the scene's tables and places; a miss, -1, stays one."""
        place = np.searchsorted(self.first[1:], prim, "right")
        return prim - self.shift.take(place), place

    def turn(self, normals: Floats) -> Floats:
        """Unit normals of meshes (3, p), one for each column -> normals in the scene, of any length."""
        return _times(self.normal, normals)

    def stretch(self, vectors: Floats) -> Floats:
        """Vectors in meshes (3·k, p), k for each column -> vectors in the scene."""
        return np.concatenate([_times(self.linear, vectors[i : i + 3]) for i in range(0, len(vectors), 3)])


def _times(m: Floats, vectors: Floats) -> Floats:
    """Matrices (9, p), row by row, times vectors (3, p)."""
    x, y, z = vectors
    return np.stack([m[i] * x + m[i + 1] * y + m[i + 2] * z for i in (0, 3, 6)])


def resolve(shapes: Sequence[Shape], most_copies: int) -> tuple[list[Mesh], list[Sphere], list[Instance]]:
    """Sort shapes by kind; instances that had better not share their mesh become meshes.

    Those are all, where they come to no more than `most_copies` triangles together; those of emitting
    meshes, as each triangle is a light; that of a mesh placed once; and very skewed ones, as float32
    is not enough in the mesh's own frame.
    """
    total = sum(len(shape.mesh.faces) for shape in shapes if isinstance(shape, Instance))
    copies = Counter(id(shape.mesh) for shape in shapes if isinstance(shape, Instance))
    meshes: list[Mesh] = []
    spheres: list[Sphere] = []
    instances: list[Instance] = []
    shareable = _shareable([shape for shape in shapes if isinstance(shape, Instance)])
    for shape in shapes:
        if isinstance(shape, Mesh):
            meshes.append(shape)
        elif isinstance(shape, Sphere):
            spheres.append(shape)
        elif not isinstance(shape, Instance):
            raise SceneError(f"{shape.name}: cannot trace a {type(shape).__name__}")
        elif total > most_copies and copies[id(shape.mesh)] > 1 and id(shape) in shareable:
            instances.append(shape)
        else:
            meshes.append(shape.to_mesh())
    return meshes, spheres, instances


def _shareable(instances: Sequence[Instance]) -> set[int]:
    """Return the identities of the instances that shine by no light and are not very skewed."""
    if not instances:
        return set()
    linear = np.stack([instance.transform[:3, :3] for instance in instances])
    stretch = np.linalg.svd(linear, compute_uv=False)
    even = (stretch[:, 0] <= SKEW * stretch[:, 2]).tolist()
    pairs = zip(instances, even, strict=True)
    return {id(instance) for instance, fits in pairs if fits and instance.emission is None}


def own_frame(mesh: Mesh) -> Doubles:
    """Return the vertices (n, 3) as they are traced: relative to the middle of the mesh's box."""
    return mesh.vertices - mesh.bounds.mean(0)


def place(
    instances: Sequence[Instance],
    shared: Sequence[Mesh],
    center: Doubles,
    triangles: int,
    spheres: int,
    material: Ints | None,
) -> tuple[Placements, InstanceTable]:
    """Compute where instances stand.

    Parameters
    ----------
    instances
        k of them.
    shared
        The distinct meshes that they are of. Their rows follow one another, after those of triangles
        that are placed once and before those of spheres.
    center
        (3,) of the scene.
    triangles, spheres
        How many are placed once.
    material
        (k,) material of each instance in place of the mesh's, -1 for none.
    """
    numbers = {id(mesh): number for number, mesh in enumerate(shared)}
    mesh_of = np.array([numbers[id(instance.mesh)] for instance in instances], np.intp)
    sizes = np.array([len(mesh.faces) for mesh in shared])
    rows = triangles + np.cumsum(sizes) - sizes
    ends = triangles + spheres + np.cumsum(sizes.take(mesh_of))
    first = ends - sizes.take(mesh_of)
    boxes = instance_bounds(instances) - center
    middles = np.stack([mesh.bounds.mean(0) for mesh in shared]).take(mesh_of, 0)
    halves = np.stack([np.ptp(mesh.bounds, axis=0) / 2 for mesh in shared]).take(mesh_of, 0)
    linear = np.stack([instance.transform[:3, :3] for instance in instances])
    shift = np.stack([instance.transform[:3, 3] for instance in instances])
    shift += (linear * middles[:, None]).sum(2) - center
    inverse = np.linalg.inv(linear)
    to_local = np.concatenate([inverse, -(inverse * shift[:, None]).sum(2)[:, :, None]], 2)
    room = BOX_ROOM * (np.abs(boxes).max((1, 2)) + np.ptp(boxes, axis=1).max(1))[:, None]
    placements = Placements(
        mesh=mesh_of,
        first=first,
        to_local=np.ascontiguousarray(to_local.reshape(-1, 12).T),
        low=np.ascontiguousarray((boxes[:, 0] - room).T, f4),
        high=np.ascontiguousarray((boxes[:, 1] + room).T, f4),
    )
    longest = np.linalg.norm(inverse, 2, (1, 2))  # of unit vectors of the scene, in the mesh's frame
    table = InstanceTable(
        first=np.concatenate([[0, triangles], first]),
        shift=np.concatenate([[0, -int(sizes.sum())], first - rows.take(mesh_of)]),
        linear=_after_identities(linear),
        normal=_after_identities(inverse.transpose(0, 2, 1) / longest[:, None, None]),
        reach=np.concatenate([[0, 0], np.linalg.norm(halves, axis=1) / longest]).astype(f4),
        material=None if material is None else np.concatenate([[-1, -1], material]),
    )
    return placements, table


def _after_identities(matrices: Doubles) -> Floats:
    """Return matrices (k, 3, 3), after those of the two places of what is placed once, as (9, k + 2)."""
    return np.concatenate([[np.eye(3)] * 2, matrices]).reshape(-1, 9).T.astype(f4, order="C")

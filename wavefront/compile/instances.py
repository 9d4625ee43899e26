"""Instances: which of them share one mesh, and the data of instances that tracing and shading need."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import compress

import numpy as np

from ..accel import Placements
from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4
from ..core.errors import SceneError
from ..shapes import CurvedShape, Instance, Mesh, Shape
from ..shapes.instance import by_mesh, instance_bounds, kinds_of, of_class, transforms_of
from .curved import order_by_kind
from .overlaps import overlapping_instances

SKEW = 1e3  # instances whose scales along two axes have a larger ratio become meshes of their own
BOX_ROOM = 2.0**-20  # margin of boxes on all sides, relative to their size and distance from the center


@soa
class InstanceTable(SoA):
    """Data of instances for shading.

    The first two columns, with identity transforms, are for the triangles and the curved primitives that are
    not instanced; then there is a column for each instance. Triangles of instances have distinct primitive
    ids, but those of one mesh share the rows of the scene's tables.
    """

    first: Ints  # (p,) first primitive id, ascending
    shift: Ints  # (p,) primitive id minus table row
    linear: Floats  # (9, p) matrix from vectors of the mesh to vectors of the scene, row by row
    normal: Floats  # (9, p) the same for normals, scaled so that their lengths are at most 1
    radius: Floats  # (p,) half the diagonal of the mesh's box, times the same factor; 0 if not instanced
    material: Ints | None  # (p,) material that replaces the mesh's, -1 for none; None if no instance has one

    def locate(self, prim: Ints) -> tuple[Ints, Ints]:
        """Return the table rows (n,) and columns here (n,) of primitive ids (n,); -1, a miss, stays -1."""
        instance = np.searchsorted(self.first[1:], prim, "right")
        return prim - self.shift.take(instance), instance


def times(m: Floats, vectors: Floats) -> Floats:
    """Return the products of matrices (9, p), row by row, and vectors (3, p)."""
    x, y, z = vectors
    return np.stack([m[i] * x + m[i + 1] * y + m[i + 2] * z for i in (0, 3, 6)])


def sort_shapes(
    shapes: Sequence[Shape], most_copies: int, moving: Collection[int] = ()
) -> tuple[list[Mesh], list[CurvedShape], list[Instance], Ints]:
    """Sort shapes by kind, and convert instances to meshes where sharing has no advantage.

    The last result has the positions in `shapes` of all these meshes, curved shapes and instances. Those
    instances whose numbers are in `moving` are kept.

    These are all instances, if they have no more than `most_copies` triangles together; instances of
    emitting meshes, because each triangle is a light; the only instance of a mesh; very skewed instances,
    because float32 is not precise enough in the mesh's coordinates; and those that overlap other shapes in a
    plane.
    """
    still = [shape for number, shape in enumerate(shapes) if number not in moving] if moving else shapes
    shared = _kept_instances(still, most_copies)
    meshes: list[Mesh] = []
    curved: list[CurvedShape] = []
    instances: list[Instance] = []
    numbers: tuple[list[int], list[int], list[int]] = [], [], []
    for number, shape in enumerate(shapes):
        if isinstance(shape, Instance):  # first, as there may be very many
            if id(shape) in shared or number in moving:
                instances.append(shape)
                numbers[2].append(number)
            else:
                meshes.append(shape.to_mesh())
                numbers[0].append(number)
        elif isinstance(shape, Mesh):
            meshes.append(shape)
            numbers[0].append(number)
        elif isinstance(shape, CurvedShape):
            curved.append(shape)
            numbers[1].append(number)
        else:
            raise SceneError(f"{shape.name}: cannot trace a {type(shape).__name__}")
    order = order_by_kind(curved, [number in moving for number in numbers[1]])
    positions = [*numbers[0], *(numbers[1][at] for at in order), *numbers[2]]
    return meshes, [curved[at] for at in order], instances, np.array(positions, np.intp)


def _kept_instances(shapes: Sequence[Shape], most_copies: int) -> set[int]:
    """Return the identities of the instances that share a mesh: see `sort_shapes`."""
    instances = of_class(shapes, Instance)
    groups = by_mesh(instances)
    if sum(len(group) * len(instances[group[0]].mesh.faces) for group in groups) <= most_copies:
        return set()
    kept = _shareable(instances)
    for group in groups:
        kept[group] &= len(group) > 1
    candidates = list(compress(instances, kept.tolist()))
    meshes = [instance.to_mesh() for instance in compress(instances, (~kept).tolist())]
    meshes += of_class(shapes, Mesh)
    return set(map(id, candidates)) - overlapping_instances(candidates, meshes)


def _shareable(instances: Sequence[Instance]) -> Bools:
    """Return a mask (n,) of the instances that emit no light and are not very skewed."""
    scales = np.linalg.svd(transforms_of(instances)[:, :3, :3], compute_uv=False)
    kinds, kind = kinds_of(instances)
    dark = np.array([shape.emission is None for shape in kinds], np.bool_)[kind]
    return (scales[:, 0] <= SKEW * scales[:, 2]) & dark


def own_frame(mesh: Mesh) -> Doubles:
    """Return the vertices (n, 3) of an instanced mesh as they are traced: relative to its box's center."""
    return mesh.vertices - mesh.bounds.mean(0)


def place_instances(
    instances: Sequence[Instance],
    shared: Sequence[Mesh],
    center: Doubles,
    triangles: int,
    curved: int,
    material: Ints | None,
) -> tuple[Placements, InstanceTable]:
    """Return the data of instances for tracing and for shading.

    Parameters
    ----------
    instances
        k of them.
    shared
        The distinct meshes of the instances. Their table rows follow one another, after those of
        triangles that are not instanced and before those of curved primitives.
    center
        (3,) of the scene.
    triangles, curved
        The numbers of those that are not instanced.
    material
        (k,) the material of each instance that replaces the mesh's, -1 for none.
    """
    numbers = {id(mesh): number for number, mesh in enumerate(shared)}
    mesh_of = np.array([numbers[id(instance.mesh)] for instance in instances], np.intp)
    sizes = np.array([len(mesh.faces) for mesh in shared])
    rows = triangles + np.cumsum(sizes) - sizes
    ends = triangles + curved + np.cumsum(sizes.take(mesh_of))
    first = ends - sizes.take(mesh_of)
    boxes = instance_bounds(instances) - center
    middles = np.stack([mesh.bounds.mean(0) for mesh in shared]).take(mesh_of, 0)
    halves = np.stack([np.ptp(mesh.bounds, axis=0) / 2 for mesh in shared]).take(mesh_of, 0)
    matrices = transforms_of(instances)
    linear, shift = matrices[:, :3, :3], matrices[:, :3, 3].copy()
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
    # of a scene's unit vector in mesh coordinates: its greatest length
    longest = np.linalg.norm(inverse, 2, (1, 2))
    table = InstanceTable(
        first=np.concatenate([[0, triangles], first]),
        shift=np.concatenate([[0, -int(sizes.sum())], first - rows.take(mesh_of)]),
        linear=_after_identities(linear),
        normal=_after_identities(inverse.transpose(0, 2, 1) / longest[:, None, None]),
        radius=np.concatenate([[0, 0], np.linalg.norm(halves, axis=1) / longest]).astype(f4),
        material=None if material is None else np.concatenate([[-1, -1], material]),
    )
    return placements, table


def _after_identities(matrices: Doubles) -> Floats:
    """Return two identity matrices and then matrices (k, 3, 3), as (9, k + 2)."""
    return np.concatenate([[np.eye(3)] * 2, matrices]).reshape(-1, 9).T.astype(f4, order="C")

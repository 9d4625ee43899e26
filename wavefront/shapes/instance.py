"""Meshes placed by a matrix."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from itertools import compress, repeat
from operator import attrgetter, is_
from os import PathLike
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import FLOAT32_MAX, Bools, Doubles, Ints
from ..core.errors import SceneError, finite_array, in_brief, number
from ..core.memory import unwatched
from ..core.suggestions import suggests_keywords
from ..materials import Material, MaterialLike, as_material
from ..motion import Motion, Together, product
from ..textures.base import BaseTexture
from .base import Checked, Shape
from .mesh import Mesh, check_range
from .transform import Matrix, affine, moved, moved_tangents

SINGULAR = 1e-12  # least scale of a transform along an axis, relative to the greatest
USUAL = 5  # attributes of an instance: name, material, mesh, transform and motion
MOST_PLACED = 1 << 16  # vertices that are transformed at once
MOST_HULL = 1 << 22  # vertices of all instances of a mesh; above, its box stands for it where it is framed
CERTAINLY_REGULAR = 1e-6  # above this value, a cheap bound of that ratio is sufficient


def _invertible(name: str, value: ArrayLike) -> Doubles:
    """Return a (4, 4) affine matrix that can be inverted."""
    matrix = affine(name, value)
    stretch = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not stretch[2] > SINGULAR * stretch[0]:
        raise SceneError(
            f"{name} is singular: it stretches by {stretch[2]:.3g} along one axis and {stretch[0]:.3g} "
            f"along another; their ratio must be above {SINGULAR:g}"
        )
    return matrix


class Placing(Checked):
    """The transform of an instance: a motion that is assigned is kept beside the matrix of its start."""

    def __set__(self, instance: Any, value: Any) -> None:
        """Store the matrix, and the motion, if it is one."""
        motion = value if isinstance(value, Motion) else None
        super().__set__(instance, value if motion is None else motion.at(motion.start))
        if motion is not None or instance.motion is not None:
            instance.motion = motion


def _check_mesh(name: str | None, mesh: Any) -> None:
    """Raise a SceneError if what is to be placed is not a mesh; it says how to get one."""
    if isinstance(mesh, Mesh):
        return
    hint = ""
    if isinstance(mesh, list | tuple | Shape):
        hint = "; wf.Group(...).placed(matrices) places shapes of all kinds"
    elif isinstance(mesh, str | PathLike):
        hint = "; write wf.load_mesh(path)"
    elif hasattr(mesh, "vertices"):
        hint = "; write wf.from_trimesh(mesh).shapes[0]"
    raise SceneError(f"{name or 'instance'}: mesh must be a wf.Mesh, got {in_brief(mesh)}{hint}")


class Instance(Shape):
    """A mesh placed by an affine transform: moved, rotated, scaled, mirrored or sheared.

    For many instances of one mesh, its arrays are stored once and its tree is built once. A `Group` places
    several shapes together, also curved ones.

    Parameters
    ----------
    mesh
        The mesh; instances of one mesh share the object.
    transform
        (4, 4) affine matrix from the mesh's coordinates to the scene's, for column vectors: the translation
        is its last column. It must be invertible. A reflection keeps the front side. Or a `Motion`, such as
        `Keyframes`: the attribute is then its matrix at its start, and `motion` is the motion.
    material
        The `Material` or `Bsdf` of this instance; by default the material of the mesh.
    name
        Used in messages; by default that of the mesh.

    Raises
    ------
    SceneError
        If the transform is malformed, singular, or takes a vertex beyond the range of float32.

    Examples
    --------
    >>> leaf = wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> moved = np.eye(4)
    >>> moved[:3, 3] = (2, 0, 0)
    >>> scene = wf.Scene([wf.Instance(leaf, np.eye(4)), wf.Instance(leaf, moved)])
    """

    transform = Placing(_invertible)

    @suggests_keywords
    def __init__(
        self,
        mesh: Mesh,
        transform: ArrayLike | Motion,
        *,
        material: MaterialLike | None = None,
        name: str | None = None,
    ) -> None:
        _check_mesh(name, mesh)
        self.name = mesh.name if name is None else name
        self.mesh = mesh
        self.transform = transform
        self.material = material
        check_range(self.name, _placed(self.transform, mesh.vertices).T)

    @classmethod
    @suggests_keywords
    def many(
        cls,
        mesh: Mesh,
        transforms: ArrayLike | Sequence[Motion],
        *,
        material: MaterialLike | None = None,
        name: str | None = None,
    ) -> list[Instance]:
        """Return many instances of one mesh, much faster than by single calls.

        Parameters
        ----------
        mesh, material, name
            As for `Instance`.
        transforms
            (n, 4, 4) the matrices, as `transform` of `Instance`; or n motions.

        Raises
        ------
        SceneError
            As for `Instance`. The message names the first invalid transform.
        """
        _check_mesh(name, mesh)
        label = mesh.name if name is None else name
        motions = motions_of(transforms)
        starts: Any = transforms if motions is None else Together(motions).at_starts()
        matrices = finite_array(f"{label}: transforms", starts, (None, 4, 4))
        bad = np.flatnonzero(~can_place(mesh, matrices))
        if bad.size:
            cls(mesh, matrices[bad[0]], name=f"{label}: transforms[{bad[0]}]")  # raises
        shared = None if material is None else as_material(f"{label}: material", material)
        instance = cls.__new__(cls)
        instance.name = label
        vars(instance).update(mesh=mesh, _material=shared)
        out = placed_together([instance] * len(matrices), matrices, {})  # which have been checked
        for placed, motion in zip(out, motions or (), strict=False):
            placed.motion = motion
        return out

    def __repr__(self) -> str:
        """Return the name and the position of the mesh's origin."""
        return f"<Instance {self.name!r} of {self.mesh!r}: at {self.transform[:3, 3].tolist()}>"

    @property
    def default_material(self) -> Material:
        """The mesh's material."""
        return self.mesh.material

    @property
    def emission(self) -> BaseTexture | NDArray[np.float32] | None:
        """Radiance that leaves the surface, as of the mesh with the instance's material."""
        return self.mesh.emission_by(self.material)

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3), of the placed vertices that faces use."""
        return instance_bounds([self])[0]

    def to_mesh(self) -> Mesh:
        """Return a mesh with the transformed vertices of the instance."""
        mesh = copy(self.mesh)
        mesh.name, mesh.material = self.name, self.material
        mesh.vertices, mesh.faces, mesh.normals = moved(
            self.transform, mesh.vertices, mesh.faces, mesh.normals
        )
        mesh.tangents = moved_tangents(self.transform, mesh.tangents)
        return mesh

    @property
    def moves(self) -> bool:
        """Whether it moves, or its mesh deforms."""
        return self.motion is not None or self.mesh.moves

    @property
    def keys(self) -> Doubles:
        """Seconds (k,) at which it, or its mesh, may go another way."""
        return np.concatenate([super().keys, self.mesh.keys])

    @property
    def time_span(self) -> tuple[float, float]:
        """When it begins and ends to move or its mesh to deform, seconds, as of every shape."""
        (start, end), (first, last) = super().time_span, self.mesh.time_span
        return min(start, first), max(end, last)

    def at(self, time: float) -> Self:
        """Return the instance at a time, seconds; one that is still returns itself."""
        if not self.moves:
            return self
        matrix = self.transform if self.motion is None else self.motion.at(number("time", time))
        return self.placed_as(self.mesh.at(time), matrix)

    def placed_as(self, mesh: Mesh, matrix: Matrix) -> Self:
        """Return a still copy of another mesh, by a matrix (4, 4) that is known to be good."""
        return placed_together([self], [matrix], {id(self.mesh): mesh})[0]

    def _transformed(self, matrix: ArrayLike) -> Self:
        placing = _invertible(f"{self.name}: transform matrix", matrix)
        instance = copy(self)
        instance.transform = placing @ self.transform
        check_range(self.name, _placed(instance.transform, self.mesh.vertices).T)
        return instance

    def _carried(self, placing: Motion | Doubles) -> Self:
        instance = copy(self)
        placement = self.transform if self.motion is None else self.motion
        instance.transform = product(placing, placement)
        return instance

    def with_mesh(self, factor: float, mesh: Mesh, mesh_factor: float) -> Instance:
        """Return the instance with all lengths multiplied by `factor`, and the same material.

        Parameters
        ----------
        factor
            Factor of the lengths in the scene.
        mesh, mesh_factor
            The mesh of the new instance: its mesh, with lengths multiplied by `mesh_factor`.
        """
        instance = copy(self)
        instance.mesh, instance.transform = mesh, self.transform.copy()
        instance.transform[:3, :3] *= factor / mesh_factor
        instance.transform[:3, 3] *= factor
        return instance


I = TypeVar("I", bound=Instance)
S = TypeVar("S", bound=Shape)


def placed_together(
    instances: Sequence[I], matrices: Matrix | Sequence[Matrix], forms: Mapping[int, Mesh]
) -> list[I]:
    """Return still copies of instances.

    Parameters
    ----------
    instances
        n of them.
    matrices
        (n, 4, 4), which are not checked.
    forms
        By the ids of their meshes, others in their place.
    """
    with unwatched():
        # loops over calls would take twice as long
        out: list[I] = list(map(object.__new__, map(type, instances)))
        for values, source, matrix in zip(map(vars, out), map(vars, instances), matrices, strict=True):
            values["name"], values["_material"] = source["name"], source.get("_material")
            values["mesh"], values["transform"] = source["mesh"], matrix
            if len(source) > USUAL:
                values |= {name: value for name, value in source.items() if name not in {*values, "motion"}}
        if forms:
            for values in map(vars, out):
                values["mesh"] = forms.get(id(values["mesh"]), values["mesh"])
    return out


def motions_of(transforms: Any) -> list[Motion] | None:
    """Return a list of motions, None for anything else, such as matrices."""
    if isinstance(transforms, list | tuple) and transforms:
        motions = [transform for transform in transforms if isinstance(transform, Motion)]
        return motions if len(motions) == len(transforms) else None
    return None


def can_place(mesh: Mesh, transforms: Doubles) -> Bools:
    """Return a mask (n,) of the finite transforms (n, 4, 4) that are valid for an `Instance` of the mesh."""
    good = (transforms[:, 3] == (0, 0, 0, 1)).all(1)
    linear = transforms[:, :3, :3]
    # The ratio of the least scale to the greatest is at least |det| / (sum of all squares)^1.5, which is
    # cheap. Only where this bound does not decide, the scales are computed. Normalized against overflow.
    largest = np.abs(linear).max((1, 2))
    unit = linear / np.where(largest > 0, largest, 1)[:, None, None]
    least = np.abs(np.linalg.det(unit)) / np.maximum((unit**2).sum((1, 2)), 1) ** 1.5
    undecided = np.flatnonzero(good & (least < CERTAINLY_REGULAR))
    stretch = np.linalg.svd(linear[undecided], compute_uv=False)
    good[undecided] = stretch[:, 2] > SINGULAR * stretch[:, 0]
    # the same for the range: first a bound, then the vertices themselves
    reach = np.abs(mesh.vertices).max(0)
    with np.errstate(over="ignore", invalid="ignore"):
        bound = (np.abs(linear) * reach).sum(2) + np.abs(transforms[:, :3, 3])
    for i in np.flatnonzero(good & ~(bound.max(1) <= FLOAT32_MAX / 2)).tolist():
        good[i] = (np.abs(_placed(transforms[i], mesh.vertices)) <= FLOAT32_MAX).all()
    return good


def transforms_of(instances: Sequence[Instance]) -> Doubles:
    """Return the matrices (n, 4, 4) of instances."""
    if not instances:
        return np.zeros((0, 4, 4))
    return np.concatenate(list(map(attrgetter("transform"), instances))).reshape(-1, 4, 4)


def by_mesh(instances: Sequence[Instance]) -> list[Ints]:
    """Return the numbers of the instances of each distinct mesh."""
    if not instances:
        return []
    ids = np.fromiter(map(id, map(attrgetter("mesh"), instances)), np.uint64, len(instances))
    order = np.argsort(ids, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(ids.take(order))) + 1)


def kinds_of(shapes: Sequence[S]) -> tuple[list[S], Ints]:
    """Return shapes, of all instances of one mesh with one material the first, and the number of each there.

    All that follows from mesh and material is the same for those.
    """
    count = len(shapes)
    one, other = np.fromiter(map(id, shapes), np.int64, count), np.zeros(count, np.int64)
    # one of a class of its own may differ
    placed = np.fromiter(map(is_, map(type, shapes), repeat(Instance)), np.bool_, count)
    instances: list[Any] = list(compress(shapes, placed.tolist()))
    for ids, name in ((one, "mesh"), (other, "_material")):
        ids[placed] = np.fromiter(map(id, map(attrgetter(name), instances)), np.int64, len(instances))
    (_, first), (_, second) = (np.unique(ids, return_inverse=True) for ids in (one, other))
    _, at, kind = np.unique(first * count + second, return_index=True, return_inverse=True)
    order = np.argsort(at)
    number = np.empty_like(order)
    number[order] = np.arange(order.size)
    return [shapes[first] for first in at.take(order).tolist()], number[kind]


def of_class(shapes: Iterable[Shape], kind: type[S]) -> list[S]:
    """Return the shapes of a class and its subclasses; `isinstance` for each would take ten times as long."""
    listed: Any = list(shapes)
    chosen = {each for each in set(map(type, listed)) if issubclass(each, kind)}
    return list(compress(listed, map(chosen.__contains__, map(type, listed))))


def unshaded(shape: Shape) -> Shape:
    """Return a shape that is at the same places at all times, but need not have normals there."""
    if isinstance(shape, Mesh):
        return shape.unshaded()
    if isinstance(shape, Instance) and shape.mesh.unshaded() is not shape.mesh:
        shape = copy(shape)
        shape.mesh = shape.mesh.unshaded()
    return shape


def instance_bounds(instances: Sequence[Instance]) -> Doubles:
    """Return the `bounds` of instances, (n, 2, 3); instances of one mesh are computed together."""
    out, matrices = np.empty((len(instances), 2, 3)), transforms_of(instances)
    for members in by_mesh(instances):
        mesh = instances[members[0]].mesh
        used = np.flatnonzero(np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices)))
        vertices = mesh.vertices.take(used, 0).T
        step = max(1, MOST_PLACED // used.size)
        for begin in range(0, len(members), step):
            batch = members[begin : begin + step]
            transforms = matrices.take(batch, 0)
            with np.errstate(over="ignore", invalid="ignore"):
                placed = transforms[:, :3, :3] @ vertices + transforms[:, :3, 3:]
            out[batch, 0], out[batch, 1] = placed.min(2), placed.max(2)
    return out


def instance_hulls(instances: Sequence[Instance]) -> list[Doubles]:
    """Return points (n, 3) whose convex hull holds the instances, of each mesh apart."""
    groups: dict[int, list[Instance]] = {}
    for instance in instances:
        groups.setdefault(id(instance.mesh), []).append(instance)
    out = []
    for members in groups.values():
        mesh = members[0].mesh
        points = (mesh.hull() if len(members) * len(mesh.vertices) <= MOST_HULL else Shape.hull(mesh))[0]
        rows = np.stack([instance.transform[:3] for instance in members])[..., None]
        x, y, z = points.T
        placed = rows[:, :, 0] * x + rows[:, :, 1] * y + rows[:, :, 2] * z + rows[:, :, 3]
        out.append(placed.transpose(0, 2, 1).reshape(-1, 3))
    return out


def _placed(transform: Doubles, vertices: Doubles) -> Doubles:
    """Return the transformed vertices (3, n) of vertices (n, 3)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return transform[:3, :3] @ vertices.T + transform[:3, 3:]

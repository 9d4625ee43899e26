"""The placements of a file's meshes: a mesh that is placed several times is built once."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arrays.vec import Bools, Ints, cross, dot, spans
from ...core.errors import LimitError, SceneError
from ...materials import Material
from ...motion import Motion
from ...shapes import Instance, Mesh
from ...shapes.instance import can_place
from ...shapes.transform import Matrix, moved, moved_tangents
from ..losses import Losses
from ..repair import AT_ONCE, RawMesh, build

MAX_ELEMENT = 1e100  # of a matrix: the squares of larger elements overflow
ALMOST_FLAT = 1e-9  # determinant, relative to the largest element, of matrices that are no instances
MAX_COPIES = 2**14  # meshes that cannot be instances, because their matrices are singular
MAX_COPIED_FACES = 2**25  # triangles in copies of meshes, where each placement becomes a mesh


@dataclass
class Places:
    """Placements of meshes, in the order of the scene's shapes."""

    raw: Ints = field(default_factory=lambda: np.zeros(0, np.intp))  # (n,) index of the mesh
    matrix: Matrix = field(default_factory=lambda: np.zeros((0, 4, 4)))  # (n, 4, 4) to the scene
    # (n,) of the placed shapes, "" for that of the mesh; None for all of these
    names: list[str] | None = None
    materials: list[Material | None] | None = None  # the same, in place of those of the meshes
    motions: list[Motion | None] | None = None  # of those that move; the matrices are of the start

    @classmethod
    def once(cls, count: int) -> Places:
        """Return the placements of meshes that are placed once each, without a transform."""
        return cls(np.arange(count), np.tile(np.eye(4), (count, 1, 1)))

    def scale(self, factor: float) -> None:
        """Multiply all lengths of the scene, as where a file has another unit than meters."""
        with np.errstate(all="ignore"):  # a matrix that is not finite is refused where it is used
            self.matrix = np.diag([factor] * 3 + [1.0]) @ self.matrix


def meters(losses: Losses, name: str, unit: Any, usual: float) -> float:
    """Return the unit of a file in meters; `usual` where it has none, or one that is not valid."""
    if unit is None:
        return usual
    value = float(unit)
    if not 0 < value <= MAX_ELEMENT:
        losses.note(name, value=f"{value:g} meters", done=f"{usual:g} in its place")
        return usual
    return value


def place_shapes(name: str, raws: list[RawMesh], places: Places, losses: Losses) -> list[Mesh | Instance]:
    """Build meshes, and an instance for each placement of a mesh with several.

    Parameters
    ----------
    name
        File name, for messages.
    raws
        The distinct meshes.
    places
        Their placements.
    losses
        As for `build`.

    Raises
    ------
    SceneError
        As from `build`, or if too many meshes would have to be copied.
    """
    _check_range(name, raws, places)
    shapes: list[Mesh | Instance | None] = [None] * len(places.raw)
    copies = 0
    motions: list[Motion | None] = places.motions or [None] * len(places.raw)
    for raw, at in _by_mesh(raws, places):
        matrices = places.matrix[at]
        if len(at) == 1 and motions[at[0]] is None and raw.deformation is None:
            shapes[at[0]] = build(name, moved_raw(raw, matrices[0]), losses)
            continue
        mesh = build(name, raw, losses)
        if mesh is None:
            continue
        if len(at) == 1 and motions[at[0]] is None:
            shapes[at[0]] = mesh.transformed(matrices[0])
            continue
        moving = np.array([motions[i] is not None for i in at.tolist()])
        matrices[moving] = invertible(matrices[moving])
        fit = can_place(mesh, matrices)
        instances = Instance.many(mesh, matrices[fit])
        for i, instance in zip(at[fit].tolist(), instances, strict=True):
            shapes[i] = instance
            if motions[i] is not None:
                instance.motion = motions[i]
        copies += len(at) - len(instances)
        if copies > MAX_COPIES:
            raise LimitError(
                f"{name}: {raw.name!r} brings the meshes whose matrices are singular to {copies}; "
                f"the limit is {MAX_COPIES}"
            )
        for i in at[~fit].tolist():
            shapes[i] = build(name, moved_raw(raw, places.matrix[i]), losses)
    for shape, shape_name in zip(shapes, places.names or (), strict=False):
        if shape is not None and shape_name:
            shape.name = shape_name
    for shape, made_of in zip(shapes, places.materials or (), strict=False):
        if shape is not None and made_of is not None:
            shape.material = made_of
    return [shape for shape in shapes if shape is not None]


def invertible(matrices: Matrix) -> Matrix:
    """Return matrices (n, 4, 4) of the starts of motions; those that flatten then scale by almost 0."""
    linear = matrices[:, :3, :3]
    flat = np.abs(np.linalg.det(linear)) <= ALMOST_FLAT * np.abs(linear).max((1, 2)) ** 3
    out = matrices.copy()
    out[flat, :3, :3] = ALMOST_FLAT * np.eye(3)
    return out


def place_meshes(name: str, raws: list[RawMesh], places: Places, losses: Losses) -> list[Mesh]:
    """Build a mesh for each placement; arguments and errors as of `place_shapes`."""
    _check_range(name, raws, places)
    sizes = np.array([len(raw.faces) for raw in raws], np.int64)
    total = int(sizes.take(places.raw).sum())
    if total > sizes.sum() + MAX_COPIED_FACES:
        raise LimitError(
            f"{name}: its {len(places.raw)} instances have {total} triangles together, "
            f"its meshes {sizes.sum()}; as meshes of their own, at most {MAX_COPIED_FACES} are copied"
        )
    parts = zip(places.raw.tolist(), places.matrix, strict=True)
    built = (build(name, moved_raw(raws[number], matrix), losses) for number, matrix in parts)
    return [mesh for mesh in built if mesh is not None]


def moved_raw(raw: RawMesh, matrix: Matrix) -> RawMesh:
    """Return a mesh moved by a (4, 4) matrix."""
    with np.errstate(all="ignore"):  # values that are not finite are noted where the mesh is built
        vertices, faces, normals = moved(matrix, raw.vertices, raw.faces, raw.normals)
        tangents = moved_tangents(matrix, raw.tangents)
    return replace(raw, vertices=vertices, faces=faces, normals=normals, tangents=tangents)


def facing(raw: RawMesh, reverse: bool) -> RawMesh:
    """Return a mesh whose faces have their fronts where its normals are; `reverse` is ReverseOrientation.

    Faces of vertices that do not exist turn anyhow; `build` leaves them out.
    """
    faces, normals = raw.faces, raw.normals
    if normals is not None:
        ahead = np.empty(len(faces), np.bool_)
        for block in spans(len(faces), AT_ONCE):
            corners = (raw.vertices.take(column, 0, mode="clip") for column in faces[block].T)
            a, b, c = (np.ascontiguousarray(corner.T) for corner in corners)
            mean = normals.take(faces[block], 0, mode="clip").sum(1).T
            ahead[block] = dot(cross(b - a, c - a), mean) >= 0
        if not ahead.all():
            faces = np.where(ahead[:, None], faces, faces[:, ::-1])
    if reverse:
        faces, normals = faces[:, ::-1], None if normals is None else -normals
    return replace(raw, faces=faces, normals=normals)


def in_range(matrices: Matrix) -> Bools:
    """Return a mask (n,) of the matrices (n, 4, 4) whose elements are all in the supported range."""
    return np.asarray((np.abs(matrices) <= MAX_ELEMENT).all((1, 2)))


def _check_range(name: str, raws: list[RawMesh], places: Places) -> None:
    bad = np.flatnonzero(~in_range(places.matrix))
    if bad.size:
        element = np.abs(places.matrix[bad[0]]).max()
        raise SceneError(
            f"{name}: {raws[places.raw[bad[0]]].name!r} is placed by a matrix with an element of size "
            f"{element:g}; it must be at most {MAX_ELEMENT:g}"
        )


def _by_mesh(raws: list[RawMesh], places: Places) -> list[tuple[RawMesh, Ints]]:
    """Return each mesh that is placed, with the numbers of its placements in rising order."""
    order = np.argsort(places.raw, kind="stable")
    numbers, begins = np.unique(places.raw[order], return_index=True)
    return list(zip((raws[i] for i in numbers), np.split(order, begins)[1:], strict=True))

"""The models of BOP's layout: a file of each mesh, and the sizes of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, f4
from ..colors import linear_to_srgb
from ..core.errors import warn_caller
from ..core.files import make_folder, write_bytes, write_json
from ..shapes import Instance, Mesh, Shape
from .annotated import AnnotatedObject

FOLDER = "models"
MOST_LISTED = 200  # letters of names in a warning
BLOCK = 64  # points that are compared with others at once, or a thousandth of all
AXES = "xyz"


def write_models(
    folder: Path, shapes: Sequence[Shape], objects: Mapping[int, AnnotatedObject], millimeters: float
) -> None:
    """Write `models/obj_000001.ply` and so on, and `models/models_info.json`.

    Models of shapes that are no meshes, such as spheres, are left out.

    Parameters
    ----------
    folder
        Of the data set.
    shapes
        Those of the scene.
    objects
        The shapes that are annotated, by their numbers.
    millimeters
        Of a scene unit.
    """
    _warn_of_objects(shapes, objects)
    meshes = {obj.model: _model(shapes[number], obj) for number, obj in objects.items()}
    make_folder(folder / FOLDER)
    sizes = {}
    for number, mesh in sorted(meshes.items()):
        if mesh is not None:
            points = mesh.vertices[np.unique(mesh.faces)] * millimeters
            write_bytes(folder / FOLDER / f"obj_{number:06d}.ply", _ply(mesh, millimeters))
            sizes[str(number)] = _size(points)
    write_json(folder / FOLDER / "models_info.json", sizes)


def _warn_of_objects(shapes: Sequence[Shape], objects: Mapping[int, AnnotatedObject]) -> None:
    """Warn of objects that are no meshes, and so have no model, and of instances without a pose."""
    kinds = {obj.name: type(shapes[number]).__name__ for number, obj in objects.items()}
    bare = [name for number, name in _names(objects) if not isinstance(shapes[number], Instance | Mesh)]
    still = [
        name
        for number, name in _names(objects)
        if isinstance(shapes[number], Instance) and not objects[number].of_mesh
    ]
    if bare:
        listed = ", ".join(f"{name!r} ({kinds[name]})" for name in dict.fromkeys(bare))
        warn_caller(f"objects without a model, as they are no meshes: {listed[:MOST_LISTED]}")
    if still:
        listed = ", ".join(map(repr, dict.fromkeys(still)))
        warn_caller(
            f"objects without a pose, as they are scaled or mirrored: {listed[:MOST_LISTED]}; their models "
            "are in world coordinates"
        )


def _names(objects: Mapping[int, AnnotatedObject]) -> list[tuple[int, str]]:
    return [(number, obj.name) for number, obj in objects.items()]


def _model(shape: Shape, obj: AnnotatedObject) -> Mesh | None:
    """Return the mesh of a model in its own coordinates; None if it is no mesh."""
    if isinstance(shape, Instance):
        return shape.mesh if obj.of_mesh else shape.to_mesh()
    return shape if isinstance(shape, Mesh) else None


def _ply(mesh: Mesh, millimeters: float) -> bytes:
    """Return a mesh as a binary ply file, with its vertex normals and colors if it has any."""
    import trimesh

    model = trimesh.Trimesh(
        mesh.vertices * millimeters,
        mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=None if mesh.colors is None else _codes(mesh.colors),
        process=False,
    )
    data: bytes = trimesh.exchange.ply.export_ply(model, vertex_normal=mesh.normals is not None)
    return data


def _codes(colors: Doubles) -> NDArray[np.uint8]:
    """Return linear colors (n, 4) as codes: sRGB, and opacity."""
    values = np.column_stack([linear_to_srgb(colors[:, :3].astype(f4)), colors[:, 3]])
    return np.rint(values * 255).astype(np.uint8)


def _size(points: Doubles) -> dict[str, Any]:
    """Return the box of points (n, 3), and the largest distance of two of them."""
    low, size = points.min(0), np.ptp(points, 0)
    return {
        "diameter": diameter(points),
        **{f"min_{axis}": float(value) for axis, value in zip(AXES, low, strict=True)},
        **{f"size_{axis}": float(value) for axis, value in zip(AXES, size, strict=True)},
    }


def diameter(points: Doubles) -> float:
    """Return the largest distance between two of some points (n, 3).

    Blocks of points that cannot be farther apart than two points that have been found are not compared.
    """
    points = points - (points.min(0) + points.max(0)) / 2  # for the precision of the squares below
    blocks = _blocks(points, max(BLOCK, len(points) // 1000))
    center = np.stack([(block.min(0) + block.max(0)) / 2 for block in blocks])
    radius = np.array(
        [np.linalg.norm(block - c, axis=1).max() for block, c in zip(blocks, center, strict=True)]
    )
    most = np.linalg.norm(center[:, None] - center, axis=2) + radius[:, None] + radius
    largest = 0.0
    for pair in np.argsort(-most, axis=None).tolist():
        first, second = divmod(pair, len(blocks))
        if most[first, second] <= largest:
            break
        if first <= second:
            a, b = blocks[first], blocks[second]
            squares = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * (a @ b.T)
            largest = max(largest, float(squares.max()) ** 0.5)
    return largest


def _blocks(points: Doubles, size: int) -> list[Doubles]:
    """Return points (n, 3) divided into blocks of neighbors, each of at most a number of points."""
    if len(points) <= size:
        return [points]
    middle = len(points) // 2
    order = np.argpartition(points[:, np.ptp(points, 0).argmax()], middle)
    return _blocks(points[order[:middle]], size) + _blocks(points[order[middle:]], size)

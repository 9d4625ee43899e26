"""Joining several meshes to one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..core.errors import SceneError, finite_array
from ..materials import MaterialLike, as_material
from ..shapes import Mesh
from .description.placing import moved_raw
from .losses import Losses
from .repair import RawMesh, build

COLUMNS = ("vertices", "normals", "uvs", "uvs1", "tangents", "colors")


def join(
    meshes: list[Mesh],
    name: str,
    material: MaterialLike | None = None,
    transform: ArrayLike | None = None,
) -> Mesh:
    """Return one mesh with the triangles of all meshes.

    Where only some of them have normals, the others get those of their facets. Other values per vertex
    that only some meshes have are left out; the render warns if a material reads them.

    Raises
    ------
    SceneError
        If there are several materials and `material` is not given.
    """
    if material is None and len({id(mesh.material) for mesh in meshes}) > 1:
        raise SceneError(f"{name}: has {len(meshes)} materials; pass one, or use wf.load")
    matrix = np.eye(4) if transform is None else finite_array("transform", transform, (4, 4))
    if np.linalg.det(matrix) == 0:
        raise SceneError("transform is singular; it must be invertible")
    if any(mesh.normals is not None for mesh in meshes):
        for faceted in meshes:
            faceted.keep_facets()
    raw = moved_raw(stacked(name, meshes), matrix)
    raw.material = meshes[0].material if material is None else as_material("material", material)
    if material is None:
        glow = meshes[0].emission
        raw.emission = glow[:, 0] if isinstance(glow, np.ndarray) else glow
        raw.two_sided = meshes[0].two_sided
    with Losses(name) as losses:
        mesh = build(name, raw, losses)
    if mesh is None:
        raise SceneError(f"{name}: transform leaves no face with an area")
    return mesh


def stacked(name: str, meshes: Sequence[Mesh | RawMesh]) -> RawMesh:
    """Return one mesh with the triangles of all, and the values per vertex that all of them have."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)])
    columns = {column: _joined([getattr(mesh, column) for mesh in meshes]) for column in COLUMNS}
    return RawMesh(name, faces=faces, **columns)  # type: ignore[arg-type]


def _joined(columns: list[Doubles | None]) -> Doubles | None:
    """Return the columns of several meshes as one; None if a mesh lacks it."""
    arrays = [array for array in columns if array is not None]
    return np.concatenate(arrays) if len(arrays) == len(columns) else None

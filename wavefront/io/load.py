"""Scenes and meshes from files, and from trimesh objects."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from ..errors import SceneError
from ..materials import MaterialLike
from ..progress import Progress, phase
from ..scene import Scene
from ..shapes import Instance, Mesh, Shape
from . import trimesh_objects, trimesh_view
from .joining import join
from .placing import MAX_INSTANCES, place_meshes, place_shapes
from .readers import PathLike, Wish, read

T = TypeVar("T")


def load(
    path: PathLike,
    *,
    strict: bool = False,
    progress: Progress = None,
    max_instances: int = MAX_INSTANCES,
) -> Scene:
    """Read a scene: .obj (with its .mtl), .ply, .stl, .glb, .gltf, .off, .dae, .3mf.

    The last two need the packages of the extra `formats`: `pip install pycollada lxml networkx`.

    A mesh that several nodes of a glTF file have is read once, and becomes an `Instance` for each.

    Parameters
    ----------
    path
        The file. Files that it refers to are read only from its own folder.
    strict
        Refuse what would otherwise be repaired or left out with a warning.
    progress
        Where reading takes more than 2 s, True or None shows a line that says so; False shows nothing.
    max_instances
        How many meshes a glTF file may place; one of a few bytes may place millions.

    Raises
    ------
    SceneError
        Naming the file, the line or element, the value and the limit.
    """
    with _phase(path, progress):
        name, contents = os.fspath(path), read(path, Wish(strict, max_instances=max_instances))
        placed = place_shapes(name, contents.raws, contents.places, strict)
        return Scene(_some(name, [*placed, *contents.shapes]), contents.lights, contents.camera)


def load_mesh(
    path: PathLike,
    material: MaterialLike | None = None,
    transform: ArrayLike | None = None,
    *,
    strict: bool = False,
    progress: Progress = None,
) -> Mesh:
    """Read all geometry of a file as one mesh.

    Parameters
    ----------
    path
        As for `load`.
    material
        What the mesh is made of. Without it, the material and the emission of the file, which must
        then have only one.
    transform
        (4, 4) matrix applied to the vertices.
    strict, progress
        As for `load`.

    Raises
    ------
    SceneError
        As for `load`.
    """
    with _phase(path, progress):
        meshes = load_meshes(path, strict=strict, materials=material is None)
        return join(meshes, Path(path).stem, material, transform)


def load_meshes(path: PathLike, *, strict: bool = False, materials: bool = True) -> list[Mesh]:
    """Read the meshes of a file, one for each material and node; arguments as for `load`."""
    name, contents = os.fspath(path), read(path, Wish(strict, materials))
    placed = place_meshes(name, contents.raws, contents.places, strict)
    return _some(name, [*placed, *(_as_mesh(name, shape) for shape in contents.shapes)])


def _as_mesh(name: str, shape: Shape) -> Mesh:
    if isinstance(shape, Instance):
        return shape.to_mesh()
    if not isinstance(shape, Mesh):
        raise SceneError(f"{name}: {shape.name} is a {type(shape).__name__}, not a mesh; use wf.load")
    return shape


def _phase(path: PathLike, progress: Progress) -> AbstractContextManager[None]:
    return phase(f"loading {os.path.basename(os.fspath(path))}", progress)


def from_trimesh(geometry: Any) -> Scene:
    """Turn a `trimesh.Trimesh` or `trimesh.Scene` into a scene, as if it had been read from a file.

    Normals are used where the object holds them: given by its file, or computed because somebody
    asked for `vertex_normals`. Trimesh's own exporters follow the same rule. Geometry that stands in a
    scene's graph several times becomes an `Instance` for each.

    The camera and the lights of a trimesh scene are used if somebody set them. The camera's resolution is
    the size of the picture; a camera without a transform is placed to see all of the scene. Colors of lights
    are linear. The lights that trimesh makes up for its viewer do not count.

    What trimesh itself does not keep cannot count: of glTF it rounds base colors to 8 bits, and drops
    extensions, lights, tangents and the scale of normal maps; of MTL it keeps the image of `map_Kd`
    only. `load` reads all of these.

    Raises
    ------
    SceneError
        If it is something else, or has no faces.
    """
    source = "trimesh object"
    contents = trimesh_objects.read(geometry, source, strict=False)
    shapes = _some(source, place_shapes(source, contents.raws, contents.places, strict=False))
    scene = Scene(shapes, trimesh_view.lights(geometry))
    trimesh_view.add_camera(scene, geometry)
    return scene


def _some(name: str, shapes: list[T]) -> list[T]:
    if not shapes:
        raise SceneError(f"{name}: has no faces")
    return shapes

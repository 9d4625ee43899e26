"""What can be rendered, as a scene and the camera that sees it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from .camera import Camera
from .errors import SceneError
from .lights import Light
from .materials import Material, MaterialLike, as_material
from .progress import Progress
from .scene import Scene, importer, register_importer
from .shapes import Instance, Mesh, Shape

SIZE = (512, 512)  # pixels
CAN_BE_RENDERED = (
    "a wf.Scene, a path, a mesh of trimesh, PyVista or Open3D, (vertices, faces) as a tuple, a shape such as "
    "wf.Mesh, wf.Rectangle, wf.Disk or wf.Sphere, or a list of these"
)


def as_scene(subject: Any, material: MaterialLike | None = None, progress: Progress = None) -> Scene:
    """Return what `render` was given as a `Scene`.

    Parameters
    ----------
    subject
        As for `render`.
    material
        What bare meshes are made of; None leaves everything as it is.
    progress
        As for `load`.

    Raises
    ------
    SceneError
        If it is nothing that can be rendered, or the material is meant for what has one of its own.
    """
    if material is not None:
        material = as_material("material", material)
    if isinstance(subject, Scene):
        if material is not None:
            raise SceneError("material is for bare meshes; in a wf.Scene set those of its shapes")
        subject.check()
        return subject
    if isinstance(subject, Shape):
        return Scene([_made_of(subject, material)])
    if isinstance(subject, str | os.PathLike):
        from .io.load import load  # here, so that scenes in memory do not pay for readers

        return _all_made_of(load(subject, progress=progress), material)
    convert = importer(subject)
    if convert is not None:
        return _all_made_of(convert(subject), material)
    if _is_pair(subject):
        return Scene([Mesh(*subject, material=material)])
    if isinstance(subject, list | tuple) and subject:
        return _joined(subject, material, progress)
    what = "an empty list" if isinstance(subject, list | tuple) and not subject else type(subject).__name__
    raise SceneError(f"cannot render {what}: give {CAN_BE_RENDERED}")


def choose_camera(scene: Scene, camera: Camera | None, size: tuple[int, int] | None, up: Any) -> Camera:
    """Return the camera that sees a scene.

    Parameters
    ----------
    scene
        What is seen.
    camera
        In place of the scene's own. Without either the scene is framed.
    size
        (width, height) in pixels, in place of the camera's.
    up
        (3,) what is up in the scene: it turns the camera that frames it.
    """
    camera = camera or scene.camera
    if camera is None:
        return scene.framing_camera(size=size or SIZE, up=up)
    return camera if size is None else camera.resized(size)


def _is_pair(subject: Any) -> bool:
    """Return True for (vertices, faces)."""
    if not isinstance(subject, tuple) or len(subject) != 2:
        return False
    return all(isinstance(part, np.ndarray | list | tuple) for part in subject) and not any(
        isinstance(item, Shape) or importer(item) is not None for part in subject for item in part[:1]
    )


def _joined(subjects: Sequence[Any], material: Material | None, progress: Progress) -> Scene:
    """Return one scene of all; the camera is the first that there is."""
    lights = [item for item in subjects if isinstance(item, Light)]
    parts = [as_scene(item, material, progress) for item in subjects if not isinstance(item, Light)]
    cameras = [part.camera for part in parts if part.camera is not None]
    return Scene(
        [shape for part in parts for shape in part.shapes],
        [*lights, *(light for part in parts for light in part.lights)],
        cameras[0] if cameras else None,
    )


def _made_of(shape: Shape, material: Material | None) -> Shape:
    """Return a user's shape with a material; the user's own stays as it is."""
    if material is None:
        return shape
    mesh = shape.mesh if isinstance(shape, Instance) else shape
    if shape.has_material or mesh.has_material:
        raise SceneError(f"material is for bare meshes; {shape.name} has a material of its own")
    bare = copy(shape)
    bare.material = material
    return bare


def _all_made_of(scene: Scene, material: Material | None) -> Scene:
    """Give all shapes of a scene that was just read a material in place of their own."""
    for shape in scene.shapes if material is not None else ():
        bare = shape.mesh if isinstance(shape, Instance) else shape
        bare.material = material
    return scene


def _imported(geometry: Any) -> Scene:
    from .io.load import from_trimesh

    return from_trimesh(geometry)


def _from_pyvista(data: Any) -> Scene:
    from .io.foreign import from_pyvista

    return from_pyvista(data)


def _from_open3d(data: Any) -> Scene:
    from .io.foreign import from_open3d

    return from_open3d(data)


register_importer("trimesh", _imported)
register_importer("pyvista", _from_pyvista)
register_importer("open3d", _from_open3d)

"""Scenes and cameras of all that can be rendered."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np

from ..camera import Camera, ImageSize, field_of_view, image_size, register_framing
from ..core.errors import SceneError
from ..core.progress import Progress
from ..lights import Light
from ..materials import Material, MaterialLike, as_material
from ..scene.scene import AUTO, FRAMING_FOV, Scene, importer, register_importer
from ..shapes import Instance, Mesh, Shape
from ..shapes.scalars import Coloring, with_scalars

SIZE = (512, 512)  # pixels
CAN_BE_RENDERED = (
    "a wf.Scene, a path, a mesh of trimesh, PyVista or Open3D, (vertices, faces), a shape such as "
    "wf.Mesh, wf.Rectangle, wf.Disk or wf.Sphere, or a list of these"
)


def as_scene(
    subject: Any,
    material: MaterialLike | None = None,
    progress: Progress = None,
    smooth: bool | float | str = AUTO,
    within: tuple[int, ...] = (),
    reading: Mapping[str, Any] | None = None,
    coloring: Coloring | None = None,
) -> Scene:
    """Return a `Scene` of the first argument of `render`.

    Parameters
    ----------
    subject
        As for `render`.
    material
        The material of bare meshes; None leaves everything as it is.
    progress
        As for `load`.
    smooth
        As for `render`.
    within
        The lists, by their ids, in which it is.
    reading
        Further arguments of `load`, where it is a path.
    coloring
        The numbers that meshes and points show.

    Raises
    ------
    SceneError
        If it cannot be rendered, or is a list that contains itself; or if a material or `smooth` is given and
        the subject has its own.
    """
    if material is not None:
        material = as_material("material", material)
    if coloring is not None:
        if material is not None:
            raise SceneError("material and scalars are given, and both say what the surface looks like")
        return _with_scalars(subject, progress, smooth, within, reading, coloring)
    if isinstance(subject, Scene):
        if material is not None:
            raise SceneError("material is for bare meshes; in a wf.Scene set those of its shapes")
        if smooth != AUTO:
            raise SceneError("smooth is for bare meshes; for those of a wf.Scene use Mesh(..., smooth=...)")
        subject.check()
        return subject
    if isinstance(subject, Shape):
        return Scene([_made_of(subject, material, smooth)])
    if isinstance(subject, str | os.PathLike):
        from .load import load  # here, so that scenes in memory do not pay for readers

        return _all_made_of(load(subject, progress=progress, smooth=smooth, **(reading or {})), material)
    convert = importer(subject)
    if convert is not None:
        return _all_made_of(convert(subject, smooth), material)
    if _is_mesh(subject):
        return Scene([_mesh_of(subject, material, smooth)])
    if isinstance(subject, list | tuple) and subject:
        if id(subject) in within:
            raise SceneError("cannot render a list that contains itself")
        return _joined(subject, material, progress, smooth, (*within, id(subject)))
    what = "an empty list" if isinstance(subject, list | tuple) and not subject else type(subject).__name__
    raise SceneError(f"cannot render {what}: scene must be {CAN_BE_RENDERED}")


def _with_scalars(
    subject: Any,
    progress: Progress,
    smooth: bool | float | str,
    within: tuple[int, ...],
    reading: Mapping[str, Any] | None,
    coloring: Coloring,
) -> Scene:
    """Return a `Scene` whose shapes show numbers, of the first argument of `render`; see `as_scene`."""
    if importer(subject) is _from_pyvista:
        from .pyvista.objects import from_pyvista

        settings = {"scalars": coloring.scalars, "cmap": coloring.cmap, "clim": coloring.clim}
        return from_pyvista(subject, smooth=smooth, **settings)
    if coloring.scalars is None:
        raise SceneError("cmap and clim are for scalars; give scalars=..., numbers or the name of some")
    if isinstance(subject, list | tuple) and not _is_mesh(subject):
        raise SceneError("scalars are for one mesh or cloud, not for a list; give shapes with colors=, cmap=")
    known = {
        **getattr(subject, "face_attributes", {}),
        **getattr(subject, "vertex_attributes", {}),
    }
    if isinstance(coloring.scalars, str) and coloring.scalars in known:
        coloring = replace(coloring, scalars=known[coloring.scalars])
    if _is_mesh(subject):  # before vertices are split
        flat = with_scalars(_mesh_of(subject, None, AUTO), coloring)
        return as_scene(flat, None, progress, smooth, within, reading)
    has_normals = isinstance(subject, Shape | Scene)
    scene = as_scene(subject, None, progress, AUTO if has_normals else smooth, within, reading)
    if len(scene.shapes) != 1:
        raise SceneError(f"scalars are for one shape; there are {len(scene.shapes)}")
    shown = copy(scene)
    shown.shapes = [with_scalars(scene.shapes[0], coloring)]
    return shown


def choose_camera(
    scene: Scene,
    camera: Camera | None,
    size: ImageSize | None,
    up: Any = AUTO,
    view: Any = None,
    fov: float | None = None,
    turning: bool = False,
) -> tuple[Camera, bool]:
    """Return the camera that sees a scene, and whether it was made to frame it.

    Parameters
    ----------
    scene
        The scene that is seen.
    camera
        In place of the scene's own. Without either the scene is framed, and with a `view`.
    size
        (width, height) in pixels, in place of the camera's.
    up
        The up axis of the scene, as for `render`: it turns the camera that frames it.
    view, fov
        As for `render`.
    turning
        As of `Scene.framing_camera`.

    Raises
    ------
    SceneError
        If one of the last is meant for a camera that frames the scene, and there is another.
    """
    if camera is None and view is None:  # a camera that is given counts more than a view
        camera = scene.camera
        if camera is not None and fov is not None:
            raise SceneError(f"fov is {fov:g}; the scene has a camera of its own, or give a view to frame it")
    if camera is not None:
        return camera if size is None else camera.resized(size), False
    if size is None:
        size = SIZE if scene.camera is None else scene.camera.size
    view, fov = scene.chosen_view(up) if view is None else view, FRAMING_FOV if fov is None else fov
    return scene.framing_camera(fov, size, up=up, direction=view, turning=turning), True


COLORING = ("scalars", "cmap", "clim")  # settings


def coloring_of(values: Mapping[str, Any]) -> Coloring | None:
    """Return the coloring of the settings in `COLORING`; None where none is given."""
    settings = [values.get(name) for name in COLORING]
    return None if all(setting is None for setting in settings) else Coloring(*settings)


def framed(subject: Any, view: Any, fov: float | None, size: Any, up: Any) -> Camera:
    """Return the camera that `render` would choose; arguments as for `render`."""
    size = None if size is None else image_size(size)
    fov = None if fov is None else field_of_view(fov)
    return choose_camera(as_scene(subject), None, size, up, view, fov)[0]


def _is_mesh(subject: Any) -> bool:
    """Return True for (vertices, faces) or (vertices, faces, normals), as a tuple or a list."""
    if not isinstance(subject, tuple | list) or len(subject) not in (2, 3):
        return False
    whole = isinstance(subject, tuple)  # also where one of them is empty, which the mesh says
    return all(_is_table(element) or (whole and element == []) for element in subject)


def _is_table(element: Any) -> bool:
    """Return True for an array, or a list of rows of numbers."""
    if isinstance(element, np.ndarray):
        return True
    row = element[0] if isinstance(element, list | tuple) and element else None
    if isinstance(row, np.ndarray):
        return row.ndim == 1
    return isinstance(row, list | tuple) and all(isinstance(cell, Real) for cell in row)


def _mesh_of(parts: Sequence[Any], material: Material | None, smooth: bool | float | str) -> Mesh:
    """Return the mesh of vertices, faces and perhaps normals, in whose place `smooth` computes some."""
    vertices, faces = parts[:2]
    flat = np.asarray(faces)
    if flat.ndim == 1 and flat.size and flat.size % 4 == 0 and (flat[::4] == 3).all():
        faces = flat.reshape(-1, 4)[:, 1:]  # a count before the corners, as PyVista has them
    smooth = False if smooth == AUTO else smooth
    normals = parts[2] if len(parts) == 3 and smooth is False else None
    return Mesh(vertices, faces, normals=normals, material=material, smooth=smooth)


def _joined(
    subjects: Sequence[Any],
    material: Material | None,
    progress: Progress,
    smooth: bool | float | str,
    within: tuple[int, ...],
) -> Scene:
    """Return one scene of all subjects, with the first camera and the first up axis among them."""
    lights = [subject for subject in subjects if isinstance(subject, Light)]
    bodies = (subject for subject in subjects if not isinstance(subject, Light))
    scenes = [as_scene(subject, material, progress, smooth, within) for subject in bodies]
    cameras = [scene.camera for scene in scenes if scene.camera is not None]
    joined = Scene(
        [shape for scene in scenes for shape in scene.shapes],
        [*lights, *(light for scene in scenes for light in scene.lights)],
        cameras[0] if cameras else None,
        up=next((scene.up for scene in scenes if scene.up is not None), None),
        settings=next((scene.settings for scene in scenes if scene.settings), None),
    )
    joined.losses = tuple(loss for scene in scenes for loss in scene.losses)
    return joined


def _made_of(shape: Shape, material: Material | None, smooth: bool | float | str) -> Shape:
    """Return a user's shape with a material and normals; the user's own stays as it is."""
    if material is None and smooth == AUTO:
        return shape
    mesh = shape.mesh if isinstance(shape, Instance) else shape
    bare = copy(shape)
    if material is not None:
        if shape.has_material or mesh.has_material:
            raise SceneError(f"material is for bare meshes; {shape.name} has a material of its own")
        bare.material = material
    if smooth != AUTO and isinstance(shape, Instance):
        raise SceneError(f"smooth is for bare meshes; {shape.name} is an instance: use Mesh(..., smooth=...)")
    if smooth != AUTO and isinstance(bare, Mesh):
        bare.compute_normals(smooth)
    return bare


def _all_made_of(scene: Scene, material: Material | None) -> Scene:
    """Give all shapes of a scene that was just read a material in place of their own."""
    for shape in scene.shapes if material is not None else ():
        bare = shape.mesh if isinstance(shape, Instance) else shape
        bare.material = material
    return scene


def _imported(geometry: Any, smooth: bool | float | str = AUTO) -> Scene:
    from .load import from_trimesh

    return from_trimesh(geometry, smooth=smooth)


def _from_pyvista(data: Any, smooth: bool | float | str = AUTO) -> Scene:
    from .pyvista.objects import from_pyvista

    return from_pyvista(data, smooth=smooth)


def _from_open3d(data: Any, smooth: bool | float | str = AUTO) -> Scene:
    from .foreign import from_open3d

    return from_open3d(data, smooth=smooth)


register_framing(framed)
register_importer("trimesh", _imported)
register_importer("pyvista", _from_pyvista)
register_importer("open3d", _from_open3d)

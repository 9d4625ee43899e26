"""Scenes and meshes from files, and from trimesh objects."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ..codecs.budget import in_memory
from ..core.errors import SceneError, collect_warnings, number
from ..core.files import path_name
from ..core.progress import Progress, phase
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from ..scene import Scene
from ..scene.file_moments import FileMoments
from ..shapes import Instance, Mesh, Shape
from ..shapes.smoothing import AUTO, check_smooth
from .description.placing import place_meshes
from .joining import join
from .losses import Losses
from .readers import LoadOptions, mesh_reader, read
from .sources import LoadLimits, PathLike, SceneFiles, checked_limits, folders

ALL_OF_THE_LIGHT = (".xml", ".pbrt", ".xml.gz", ".pbrt.gz")  # scenes of renderers, which show no other light


@suggests_keywords
def load(
    path: PathLike,
    *,
    strict: bool = False,
    progress: Progress = None,
    limits: LoadLimits | None = None,
    search_paths: PathLike | Sequence[PathLike] = (),
    smooth: bool | float | str = AUTO,
    parameters: Mapping[str, Any] | None = None,
    time: float | None = None,
    animation: str | int | bool | None = None,
) -> Scene:
    """Read a scene: obj (with its mtl), ply, stl, glb, gltf, off, dae, 3mf, xml of Mitsuba 3, pbrt, or usd.

    Points of .obj and .ply files without faces become `Spheres`, whose radius a warning states.

    A mesh of several nodes of a glTF file is read once, and becomes an `Instance` for each node.

    Parameters
    ----------
    path
        The file. Files that it refers to are read only from its own folder, and folders below it.
    strict
        Raise an error in place of each warning of a repair or of an unsupported property.
    progress
        If reading takes more than 2 s, True or None shows a line with the file's name; False shows nothing.
    limits
        How large the file, its images and its meshes may be; None for the defaults of `LoadLimits`.
    search_paths
        A folder, or several, where files that it refers to may be, too.
    smooth
        Normals of the meshes. "auto" keeps those of the file, and computes missing ones by a crease angle of
        60°, but for glTF, whose facets are flat then. True, False or another crease angle in degrees, as of
        `Mesh`, replace those of the file.
    parameters
        Values of the parameters `$name` of an .xml file, in place of their defaults.
    time
        Seconds: the scene of this time, in which nothing moves. By default a file that moves gives a scene
        that does, and is that of its start (`Scene.at`).
    animation
        Of glTF: the name or number of what moves it, one of `Scene.animations`. By default the first one;
        False leaves everything at rest.

    Raises
    ------
    SceneError
        If the file cannot be read, or has no such animation. The message names the file, the line or element,
        the value and the limit.

    Examples
    --------
    >>> with open("triangle.obj", "w") as file:
    ...     _ = file.write("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n")
    >>> scene = wf.load("triangle.obj")
    >>> len(scene.shapes[0].faces)
    1
    """
    with Losses(path_name(path), strict) as losses, _reading(path, progress):
        options = LoadOptions(
            losses,
            limits=checked_limits(limits),
            search_paths=folders(search_paths),
            smooth=check_smooth("smooth", smooth),
            parameters=dict(parameters or {}),
            time=None if time is None else number("time", time),
            animation=animation,
        )
        contents = read(path, options)
        scene = contents.scene(path_name(path), losses)
        scene = scene if options.time is None else scene.at(options.time)
        if contents.span is not None and options.time is None:
            at = partial(_read_at, path, options)
            scene.file_moments = FileMoments(at, contents.span, scene)
        if not os.fspath(path).lower().endswith(ALL_OF_THE_LIGHT):
            scene.lights_of_file = [id(light) for light in scene.lights]
        return scene


def _read_at(path: PathLike, options: LoadOptions, time: float) -> Scene:
    """Read a file again, at another time; its losses have been reported before."""
    name = path_name(path)
    with collect_warnings(), Losses(name) as losses:
        return read(path, replace(options, losses=losses, time=time)).scene(name, losses)


@suggests_keywords
def load_mesh(
    path: PathLike,
    material: MaterialLike | None = None,
    transform: ArrayLike | None = None,
    *,
    strict: bool = False,
    progress: Progress = None,
    limits: LoadLimits | None = None,
    search_paths: PathLike | Sequence[PathLike] = (),
    smooth: bool | float | str = AUTO,
) -> Mesh:
    """Read all geometry of a file as one mesh.

    Parameters
    ----------
    path
        As for `load`.
    material
        Material of the mesh. By default the material and the emission of the file, which must then have only
        one.
    transform
        (4, 4) matrix applied to the vertices.
    strict, progress, limits, search_paths, smooth
        As for `load`.

    Raises
    ------
    SceneError
        As for `load`.

    Examples
    --------
    >>> with open("triangle.off", "w") as file:
    ...     _ = file.write("OFF\\n3 1 0\\n0 0 0\\n1 0 0\\n0 1 0\\n3 0 1 2\\n")
    >>> mesh = wf.load_mesh("triangle.off", material=wf.Diffuse(0.8))
    >>> mesh.vertices.shape
    (3, 3)
    """
    with Losses(path_name(path), strict) as losses, _reading(path, progress):
        options = LoadOptions(
            losses,
            material is None,
            checked_limits(limits),
            folders(search_paths),
            check_smooth("smooth", smooth),
        )
        meshes = _meshes(path, options)
        return join(meshes, Path(path).stem, material, transform)


def load_meshes(
    path: PathLike,
    *,
    strict: bool = False,
    materials: bool = True,
    limits: LoadLimits | None = None,
    search_paths: PathLike | Sequence[PathLike] = (),
    smooth: bool | float | str = AUTO,
) -> list[Mesh]:
    """Read the meshes of a file, one for each material and node; arguments as for `load`."""
    with Losses(path_name(path), strict) as losses:
        options = LoadOptions(
            losses, materials, checked_limits(limits), folders(search_paths), check_smooth("smooth", smooth)
        )
        return _meshes(path, options)


def _meshes(path: PathLike, options: LoadOptions) -> list[Mesh]:
    name, contents = path_name(path), read(path, options)
    placed = place_meshes(name, contents.raws, contents.places, options.losses)
    meshes = [*placed, *(_as_mesh(name, shape) for shape in contents.shapes)]
    if not meshes:
        raise options.losses.nothing("has no faces")
    return meshes


def _as_mesh(name: str, shape: Shape) -> Mesh:
    if isinstance(shape, Instance):
        return shape.to_mesh()
    if not isinstance(shape, Mesh):
        raise SceneError(f"{name}: {shape.name} is a {type(shape).__name__}, not a mesh; use wf.load")
    return shape


@contextmanager
def _reading(path: PathLike, progress: Progress) -> Iterator[None]:
    """Show that a file is read. If memory runs out, the error names the file."""
    with phase(f"loading {os.path.basename(path_name(path))}", progress), in_memory(path):
        yield


@suggests_keywords
def from_trimesh(geometry: Any, *, smooth: bool | float | str = AUTO) -> Scene:
    """Convert a `trimesh.Trimesh` or `trimesh.Scene` to a scene, as if it had been read from a file.

    Normals are used if the object has them: from its file, or computed by an access to
    `vertex_normals`. Trimesh's own exporters follow the same rule. Geometry that occurs several times in a
    scene's graph becomes an `Instance` for each time.

    The camera and the lights of a trimesh scene are used if they were set. The camera's resolution is the
    size of the picture; a camera without a transform is placed to see all of the scene. Colors of lights
    are linear. Lights that trimesh adds for its viewer do not count.

    Some properties of files are lost in trimesh: of glTF it rounds base colors to 8 bits, and drops
    extensions, lights, tangents and the scale of normal maps; of MTL it keeps only the image of `map_Kd`.
    `load` reads all of these.

    Parameters
    ----------
    geometry
        The object.
    smooth
        As for `load`.

    Raises
    ------
    SceneError
        If it is something else, or has no faces.

    Examples
    --------
    >>> import trimesh
    >>> scene = wf.from_trimesh(trimesh.creation.box())
    >>> scene.add(wf.Environment(1)).bounds
    array([[-0.5, -0.5, -0.5],
           [ 0.5,  0.5,  0.5]])
    """
    from .trimesh import objects, view  # here, as programs that hold no such object need not pay for it

    source = "trimesh object"
    with Losses(source) as losses:
        contents = objects.read(geometry, source, losses)
        contents.smooth(check_smooth("smooth", smooth))
        scene = contents.scene(source, losses)
        scene.lights = view.lights(geometry, losses)
        view.add_camera(scene, geometry)
        scene.losses = losses.found
        return scene


@suggests_keywords
def from_mitsuba(
    scene: Mapping[str, Any], *, strict: bool = False, limits: LoadLimits | None = None
) -> Scene:
    """Convert a scene as `mi.load_dict` of Mitsuba 3 takes it; Mitsuba itself is not needed.

    docs/mitsuba.md has a table of the plugins. What is not honored gives one warning, which names each plugin
    and parameter. The film, the sampler and the integrator become the camera and the `settings` of the scene.

    Parameters
    ----------
    scene
        The dictionary, of type "scene". Transforms are arrays (4, 4), or objects of Mitsuba. Files that it
        names may be anywhere; relative names are looked for in the current folder.
    strict
        Raise an error in place of the warning.
    limits
        As for `load`.

    Raises
    ------
    SceneError
        If it is malformed. The message names the plugin.

    Examples
    --------
    >>> scene = wf.from_mitsuba({
    ...     "type": "scene",
    ...     "light": {"type": "constant", "radiance": 0.8},
    ...     "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": 0.4}},
    ... })
    >>> scene.shapes[0]
    <Sphere 'ball': center [0.0, 0.0, 0.0], radius 1>
    """
    from .mitsuba.convert import convert  # here, as programs that read no such scene need not pay for it

    name = "Mitsuba scene"
    with Losses(name, strict) as losses:
        files = SceneFiles(name, (), checked_limits(limits), losses)
        return convert(name, scene, files, Path, mesh_reader(files)).scene(name, losses)

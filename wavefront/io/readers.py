"""The file formats, and the reader of each, whose modules are imported with its first file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from ..core.errors import SceneError
from ..core.files import decode_text, extension_of
from ..core.registry import Registry
from ..scene import Scene
from ..shapes.smoothing import AUTO
from .clouds import cloud
from .description.appearance import assign_material, from_srgb
from .description.contents import Contents
from .losses import Losses
from .repair import RawMesh
from .sources import LoadLimits, PathLike, SceneFiles


@dataclass(frozen=True)
class LoadOptions:
    """Options of reading a file."""

    losses: Losses  # where damaged, unknown and unsupported parts are noted
    materials: bool = True  # read materials
    limits: LoadLimits = field(default_factory=LoadLimits)
    search_paths: tuple[Path, ...] = ()  # folders whose files the file may refer to, beside its own
    smooth: bool | float | str = AUTO  # normals, as for `load`
    parameters: Mapping[str, Any] = field(default_factory=dict)  # of the scene file, by name
    time: float | None = None  # seconds, for readers that read one time; None for the first
    animation: str | int | bool | None = None  # name or number; None for the first, False for none


def read(path: PathLike, options: LoadOptions) -> Contents:
    """Read a file of any supported format.

    Raises
    ------
    SceneError
        If it cannot be read. The message names the file, the line or element, the value and the limit.
    """
    name = os.fspath(path)
    kind = extension_of(name, READERS)
    parse = READERS.find(kind, f"{name}: extension")
    if options.parameters and kind != ".xml":
        raise SceneError(f"{name}: parameters are for .xml files")
    files = SceneFiles(path, options.search_paths, options.limits, options.losses)
    data = files.read(path)
    if kind in PLAIN:
        _refuse(name, data)
    contents = parse(files, data, options)
    if not (options.animation is None or options.animation is False or contents.animations):
        raise SceneError(f"{name}: animation is {options.animation!r}; the file has none")
    contents.smooth(options.smooth)
    options.limits.check_meshes(name, len(contents.raws))
    options.limits.check_triangles(name, sum(len(raw.faces) for raw in contents.raws))
    return contents


def _refuse(name: str, data: bytes) -> None:
    """Refuse files that are empty, or archives under another name."""
    if not data:
        raise SceneError(f"{name}: is empty")
    if data[:4] in (b"PK\x03\x04", b"PK\x05\x06") or data[:2] == b"\x1f\x8b":
        raise SceneError(f"{name}: is an archive; unpack it first")


def _read_gltf(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .gltf import scene as gltf
    from .gltf.materials import GltfMaterials

    document = gltf.Document(files, data)
    with document.inside("the file"):
        contents, numbers = gltf.contents(document, options.animation)
        specs = GltfMaterials(document)
        for raw, number in zip(contents.raws, numbers, strict=True):
            if options.materials and not assign_material(raw, specs.spec(number)):
                document.lose("vertex colors", f"mesh {raw.name!r}")
    return contents


def _read_obj(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from . import mtl, obj

    losses, materials = files.losses, options.materials
    parsed = obj.parse(losses, decode_text(data), options.limits)
    for keyword, line in parsed.ignored.items():
        losses.note(keyword, f"line {line}")
    if parsed.points is not None:
        codes = None if parsed.points.shape[1] < 6 else from_srgb(parsed.points[:, 3:])
        points = cloud(losses, parsed.points[:, :3], codes)
        return Contents(shapes=[] if points is None else [points])
    specs = mtl.libraries(files, parsed.libraries) if materials else {}
    for raw in parsed.raws:
        raw.colors = None if raw.colors is None else from_srgb(raw.colors)
        if materials and not assign_material(raw, specs.get(raw.name)):
            losses.note("vertex colors", f"material {raw.name!r}")
    absent = ", ".join(repr(raw.name) for raw in parsed.raws if raw.name and raw.name not in specs)
    if specs and absent:
        losses.note(f"not in its material files: {absent}", done="gray in their place")
    if materials and absent and not parsed.libraries:
        losses.note(f"names no material file for its materials {absent}", done="gray in their place")
    return Contents.once(parsed.raws)


def _read_ply(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .ply import meshes as ply

    return ply.parse(files, data, options.materials).contents


def _read_stl(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from . import stl

    contents = Contents.once(stl.parse(files.losses, data))
    contents.up = "z"
    return contents


def _read_off(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from . import off

    raws = off.parse(files.losses, data, options.materials)
    return Contents.once([raw for raw in raws if len(raw.faces)])


def _read_dae(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .dae import document as dae

    return dae.parse(files, data, options.materials)


def _read_3mf(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from . import threemf

    return threemf.parse(files, data, options.materials)


def _read_mitsuba(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .mitsuba.convert import convert
    from .mitsuba.document import Document

    document = Document(files, data, options.parameters)
    return convert(files.name, document.scene, files, document.find, mesh_reader(files), document.version)


def _read_usd(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .usd.stage import read_usd

    return read_usd(files, options.time)


def _read_pbrt(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
    from .pbrt.scene import read_scene

    return read_scene(files, data, mesh_reader(files))


def mesh_reader(files: SceneFiles) -> Callable[[Path], list[RawMesh]]:
    """Return a function that reads the meshes of an obj or ply file to which a scene refers."""

    def read_meshes(path: Path) -> list[RawMesh]:
        kind = Path(path.name.removesuffix(".gz")).suffix.lower()
        if kind not in (".obj", ".ply"):
            raise SceneError(f"{path}: extension is {kind!r}; it must be .obj or .ply")
        local, name = files.seen_from(path), os.fspath(path)
        data = local.read(path)
        _refuse(name, data)
        if kind == ".obj":
            return _read_obj(
                local, data, LoadOptions(files.losses, materials=False, limits=files.limits)
            ).raws
        from .ply import meshes as ply
        from .ply.attributes import ply_attributes

        parsed = ply.parse(local, data, materials=False)
        raws = parsed.contents.raws
        for raw in raws:
            raw.attributes = ply_attributes(parsed.rows, parsed.row)
        return raws

    return read_meshes


def _from_scene(load: Callable[[str, bytes], Scene]) -> Reader:
    """Return a reader that calls `load`, a user's own function."""

    def read_scene(files: SceneFiles, data: bytes, options: LoadOptions) -> Contents:
        name = files.name
        scene = load(name, data)
        if not isinstance(scene, Scene):
            raise SceneError(f"{name}: its reader returned {type(scene).__name__}; it must return a wf.Scene")
        return Contents(lights=scene.lights, camera=scene.camera, shapes=scene.shapes)

    return read_scene


Reader: TypeAlias = Callable[[SceneFiles, bytes, LoadOptions], Contents]
READERS: Registry[Reader] = Registry(
    "extension",
    "a function of (path, data) that returns a wf.Scene",
    {
        ".obj": _read_obj,
        ".ply": _read_ply,
        ".stl": _read_stl,
        ".glb": _read_gltf,
        ".gltf": _read_gltf,
        ".off": _read_off,
        ".dae": _read_dae,
        ".3mf": _read_3mf,
        ".xml": _read_mitsuba,
        ".pbrt": _read_pbrt,
        **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _read_usd),
    },
    adapt=_from_scene,
    group="load",
)
# formats that are no archives
PLAIN = (".obj", ".ply", ".stl", ".glb", ".gltf", ".off", ".dae", ".xml", ".pbrt")

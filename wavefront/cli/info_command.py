"""`wavefront info`."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..arrays.vec import Doubles
from ..camera import Sensors
from ..codecs.luminaires import EXTENSIONS as LUMINAIRES
from ..codecs.luminaires import luminaire_texts, parsed_luminaire
from ..core.errors import collect_warnings
from ..core.parameter import brief
from ..core.plural import plural
from ..drive import program
from ..io.load import load
from ..lights.ies import Web
from ..materials import Material
from ..scene.lighting import DEFAULT
from ..scene.scene import FRAMING_VIEW, Scene
from ..settings import Settings
from ..shapes import Instance, Mesh, Shape
from ..textures.base import BaseTexture
from ..textures.image import Texture
from .command import SCENE_FILE, add_command
from .options import add_reading, reading

UNSAID_UP = (".obj", ".ply", ".off")  # formats without an up axis
_PACKAGE = BaseTexture.__module__.partition(".")[0] + "."


def add_info_command(commands: Any) -> None:
    """Add the command to a parser's commands."""
    command = add_command(
        commands,
        "info",
        "say what a file of a scene or luminaire holds: shapes, materials, lights, and what is wrong with it",
        ["wavefront info scene.glb", "wavefront info --stages scene.glb"],
    )
    command.add_argument("scene", help=SCENE_FILE)
    add_reading(command)
    command.add_argument(
        "--stages",
        action="store_true",
        help="list the stages that run for it, with their files",
    )
    command.add_argument("--quiet", action="store_true", help="do not say that a large file is being read")
    command.set_defaults(run=_info)


def _info(options: argparse.Namespace) -> int:
    """Print the content of a scene file; return the exit status."""
    path = options.scene
    if options.stages:
        print(program(load(path, progress=False, **reading(options)), progress=False))
        return 0
    with collect_warnings() as said:  # they are listed here
        if path.lower().endswith(LUMINAIRES):
            lines, losses = [_luminaire(path)], list(said)
        else:
            scene = load(path, progress=False if options.quiet else None, **reading(options))
            lines, losses = list(_lines(path, scene)), [loss.said(path) for loss in scene.losses]
    print("\n".join([*lines, f"losses: {len(losses) or 'none'}", *(f"  {loss}" for loss in losses)]))
    return 0


def _luminaire(path: str) -> str:
    """Return the line about a file of a luminaire."""
    photometry = parsed_luminaire(*luminaire_texts(path))
    size = " × ".join(map(str, photometry.candela.shape))
    flux, most = Web(photometry).flux, photometry.candela.max()
    return f"{path}: luminaire of {flux:.4g} lm, at most {most:.4g} cd, {size} angles"


def _lines(path: str, scene: Scene) -> Iterator[str]:
    """Yield the lines about a scene."""
    meshes = _distinct(shape.mesh if isinstance(shape, Instance) else shape for shape in scene.shapes)
    low, high = scene.bounds
    yield (
        f"{path}: {plural(len(scene.shapes), 'shape')}, {plural(_triangles(scene.shapes), 'triangle')}, "
        f"{plural(len(scene.lights), 'light')}"
    )
    yield f"size: file {_bytes(os.path.getsize(path))}, meshes {_bytes(_mesh_bytes(meshes))} in memory"
    yield f"bounds: {_triple(low)} to {_triple(high)}, {_triple(high - low)} across"
    camera, lit = scene.camera is not None, scene.emits
    yield f"up: {_axis(path, scene)}"
    if scene.moves:
        named = f"; animations {', '.join(map(repr, scene.animations))}" if scene.animations else ""
        yield f"moves: from {scene.start:g} to {scene.end:g} s{named}"
    yield f"camera: {'in the file' if camera else f'none; render frames the scene, view={FRAMING_VIEW!r}'}"
    if scene.settings:
        told = (f"{name} {value}" for name, value in scene.settings.items())
        yield f"settings: {', '.join(told)}"
    if not lit:
        yield f"light: none; render adds lighting={DEFAULT!r} and a ground"
    if not isinstance(scene.camera, Sensors):
        yield f"picture: ends {Settings(**scene.settings).ending(not lit).end or 'as the settings say'}"
    yield "shapes:"
    for shape in scene.shapes:
        glow = "" if shape.emission is None else ", emits"
        yield f"  {shape!r} {_label(shape.material)}{glow}"
    if scene.lights:
        yield "lights:"
        yield from (f"  {light!r}" for light in scene.lights)
    yield "materials:"
    materials = _distinct(shape.material for shape in scene.shapes)
    for material in materials:
        name = f"{material.name!r} " if material.name else ""
        yield f"  {name}{brief(material.bsdf)}"
    textures = _distinct(texture for material in materials for texture in _textures(material, set()))
    yield "textures:" if textures else "textures: none"
    for texture in textures:
        yield f"  {texture!r}, {plural(texture.channels, 'channel')}, {'sRGB' if texture.srgb else 'linear'}"


def _textures(node: Any, seen: set[int]) -> Iterator[Texture]:
    """Yield the image textures that a material, a BSDF, or a tuple of these, reads."""
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, Texture):
        yield node
    elif isinstance(node, list | tuple):
        for element in node:
            yield from _textures(element, seen)
    elif type(node).__module__.startswith(_PACKAGE) and hasattr(node, "__dict__"):
        for element in vars(node).values():
            yield from _textures(element, seen)


def _distinct(elements: Iterable[Any]) -> list[Any]:
    """Return the distinct objects among some, in their order."""
    return list({id(element): element for element in elements}.values())


def _triangles(shapes: Iterable[Shape]) -> int:
    meshes = (shape.mesh if isinstance(shape, Instance) else shape for shape in shapes)
    return sum(len(mesh.faces) for mesh in meshes if isinstance(mesh, Mesh))


def _mesh_bytes(meshes: Iterable[Shape]) -> int:
    """Return the bytes of the arrays of meshes."""
    return sum(
        value.nbytes for mesh in meshes for value in vars(mesh).values() if isinstance(value, np.ndarray)
    )


def _bytes(count: int) -> str:
    """Return a number of bytes with a unit."""
    size, unit = float(count), "bytes"
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000 or unit == "GB":
            break
        size /= 1000
    return f"{size:.4g} {unit}"


def _axis(path: str, scene: Scene) -> str:
    """Return the axis that is up, and the reason."""
    if scene.up is None and os.path.splitext(path)[1].lower() in UNSAID_UP:
        return "y (assumed; up='z' turns it)"
    axis = "xyz"[int(scene.vertical().argmax())]
    return f"{axis}, {'the default' if scene.up is None else 'by the file or its format'}; --up changes it"


def _label(material: Material) -> str:
    return type(material.bsdf).__name__


def _triple(values: Doubles) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"

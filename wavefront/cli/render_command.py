"""`wavefront render`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..codecs.images import check_display, check_writable
from ..errors import Interrupted, RenderError, SaveError, SceneError
from ..image import Image
from ..io.load import load
from ..render import finish
from ..scene import Scene
from ..session import Session
from . import arguments
from .options import Help, add_display, add_settings, display_of, setting_values
from .rescue import save_elsewhere
from .status import ERROR, INTERRUPTED

FOV = 40.0  # degrees


def add_render_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = commands.add_parser("render", help="render a scene file", formatter_class=Help)
    command.add_argument("scene", help="obj, ply, stl, glb or gltf file")
    command.add_argument(
        "-o", "--output", default="out.png", help="png, jpg, exr, hdr, npy or npz file to write"
    )
    add_settings(command)
    where = {"type": arguments.vector, "metavar": "X,Y,Z"}
    command.add_argument("--origin", **where, help="camera position; replaces the file's camera")
    command.add_argument(
        "--target", **where, help="point that the camera looks at (default: the scene's middle)"
    )
    command.add_argument(
        "--direction", **where, help="from where a scene is framed: from its middle to the camera"
    )
    command.add_argument(
        "--fov", type=arguments.fov, help=f"vertical field of view, degrees (default: {FOV:g})"
    )
    add_display(command)
    command.add_argument("--bits", type=int, choices=(8, 16), default=8, help="of each channel of a png")
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(run=_render)


def _render(options: argparse.Namespace) -> int:
    check_writable(options.output)
    display = display_of(options)
    check_display(options.output, display, options.bits)
    progress = False if options.quiet else None
    scene = load(options.scene, progress=progress)
    scene.camera = _camera(scene, options)
    image: Image | None
    status = 0
    try:
        image = render_by_command(
            scene,
            {"arguments": options.arguments, "folder": options.folder},
            **setting_values(options),
            progress=progress,
        )
    except Interrupted as stop:
        image, status = stop.image, INTERRUPTED
        print(f"wavefront: {stop}", file=sys.stderr)
    except RenderError as error:
        image, status = error.image, ERROR
        print(f"wavefront: error: {error}", file=sys.stderr)
    return (image is not None and _save(image, options)) or status


def render_by_command(scene: Scene, command: dict[str, Any], **settings: Any) -> Image:
    """Render a scene with settings of `Session`; a checkpoint keeps the command for `wavefront resume`."""
    session = Session(scene, **settings)
    session.command = command
    return finish(session)


def _save(image: Image, options: argparse.Namespace) -> int:
    """Save a picture, if not where it was meant to go then elsewhere; return the exit status."""

    def save(path: str | Path) -> None:
        if Path(path).suffix.lower() != Path(options.output).suffix.lower():
            image.save(path)  # it may not be able to hold what the options ask for
            return
        image.save(
            path,
            options.gamma,
            options.exposure,
            options.tone,
            options.white_balance,
            bits=options.bits,
        )

    try:
        save(options.output)
    except (SaveError, MemoryError) as error:
        print(f"wavefront: error: {error or 'out of memory'}", file=sys.stderr)
        place = save_elsewhere(save, options.output)
        print(f"wavefront: the picture {f'was saved as {place}' if place else 'is lost'}", file=sys.stderr)
        return ERROR
    print(_summary(image, options.output))
    return 0


def _camera(scene: Scene, options: argparse.Namespace) -> Camera:
    """Return the camera that the options describe, else the file's, else one that frames the scene."""
    size = options.size or (scene.camera.size if scene.camera else (512, 512))
    fov = FOV if options.fov is None else options.fov
    up = (0.0, 1.0, 0.0) if options.up is None else options.up
    if options.origin is not None:
        if options.direction is not None:
            raise SceneError("--direction is for scenes that are framed; with --origin use --target")
        target = scene.bounds.mean(0) if options.target is None else options.target
        return Camera.look_at(options.origin, target, up, fov=fov, size=size)
    if options.target is not None:
        raise SceneError("--target needs --origin")
    if scene.camera is None:
        return scene.framing_camera(fov, size, up=up, direction=options.direction)
    for name in ("fov", "up", "direction"):
        if getattr(options, name) is not None:
            raise SceneError(f"--{name} needs --origin: {options.scene} has a camera of its own")
    return scene.camera.resized(size)


def _summary(image: Image, path: str) -> str:
    height, width = image.rgb.shape[:2]
    seconds, noise = image.metadata["seconds"], image.metadata["noise"]
    rate = image.metadata["samples"] / max(seconds, 1e-9) / 1e6
    return (
        f"{path}: {width}x{height}, {image.spp} spp in {seconds:.1f} s ({rate:.2f} million samples/s), "
        f"estimated error {'unknown' if np.isnan(noise) else f'{noise:.2%}'}"
        f"{' before denoising' if 'denoiser' in image.metadata else ''}"
    )

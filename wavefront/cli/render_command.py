"""`wavefront render`, and `wavefront resume`, which goes on with one."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera, Sensors
from ..codecs.display import Display
from ..codecs.images import check_display, check_writable
from ..core.errors import SaveError, SceneError
from ..drive import Session
from ..drive.render import finish
from ..film.checkpoint import contents_of, read_header
from ..image import Image
from ..io.to_scene import SIZE
from ..scene.scene import AUTO, FRAMING_FOV, Scene
from ..viewer import view
from .command import PICTURE_FILE, SCENE_FILE, add_command
from .messages import ERROR, INTERRUPTED, print_done, print_error, print_note
from .options import add_display, add_settings, display_values, read_scene, setting_values, vector
from .outputs import output_paths, save_elsewhere, whole_or_part


def add_render_command(commands: Any) -> None:
    """Add the command and its options to those of a parser."""
    command = add_command(
        commands,
        "render",
        "render scene files",
        [
            "wavefront render scene.glb -o out.png --spp 256",
            "wavefront render part.stl --view iso --size 800x600 --noise 0.02",
            "wavefront render a.obj b.ply -o pictures/",
            "wavefront render a.obj b.ply -o 'layers/{}.exr' --aov depth --aov normal --denoise",
            "wavefront render room.gltf --spp 4096 --guide --checkpoint room.wfck -o room.exr",
        ],
    )
    command.add_argument("scenes", nargs="+", metavar="scene", help=SCENE_FILE)
    command.add_argument(
        "-o",
        "--output",
        default="out.png",
        help=f"{PICTURE_FILE} to write; a folder, for pngs with the names of the scenes; "
        "or a path with {} in the place of that name",
    )
    add_settings(command)
    where: dict[str, Any] = {"type": vector, "metavar": "X,Y,Z"}
    command.add_argument("--origin", **where, help="camera position; replaces the file's camera")
    command.add_argument(
        "--target", **where, help="point that the camera looks at (default: the scene's middle)"
    )
    command.add_argument("--direction", **where, help="the same as --view X,Y,Z")
    add_display(command)
    command.add_argument("--bits", type=int, choices=(8, 16), default=8, help="of each channel of a png")
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.add_argument(
        "--show",
        action="store_true",
        help="show the scene with these options in the browser, in place of writing a picture",
    )
    command.set_defaults(run=_render)


def add_resume_command(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the command to those of a parser, which reads the command that began the render."""
    command = add_command(
        commands,
        "resume",
        "go on with what wavefront render or measure --checkpoint began",
        ["wavefront resume out.wfck"],
    )
    command.add_argument("checkpoint", help="the file that --checkpoint named")
    command.set_defaults(run=lambda options: _resume(options.checkpoint, parser))


def _render(options: argparse.Namespace) -> int:
    """Render all scenes; return the worst exit status."""
    if options.show:
        return _show(options)
    paths = output_paths(options.scenes, options.output)
    if len(paths) > 1 and options.checkpoint is not None:
        raise SceneError(f"--checkpoint is for one scene; there are {len(paths)}")
    display = Display(**display_values(options))
    for path in paths:
        check_writable(path)
        check_display(path, display, options.bits)
    worst = 0
    for scene, path in zip(options.scenes, paths, strict=True):
        try:
            status = _render_scene(scene, path, options)
        except (SceneError, OSError) as error:
            if len(paths) == 1:
                raise
            print_error(error)
            status = ERROR
        if status == INTERRUPTED:
            return status
        worst = max(worst, status)
    return worst


def _show(options: argparse.Namespace) -> int:
    """Show the scene in the browser until Ctrl-C; return the exit status."""
    if len(options.scenes) > 1:
        raise SceneError(f"--show is for one scene; there are {len(options.scenes)}")
    (path,) = options.scenes
    scene = read_scene(path, options, False if options.quiet else None)
    view(scene, block=True, **_view(path, scene, options), **setting_values(options))
    return 0


def _render_scene(path: str, output: str, options: argparse.Namespace) -> int:
    """Render a scene and save the picture; return the exit status."""
    progress = False if options.quiet else None
    scene = read_scene(path, options, progress)
    viewpoint = (options.origin, options.view, options.direction)
    if isinstance(scene.camera, Sensors) and all(option is None for option in viewpoint):
        raise SceneError(f"{path}: has a sensor that measures light: wavefront measure {path} -o out.csv")
    command = {"arguments": options.arguments, "folder": options.folder}
    settings = {**_view(path, scene, options), **setting_values(options), "progress": progress}
    image, status = whole_or_part(lambda: render_by_command(scene, command, **settings))
    return (image is not None and _save(image, output, options)) or status


def render_by_command(scene: Scene, command: dict[str, Any], **settings: Any) -> Image:
    """Render a scene with settings of `Session`; a checkpoint keeps the command for `wavefront resume`."""
    session = Session(scene, **settings)
    session.command = command
    return finish(session)


def _save(image: Image, output: str, options: argparse.Namespace) -> int:
    """Save a picture, if not where it was meant to go then elsewhere; return the exit status."""

    def save(path: str | Path) -> None:
        if Path(path).suffix.lower() != Path(output).suffix.lower():
            image.save(path)  # the format may not hold the bits or the tone curve of the options
        else:
            image.save(path, **display_values(options), bits=options.bits)

    try:
        save(output)
    except (SaveError, MemoryError) as error:
        print_error(error)
        place = save_elsewhere(save, output)
        print_note(f"the picture {f'was saved as {place}' if place else 'is lost'}")
        return ERROR
    print_done(_summary(image, output))
    return 0


def _view(path: str, scene: Scene, options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of the camera that the options describe."""
    named = options.direction if options.view is None else options.view
    if options.origin is None:
        if options.target is not None:
            raise SceneError("--target needs --origin")
        if scene.camera is not None and named is None:
            for name in ("fov", "up"):
                if getattr(options, name) not in (None, AUTO):
                    raise SceneError(f"--{name} needs --origin or --view: {path} has a camera of its own")
        return {"size": options.size, "view": named, "fov": options.fov}
    if named is not None:
        raise SceneError("--view is for scenes that are framed; with --origin use --target")
    size = options.size or (scene.camera.size if scene.camera else SIZE)
    target = scene.bounds.mean(0) if options.target is None else options.target
    fov = FRAMING_FOV if options.fov is None else options.fov
    return {"camera": Camera.look_at(options.origin, target, scene.vertical(options.up), fov, size=size)}


def _summary(image: Image, path: str) -> str:
    height, width = image.rgb.shape[:2]
    seconds, noise = image.metadata["seconds"], image.metadata["noise"]
    rate = image.metadata["samples"] / max(seconds, 1e-9) / 1e6
    return (
        f"{path}: {width}x{height}, {image.spp} spp in {seconds:.1f} s ({rate:.2f} million samples/s), "
        f"estimated error {'unknown' if np.isnan(noise) else f'{noise:.2%}'}"
        f"{' before denoising' if 'denoiser' in image.metadata else ''}"
    )


def _resume(path: str, parser: argparse.ArgumentParser) -> int:
    """Run the command that began a render again; return the exit status."""
    with contents_of(path):
        command = read_header(path)["command"]
        if command is None:
            raise SceneError(f"{path}: was not begun by wavefront render; call render(checkpoint=...) again")
        arguments, folder = command["arguments"], os.fspath(command["folder"])
        if not all(isinstance(argument, str) for argument in arguments):
            raise TypeError("an argument is no text")
    options = parser.parse_args(arguments)
    options.arguments, options.folder = arguments, folder
    options.scenes = [os.path.join(options.folder, scene) for scene in options.scenes]
    options.output = os.path.join(options.folder, options.output)
    options.checkpoint = path
    status: int = options.run(options)
    return status

"""`wavefront render`, `wavefront info` and `wavefront compare`."""

from __future__ import annotations

import argparse
import io
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from .camera import Camera, image_size, upward
from .codecs.encoding import check_exposure, check_gamma
from .codecs.images import check_writable
from .errors import Interrupted, RenderError, SaveError, SceneError
from .image import Image
from .io.load import load
from .lighting import check_lighting
from .metrics import compare
from .render import render
from .rescue import save_elsewhere
from .scene import Scene
from .settings import Settings
from .shapes import Instance, Mesh
from .version import VERSION

ERROR = 2  # as argparse has it
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
TERMINATED = 143  # 128 + SIGTERM
VECTOR_OPTIONS = ("--origin", "--target", "--up", "--direction")
FOV = 40.0  # degrees


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files may be in no encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    options = parser().parse_args(_joined(sys.argv[1:] if arguments is None else arguments))
    with _sigterm_exits(), warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: _show_warning(message)
        try:
            status: int = options.run(options)
        except (SceneError, OSError) as error:
            print(f"wavefront: error: {error}", file=sys.stderr)
            return ERROR
        except KeyboardInterrupt:
            return INTERRUPTED
    return status


@contextmanager
def _sigterm_exits() -> Iterator[None]:
    """Let SIGTERM end the program as an error does, which tidies up; a second one ends it at once."""

    def leave(signal_number: int, frame: Any) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        raise SystemExit(TERMINATED)

    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield
        return
    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _joined(arguments: Sequence[str]) -> list[str]:
    """Join a vector to its option, since argparse takes "-1,2,3" for an option of its own."""
    joined: list[str] = []
    for argument in arguments:
        negative = argument[:1] == "-" and ("," in argument or argument.lower() in ("-x", "-y", "-z"))
        if joined and joined[-1] in VECTOR_OPTIONS and negative:
            joined[-1] += "=" + argument
        else:
            joined.append(argument)
    return joined


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(prog="wavefront", description="A path tracer in whole-array NumPy.")
    top.add_argument("--version", action="version", version=VERSION)
    commands = top.add_subparsers(required=True, metavar="command")
    _add_render(commands)
    info = commands.add_parser("info", help="say what a scene file holds")
    info.add_argument("scene", help="obj, ply, stl, glb or gltf file")
    info.set_defaults(run=_info)
    measure = commands.add_parser("compare", help="say how far a picture is from a reference")
    measure.add_argument("picture", help="png, jpg, exr, hdr or npy file")
    measure.add_argument("reference", help="the same, of the same size")
    measure.add_argument("-o", "--output", help="where to write the absolute difference")
    measure.set_defaults(run=_compare)
    return top


class _Help(argparse.ArgumentDefaultsHelpFormatter):
    """Names defaults where there are any."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None else super()._get_help_string(action)


def _add_render(commands: Any) -> None:
    command = commands.add_parser("render", help="render a scene file", formatter_class=_Help)
    command.add_argument("scene", help="obj, ply, stl, glb or gltf file")
    command.add_argument("-o", "--output", default="out.png", help="png, jpg, exr, hdr or npy file to write")
    for each in fields(Settings):
        if each.metadata.get("option"):
            _add_setting(command, each)
    where = {"type": _vector, "metavar": "X,Y,Z"}
    command.add_argument("--origin", **where, help="camera position; replaces the file's camera")
    command.add_argument(
        "--target", **where, help="point that the camera looks at (default: the scene's middle)"
    )
    command.add_argument(
        "--direction", **where, help="from where a scene is framed: from its middle to the camera"
    )
    command.add_argument("--fov", type=_fov, help=f"vertical field of view, degrees (default: {FOV:g})")
    command.add_argument("--gamma", type=_gamma, default=2.2, help='for png and jpg: a number or "srgb"')
    command.add_argument("--exposure", type=_exposure, default=0.0, help="stops, applied when saving")
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(run=_render)


def _add_setting(command: argparse.ArgumentParser, setting: Field[Any]) -> None:
    """Add the option of a setting that has one."""
    how: dict[str, Any] = {"help": setting.metadata["option"], "default": setting.default}
    if setting.type == "bool":
        how["action"] = "store_true"
    else:
        how["type"] = PARSERS.get(setting.name) or TYPES[str(setting.type).split(" ")[0]]
        how["choices"] = setting.metadata["choices"]
        how["metavar"] = METAVARS.get(setting.name)
    command.add_argument("--" + setting.name.replace("_", "-"), **how)


def _render(options: argparse.Namespace) -> int:
    check_writable(options.output)
    progress = False if options.quiet else None
    scene = load(options.scene, progress=progress)
    scene.camera = _camera(scene, options)
    image: Image | None
    status = 0
    try:
        image = render(
            scene,
            **{name: getattr(options, name) for name in RENDER_OPTIONS},
            progress=progress,
        )
    except Interrupted as stop:
        image, status = stop.image, INTERRUPTED
        print(f"wavefront: {stop}", file=sys.stderr)
    except RenderError as error:
        image, status = error.image, ERROR
        print(f"wavefront: error: {error}", file=sys.stderr)
    return (image is not None and _save(image, options)) or status


def _save(image: Image, options: argparse.Namespace) -> int:
    """Save a picture, if not where it was meant to go then elsewhere; return the exit status."""

    def save(path: str | Path) -> None:
        image.save(path, gamma=options.gamma, exposure=options.exposure)

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
    )


def _info(options: argparse.Namespace) -> int:
    scene = load(options.scene)
    low, high = scene.bounds
    meshes = [shape.mesh if isinstance(shape, Instance) else shape for shape in scene.shapes]
    faces = sum(len(mesh.faces) for mesh in meshes if isinstance(mesh, Mesh))
    print(f"{options.scene}: {len(scene.shapes)} shapes, {faces} triangles, {len(scene.lights)} lights")
    print(f"bounds: {_triple(low)} to {_triple(high)}")
    print(f"camera: {'in the file' if scene.camera else 'none; the scene will be framed'}")
    for shape in scene.shapes:
        glow = "" if shape.emission is None else ", emits"
        print(f"  {shape!r} {type(shape.material.bsdf).__name__}{glow}")
    return 0


def _compare(options: argparse.Namespace) -> int:
    if options.output:
        check_writable(options.output)
    result = compare(options.picture, options.reference)
    print(result)
    if options.output:
        result.difference.save(options.output)
    return 0


def _triple(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"


def _show_warning(message: Warning | str) -> None:
    print(f"wavefront: warning: {message}", file=sys.stderr)


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, such as 640x480") from None
    try:
        return image_size((width, height))
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _fov(text: str) -> float:
    fov = _finite(text)
    if not 0 < fov < 180:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0 and below 180 degrees")
    return fov


def _lighting(text: str) -> str | None:
    lighting = None if text == "none" else text
    try:
        check_lighting(lighting)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return lighting


def _vector(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,Z, such as 0,1.5,4") from None
    return x, y, z


def _up(text: str) -> tuple[float, float, float]:
    if "," in text:
        return _vector(text)
    try:
        x, y, z = upward("--up", text).tolist()
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return x, y, z


def _gamma(text: str) -> float | str:
    if text == "srgb":
        return text
    try:
        return check_gamma(_finite(text))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f'{text!r} is neither a number from 0.01 to 100 nor "srgb"'
        ) from None


def _exposure(text: str) -> float:
    try:
        return check_exposure(_finite(text))
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _finite(text: str) -> float:
    number = float(text)
    if not np.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


TYPES: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "str": str}
PARSERS: dict[str, Callable[[str], Any]] = {"size": _size, "lighting": _lighting, "up": _up}
METAVARS = {"lighting": "PRESET", "up": "X,Y,Z"}
CAMERA_OPTIONS = ("size",)  # settings that the command line uses for its own camera
RENDER_OPTIONS = [
    each.name for each in fields(Settings) if each.metadata.get("option") and each.name not in CAMERA_OPTIONS
]


if __name__ == "__main__":
    sys.exit(main())

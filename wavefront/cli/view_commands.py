"""Commands that show one scene from many sides: `wavefront turntable`, `dataset` and `view`."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from typing import Any

from ..animation import check_animation, save_animation
from ..camera import Camera
from ..codecs.display import Display
from ..codecs.tone import TONE_NAMES
from ..core.plural import plural
from ..core.progress import Progress
from ..datasets import write_dataset
from ..datasets.dataset import FORMATS
from ..scene import Scene
from ..viewer import view
from ..views import render_many, turntable
from .command import SCENE_FILE, add_command
from .messages import print_done
from .options import (
    Several,
    add_display,
    add_settings,
    count,
    display_values,
    framing,
    read_scene,
    setting_values,
    times,
)


def add_turntable_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "turntable",
        "render an animation around a scene",
        [
            "wavefront turntable mesh.obj -o spin.mp4 --frames 90 --fps 30 --spp 64 --size 640x480",
            "wavefront turntable part.stl -o 'frame_{:03d}.png'",
        ],
    )
    command.add_argument("scene", help=SCENE_FILE)
    command.add_argument(
        "-o",
        "--output",
        default="turntable.gif",
        help="gif, png (animated) or mp4 file to write, or numbered files such as frame_{:03d}.png",
    )
    command.add_argument("--frames", type=count, default=60, help="pictures of a whole turn")
    command.add_argument("--fps", type=float, default=24.0, help="pictures per second")
    add_settings_of_series(command)
    command.set_defaults(run=_turntable)


def _turntable(options: argparse.Namespace) -> int:
    check_animation(options.output)
    display = checked_display(options)
    scene, cameras, settings = _series(options, options.frames)
    images = render_many(scene, cameras, **settings)
    written = save_animation(options.output, images, fps=options.fps, **display)
    print_done(f"{options.output}: {plural(written, 'picture')}")
    return 0


def add_dataset_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "dataset",
        "render views around a scene with annotations, for machine learning",
        [
            "wavefront dataset scene.glb -o set --views 200 --spp 64 --size 640x480",
            "wavefront dataset walk.glb -o set --views 4 --times 0,0.1,0.2 --format kitti",
            "wavefront dataset parts.obj -o set --format coco --format bop --object bolt --object nut",
        ],
    )
    command.add_argument("scene", help=SCENE_FILE)
    command.add_argument("-o", "--output", required=True, help="folder to write; the same command goes on")
    command.add_argument("--views", type=count, default=60, help="pictures of a whole turn")
    command.add_argument(
        "--format",
        action=Several,
        default=(),
        choices=FORMATS,
        help="layout; can be given several times (default: coco)",
    )
    command.add_argument(
        "--object",
        action=Several,
        default=(),
        metavar="NAME",
        help="shapes to annotate; can be given several times (default: all; wavefront info lists them)",
    )
    command.add_argument(
        "--times", type=times, metavar="T,T,...", help="seconds at which each camera sees a scene that moves"
    )
    command.add_argument("--millimeters", type=float, default=1000.0, help="length of a scene unit, for BOP")
    command.add_argument(
        "--depth-scale", type=float, help="millimeters of a code of BOP's depth (default: 0.1 or more)"
    )
    add_settings_of_series(command)
    command.set_defaults(run=_dataset)


def _dataset(options: argparse.Namespace) -> int:
    display = checked_display(options)
    scene, cameras, settings = _series(options, options.views)
    rendered = write_dataset(
        options.output,
        scene,
        cameras,
        format=options.format or FORMATS[0],
        times=options.times,
        objects=options.object or None,
        millimeters=options.millimeters,
        depth_scale=options.depth_scale,
        **display,
        **settings,
    )
    views = len(cameras) * len(options.times or "1")
    earlier = views - rendered
    before = f", {earlier} of them there before" if earlier else ""
    print_done(f"{options.output}: {plural(views, 'view')}{before}")
    return 0


def add_settings_of_series(command: argparse.ArgumentParser, own: Collection[str] = ()) -> None:
    """Add the options of commands that render several pictures, but for the command's own."""
    add_settings(command, own)
    add_display(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")


def checked_display(options: argparse.Namespace) -> dict[str, Any]:
    """Return how pictures are shown, checked before anything is rendered."""
    display = display_values(options)
    Display(**display)
    return display


def _series(options: argparse.Namespace, count: int) -> tuple[Scene, list[Camera], dict[str, Any]]:
    """Return the scene, the cameras of a whole turn around it, and the settings of its renders."""
    progress: Progress = False if options.quiet else None
    scene = read_scene(options.scene, options, progress)
    cameras = turntable(scene, count, up=options.up, **framing(options))
    return scene, cameras, {"progress": progress, **setting_values(options)}


def add_view_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "view",
        "show a scene in the browser, rendered while one moves around",
        ["wavefront view scene.glb", "wavefront view part.stl --no-browser --port 9000"],
    )
    command.add_argument("scene", help=SCENE_FILE)
    command.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen at; 0.0.0.0 lets the network in, with the token",
    )
    command.add_argument("--port", type=int, default=8080, help="port to listen at, or one of the next")
    token = command.add_mutually_exclusive_group()
    token.add_argument(
        "--token",
        default=True,
        help="what the page's address has as ?token=; others see it here (default: drawn)",
    )
    token.add_argument("--no-token", dest="token", action="store_false", help="let in all who can connect")
    command.add_argument(
        "--tone", choices=TONE_NAMES, default="auto", help="tone curve that the page begins with"
    )
    command.add_argument("--no-browser", action="store_true", help="do not open the page")
    add_settings(command)
    command.set_defaults(run=_view)


def _view(options: argparse.Namespace) -> int:
    view(
        read_scene(options.scene, options, None),
        host=options.host,
        port=options.port,
        token=options.token,
        tone=options.tone,
        open_browser=not options.no_browser,
        block=True,
        **framing(options),
        **setting_values(options),
    )
    return 0

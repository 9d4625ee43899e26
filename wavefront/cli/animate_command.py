"""The command `wavefront animate`: the motion of a file as an animation."""

from __future__ import annotations

import argparse
from copy import copy

from ..animation import check_animation, save_animation
from ..core.errors import SceneError, number
from ..core.plural import plural
from ..core.progress import Progress
from ..drive.frames import frame_times, render_frames
from ..io.to_scene import choose_camera
from ..motion.turn import Turn
from ..scene import Scene
from .command import SCENE_FILE, add_command
from .messages import print_done
from .options import framing, read_scene, setting_values
from .view_commands import add_settings_of_series, checked_display


def add_animate_command(commands: object) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "animate",
        "render what moves in a file",
        [
            "wavefront animate fox.glb -o fox.mp4 --fps 24 --animation Run --turntable 90",
            "wavefront animate fox.glb -o 'frame_{:03d}.png' --checkpoint 'fox_{:03d}.wfck'",
        ],
    )
    command.add_argument("scene", help=SCENE_FILE)
    command.add_argument(
        "-o",
        "--output",
        default="animation.gif",
        help="gif, png (animated) or mp4 file to write, or numbered files such as frame_{:03d}.png",
    )
    command.add_argument("--fps", type=float, default=24.0, help="pictures per second of the file")
    command.add_argument("--start", type=float, help="seconds of the file (default: where it begins to move)")
    command.add_argument("--end", type=float, help="seconds of the file (default: where all motion is over)")
    command.add_argument(
        "--turntable", type=float, default=0.0, help="degrees by which the view turns meanwhile"
    )
    add_settings_of_series(command, own=("shutter",))
    shutter_help = "part of the time of a picture for which the shutter is open, such as 0.5"
    command.add_argument("--shutter", type=float, metavar="PART", help=shutter_help)
    command.set_defaults(run=_animate)


def _animate(options: argparse.Namespace) -> int:
    check_animation(options.output)
    if options.time is not None:
        raise SceneError("--time is one moment; give --start and --end")
    display = checked_display(options)
    progress: Progress = False if options.quiet else None
    scene = read_scene(options.scene, options, progress)
    start = scene.start if options.start is None else number("--start", options.start)
    end = scene.end if options.end is None else number("--end", options.end)
    if end < start:
        raise SceneError(f"--end is {end:g}, before the start at {start:g} s")
    times = frame_times(None, options.fps, (start, end))
    if len(times) == 1 and not options.turntable:
        raise SceneError(
            f"{options.scene}: nothing moves for longer than a picture; give --turntable or --end"
        )
    settings = {"progress": progress, **setting_values(options)}
    images = render_frames(_turning(scene, options, start, end), times, fps=options.fps, **settings)
    written = save_animation(options.output, images, fps=options.fps, **display)
    print_done(f"{options.output}: {plural(written, 'picture')}")
    return 0


def _turning(scene: Scene, options: argparse.Namespace, start: float, end: float) -> Scene:
    """Return a scene with a camera, which turns around the middle of all times."""
    view_options, degrees = framing(options), number("--turntable", options.turntable)
    size, view, fov = view_options["size"], view_options["view"], view_options["fov"]
    camera, _ = choose_camera(scene, None, size, options.up, view, fov, turning=bool(degrees))
    if degrees:
        turn = Turn(scene.vertical(options.up), scene.reach.mean(0), degrees, start, max(start, end))
        camera = camera.transformed(turn)
    turning = copy(scene)
    turning.camera = camera
    return turning

"""`wavefront turntable`."""

from __future__ import annotations

import argparse
from typing import Any

from ..animation import check_animation, save_animation
from ..core.counted import counted
from ..views import render_many, turntable
from .arguments import count
from .command import add_command, add_scene
from .messages import print_done
from .options import add_display, add_settings, display_of, read_scene, setting_values


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
    add_scene(command)
    command.add_argument(
        "-o",
        "--output",
        default="turntable.gif",
        help="gif, png (animated) or mp4 file to write, or numbered files such as frame_{:03d}.png",
    )
    command.add_argument("--frames", type=count, default=60, help="pictures of a whole turn")
    command.add_argument("--fps", type=float, default=24.0, help="pictures per second")
    add_settings(command)
    add_display(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(run=_turntable)


def _turntable(options: argparse.Namespace) -> int:
    check_animation(options.output)
    display = display_of(options)
    progress = False if options.quiet else None
    scene = read_scene(options.scene, options, progress)
    cameras = turntable(
        scene, options.frames, size=options.size, up=options.up, view=options.view, fov=options.fov
    )
    images = render_many(scene, cameras, progress=progress, **setting_values(options))
    count = save_animation(
        options.output,
        images,
        fps=options.fps,
        gamma=display.gamma,
        exposure=display.exposure,
        tone=display.tone,
        white_balance=display.white_balance,
    )
    print_done(f"{options.output}: {counted(count, 'picture')}")
    return 0

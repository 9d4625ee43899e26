"""`wavefront dataset`."""

from __future__ import annotations

import argparse
from typing import Any

from ..core.counted import counted
from ..datasets import write_dataset
from ..datasets.dataset import FORMATS
from ..views import turntable
from .arguments import Several, count
from .command import add_command, add_scene
from .messages import print_done
from .options import add_display, add_settings, display_of, read_scene, setting_values


def add_dataset_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "dataset",
        "render views around a scene with annotations, for machine learning",
        [
            "wavefront dataset scene.glb -o set --views 200 --spp 64 --size 640x480",
            "wavefront dataset parts.obj -o set --format coco --format bop --object bolt --object nut",
        ],
    )
    add_scene(command)
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
    command.add_argument("--millimeters", type=float, default=1000.0, help="length of a scene unit, for BOP")
    command.add_argument(
        "--depth-scale", type=float, help="millimeters of a code of BOP's depth (default: 0.1 or more)"
    )
    add_settings(command)
    add_display(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(run=_dataset)


def _dataset(options: argparse.Namespace) -> int:
    display = display_of(options)
    progress = False if options.quiet else None
    scene = read_scene(options.scene, options, progress)
    cameras = turntable(
        scene, options.views, size=options.size, up=options.up, view=options.view, fov=options.fov
    )
    rendered = write_dataset(
        options.output,
        scene,
        cameras,
        format=options.format or FORMATS[0],
        objects=options.object or None,
        millimeters=options.millimeters,
        depth_scale=options.depth_scale,
        gamma=display.gamma,
        exposure=display.exposure,
        tone=display.tone,
        white_balance=display.white_balance,
        progress=progress,
        **setting_values(options),
    )
    earlier = len(cameras) - rendered
    before = f", {earlier} of them there before" if earlier else ""
    print_done(f"{options.output}: {counted(len(cameras), 'view')}{before}")
    return 0

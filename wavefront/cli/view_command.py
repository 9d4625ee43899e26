"""`wavefront view`."""

from __future__ import annotations

import argparse
from typing import Any

from ..codecs.tone import TONES
from ..viewer import view
from .command import add_command, add_scene
from .options import add_settings, read_scene, setting_values


def add_view_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "view",
        "show a scene in the browser, rendered while one moves around",
        ["wavefront view scene.glb", "wavefront view part.stl --no-browser --port 9000"],
    )
    add_scene(command)
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
    command.add_argument("--tone", choices=TONES, default="none", help="tone curve that the page begins with")
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
        size=options.size,
        view=options.view,
        fov=options.fov,
        **setting_values(options),
    )
    return 0

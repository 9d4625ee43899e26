"""The command line: options, signals and the exit status."""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ..errors import SceneError
from ..version import VERSION
from .arguments import joined
from .compare_command import compare_pictures
from .info_command import describe_scene
from .render_command import add_render_command
from .resume_command import add_resume_commands
from .status import ERROR, INTERRUPTED, TERMINATED
from .turntable_command import add_turntable_command
from .view_command import add_view_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files may be in no encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    words = joined(sys.argv[1:] if arguments is None else arguments)
    options = parser().parse_args(words, argparse.Namespace(arguments=words, folder=os.getcwd()))
    with _sigterm_as_ctrl_c() as sigterm, warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: _show_warning(message)
        try:
            status: int = options.run(options)
        except (SceneError, OSError) as error:
            print(f"wavefront: error: {error}", file=sys.stderr)
            return ERROR
        except KeyboardInterrupt:
            status = INTERRUPTED
    return TERMINATED if sigterm.came and status == INTERRUPTED else status


class _Sigterm:
    """What to do at SIGTERM: the same as at Ctrl-C, which keeps the picture; a second one ends at once."""

    came = False

    def handle(self, signal_number: int, frame: Any) -> None:
        """Handle the signal."""
        self.came = True
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if not callable(signal.getsignal(signal.SIGINT)):  # ignored, as in the background
            raise SystemExit(TERMINATED)
        signal.raise_signal(signal.SIGINT)


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[_Sigterm]:
    """Handle SIGTERM as Ctrl-C."""
    sigterm = _Sigterm()
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield sigterm
        return
    before = signal.signal(signal.SIGTERM, sigterm.handle)
    try:
        yield sigterm
    finally:
        signal.signal(signal.SIGTERM, before)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(prog="wavefront", description="A path tracer in whole-array NumPy.")
    top.add_argument("--version", action="version", version=VERSION)
    commands = top.add_subparsers(required=True, metavar="command")
    add_render_command(commands)
    add_turntable_command(commands)
    add_view_command(commands)
    add_resume_commands(commands, top)
    info = commands.add_parser("info", help="say what a scene file holds")
    info.add_argument("scene", help="obj, ply, stl, glb or gltf file")
    info.set_defaults(run=describe_scene)
    measure = commands.add_parser("compare", help="say how far a picture is from a reference")
    measure.add_argument("picture", help="png, jpg, exr, hdr, npy or npz file")
    measure.add_argument("reference", help="the same, of the same size")
    measure.add_argument("-o", "--output", help="where to write the absolute difference")
    measure.set_defaults(run=compare_pictures)
    return top


def _show_warning(message: Warning | str) -> None:
    print(f"wavefront: warning: {message}", file=sys.stderr)

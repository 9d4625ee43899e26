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

from ..errors import RenderError, SceneError
from ..version import VERSION
from .arguments import joined
from .command import COMMAND, Parser
from .compare_command import add_compare_command
from .completion_command import add_completion_command
from .dataset_command import add_dataset_command
from .doctor_command import add_doctor_command
from .info_command import add_info_command
from .messages import print_error, print_note, print_warning
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
        warnings.showwarning = lambda message, *_: print_warning(message)
        try:
            status: int = options.run(options)
        except (SceneError, RenderError, ImportError, OSError, MemoryError) as error:
            print_error(error)
            return ERROR
        except KeyboardInterrupt as stop:
            if str(stop):
                print_note(stop)
            status = INTERRUPTED
    return TERMINATED if sigterm.came and status == INTERRUPTED else status


class _Sigterm:
    """What to do at SIGTERM: the same as at Ctrl-C, which keeps the picture; a second one ends at once."""

    came = False

    def handle(self, signal_number: int, frame: Any) -> None:
        """Handle the signal."""
        self.came = True
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[_Sigterm]:
    """Handle SIGTERM as Ctrl-C."""
    sigterm = _Sigterm()
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield sigterm
        return
    before = signal.signal(signal.SIGTERM, sigterm.handle)
    if not callable(signal.getsignal(signal.SIGINT)):  # ignored, as in the background of a script
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        sigterm.came = True  # if anything interrupts
    try:
        yield sigterm
    finally:
        signal.signal(signal.SIGTERM, before)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = Parser(
        prog="wavefront",
        description="A path tracer in whole-array NumPy.",
        epilog="wavefront COMMAND --help has the options of a command, and examples. Exit status: 0 done, "
        "1 doctor found a fault, 2 error, 130 stopped by Ctrl-C, 143 by SIGTERM.",
    )
    top.add_argument("--version", action="version", version=VERSION)
    commands = top.add_subparsers(required=True, metavar=COMMAND)
    add_render_command(commands)
    add_turntable_command(commands)
    add_view_command(commands)
    add_dataset_command(commands)
    add_resume_commands(commands, top)
    add_info_command(commands)
    add_compare_command(commands)
    add_doctor_command(commands)
    add_completion_command(commands, top)
    return top

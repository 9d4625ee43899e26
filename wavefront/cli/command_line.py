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

from ..core.errors import RenderError, SceneError
from ..scheduling.interrupt import SIGNALS
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
from .status import ERROR, HUNG_UP, INTERRUPTED, TERMINATED
from .turntable_command import add_turntable_command
from .view_command import add_view_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files may be in no encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    words = joined(sys.argv[1:] if arguments is None else arguments)
    options = parser().parse_args(words, argparse.Namespace(arguments=words, folder=os.getcwd()))
    with _endings_as_ctrl_c() as ending, warnings.catch_warnings():
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
    return ending.status if status == INTERRUPTED else status


class _Ending:
    """What to do at SIGTERM and SIGHUP: the same as at Ctrl-C, which keeps the picture.

    A second SIGTERM ends the program at once. SIGHUP, which says that the terminal was closed, may come from
    the system and from the shell, and beside SIGTERM: it counts once.

    Attributes
    ----------
    status
        The exit status, if one of them interrupts the program.
    """

    status = INTERRUPTED

    def __init__(self) -> None:
        ends = {number: signal.getsignal(number) for number in SIGNALS if number != signal.SIGINT}
        self.before = {number: handler for number, handler in ends.items() if handler != signal.SIG_IGN}

    def handle(self, number: int, frame: Any) -> None:
        """Handle the signal."""
        self.status = TERMINATED if number == signal.SIGTERM else HUNG_UP
        for each in self.before:
            if each != signal.SIGTERM:
                signal.signal(each, signal.SIG_IGN)
            elif each == number:
                signal.signal(each, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)


@contextmanager
def _endings_as_ctrl_c() -> Iterator[_Ending]:
    """Handle SIGTERM and SIGHUP as Ctrl-C, but for one that is ignored, as `nohup` has it."""
    ending = _Ending()
    if threading.current_thread() is not threading.main_thread():  # only that one may set handlers
        yield ending
        return
    handler: Any = ending.handle
    if not callable(signal.getsignal(signal.SIGINT)):  # ignored, as in the background of a script
        handler = signal.default_int_handler
        ending.status = TERMINATED  # if anything interrupts
    for number in ending.before:
        signal.signal(number, handler)
    try:
        yield ending
    finally:
        for number, before in ending.before.items():
            signal.signal(number, before)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = Parser(
        prog="wavefront",
        allow_abbrev=False,
        description="A path tracer in whole-array NumPy.",
        epilog="wavefront COMMAND --help has the options of a command, and examples. Exit status: 0 done, "
        "1 doctor found a fault, 2 error, 130 stopped by Ctrl-C, 143 by SIGTERM, 129 by a closed terminal.",
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

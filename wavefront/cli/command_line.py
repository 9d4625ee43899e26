"""The command line: its commands, their completion in a shell, signals and the exit status."""

from __future__ import annotations

import argparse
import io
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any

from ..core.errors import RenderError, SceneError
from ..core.interrupt import endings_as_ctrl_c
from ..version import VERSION
from .animate_command import add_animate_command
from .command import COMMAND, Parser, add_command
from .doctor_command import add_doctor_command
from .info_command import add_info_command
from .measure_command import add_measure_command
from .messages import (
    ERROR,
    INTERRUPTED,
    SIGNALED,
    print_error,
    print_note,
    print_warning,
)
from .options import joined
from .picture_commands import add_compare_command, add_merge_command
from .render_command import add_render_command, add_resume_command
from .view_commands import add_dataset_command, add_turntable_command, add_view_command

SHELLS = ("bash", "zsh")
FILES = ("scene", "scenes", "output", "checkpoint", "pictures", "picture", "reference", "points")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files may be in no encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    words = joined(sys.argv[1:] if arguments is None else arguments)
    options = parser().parse_args(words, argparse.Namespace(arguments=words, folder=os.getcwd()))
    with endings_as_ctrl_c() as endings, warnings.catch_warnings():
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
    return SIGNALED + endings[-1] if status == INTERRUPTED and endings else status


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
    add_animate_command(commands)
    add_view_command(commands)
    add_dataset_command(commands)
    add_measure_command(commands)
    add_resume_command(commands, top)
    add_merge_command(commands)
    add_info_command(commands)
    add_compare_command(commands)
    add_doctor_command(commands)
    add_completion_command(commands, top)
    return top


def add_completion_command(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the command to those of a parser, whose completion it prints."""
    command = add_command(
        commands,
        "completion",
        "print a script that completes commands and options in a shell (needs pip install shtab)",
        [
            "wavefront completion bash > ~/.local/share/bash-completion/completions/wavefront",
            "wavefront completion zsh > ~/.zfunc/_wavefront",
        ],
    )
    command.add_argument("shell", choices=SHELLS, help="the shell")
    command.set_defaults(run=lambda options: _print_script(parser, options.shell))


def _print_script(parser: argparse.ArgumentParser, shell: str) -> int:
    """Print the script for a shell; return the exit status."""
    if find_spec("shtab") is None:
        raise SceneError("completion needs pip install shtab")
    import shtab

    for action in _actions(parser):
        if action.dest in FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)

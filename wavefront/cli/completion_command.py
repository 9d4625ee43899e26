"""`wavefront completion`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

from ..core.errors import SceneError
from .command import add_command

SHELLS = ("bash", "zsh")
FILES = ("scene", "scenes", "output", "checkpoint", "pictures", "picture", "reference")


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

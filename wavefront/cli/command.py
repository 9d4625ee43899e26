"""Commands of the command line: their help with examples, and their errors on one line."""

from __future__ import annotations

import argparse
import os
from typing import Any, NoReturn

from ..core.errors import SceneError
from ..core.suggestions import did_you_mean, meant
from .messages import ERROR

COMMAND = "command"  # the name of the first word in messages
SCENE_FILE = "obj, ply, stl, off, glb, gltf, dae, 3mf, pbrt or Mitsuba xml file"
PICTURE_FILE = "png, jpg, exr, hdr, npy or npz file"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, with a suggestion."""

    def parse_known_args(  # type: ignore[override]
        self, args: Any = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse unknown arguments here, where the options of the command are known."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            names = [name.lstrip("-").replace("-", "_") for name in self._option_string_actions]
            option = meant(unknown[0].partition("=")[0].lstrip("-").replace("-", "_"), names)
            hint = f"; did you mean --{option.replace('_', '-')}?" if option and unknown[0][0] == "-" else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return options, []

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        """Read a value; the message of a check stays as it is."""
        try:
            return super()._get_value(action, arg_string)
        except argparse.ArgumentError as error:
            if isinstance(error.__context__, SceneError):
                error.message = str(error.__context__)
            raise

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is none of the choices."""
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            hint = did_you_mean(value, map(str, action.choices or ()))
            if action.metavar == COMMAND and os.path.isfile(value):
                hint = f"; to render a file: {self.prog} render {value}"
            raise argparse.ArgumentError(action, error.message + hint) from None

    def error(self, message: str) -> NoReturn:
        """Print an error, and end the program."""
        self.exit(ERROR, f"{self.prog}: error: {message}; see {self.prog} --help\n")


class Help(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Names defaults where there are any, and keeps the lines of examples."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default in (None, ()) else super()._get_help_string(action)


def add_command(commands: Any, name: str, what: str, examples: list[str]) -> argparse.ArgumentParser:
    """Add a command to those of a parser: what it does, and command lines that end its help."""
    lines = "\n".join(f"  {example}" for example in examples)
    command: argparse.ArgumentParser = commands.add_parser(
        name,
        help=what,
        description=what[0].upper() + what[1:] + ".",
        epilog=f"examples:\n{lines}",
        formatter_class=Help,
        allow_abbrev=False,  # an option of a later version would change what an abbreviation means
    )
    return command

"""The program `wavefront`: a file for each command, and the code that they share."""

from .command_line import main, parser

__all__ = ["main", "parser"]

"""The program `wavefront`: a file for each command, and what they share."""

from .command_line import main, parser

__all__ = ["main", "parser"]

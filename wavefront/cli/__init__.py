"""`wavefront render`, `resume`, `merge`, `info` and `compare`."""

from .command_line import main, parser

__all__ = ["main", "parser"]

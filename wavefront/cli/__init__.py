"""`wavefront render`, `wavefront info` and `wavefront compare`."""

from .command_line import main, parser

__all__ = ["main", "parser"]

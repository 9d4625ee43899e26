"""Messages of the command line, a line each, to standard error."""

from __future__ import annotations

import sys


def print_error(error: BaseException | str) -> None:
    """Say what went wrong."""
    out_of_memory = isinstance(error, MemoryError) and not str(error)
    _print_line(f"error: {'out of memory' if out_of_memory else error}")


def print_warning(message: Warning | str) -> None:
    """Say what should be known."""
    _print_line(f"warning: {message}")


def print_note(message: object) -> None:
    """Say something else."""
    _print_line(str(message))


def _print_line(text: str) -> None:
    print("wavefront: " + " ".join(text.splitlines()), file=sys.stderr)

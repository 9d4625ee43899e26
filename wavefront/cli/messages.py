"""The messages of the command line, a line each, and its exit statuses.

A message that cannot be shown is lost, and ends nothing.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TextIO

FAULT = 1  # `doctor` found one
ERROR = 2  # as argparse has it
SIGNALED = 128  # plus the number of a signal that ended the program, as shells report it
INTERRUPTED = 130  # by SIGINT


def print_error(error: BaseException | str) -> None:
    """Print an error."""
    out_of_memory = isinstance(error, MemoryError) and not str(error)
    _print_line(f"error: {'out of memory' if out_of_memory else error}")


def print_warning(message: Warning | str) -> None:
    """Print a note."""
    _print_line(f"warning: {message}")


def print_note(message: object) -> None:
    """Say something else."""
    _print_line(str(message))


def print_done(text: str) -> None:
    """Print to standard output that a file was written; the file is there in any case."""
    _print_to(sys.stdout, text)


def _print_line(text: str) -> None:
    _print_to(sys.stderr, "wavefront: " + " ".join(text.splitlines()))


def _print_to(file: TextIO | None, text: str) -> None:
    """Print where there is a file that takes it: a terminal may be closed, a disk full."""
    if file is not None:
        with suppress(OSError, ValueError):
            print(text, file=file, flush=True)

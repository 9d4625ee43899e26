"""`wavefront compare`."""

from __future__ import annotations

import argparse
from typing import Any

from ..codecs.images import check_writable
from ..image.comparison import compare
from .command import PICTURE_FILE, add_command


def add_compare_command(commands: Any) -> None:
    """Add the command to a parser's commands."""
    command = add_command(
        commands,
        "compare",
        "say how far a picture is from a reference, and whether noise alone explains it",
        ["wavefront compare out.npz reference.npz", "wavefront compare a.png b.png -o difference.png"],
    )
    command.add_argument("picture", help=PICTURE_FILE)
    command.add_argument(
        "reference", help="the same, of the same size; p-values need npz or exr files of both, of other seeds"
    )
    command.add_argument("-o", "--output", help="where to write the absolute difference")
    command.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> int:
    """Say how far a picture is from a reference; return the exit status."""
    if options.output:
        check_writable(options.output)
    result = compare(options.picture, options.reference)
    print(result)
    if options.output:
        result.difference.save(options.output)
    return 0

"""`wavefront resume` and `wavefront merge`."""

from __future__ import annotations

import argparse
import os
from typing import Any

from ..codecs.images import check_writable
from ..core.errors import SceneError
from ..film.checkpoint_file import contents_of, read_header
from ..image import Image
from .command import PICTURE_FILE, add_command
from .messages import print_done


def add_resume_commands(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the commands to those of a parser."""
    resume = add_command(
        commands,
        "resume",
        "go on with a render that wavefront render --checkpoint began",
        ["wavefront resume out.wfck"],
    )
    resume.add_argument("checkpoint", help="the file that --checkpoint named")
    resume.set_defaults(run=lambda options: _resume(options.checkpoint, parser))
    merge = add_command(
        commands,
        "merge",
        "join pictures of different samples of one scene",
        ["wavefront merge part0.npz part1.npz -o out.exr"],
    )
    merge.add_argument("pictures", nargs="+", help="npz files of render --samples, or checkpoints")
    merge.add_argument("-o", "--output", required=True, help=f"{PICTURE_FILE} to write")
    merge.set_defaults(run=_merge)


def _resume(path: str, parser: argparse.ArgumentParser) -> int:
    """Give the command that began a render once more; return the exit status."""
    with contents_of(path):
        command = read_header(path)["command"]
        if command is None:
            raise SceneError(f"{path}: was not begun by wavefront render; call render(checkpoint=...) again")
        arguments, folder = command["arguments"], os.fspath(command["folder"])
        if not all(isinstance(each, str) for each in arguments):
            raise TypeError("an argument is no text")
    options = parser.parse_args(arguments)
    options.arguments, options.folder = arguments, folder
    options.scenes = [os.path.join(options.folder, each) for each in options.scenes]
    options.output = os.path.join(options.folder, options.output)
    options.checkpoint = path
    status: int = options.run(options)
    return status


def _merge(options: argparse.Namespace) -> int:
    """Write the picture of the samples of several; return the exit status."""
    check_writable(options.output)
    merged: Image | None = None
    for path in options.pictures:
        picture = Image.load(path)
        try:
            merged = picture if merged is None else merged.merge(picture)
        except SceneError as error:
            raise SceneError(f"{path}: {error}") from error
    assert merged is not None
    merged.save(options.output)
    print_done(f"{options.output}: {merged.spp} spp, samples {_listed(merged.metadata['sample_ranges'])}")
    return 0


def _listed(ranges: list[list[int]]) -> str:
    return ", ".join(f"{first}:{end}" for first, end in ranges)

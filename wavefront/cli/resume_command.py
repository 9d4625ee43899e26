"""`wavefront resume` and `wavefront merge`."""

from __future__ import annotations

import argparse
import os
from typing import Any

from ..checkpoint_file import read_header
from ..codecs.images import check_writable
from ..errors import SceneError
from ..image import Image


def add_resume_commands(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the commands to those of a parser."""
    resume = commands.add_parser(
        "resume", help="go on with a render that wavefront render --checkpoint began"
    )
    resume.add_argument("checkpoint", help="the file that --checkpoint named")
    resume.set_defaults(run=lambda options: _resume(options.checkpoint, parser))
    merge = commands.add_parser("merge", help="join pictures of different samples of one scene")
    merge.add_argument("pictures", nargs="+", help="npz files of render --samples, or checkpoints")
    merge.add_argument("-o", "--output", required=True, help="png, jpg, exr, hdr, npy or npz file to write")
    merge.set_defaults(run=_merge)


def _resume(path: str, parser: argparse.ArgumentParser) -> int:
    """Give the command that began a render once more; return the exit status."""
    command = read_header(path)["command"]
    if command is None:
        raise SceneError(f"{path}: was not begun by wavefront render; call render(checkpoint=...) again")
    options = parser.parse_args(command["arguments"])
    options.arguments, options.folder = command["arguments"], command["folder"]
    options.scene, options.output = (
        os.path.join(options.folder, each) for each in (options.scene, options.output)
    )
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
    print(f"{options.output}: {merged.spp} spp, samples {_listed(merged.metadata['sample_ranges'])}")
    return 0


def _listed(ranges: list[list[int]]) -> str:
    return ", ".join(f"{first}:{end}" for first, end in ranges)

"""Commands about pictures: `wavefront merge` and `wavefront compare`."""

from __future__ import annotations

import argparse
from typing import Any

from ..codecs.images import check_writable
from ..core.errors import SceneError
from ..film.aov_names import BEFORE_DENOISING
from ..image import Image
from ..image.comparison import compare
from .command import PICTURE_FILE, add_command
from .messages import print_done


def add_merge_command(commands: Any) -> None:
    """Add the command to a parser's commands."""
    command = add_command(
        commands,
        "merge",
        "join pictures of different samples of one scene",
        ["wavefront merge part0.npz part1.npz -o out.exr"],
    )
    command.add_argument("pictures", nargs="+", help="npz files of render --samples, or checkpoints")
    command.add_argument("-o", "--output", required=True, help=f"{PICTURE_FILE} to write")
    command.set_defaults(run=_merge)


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
    before = ", before denoising" if merged.metadata.get(BEFORE_DENOISING) else ""
    samples = _listed(merged.metadata["sample_ranges"])
    print_done(f"{options.output}: {merged.spp} spp, samples {samples}{before}")
    return 0


def _listed(ranges: list[list[int]]) -> str:
    return ", ".join(f"{first}:{end}" for first, end in ranges)


def _compare(options: argparse.Namespace) -> int:
    """Say how far a picture is from a reference; return the exit status."""
    if options.output:
        check_writable(options.output)
    result = compare(options.picture, options.reference)
    print(result)
    if options.output:
        result.difference.save(options.output)
    return 0

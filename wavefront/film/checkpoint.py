"""Checkpoints: renders that were begun, as files from which they go on."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping
from operator import index
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..core.errors import SceneError, in_brief
from ..core.files import check_size
from ..version import VERSION
from . import checkpoint_file
from .identity import differences
from .picture_sums import PictureSums, identified_sums

PIXELS = "pixels"  # the array of those of the pass
VERSIONS = {"wavefront": VERSION, "numpy": np.__version__}

FORM: dict[str, type | tuple[type, ...]] = {  # of a header
    **dict.fromkeys((*VERSIONS, "python"), str),
    **dict.fromkeys(("identity", "metadata", "state"), dict),
    "command": (dict, type(None)),
}

SumsMaker = Callable[[Mapping[str, Any]], PictureSums]  # of the header


@soa
class Checkpoint:
    """A render that was begun."""

    sums: PictureSums
    metadata: dict[str, Any]  # of the picture so far
    state: dict[str, Any]  # what a render counts, and the first sample of the pass
    pixels: NDArray[Any] | None  # row-major indices of those in the pass; None: all
    command: dict[str, Any] | None = None  # the call of the command line that began it

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the checkpoint; the file holds its old content until all of the new content is there.

        Raises
        ------
        SaveError
            If it cannot be written.
        """
        header = {
            **VERSIONS,
            "python": platform.python_version(),
            "identity": self.sums.identity,
            "metadata": self.metadata,
            "state": self.state,
            "command": self.command,
        }
        arrays = self.sums.arrays()
        if self.pixels is not None:
            arrays[PIXELS] = self.pixels.astype(np.int64)
        checkpoint_file.write(path, header, arrays)


def sums_of(header: Mapping[str, Any]) -> PictureSums:
    """Return sums for the samples of a checkpoint with a header."""
    width, height = (index(side) for side in header["identity"]["size"])
    check_size(height, width)
    return identified_sums(header["identity"])


def read_checkpoint(path: str | os.PathLike[str], make_sums: SumsMaker = sums_of) -> Checkpoint:
    """Return a checkpoint.

    Parameters
    ----------
    path
        The file.
    make_sums
        Checks the header, and returns sums, which then become those of the file.

    Raises
    ------
    SceneError
        If the file is missing, damaged, of another kind or version. The message names it.
    """
    made: list[PictureSums] = []

    def places(header: Mapping[str, Any]) -> Mapping[str, NDArray[Any]]:
        for key, kind in FORM.items():
            if not isinstance(header[key], kind):
                raise TypeError(f"{key} is {in_brief(header[key])}")
        made.append(make_sums(header))
        return made[0].arrays()

    header, arrays = checkpoint_file.read(path, places)
    pixels = arrays.pop(PIXELS, None)
    with checkpoint_file.contents_of(path):
        made[0].restore(arrays)
        count = made[0].film.count
        if count.min() < 0 or (pixels is not None and not _are_pixels(pixels, count.size)):
            raise ValueError("counts of samples or numbers of pixels are out of range")
    return Checkpoint(
        made[0],
        header["metadata"],
        header["state"],
        None if pixels is None else pixels.astype(np.uint32),
        header["command"],
    )


def _are_pixels(pixels: NDArray[Any], count: int) -> bool:
    """Return whether an array holds indices of pixels."""
    whole = pixels.ndim == 1 and pixels.dtype.kind == "i"
    return whole and bool(((pixels >= 0) & (pixels < count)).all())


def check_identity(path: str | os.PathLike[str], before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Check that a render can go on from a checkpoint.

    Raises
    ------
    SceneError
        If not. The message names what differs.
    """
    found = differences(before, now)
    if found:
        raise SceneError(
            f"{os.fspath(path)}: is the checkpoint of another render: {', '.join(found)}; "
            "render as before, or choose another file"
        )


def other_versions(header: Mapping[str, Any]) -> str:
    """Return which versions a file was written with, if they are not those of this program; else ""."""
    return ", ".join(
        f"{name} {header[name]}, now {now}" for name, now in VERSIONS.items() if header[name] != now
    )

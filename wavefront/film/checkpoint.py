"""Checkpoints: renders that were begun, as files from which they go on.

A checkpoint is an npz file (`core/npz.py`), as that of a picture with its sums, but without values that
follow from the sums. Its first member, "checkpoint", is JSON text with all else that a render needs to go on.
Nothing is pickled: reading runs no code of the file.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..core.errors import SceneError, in_brief, printable
from ..core.files import check_regular, check_size, write_chunks
from ..core.npz import DAMAGED, SUMS, npz_chunks, open_npz, read_array
from ..version import VERSION
from .identity import differences
from .picture_sums import MALFORMED, PictureSums, identified_sums

if TYPE_CHECKING:
    from zipfile import ZipFile

HEADER = "checkpoint"  # the array of JSON text, which comes first
START = slice(30, 40)  # bytes of the file that are this name
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
    state: dict[str, Any]  # the counters of a render, and the first sample of the pass
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
        arrays = {SUMS + name: array for name, array in self.sums.arrays().items()}
        if self.pixels is not None:
            arrays[PIXELS] = self.pixels.astype(np.int64)
        write_chunks(path, partial(npz_chunks, {HEADER: np.array(json.dumps(header)), **arrays}))


def is_checkpoint(path: str | os.PathLike[str]) -> bool:
    """Return whether a file begins as checkpoints do."""
    try:
        check_regular(path)
        with open(path, "rb") as file:
            return file.read(START.stop)[START] == HEADER.encode()
    except (SceneError, OSError):
        return False


@contextmanager
def contents_of(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise a SceneError that names a file whose contents are wrong, though their checksum is right."""
    name = os.fspath(path)
    try:
        yield
    except SceneError as error:
        if str(error).startswith(printable(name)):
            raise
        raise SceneError(f"{name}: {error}") from error
    except OSError as error:
        raise SceneError(f"{name}: cannot be read: {error}") from error
    except MALFORMED as error:
        what = f"its contents are not those of a checkpoint ({type(error).__name__}: {error})"
        raise SceneError(f"{name}: {what}; it {DAMAGED}") from error


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[tuple[ZipFile, dict[str, Any]]]:
    """Open a checkpoint: its arrays, of which no bit is damaged, and its header, which has the right form."""
    check_regular(path)
    with contents_of(path), open(path, "rb") as file:
        if not is_checkpoint(path):
            raise SceneError("is not a checkpoint of wavefront, or its first bytes are damaged")
        archive = open_npz(file)
        header: dict[str, Any] = json.loads(str(read_array(archive, HEADER)))
        for key, kind in FORM.items():
            if not isinstance(header[key], kind):
                raise TypeError(f"{key} is {in_brief(header[key])}")
        width, height = (index(side) for side in header["identity"]["size"])
        check_size(height, width)
        if width * height > os.fstat(file.fileno()).st_size:  # before memory for so many is taken
            raise ValueError(f"it has no sums of {width} × {height} pixels")
        yield archive, header


def read_header(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the header of a checkpoint: all but its arrays.

    Raises
    ------
    SceneError
        As for `read_checkpoint`.
    """
    with _opened(path) as (_, header):
        return header


def _identified_sums(header: Mapping[str, Any]) -> PictureSums:
    return identified_sums(header["identity"])


def read_checkpoint(path: str | os.PathLike[str], make_sums: SumsMaker = _identified_sums) -> Checkpoint:
    """Return a checkpoint, all of it checked.

    Parameters
    ----------
    path
        The file.
    make_sums
        Checks the header, and returns sums, which then become those of the file.

    Raises
    ------
    SceneError
        If the file is missing, damaged, truncated, or of another kind. The message names it.
    """
    with _opened(path) as (archive, header):
        sums = make_sums(header)
        places = {SUMS + name: array for name, array in sums.arrays().items()}
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        arrays = {name: read_array(archive, name, places.get(name)) for name in names}
        sums.restore(arrays, SUMS)
        count, pixels = sums.film.count, arrays.get(PIXELS)
        if count.min() < 0 or (pixels is not None and not _are_pixels(pixels, count.size)):
            raise ValueError("counts of samples or numbers of pixels are out of range")
        return Checkpoint(
            sums,
            header["metadata"],
            header["state"],
            None if pixels is None else pixels.astype(np.uint32),
            header["command"],
        )


def _are_pixels(pixels: NDArray[Any], count: int) -> bool:
    """Return whether an array holds indices of pixels."""
    whole = pixels.ndim == 1 and pixels.dtype.kind == "i"
    return whole and bool(((pixels >= 0) & (pixels < count)).all())


def check_identity(
    path: str | os.PathLike[str], before: Mapping[str, Any], now: Mapping[str, Any], otherwise: str = ""
) -> None:
    """Check that a render can go on from a checkpoint.

    Parameters
    ----------
    path
        Of the file.
    before, now
        The identities of the two renders, which must agree.
    otherwise
        Further words of the message.

    Raises
    ------
    SceneError
        If not. The message names the differences.
    """
    changed = differences(before, now)
    if changed:
        raise SceneError(
            f"{os.fspath(path)}: is the checkpoint of another render: {', '.join(changed)}; "
            f"render as before, or choose another file{otherwise}"
        )


def other_versions(header: Mapping[str, Any]) -> str:
    """Return which versions a file was written with, if they are not those of this program; else ""."""
    return ", ".join(
        f"{name} {header[name]}, now {now}" for name, now in VERSIONS.items() if header[name] != now
    )

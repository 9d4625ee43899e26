"""Pictures as archives of NumPy: every array under its name, metadata as JSON text, nothing pickled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from ..core.npz import KINDS, MAX_HEADER, METADATA, SUMS, npz_chunks
from ..core.plural import plural
from .archive import checked_members
from .budget import Budget
from .image_data import ImageData, from_json, from_named, to_json

if TYPE_CHECKING:
    import zipfile

MAX_ARRAYS = 2**12


def encode(picture: ImageData) -> bytes:
    """Return an npz file of all arrays of a picture, not compressed: noise hardly shrinks, and takes long."""
    sums = {SUMS + name: values for name, values in picture.sums.items()}
    return b"".join(npz_chunks({**picture.named(), **sums, METADATA: np.array(to_json(picture.info))}))


def decode(data: bytes, budget: Budget | None = None) -> ImageData:
    """Return the picture of an npz file.

    Every header is checked before an array is read.

    Raises
    ------
    SceneError
        If the file is not an archive of numeric arrays, claims more than it can hold, or has no rgb.
    """
    arrays = read_arrays(data, budget or Budget.of(data))
    text = arrays.pop(METADATA, np.array("{}"))
    if text.dtype.kind != "U" or text.ndim:
        raise SceneError(f"the array {METADATA!r} is {text.dtype} of shape {text.shape}; it must be one text")
    sums = {name: arrays.pop(name) for name in list(arrays) if name.startswith(SUMS)}
    picture = from_named(arrays, from_json(str(text)))
    return replace(picture, sums={name.removeprefix(SUMS): values for name, values in sums.items()})


def read_arrays(data: bytes, budget: Budget) -> dict[str, NDArray[Any]]:
    """Return the arrays of an npz file by their names; every header is checked before an array is read.

    Raises
    ------
    SceneError
        If it is damaged, claims more than it holds, or holds something else than numbers and text.
    """
    import zipfile

    with _typed("npz"), zipfile.ZipFile(BytesIO(data)) as archive:
        members = {
            member.filename.removesuffix(".npy"): member for member in checked_members(archive, MAX_ARRAYS)
        }
        shapes = {name: _shape(archive, member) for name, member in members.items()}
        if len(shapes.get("rgb", ())) > 1:
            budget.check_size(*shapes["rgb"][:2])
        claimed = sum(member.file_size for member in members.values())
        budget.charge(f"the content of {plural(len(members), 'array')}", claimed)
        return {name: _read(archive, member) for name, member in members.items()}


def read_array(data: bytes, budget: Budget) -> NDArray[Any]:
    """Return the array of an npy file, whose header is checked before.

    Raises
    ------
    SceneError
        As `read_arrays`.
    """
    with _typed("npy"):
        shape = _checked_shape("array", data[:MAX_HEADER], len(data))
        budget.charge(f"the array of shape {shape}", 2 * len(data))
        return np.asarray(np.lib.format.read_array(BytesIO(data), allow_pickle=False))


@contextmanager
def _typed(kind: str) -> Iterator[None]:
    """Convert the errors of zipfile, zlib and the parser of headers, which are of many types."""
    try:
        yield
    except (MemoryError, SceneError):
        raise
    except Exception as error:
        raise SceneError(f"not a readable {kind} file: {error or type(error).__name__}") from error


def _shape(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the shape of an array, after checking that its header claims what the archive holds."""
    with archive.open(member) as packed:
        return _checked_shape(member.filename, packed.read(MAX_HEADER), member.file_size)


def _checked_shape(name: str, start: bytes, available: int) -> tuple[int, ...]:
    """Return the shape of an array in the format npy, given its first bytes and its size in bytes."""
    file = BytesIO(start)
    major, _ = np.lib.format.read_magic(file)
    header = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}.get(major)
    if header is None:
        raise SceneError(f"the array {name!r} is of version {major} of npy; 1 and 2 are read")
    shape, _, kind = header(file)
    size = math.prod(shape) * kind.itemsize
    if kind.kind not in KINDS or kind.hasobject or size != available - file.tell():
        raise SceneError(
            f"the array {name!r} is {kind} of shape {shape}, in {available} bytes; "
            "only numbers and text of their own size are read"
        )
    return tuple(shape)


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as file:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))

"""Files of arrays with a checksum for each part, so that damage is noticed before anything is used.

A file is, with numbers in little-endian order:

- `MAGIC`, the version of the format (4 bytes), and the length of the header in bytes (4 bytes);
- the header, JSON text in UTF-8. Its "arrays" are [name, type, shape] of each array;
- the SHA-256 of all that;
- for each array its bytes in row-major order, and their SHA-256.

Nothing else follows. There is no compression and no pickle: reading runs no code of the file.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from io import BufferedReader
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError, printable
from ..core.files import check_regular, write_chunks
from ..core.plural import plural

MAGIC = b"\x93WFCK\r\n\n"
VERSION = 1
PRELUDE = struct.Struct("<8sII")
DIGEST = 32  # bytes of a SHA-256
MAX_HEADER = 2**24  # bytes
TYPES = ("<i8", "<i4", "<f8", "<f4")  # of arrays
DAMAGED = "is damaged: delete it, or restore it from a copy"
# errors of values of JSON of another form: a list in place of a number, text in place of a list
MALFORMED = (TypeError, KeyError, AttributeError, IndexError, ValueError, OverflowError, RecursionError)


def write(
    path: str | os.PathLike[str], header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Write a file; it holds its old content or all of the new content, whatever happens.

    Parameters
    ----------
    path
        Where to write.
    header
        Values of JSON.
    arrays
        Arrays by name.

    Raises
    ------
    SaveError
        If it cannot be written.
    """
    write_chunks(path, partial(_chunks, header, arrays))


def _chunks(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Iterator[Any]:
    listed = [[name, _type(array), list(array.shape)] for name, array in arrays.items()]
    text = json.dumps({**header, "arrays": listed}).encode()
    start = PRELUDE.pack(MAGIC, VERSION, len(text)) + text
    yield start + hashlib.sha256(start).digest()
    for (_, kind, _), array in zip(listed, arrays.values(), strict=True):
        data = _bytes_of(np.ascontiguousarray(array, np.dtype(str(kind))))
        yield data
        yield hashlib.sha256(data).digest()


def _type(array: NDArray[Any]) -> str:
    return array.dtype.newbyteorder("<").str


def is_checkpoint(path: str | os.PathLike[str]) -> bool:
    """Return whether a file begins as one of these does."""
    try:
        check_regular(path)
        with open(path, "rb") as file:
            return file.read(len(MAGIC)) == MAGIC
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
    except MALFORMED as error:
        what = f"its contents are not those of a checkpoint ({type(error).__name__}: {error})"
        raise SceneError(f"{name}: {what}; it {DAMAGED}") from error


def read_header(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the header of a file.

    Raises
    ------
    SceneError
        If the file is missing, of another kind or version, damaged or truncated. The message names it.
    """
    with _opened(path) as file, contents_of(path):
        return _header(file, os.fspath(path))


def read(
    path: str | os.PathLike[str], place_for: Callable[[dict[str, Any]], Mapping[str, NDArray[Any]]]
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the header and the arrays of a file, all of it checked.

    Parameters
    ----------
    path
        The file.
    place_for
        Given the header, returns arrays that are to be filled, by name. Others are made.

    Raises
    ------
    SceneError
        If the file is missing, of another kind or version, damaged or truncated. The message names it.
    """
    name = os.fspath(path)
    with _opened(path) as file, contents_of(path):
        header = _header(file, name)
        places = place_for(header)
        arrays = {}
        for key, kind, shape in header["arrays"]:
            place = places.get(key)
            if place is None or place.shape != tuple(shape) or place.dtype.str != kind:
                place = np.empty(shape, kind)
            _fill(file, place, f"{name}: the array {key!r}")
            arrays[key] = place
    return header, arrays


def _opened(path: str | os.PathLike[str]) -> BufferedReader:
    check_regular(path)
    try:
        return open(path, "rb")
    except OSError as error:
        raise SceneError(f"{os.fspath(path)}: cannot be read: {error}") from error


def _header(file: BufferedReader, name: str) -> dict[str, Any]:
    prelude = file.read(PRELUDE.size)
    if prelude[: len(MAGIC)] != MAGIC:
        raise SceneError(f"{name}: is not a checkpoint of wavefront, or its first bytes are damaged")
    if len(prelude) < PRELUDE.size:
        raise SceneError(f"{name}: is truncated after {plural(len(prelude), 'byte')}; it {DAMAGED}")
    _, version, length = PRELUDE.unpack(prelude)
    if version != VERSION:
        raise SceneError(f"{name}: has version {version} of the format; this program reads {VERSION}")
    text = file.read(min(length, MAX_HEADER))
    if file.read(DIGEST) != hashlib.sha256(prelude + text).digest():
        raise SceneError(f"{name}: the header {DAMAGED}")
    header: dict[str, Any] = json.loads(text.decode())
    size = file.tell() + sum(_size(kind, shape, name) + DIGEST for _, kind, shape in header["arrays"])
    found = os.fstat(file.fileno()).st_size
    if found != size:
        raise SceneError(f"{name}: has {plural(found, 'byte')} and should have {size}; it {DAMAGED}")
    return header


def _size(kind: str, shape: list[int], name: str) -> int:
    """Return the bytes of an array, after checking what the header claims of it."""
    whole = all(isinstance(each, int) and each >= 0 for each in shape)
    if kind not in TYPES or not whole:
        raise SceneError(f"{name}: holds an array of type {kind!r} and shape {shape}, which is not read")
    return math.prod(shape) * np.dtype(kind).itemsize


def _fill(file: BufferedReader, array: NDArray[Any], what: str) -> None:
    """Read the bytes of an array into it, and compare their checksum."""
    data = _bytes_of(array)
    read = file.readinto(data) if len(data) else 0
    if read != len(data) or file.read(DIGEST) != hashlib.sha256(data).digest():
        raise SceneError(f"{what} {DAMAGED}")


def _bytes_of(array: NDArray[Any]) -> memoryview:
    """Return the bytes of a contiguous array, without copying them."""
    return array.reshape(-1).view(np.uint8).data

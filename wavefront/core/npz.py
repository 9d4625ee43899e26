"""Archives of NumPy (npz), written and read as streams.

An npz file is a zip archive with a member NAME.npy for each array. Those that are written here are not
compressed, and end with the CRC-32 of all bytes before, as the comment of the archive: no damage is missed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from io import BufferedReader
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError

if TYPE_CHECKING:
    from zipfile import ZipFile

METADATA = "metadata"  # the array of JSON text of a picture
SUMS = "sums."  # before the names of arrays of sums
KINDS = "fiubU"  # of NumPy types that are read
MAX_HEADER = 2**14  # bytes of the header of an array
CHECKSUM = 4  # bytes
PIECE = 2**20  # bytes that are read at once
DAMAGED = "is damaged: delete it, or restore it from a copy"


class _Parts(list[Any]):
    """A file in memory: the parts that were written, which are not copied."""

    def write(self, data: Any) -> int:
        self.append(data)
        return memoryview(data).nbytes

    def flush(self) -> None:
        """Do nothing."""


def npz_chunks(arrays: Mapping[str, NDArray[Any]]) -> Iterator[Any]:
    """Yield the bytes of an archive of arrays, one part after the other; the arrays are not copied."""
    import zipfile  # imported here to keep `import wavefront` quick

    parts, crc = _Parts(), 0
    with zipfile.ZipFile(parts, "w") as archive:  # type: ignore[call-overload]
        archive.comment = bytes(CHECKSUM)
        for name, values in arrays.items():
            array = np.asarray(values, order="C")
            # with a fixed date: the same arrays give the same bytes
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, np.lib.format.header_data_from_array_1_0(array))
                member.write(_bytes_of(array))
            for chunk in parts:
                crc = crc32(chunk, crc)
                yield chunk
            parts.clear()
    directory = b"".join(parts)[:-CHECKSUM]
    yield directory
    yield crc32(directory, crc).to_bytes(CHECKSUM, "little")


def _bytes_of(array: NDArray[Any]) -> memoryview:
    """Return the bytes of a contiguous array, without copying them."""
    return array.reshape(-1).view(np.uint8).data


def open_npz(file: BufferedReader) -> ZipFile:
    """Return an archive that `npz_chunks` wrote, after comparing its checksum.

    Raises
    ------
    SceneError
        If it is damaged, truncated, or of another kind.
    """
    import zipfile

    size, crc = os.fstat(file.fileno()).st_size - CHECKSUM, 0
    for start in range(0, size, PIECE):
        crc = crc32(file.read(min(PIECE, size - start)), crc)
    if file.read() != crc.to_bytes(CHECKSUM, "little"):
        raise SceneError(DAMAGED)
    try:
        archive = zipfile.ZipFile(file)
    except (ValueError, NotImplementedError, zipfile.BadZipFile) as error:
        raise SceneError(DAMAGED) from error
    members = archive.infolist()
    if any(info.compress_type for info in members) or sum(info.compress_size for info in members) > size:
        raise SceneError(DAMAGED)
    return archive


def read_array(archive: ZipFile, name: str, place: NDArray[Any] | None = None) -> NDArray[Any]:
    """Return an array of an archive; it is read into `place` where this has its shape and type.

    Raises
    ------
    SceneError
        If there is none of this name, of numbers or text and of the size that it claims.
    """
    try:
        with archive.open(f"{name}.npy") as file:
            np.lib.format.read_magic(file)
            shape, by_columns, kind = np.lib.format.read_array_header_1_0(file)
            member = archive.getinfo(f"{name}.npy")
            size = math.prod(shape) * kind.itemsize
            if by_columns or kind.kind not in KINDS or file.tell() + size != member.compress_size:
                raise ValueError(f"{kind} of shape {shape}")
            if place is None or place.shape != shape or place.dtype != kind:
                place = np.empty(shape, kind)
            data = _bytes_of(place)
            for start in range(0, size, PIECE):
                data[start : start + PIECE] = file.read(PIECE)
    except (MemoryError, OSError):
        raise
    except Exception as error:  # zipfile and the parser of headers raise errors of many types
        raise SceneError(f"the array {name!r} {DAMAGED}") from error
    return place

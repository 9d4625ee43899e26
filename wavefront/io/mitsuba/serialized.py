"""Meshes in Mitsuba's .serialized files, versions 3 and 4.

Source: the documentation of Mitsuba 3, plugin "serialized".
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ..repair import RawMesh
from ..sources import SceneFiles

MAGIC = 0x041C
NORMALS, UVS, COLORS, FACE_NORMALS, DOUBLE = 1, 2, 8, 16, 0x2000
MOST_NAME = 4096  # bytes


class _Stream:
    """Bytes that are unpacked as they are read."""

    def __init__(self, name: str, data: bytes) -> None:
        self._name, self._rest, self._unpacker = name, data, zlib.decompressobj()

    def read(self, size: int) -> bytes:
        """Return the next bytes."""
        data = b""
        try:
            while len(data) < size and not self._unpacker.eof:
                chunk = self._unpacker.decompress(self._rest, size - len(data))
                self._rest = self._unpacker.unconsumed_tail
                data += chunk
                if not chunk and not self._rest:
                    break
        except zlib.error as error:
            raise SceneError(f"{self._name}: cannot be unpacked: {error}") from error
        if len(data) < size:
            raise SceneError(f"{self._name}: ends {size - len(data)} bytes before the end of its mesh")
        return data

    def rows(self, count: int, width: int, kind: str) -> Doubles:
        """Return an array (count, width)."""
        values = np.frombuffer(self.read(count * width * np.dtype(kind).itemsize), kind)
        with np.errstate(invalid="ignore"):
            return values.reshape(count, width).astype(np.float64)


def read_serialized(name: str, data: bytes, index: int, files: SceneFiles) -> RawMesh:
    """Return one of the meshes of a file.

    Raises
    ------
    SceneError
        If the file is malformed, or its header claims more than the limits allow.
    """
    version, begin = _mesh_start(name, data, index)
    stream = _Stream(name, data[begin + 4 :])
    (flags,) = struct.unpack("<I", stream.read(4))
    label = b""
    while version == 4 and len(label) < MOST_NAME and (letter := stream.read(1)) != b"\0":
        label += letter
    vertices, faces = struct.unpack("<QQ", stream.read(16))
    files.limits.check_triangles(name, faces)
    kind = "<f8" if flags & DOUBLE else "<f4"
    files.budget.charge(f"{name}: mesh {index}", 16 * vertices * 14 + 32 * faces)
    points = stream.rows(vertices, 3, kind)
    normals = stream.rows(vertices, 3, kind) if flags & NORMALS else None
    uvs = stream.rows(vertices, 2, kind) if flags & UVS else None
    colors = stream.rows(vertices, 3, kind) if flags & COLORS else None
    corners = np.frombuffer(stream.read(12 * faces), "<u4").reshape(-1, 3).astype(np.intp)
    return RawMesh(label.decode("utf-8", "replace"), points, corners, normals, uvs, colors=colors)


def _mesh_start(name: str, data: bytes, index: int) -> tuple[int, int]:
    """Return the version of a file, and the byte where a mesh begins."""
    if len(data) < 8:
        raise SceneError(f"{name}: has {len(data)} bytes, too few for a serialized mesh")
    magic, version = struct.unpack_from("<HH", data)
    if magic != MAGIC or version not in (3, 4):
        raise SceneError(f"{name}: is no serialized mesh of version 3 or 4: it begins with {data[:4].hex()}")
    (count,) = struct.unpack_from("<I", data, len(data) - 4)
    width = 4 if version == 3 else 8
    begin = 0
    if index:
        at = len(data) - 4 - width * (count - index)
        if index >= count or not at >= 4:
            raise SceneError(f"{name}: shape_index is {index}; the file has {count} meshes")
        (begin,) = struct.unpack_from("<I" if version == 3 else "<Q", data, at)
        if begin + 4 > len(data):
            raise SceneError(f"{name}: mesh {index} begins at byte {begin}; the file has {len(data)}")
    return version, begin

"""Compressed meshes of glTF: KHR_draco_mesh_compression and EXT_meshopt_compression.

Source: Khronos Group, these extensions; Google, Draco bitstream specification, chapters 2 to 5.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...codecs.budget import Budget
from ...core.errors import SceneError
from ...core.plural import plural

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
DRACO_BYTES = 200  # of memory for each face and point
DEEPEST = 8  # levels of metadata


def library(name: str, extension: str) -> Any:
    """Return the library that reads a compression.

    Raises
    ------
    SceneError
        If it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        hint = f"pip install {name.lower()}, or wavefront[gltf]"
        raise SceneError(f"{extension} needs a library: {hint}") from error


def unpacked_view(data: bytes, packed: dict[str, Any], extension: str, count: int, stride: int) -> bytes:
    """Return the bytes of a buffer view that meshoptimizer compressed.

    Parameters
    ----------
    data
        The compressed bytes.
    packed, extension
        The extension of the view, and its name.
    count, stride
        Elements, and bytes of each.

    Raises
    ------
    SceneError
        If they are malformed, or the library is not installed.
    """
    mode, kind = packed.get("mode"), packed.get("filter", "NONE")
    if mode not in MODES or kind not in FILTERS:
        raise SceneError(f"{extension} has the mode {mode!r} and the filter {kind!r}, which there is not")
    meshopt = library("meshopt", extension)
    try:
        return bytes(np.ascontiguousarray(meshopt.decode_gltf_buffer(data, count, stride, mode, kind)))
    except (ValueError, RuntimeError, OverflowError) as error:
        raise SceneError(f"{extension}: {error}") from error


class DracoMesh:
    """A primitive that Draco compressed.

    Parameters
    ----------
    data
        The compressed bytes.
    item
        The extension of the primitive: the numbers of its attributes.
    budget, label
        Where the memory is charged, and its purpose, for messages.

    Raises
    ------
    SceneError
        If they are malformed, or the library is not installed.
    """

    def __init__(self, data: bytes, packed: dict[str, Any], budget: Budget, label: str) -> None:
        draco = library("DracoPy", DRACO)
        faces, points = claimed(data)
        budget.charge(f"{label}: {DRACO}", DRACO_BYTES * (faces + points))
        self._numbers = packed["attributes"]
        try:
            self._mesh = draco.decode(data)
            self.indices: NDArray[Any] = np.asarray(self._mesh.faces, np.uint32).ravel()
        except MemoryError:
            raise
        except Exception as error:  # of types of its own
            raise SceneError(f"{DRACO}: {error}") from error

    def __contains__(self, attribute: str) -> bool:
        """Return whether an attribute is compressed."""
        return attribute in self._numbers

    def values(self, attribute: str) -> NDArray[Any]:
        """Return the values (n, k) of an attribute as they are stored."""
        number = self._numbers[attribute]
        data = self._mesh.get_attribute_by_unique_id(number)
        if data is None:
            raise SceneError(f"{DRACO} has no attribute {number!r}, of {attribute}")
        values = np.asarray(data["data"])
        return values.reshape(len(values), -1)


def claimed(data: bytes) -> tuple[int, int]:
    """Return the numbers of faces and points that the header of a mesh of Draco claims.

    Raises
    ------
    SceneError
        If it is no such mesh, or of a version before 2.2.
    """
    if len(data) < 13 or data[:5] != b"DRACO" or data[7] != 1 or data[8] > 1:
        raise SceneError(f"{DRACO}: has no mesh of Draco")
    if (data[5], data[6]) < (2, 2):
        raise SceneError(f"{DRACO}: is of version {data[5]}.{data[6]}; at least 2.2 is read")
    header = _Varints(data, 11)
    if data[10] & 0x80:  # the flag of metadata
        for _ in range(header.next()):
            header.next()
            header.skip_metadata(0)
        header.skip_metadata(0)
    if data[8] == 0:  # sequential
        return header.next(), header.next()
    header.at += 1  # kind of the traversal
    points, faces = header.next(), header.next()
    return faces, points


class _Varints:
    """Reads the whole numbers of a header, 7 bits in a byte."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self.at = data, at

    def next(self) -> int:
        value = shift = 0
        while True:
            if self.at >= len(self._data) or shift > 63:
                raise SceneError(f"{DRACO}: its header ends early, after {plural(self.at, 'byte')}")
            byte = self._data[self.at]
            self.at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def skip_metadata(self, depth: int) -> None:
        """Skip names and values, and those inside of them."""
        for _ in range(self.next()):
            self._skip_name()
            size = self.next()
            self.at += size
        for _ in range(self.next()):
            if depth == DEEPEST:
                raise SceneError(f"{DRACO}: its metadata are nested deeper than {DEEPEST}")
            self._skip_name()
            self.skip_metadata(depth + 1)

    def _skip_name(self) -> None:
        self.at += 1 + (self._data[self.at] if self.at < len(self._data) else 0)

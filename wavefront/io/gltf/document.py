"""The JSON of a glTF file and the bytes that it refers to, with every index and number checked.

Source: Khronos Group, glTF 2.0 specification, chapters 3.6 (buffers and accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ...core.errors import LimitError, SceneError, printable
from ...core.plural import plural
from ..description.numbers import shown
from ..losses import Losses, Part
from ..sources import MAX_TRIANGLES, SceneFiles
from .compression import MESHOPT, unpacked_view

COMPONENTS: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MAX_ELEMENTS = 2**28  # in one accessor, with or without data
MAX_NUMBERS = 2**29  # in all accessors that are read, as several meshes may share one
NUMBER_BYTES = 20  # of memory for each number that is read, until a mesh is made of it
MAX_COUNT = 2**53  # of bytes or elements: all JSON readers represent whole numbers up to here exactly
OF_CANDELA = 1.0  # lm/W of light that a file gives in candela, lux or cd/m²
# errors of reading JSON of the wrong structure: a list in place of a number, text in place of a list
MALFORMED = (TypeError, KeyError, AttributeError, IndexError, ValueError, OverflowError)


class Document:
    """The JSON of a file and the bytes that it refers to. Errors name the file and the element."""

    def __init__(self, files: SceneFiles, data: bytes) -> None:
        self.files = files
        self.name = files.name
        text, self._binary = _chunks(files.losses, data) if data[:4] == b"glTF" else (data, None)
        try:
            self.json = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise SceneError(f"{self.name}: not glTF: its JSON is damaged: {error}") from error
        if not isinstance(self.json, dict):
            raise SceneError(f"{self.name}: not glTF: its JSON is a {type(self.json).__name__}")
        self._check_version()
        self._buffers: dict[int, bytes] = {}
        self._files: dict[str, bytes] = {}
        self._unpacked: dict[int, bytes] = {}  # buffer views
        self._numbers = 0  # numbers that were read from accessors

    def _check_version(self) -> None:
        asset = self.json.get("asset")
        version = asset.get("version") if isinstance(asset, dict) else None
        if version is None:
            self.files.losses.note("asset.version", value="missing", done="read as version 2.0")
        elif not str(version).startswith("2"):
            raise SceneError(f"{self.name}: is glTF version {shown(version)}; only version 2 is read")

    def part(self, element: str, done: str = "left out") -> Part:
        """Return a context that notes an error of its block, which reads an element: `Losses.part`."""
        return self.files.losses.part(element, done, MALFORMED)

    def items(self, kind: str) -> list[Any]:
        """Return the array `kind`; an empty one where it is malformed, which is noted."""
        array = self.json.get(kind, [])
        if not isinstance(array, list):
            self.files.losses.note(kind, value=shown(array), done="left out, as it must be a list")
            return []
        return array

    @contextmanager
    def inside(self, element: str) -> Iterator[None]:
        """Make errors of the block name the file and the element.

        Raises
        ------
        SceneError
            In place of an error that does not name the file, and of errors by malformed JSON.
        """
        try:
            yield
        except SceneError as error:
            if str(error).startswith(printable(self.name)):
                raise
            raise SceneError(f"{self.name}: {element}: {error}") from error
        except MALFORMED as error:
            raise SceneError(
                f"{self.name}: {element} is malformed: {type(error).__name__}: {shown(error)}"
            ) from error

    def lose(self, what: str, where: str) -> None:
        """Note a property that is not honored."""
        self.files.losses.note(what, where)

    def get(self, kind: str, index: Any) -> dict[str, Any]:
        """Return element `index` of the array `kind`."""
        elements = self.json.get(kind, [])
        if not isinstance(elements, list):
            raise SceneError(f"{self.name}: {kind} is {shown(elements)}; it must be a list")
        if not isinstance(index, int) or not 0 <= index < len(elements):
            raise SceneError(f"{self.name}: {kind}[{shown(index)}] does not exist; there are {len(elements)}")
        element = elements[index]
        if not isinstance(element, dict):
            raise SceneError(f"{self.name}: {kind}[{index}] is not an object")
        return element

    def count(self, where: str, element: dict[str, Any], key: str) -> int:
        """Return a number of bytes or elements, 0 by default; `where` names the element."""
        value = element.get(key, 0)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= MAX_COUNT:
            raise SceneError(
                f"{self.name}: {where}.{key} is {shown(value)}; it must be a whole number, at least 0"
                + (f" and at most {MAX_COUNT}" if isinstance(value, int) and value > 0 else "")
            )
        return value

    def uri(self, uri: Any, where: str) -> bytes:
        """Return the content of a URI: data in the URI itself, or a file in the same folder, read once."""
        if not isinstance(uri, str):
            raise SceneError(f"{self.name}: {where}.uri is {shown(uri)}; it must be text")
        if not uri.startswith("data:"):
            if uri not in self._files:
                with self.inside(where):
                    self._files[uri] = self.files.read(self.files.find(unquote(uri)))
            return self._files[uri]
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise SceneError(f"{self.name}: {where} has damaged base64 data: {error}") from error

    def buffer(self, index: Any) -> bytes:
        """Return the bytes of a buffer."""
        buffer = self.get("buffers", index)
        if index not in self._buffers:
            where = f"buffers[{index}]"
            if "uri" in buffer:
                data = self.uri(buffer["uri"], where)
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                raise SceneError(f"{self.name}: {where} has no data")
            claimed = self.count(where, buffer, "byteLength")
            if len(data) < claimed:
                size = plural(len(data), "byte")
                self.files.losses.note(
                    f"has {size}; it claims {claimed}", where, done="what is there is read"
                )
            self._buffers[index] = data
        return self._buffers[index]

    def view(self, index: Any) -> tuple[bytes, int, int, int]:
        """Return (buffer, first byte, end, stride or 0) of a buffer view."""
        view = self.get("bufferViews", index)
        where = f"bufferViews[{index}]"
        with self.inside(where):
            extension = next((name for name in MESHOPT if name in view.get("extensions", {})), None)
            if extension is not None and not self._can_do_without(extension, view.get("buffer")):
                return self._unpack(index, view["extensions"][extension], extension, where)
            data = self.buffer(view.get("buffer", -1))
        start, length = self.count(where, view, "byteOffset"), self.count(where, view, "byteLength")
        if start + length > len(data):
            raise SceneError(
                f"{self.name}: {where} ends at byte {start + length}; its buffer has {len(data)}"
            )
        return data, start, start + length, self.count(where, view, "byteStride")

    def _can_do_without(self, extension: str, buffer: Any) -> bool:
        """Return whether a compressed view has its bytes in a buffer, too, and no library unpacks it."""
        element = self.get("buffers", buffer)
        plain = "uri" in element or (buffer == 0 and self._binary is not None)
        if not plain or element.get("extensions", {}).get(extension, {}).get("fallback"):
            return False
        return find_spec("meshopt") is None

    def _unpack(
        self, index: int, packed: dict[str, Any], extension: str, where: str
    ) -> tuple[bytes, int, int, int]:
        """Return a compressed buffer view as `view` does."""
        count, stride = self.count(where, packed, "count"), self.count(where, packed, "byteStride")
        if index not in self._unpacked:
            self.files.budget.charge(f"{self.name}: {where}", count * stride)
            data, start = self.buffer(packed.get("buffer", -1)), self.count(where, packed, "byteOffset")
            data = data[start : start + self.count(where, packed, "byteLength")]
            self._unpacked[index] = unpacked_view(data, packed, extension, count, stride)
        return self._unpacked[index], 0, count * stride, stride

    def accessor(self, index: Any) -> NDArray[Any]:
        """Return the elements of an accessor, (count, width); normalized integers become float32."""
        accessor = self.get("accessors", index)
        where = f"accessors[{index}]"
        with self.inside(where):
            values = self._elements(accessor, where)
            return normalized(values) if accessor.get("normalized") else values

    def _elements(self, accessor: dict[str, Any], where: str) -> NDArray[Any]:
        kind, width = COMPONENTS.get(accessor.get("componentType", 0)), WIDTHS.get(accessor.get("type", ""))
        count = self.count(where, accessor, "count")
        if kind is None or width is None:
            raise SceneError(
                f"{self.name}: {where} is {shown(accessor.get('type'))} of "
                f"{shown(accessor.get('componentType'))}, which glTF does not have"
            )
        scale = max(1, self.files.limits.triangles // MAX_TRIANGLES)  # where the user allows larger meshes
        if count * width > MAX_ELEMENTS * scale:
            raise LimitError(
                f"{self.name}: {where} has {count} elements; the limit is {MAX_ELEMENTS * scale // width}"
            )
        self._numbers += count * width
        if self._numbers > MAX_NUMBERS * scale:
            raise LimitError(
                f"{self.name}: {where}: the accessors that its meshes read have {self._numbers} numbers "
                f"so far; the limit is {MAX_NUMBERS * scale}"
            )
        self.files.budget.charge(f"{self.name}: {where}", count * width * NUMBER_BYTES)
        if "bufferView" in accessor:
            values = self._strided(accessor, count, width, kind, where)
        else:
            values = np.zeros((count, width), kind)
        return self._sparse(accessor["sparse"], values, where) if "sparse" in accessor else values

    def _strided(
        self, accessor: dict[str, Any], count: int, width: int, kind: type[np.generic], where: str
    ) -> NDArray[Any]:
        """Return the elements (count, width) of an accessor's buffer view, from its offset on."""
        data, start, end, stride = self.view(accessor["bufferView"])
        size = np.dtype(kind).itemsize * width
        stride = stride or size
        start += self.count(where, accessor, "byteOffset")
        if count and start + (count - 1) * stride + size > end:
            elements = plural(count, "element")
            raise SceneError(f"{self.name}: {where} has {elements}, which its buffer view cannot hold")
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, data, start, (stride, np.dtype(kind).itemsize)).copy()

    def _sparse(self, sparse: dict[str, Any], values: NDArray[Any], where: str) -> NDArray[Any]:
        count = self.count(f"{where}.sparse", sparse, "count")
        at, new = sparse["indices"], sparse["values"]
        kind = COMPONENTS.get(at.get("componentType", 0), np.uint32)
        index = self._strided(at, count, 1, kind, f"{where}.sparse.indices")[:, 0]
        if index.dtype.kind != "u":
            raise SceneError(
                f"{self.name}: {where}.sparse.indices are of type {index.dtype}; they must be unsigned"
            )
        if count and index.max() >= len(values):
            raise SceneError(f"{self.name}: {where} replaces element {index.max()}; it has {len(values)}")
        values = values.copy()
        width = values.shape[1]
        values[index] = self._strided(new, count, width, values.dtype.type, f"{where}.sparse.values")
        return values


def normalized(values: NDArray[Any]) -> NDArray[Any]:
    """Return integers as float32 in [0, 1] or [-1, 1]."""
    if values.dtype.kind == "f":
        return values
    scaled = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    return np.maximum(scaled, np.float32(-1))


def _chunks(losses: Losses, data: bytes) -> tuple[bytes, bytes | None]:
    """Split a .glb into its JSON and its binary chunk."""
    name = losses.name
    if len(data) < 20:
        raise SceneError(f"{name}: ends early: {plural(len(data), 'byte')}")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise SceneError(f"{name}: is glTF version {version}; only version 2 is read")
    if length > len(data):
        losses.note(f"claims {plural(length, 'byte')}; it has {len(data)}", done="what is there is read")
    chunks: dict[bytes, bytes] = {}
    at, end = 12, min(length, len(data))
    while at + 8 <= end:
        size, kind = struct.unpack_from("<I4s", data, at)
        available = min(size, end - at - 8)
        if available < size:
            what = f"a chunk claims {plural(size, 'byte')}; {available} are there"
            losses.note(what, done="what is there is read")
        chunks.setdefault(kind, data[at + 8 : at + 8 + available])
        at += 8 + size
    if b"JSON" not in chunks:
        raise losses.nothing("has no JSON chunk")
    return chunks[b"JSON"], chunks.get(b"BIN\0")

"""Numbers of COLLADA files that pycollada would misread, or leave out a whole geometry for."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..text_lines import NUMBER

NUMBERS = re.compile(rb"<(?:\w+:)?(?:p|h|vcount|float_array)\b[^>]*>([^<]*)<")
# classes of characters: 0 digits and points, 1 signs, 2 exponents, 3 blanks, 4 all others
CLASSES = bytes(
    0
    if char in b"0123456789."
    else 1
    if char in b"+-"
    else 2
    if char in b"eE"
    else 3
    if char in b" \t\r\n"
    else 4
    for char in range(256)
)
# pairs of classes, 5 · first + second, that no number has: pycollada reads up to these, or 0
NO_PAIRS = np.isin(np.arange(25), [1, 6, 7, 8, 12, 13, 17, *range(4, 25, 5), *range(20, 25)])
UNCHECKED = re.compile(rb"<(?:\w+:)?polygons\b")  # whose indices pycollada counts all together
PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
MOST = 2**31  # an index where nothing limits it
NO_NUMBER, NO_INDEX = "1e39", -1  # faces with one of these are left out


def is_doubtful(data: bytes) -> bool:
    """Return True if a text of numbers has something else, or pycollada does not check all indices."""
    texts = (match[1] + b" " for match in NUMBERS.finditer(data))
    return UNCHECKED.search(data) is not None or any(map(_is_malformed, texts))


def _is_malformed(text: bytes) -> bool:
    kinds = np.frombuffer(text.translate(CLASSES), np.uint8)
    return bool(NO_PAIRS[5 * kinds[:-1] + kinds[1:]].any())


def mended(data: bytes) -> bytes | None:
    """Return a document with marks in place of damaged numbers and too large indices; None if it has none."""
    root = ElementTree.fromstring(data)
    changed = [_mend_numbers(numbers) for numbers in root.iterfind(".//{*}float_array")]
    for mesh in root.iterfind(".//{*}mesh"):
        rows = _rows(mesh)
        changed += [_mend_indices(primitive, rows) for primitive in mesh if _tag(primitive) in PRIMITIVES]
    return ElementTree.tostring(root) if any(changed) else None


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def _mend_numbers(element: Any) -> bool:
    words = (element.text or "").split()
    better = [word if NUMBER.fullmatch(word) and "n" not in word.lower() else NO_NUMBER for word in words]
    element.text = " ".join(better)
    return words != better


def _rows(mesh: Any) -> dict[str, int]:
    """Return the number of rows of each source of a mesh, by its reference."""
    rows = {}
    for source in mesh.iterfind("{*}source"):
        count = sum(len((array.text or "").split()) for array in source.iterfind("{*}float_array"))
        strides = [accessor.get("stride", "1") for accessor in source.iterfind(".//{*}accessor")]
        stride = int(strides[0]) if strides and strides[0].isdecimal() else 1
        rows[f"#{source.get('id')}"] = count // max(stride, 1)
    for vertices in mesh.iterfind("{*}vertices"):
        used = [rows.get(reference.get("source", ""), 0) for reference in vertices.iterfind("{*}input")]
        rows[f"#{vertices.get('id')}"] = min(used, default=0)
    return rows


def _mend_indices(primitive: Any, rows: dict[str, int]) -> bool:
    """Mend the indices of a primitive, which come in groups: one for each offset of its inputs."""
    most: dict[int, int] = {}
    for reference in primitive.iterfind("{*}input"):
        offset = reference.get("offset", "0")
        if offset.isdecimal() and len(offset) < 3:
            number = int(offset)
            most[number] = min(most.get(number, MOST), rows.get(reference.get("source", ""), MOST))
    width = max(most, default=0) + 1
    limits = np.array([most.get(offset, MOST) for offset in range(width)])
    whole = width * (3 if _tag(primitive) == "triangles" else 1)
    changed = False
    for element in primitive.iter():
        if _tag(element) in ("p", "h", "vcount"):
            words = (element.text or "").split()
            indices = np.array(
                [int(word) if re.fullmatch(r"\d{1,9}", word) else NO_INDEX for word in words], int
            )
            if _tag(element) != "vcount":
                indices = indices[: len(indices) // whole * whole].reshape(-1, width)
                indices = np.where(indices < limits, indices, NO_INDEX).ravel()
            better = [str(index) for index in indices.tolist()]
            changed |= better != words
            element.text = " ".join(better)
    return changed

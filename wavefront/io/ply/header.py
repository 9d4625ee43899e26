"""The header of a PLY file: its elements, their properties, and the images that its comments name."""

from __future__ import annotations

import re
from typing import NamedTuple

from ...core.errors import SceneError
from ..rows import Element, Property

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
LENGTHS = [name for name, kind in TYPES.items() if kind[0] != "f"]  # types of the length of a list
RGB = ("red", "green", "blue")
READ = {
    "vertex": {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "u", "v", "s", "t",
               "texture_u", "texture_v"},
    "face": {"vertex_index", "vertex_indices", "texcoord", "red", "green", "blue", "alpha"},
    "tristrips": {"vertex_index", "vertex_indices"},
}  # fmt: skip


class Header(NamedTuple):
    """The header of a file."""

    elements: list[Element]
    order: str  # "<" or ">" of a binary file; "" of a text
    textures: list[str]  # images that comments name, as MeshLab writes them
    end: int  # bytes
    lines: int


def read_header(name: str, data: bytes) -> Header:
    """Return the header of a PLY file.

    Raises
    ------
    SceneError
        If it is damaged.
    """
    end = re.search(rb"end_header[^\n]*\n", data[: 1 << 20])
    if not data.startswith(b"ply") or end is None:
        raise SceneError(f"{name}: not a PLY file: its header is damaged")
    text = data[: end.start()].decode("latin-1")
    order = "" if "format ascii" in text else ">" if "big_endian" in text else "<"
    textures = re.findall(r"(?im)^comment\s+texturefile\s+(.*?)\s*$", text)
    return Header(
        _elements(name, text),
        order,
        [texture for texture in textures if texture],
        end.end(),
        text.count("\n") + 1,
    )


def unread(elements: list[Element]) -> list[str]:
    """Return the names of elements and properties that are not used."""
    out = []
    for element in elements:
        if element.count and element.name not in READ:
            out.append(f"element {element.name}")
        elif element.count:
            names = [prop.name for prop in element.properties]
            read = READ[element.name] if set(RGB) <= set(names) else READ[element.name] - {*RGB, "alpha"}
            out += [f"{name} of {element.name}" for name in names if name not in read]
    return out


def _elements(name: str, header: str) -> list[Element]:
    out: list[Element] = []
    for number, line in enumerate(header.split("\n"), 1):
        match line.split():
            case ["element", kind, count] if _is_count(count):
                out.append(Element(kind, int(count)))
            case ["property", "list", length, kind, label] if out and length in LENGTHS and kind in TYPES:
                out[-1].properties.append(Property(label, TYPES[kind], TYPES[length]))
            case ["property", kind, label] if out and kind in TYPES:
                out[-1].properties.append(Property(label, TYPES[kind]))
            case ["element" | "property", *_]:
                raise SceneError(f"{name} line {number}: {line.strip()!r} is not part of a PLY header")
    return out


def _is_count(word: str) -> bool:
    return word.isdecimal() and word.isascii() and len(word) <= 18

"""Checks of a PLY header against the size of the file. trimesh then reads the file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from ..core.errors import SceneError
from ..core.plural import plural

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
SIZES = {name: int(kind[1]) for name, kind in TYPES.items()}  # bytes
READ = {
    "vertex": {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "u", "v", "s", "t",
               "texture_u", "texture_v"},
    "face": {"vertex_index", "vertex_indices", "texcoord", "red", "green", "blue", "alpha"},
    "tristrips": {"vertex_index", "vertex_indices"},
}  # fmt: skip


@dataclass
class Element:
    """One kind of element of the header."""

    name: str
    count: int
    size: int = 0  # bytes of one at least
    words: int = 0  # words of one in a text; a list counts as one word, its length
    lists: int = 0  # number of its properties that are lists
    properties: list[str] = field(default_factory=list)  # their names
    kinds: list[tuple[str, ...]] = field(default_factory=list)  # types; of a list, that of its length first


def check_ply(name: str, data: bytes) -> list[Element]:
    """Return the elements of a PLY file, after checking that it can hold them.

    Raises
    ------
    SceneError
        If the header is damaged or claims more than the file has, or a line of a text is malformed.
    """
    end = re.search(rb"end_header[^\n]*\n", data[: 1 << 20])
    if not data.startswith(b"ply") or end is None:
        raise SceneError(f"{name}: not a PLY file: its header is damaged")
    header = data[: end.start()].decode("latin-1")
    elements = _elements(name, header)
    text, need, there = "format ascii" in header, 0, len(data) - end.end()
    for element in elements:
        need += element.count * (2 * element.words if text else element.size)
        if need > there + 1:
            raise SceneError(
                f"{name}: claims {plural(element.count, 'row')} of {element.name}, "
                f"at least {need} bytes; {there} are there"
            )
    if text:
        _check_lines(name, elements, data[end.end() :].decode("latin-1"), header.count("\n") + 2)
    return elements


def unread(elements: list[Element]) -> list[str]:
    """Return the names of elements and properties that are not used."""
    out = []
    for element in elements:
        if element.count and element.name not in READ:
            out.append(f"element {element.name}")
        elif element.count:
            out += [
                f"{name} of {element.name}" for name in element.properties if name not in READ[element.name]
            ]
    return out


def ply_textures(data: bytes) -> list[str]:
    """Return the images that are named in the comments of a PLY header, as MeshLab writes them."""
    header = data[: data.find(b"end_header")].decode("latin-1")
    return [name for name in re.findall(r"(?im)^comment\s+texturefile\s+(.*?)\s*$", header) if name]


def _elements(name: str, header: str) -> list[Element]:
    out: list[Element] = []
    for number, line in enumerate(header.split("\n"), 1):
        match line.split():
            case ["element", kind, count] if _is_count(count):
                out.append(Element(kind, int(count)))
            case ["property", "list", length, kind, label] if out and length in SIZES and kind in SIZES:
                out[-1].size += SIZES[length]
                out[-1].words += 1
                out[-1].lists += 1
                out[-1].properties.append(label)
                out[-1].kinds.append((length, kind))
            case ["property", kind, label] if out and kind in SIZES:
                out[-1].size += SIZES[kind]
                out[-1].words += 1
                out[-1].properties.append(label)
                out[-1].kinds.append((kind,))
            case ["element" | "property", *_]:
                raise SceneError(f"{name} line {number}: {line.strip()!r} is not part of a PLY header")
    return out


def _check_lines(name: str, elements: list[Element], body: str, first: int) -> None:
    """Check that every line of a text has the number of words of its element."""
    lines = [
        (number, words) for number, line in enumerate(body.split("\n"), first) if (words := line.split())
    ]
    at = 0
    for element in elements:
        rows = lines[at : at + element.count]
        if len(rows) < element.count:
            claimed = f"{plural(element.count, 'row')} of {element.name}"
            raise SceneError(f"{name}: claims {claimed}; {len(rows)} are there")
        if element.lists < 2:
            for number, words in rows:
                _check_words(name, element, number, words)
        at += element.count


def _check_words(name: str, element: Element, number: int, words: list[str]) -> None:
    """Check one line. A list comes first, as in all faces; its length is the number of words that follow."""
    need = element.words
    if element.lists:
        if not _is_count(words[0]):
            raise SceneError(f"{name} line {number}: a list of {element.name} has the length {words[0]!r}")
        need += int(words[0])
        indices = words[1 : 1 + int(words[0])]
        if not all(_is_count(word.lstrip("+-")) for word in indices):
            raise SceneError(f"{name} line {number}: {' '.join(indices)!r} are not whole numbers")
    if len(words) != need:
        raise SceneError(
            f"{name} line {number}: {element.name} has {plural(len(words), 'word')}; it must have {need}"
        )


def _is_count(word: str) -> bool:
    return word.isdecimal() and len(word) <= 18

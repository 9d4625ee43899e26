"""STL: binary files and texts, read by trimesh after a check of their counts."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.errors import SceneError
from ..core.files import decode_text
from ..core.plural import plural
from .losses import Losses
from .repair import RawMesh, wide
from .text_lines import NUMBER, check_lines, words
from .trimesh_loading import geometries

COLORS = (b"COLOR=", b"MATERIAL=")  # keywords that Materialize Magics writes into the header
OTHERS = ("", "facet", "outer", "endloop", "endfacet")  # lines of a text without further information


def parse(losses: Losses, data: bytes) -> list[RawMesh]:
    """Read the solids of an STL file. Its normals are those of the facets and are not read.

    Some programs store colors in a binary file. There are two conventions, which contradict each other, so
    colors are left out, which is noted.

    Raises
    ------
    SceneError
        If the file is malformed. The message names the file, and the line of a text.
    """
    name, count = losses.name, int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        return _binary(losses, data)
    if data.lstrip()[:5].lower() == b"solid":
        return _text(name, decode_text(data))
    if len(data) < 84:
        raise SceneError(f"{name}: has {plural(len(data), 'byte')}; a binary STL has at least 84")
    raise SceneError(f"{name}: claims {plural(count, 'face')}, {84 + 50 * count} bytes; it has {len(data)}")


def _binary(losses: Losses, data: bytes) -> list[RawMesh]:
    colored = [f"{word.decode()} in the header" for word in COLORS if word in data[:80]]
    meshes = geometries(losses.name, "stl", data)
    extra = [mesh["face_attributes"]["stl"] for mesh in meshes]
    if extra and extra[0].any():
        colored.append(f"colors of facets (facet {int((extra[0] != 0).argmax())})")
    for each in colored:
        losses.note(each)
    return [RawMesh("", wide(mesh["vertices"]), mesh["faces"]) for mesh in meshes]


def _text(name: str, text: str) -> list[RawMesh]:
    """Check a text, and read its vertices by trimesh, which must not see the names of solids."""
    lines = [line.strip() for line in text.replace("\t", " ").split("\n")]
    solids: list[tuple[str, list[int]]] = []  # name, lines of the vertices
    inside = False
    for at, keyword in enumerate(check_lines(lines, partial(_check, name))):
        inside = keyword == "solid" or (inside and keyword != "endsolid")
        if keyword == "solid":
            solids.append((lines[at][5:].strip(), []))
        elif keyword == "vertex" and inside:
            solids[-1][1].append(at)
        elif keyword == "vertex":
            raise SceneError(f"{name} line {at + 1}: {lines[at][:40]!r} is not STL")
    if inside:
        raise SceneError(f"{name}: ends early: the text has no endsolid")
    raws = []
    for title, vertices in solids:
        if len(vertices) % 3:
            has = f"has {plural(len(vertices), 'vertex', 'vertices')}; facets need a multiple of 3"
            raise SceneError(f"{name}: solid {title!r} {has}")
        written = "\n".join(["solid", *(lines[at] for at in vertices), "endsolid"]).encode()
        for mesh in geometries(name, "stl", written):
            numbers = np.array(vertices[::3]) + 1
            raws.append(RawMesh(title, mesh["vertices"], mesh["faces"], lines=numbers))
    return raws


def _check(name: str, number: int, line: str) -> str:
    """Return the keyword of a line; raise a SceneError if lines of its form are malformed."""
    keyword, *rest = words(line.lower()) or [""]
    if keyword not in (*OTHERS, "vertex", "solid", "endsolid"):
        raise SceneError(f"{name} line {number}: {line[:40]!r} is not STL")
    if keyword == "vertex" and not (len(rest) == 3 and all(map(NUMBER.fullmatch, rest))):
        text = line[6:].strip()
        raise SceneError(f"{name} line {number}: vertex is {text!r}; it must be 3 numbers")
    return keyword

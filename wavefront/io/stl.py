"""STL: binary files and texts, read by trimesh after a check; damaged facets are left out.

The normals of facets are not used.
"""

from __future__ import annotations

import numpy as np

from ..core.errors import SceneError
from ..core.files import decode_text
from ..core.plural import plural
from .losses import Losses
from .repair import RawMesh, wide
from .text_lines import NUMBER, check_lines, words
from .trimesh_library import geometries

COLORS = (b"COLOR=", b"MATERIAL=")  # keywords that Materialize Magics writes into the header
WORDS = ("", "facet", "outer", "endloop", "endfacet")  # first words of lines that say nothing further
START, FACET = 84, 50  # bytes before the facets of a binary file, and of each
NO_VERTEX = "vertex nan nan nan"


def parse(losses: Losses, data: bytes) -> list[RawMesh]:
    """Read the solids of an STL file.

    Some programs store colors in a binary file. There are two conventions, which contradict each other, so
    colors are left out, which is noted. Of a binary file that is shorter or longer than it says, the facets
    that are there are read.

    Raises
    ------
    SceneError
        If the file is too short.
    """
    count = int.from_bytes(data[80:START], "little")
    exact = len(data) >= START and len(data) == START + FACET * count
    if not exact and _is_text(data):
        return _text(losses, decode_text(data))
    if len(data) < START:
        raise SceneError(f"{losses.name}: has {plural(len(data), 'byte')}; a binary STL has at least {START}")
    available, rest = divmod(len(data) - START, FACET)
    if count and rest:
        available = min(available, count)
    if not exact:
        value = f"{count}, but the file has {plural(len(data), 'byte')}"
        losses.note("the number of facets", value=value, done=f"{available} read")
        data = data[:80] + available.to_bytes(4, "little") + data[START : START + FACET * available]
    return _binary(losses, data)


def _is_text(data: bytes) -> bool:
    """Return whether a file is a text; some binary ones say solid, too, and every facet has zeros."""
    return data.lstrip()[:5].lower() == b"solid" and data.rstrip(b"\0").count(b"\0") < len(data) / 100


def _binary(losses: Losses, data: bytes) -> list[RawMesh]:
    colored = [f"{word.decode()} in the header" for word in COLORS if word in data[:80]]
    meshes = geometries(losses.name, "stl", data)
    for mesh in meshes:
        extra = mesh["face_attributes"]["stl"]
        if extra.any():
            colored.append(f"colors of facets (facet {int((extra != 0).argmax())})")
    for name in colored:
        losses.note(name)
    return [RawMesh("", wide(mesh["vertices"]), mesh["faces"].astype(np.intp)) for mesh in meshes]


def _text(losses: Losses, text: str) -> list[RawMesh]:
    """Return the solids of a text: three lines of vertices in succession are a facet."""
    solids: list[tuple[str, list[int]]] = [("", [])]  # name, lines of the vertices
    lines, run, inside = [line.strip() for line in text.replace("\t", " ").split("\n")], 0, False
    for at, (keyword, fault) in enumerate(check_lines(lines, _kind)):
        if fault:
            value = repr(lines[at][len(keyword) :].strip()[:40])
            losses.note(keyword or "the text", f"line {at + 1}", value, fault)
        if keyword == "vertex":
            run += 1
            solids[-1][1].append(at)
            if fault:
                lines[at] = NO_VERTEX
            continue
        if run % 3:
            del solids[-1][1][-(run % 3) :]
            losses.note("facet", f"line {at}", plural(run % 3, "vertex", "vertices"), "left out")
        run = 0
        if keyword in ("solid", "endsolid"):
            inside = keyword == "solid"
            solids += [(lines[at][5:].strip(), [])] * inside
    if inside:
        losses.note("endsolid", value="missing", done="the text ends early")
    return [_solid(losses.name, title, lines, at) for title, at in solids if len(at) > 2]


def _kind(number: int, line: str) -> tuple[str, str]:
    """Return the keyword of a line, if it matters, and the remedy if it is damaged."""
    keyword, *rest = words(line.lower()) or [""]
    if keyword == "vertex":
        sound = len(rest) == 3 and all(map(NUMBER.fullmatch, rest))
        return keyword, "" if sound else "its facet is left out"
    if keyword in ("solid", "endsolid"):
        return keyword, ""
    return "", "" if keyword in WORDS else "left out"


def _solid(name: str, title: str, lines: list[str], vertices: list[int]) -> RawMesh:
    """Return a solid; trimesh sees neither its name, which may be a keyword, nor other lines."""
    vertices = vertices[: len(vertices) // 3 * 3]
    written = "\n".join(["solid", *(lines[at] for at in vertices), "endsolid"]).encode()
    (mesh,) = geometries(name, "stl", written)
    return RawMesh(title, mesh["vertices"], mesh["faces"], lines=np.array(vertices[::3]) + 1)

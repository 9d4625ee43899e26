"""STL: binary files and texts. The normals of facets are not read; damaged facets are left out."""

from __future__ import annotations

import numpy as np

from ..core.errors import SceneError
from ..core.files import decode_text
from ..core.plural import plural
from .losses import Losses
from .repair import RawMesh, wide
from .text_lines import NUMBER, check_lines, words

COLORS = (b"COLOR=", b"MATERIAL=")  # keywords that Materialize Magics writes into the header
WORDS = ("", "facet", "outer", "endloop", "endfacet")  # first words of lines that say nothing further
FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("extra", "<u2")])
START = 84  # bytes before the facets
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
    exact = len(data) >= START and len(data) == START + FACET.itemsize * count
    if not exact and _is_text(data):
        return _text(losses, decode_text(data))
    if len(data) < START:
        raise SceneError(f"{losses.name}: has {plural(len(data), 'byte')}; a binary STL has at least {START}")
    there, rest = divmod(len(data) - START, FACET.itemsize)
    if count and rest:
        there = min(there, count)
    if not exact:
        value = f"{count}, but the file has {plural(len(data), 'byte')}"
        losses.note("the number of facets", value=value, done=f"{there} read")
    return _binary(losses, data, there)


def _is_text(data: bytes) -> bool:
    """Return whether a file is a text; some binary ones say solid, too, and every facet has zeros."""
    return data.lstrip()[:5].lower() == b"solid" and data.rstrip(b"\0").count(b"\0") < len(data) / 100


def _binary(losses: Losses, data: bytes, count: int) -> list[RawMesh]:
    facets = np.frombuffer(data, FACET, count, START)
    colored = [f"{word.decode()} in the header" for word in COLORS if word in data[:80]]
    if facets["extra"].any():
        colored.append(f"colors of facets (facet {int((facets['extra'] != 0).argmax())})")
    for each in colored:
        losses.note(each)
    corners = wide(facets["vertices"].reshape(-1, 3))
    return [RawMesh("", corners, np.arange(len(corners)).reshape(-1, 3))] if count else []


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
    return [_solid(title, lines, at) for title, at in solids if len(at) > 2]


def _kind(number: int, line: str) -> tuple[str, str]:
    """Return the keyword of a line, if it matters, and what is done about it if it is damaged."""
    keyword, *rest = words(line.lower()) or [""]
    if keyword == "vertex":
        sound = len(rest) == 3 and all(map(NUMBER.fullmatch, rest))
        return keyword, "" if sound else "its facet is left out"
    if keyword in ("solid", "endsolid"):
        return keyword, ""
    return "", "" if keyword in WORDS else "left out"


def _solid(title: str, lines: list[str], vertices: list[int]) -> RawMesh:
    written = " ".join([lines[at][6:] for at in vertices])
    corners = np.fromstring(written, np.float64, sep=" ").reshape(-1, 3)
    faces = np.arange(len(corners) // 3 * 3).reshape(-1, 3)
    return RawMesh(title, corners, faces, lines=np.array(vertices)[: faces.size : 3] + 1)

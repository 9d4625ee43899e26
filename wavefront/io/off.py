"""OFF: rows of text as in PLY, where what is damaged is left out, too. Colors are not read."""

from __future__ import annotations

import numpy as np

from ..core.errors import SceneError
from ..core.files import decode_text
from .losses import Losses
from .ply import NAME, bad_rows, faces_of_rows, note_damage
from .ply_header import Element, Property
from .ply_rows import Rows, rows_of_lines
from .repair import RawMesh

HEADERS = {"OFF": [], "COFF": ["colors of vertices"], "NOFF": ["normals"], "STOFF": ["texture coordinates"]}
VERTEX = [Property(axis, "f8") for axis in "xyz"]
FACE = [Property("corners", "f8", "u4")]


def parse(losses: Losses, data: bytes, materials: bool) -> list[RawMesh]:
    """Return the mesh of an OFF file.

    Raises
    ------
    SceneError
        If its first lines are malformed.
    """
    lines = [line.partition("#")[0].split() for line in decode_text(data).split("\n")]
    rows = [(number, words) for number, words in enumerate(lines, 1) if words]
    first = rows[0][1][0].upper() if rows else ""
    header = first.rstrip("0123456789")  # some files have the counts at once after it: OFF8 6 12
    if header not in HEADERS:
        raise SceneError(f"{losses.name}: begins with {first[:20]!r}; it must be one of {', '.join(HEADERS)}")
    rows[0] = (rows[0][0], [word for word in (first[len(header) :], *rows[0][1][1:]) if word])
    if not rows[0][1]:
        del rows[0]
    vertices, faces = _counts(losses.name, rows)
    vertex = _rows(Element("vertex", vertices, VERTEX), rows[1 : 1 + vertices])
    face = _rows(Element("face", faces, FACE), rows[1 + vertices :][:faces])
    colored = face.long is not None and bool(face.long.any())
    for each in [*HEADERS[header], *["colors of faces"] * colored] if materials else ():
        losses.note(each)
    vertex.long = face.long = None
    note_damage(losses, {"vertex": vertex, "face": face})
    points = vertex.table("xyz")
    assert points is not None
    points[bad_rows(vertex)] = np.nan
    return [RawMesh(NAME, points, faces_of_rows(losses, face, "corners", points).triangles)]


def _rows(element: Element, lines: list[tuple[int, list[str]]]) -> Rows:
    rows = rows_of_lines(element, [words for _, words in lines])
    rows.lines = np.array([number for number, _ in lines], np.intp)
    return rows


def _counts(name: str, rows: list[tuple[int, list[str]]]) -> tuple[int, int]:
    number, words = rows[0] if rows else (1, [])
    if len(words) < 2 or not all(map(_is_whole, words[:2])):
        raise SceneError(f"{name} line {number}: counts are {' '.join(words)!r}; they must be whole numbers")
    return int(words[0]), int(words[1])


def _is_whole(word: str) -> bool:
    """Return whether a word is a whole number of at least 0 that an int64 holds."""
    return word.isdecimal() and word.isascii() and len(word) < 18

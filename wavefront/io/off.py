"""OFF: triangles are read by trimesh, and other files as rows of text, as those of PLY. Colors are not read.

trimesh refuses a file with a damaged line, and covers concave polygons wrongly: these rows are read here.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ..core.errors import SceneError
from ..core.files import decode_text
from .losses import Losses
from .repair import RawMesh
from .rows import NAME, Element, Property, Rows, bad_rows, faces_of_rows, note_damage, rows_of_lines
from .trimesh_library import geometries

HEADERS = {"OFF": [], "COFF": ["colors of vertices"], "NOFF": ["normals"], "STOFF": ["texture coordinates"]}
VERTEX = [Property(axis, "f8") for axis in "xyz"]
FACE = [Property("corners", "f8", "u4")]
PLAIN = frozenset("0123456789+-.eE \n")  # of numbers; trimesh would also take 1_0 for one
Lines: TypeAlias = list[tuple[int, list[str]]]  # number and words of each line


def parse(losses: Losses, data: bytes, materials: bool) -> list[RawMesh]:
    """Return the mesh of an OFF file.

    Raises
    ------
    SceneError
        If its first lines are malformed.
    """
    header, rows = _opening(losses.name, data)
    vertices, faces = _counts(losses.name, rows)
    vertex, face = rows[1 : 1 + vertices], rows[1 + vertices :][:faces]
    whole = len(vertex) == vertices and len(face) == faces
    mesh = _triangles(losses.name, vertex, face) if whole else None
    if mesh is not None:
        _note_unread(losses, header, any(len(words) > 4 for _, words in face), materials)
        return [mesh]
    points = _rows(Element("vertex", vertices, VERTEX), vertex)
    polygons = _rows(Element("face", faces, FACE), face)
    _note_unread(losses, header, polygons.long is not None and bool(polygons.long.any()), materials)
    return [_polygons(losses, points, polygons)]


def _note_unread(losses: Losses, header: str, colored: bool, materials: bool) -> None:
    for unread in [*HEADERS[header], *["colors of faces"] * colored] if materials else ():
        losses.note(unread)


def _polygons(losses: Losses, vertex: Rows, face: Rows) -> RawMesh:
    """Return the mesh of rows; those that are damaged are left out."""
    vertex.long = face.long = None
    note_damage(losses, {"vertex": vertex, "face": face})
    points = vertex.table("xyz")
    assert points is not None
    points[bad_rows(vertex)] = np.nan
    return RawMesh(NAME, points, faces_of_rows(losses, face, "corners", points).triangles)


def _opening(name: str, data: bytes) -> tuple[str, Lines]:
    """Return the keyword of a file, and its lines from the counts on."""
    lines = [line.partition("#")[0].split() for line in decode_text(data).split("\n")]
    rows = [(number, words) for number, words in enumerate(lines, 1) if words]
    first = rows[0][1][0].upper() if rows else ""
    header = first.rstrip("0123456789")  # some files have the counts at once after it: OFF8 6 12
    if header not in HEADERS:
        raise SceneError(f"{name}: begins with {first[:20]!r}; it must be one of {', '.join(HEADERS)}")
    rows[0] = (rows[0][0], [word for word in (first[len(header) :], *rows[0][1][1:]) if word])
    return header, rows if rows[0][1] else rows[1:]


def _triangles(name: str, vertex: Lines, face: Lines) -> RawMesh | None:
    """Return the mesh of lines that are sound triangles; None if some are not."""
    if not face or any(len(words) < 4 or words[0] != "3" for _, words in face):
        return None
    body = "\n".join([" ".join(words) for _, words in [*vertex, *face]])
    if any(len(words) < 3 for _, words in vertex) or not PLAIN.issuperset(body):
        return None
    text = f"OFF\n{len(vertex)} {len(face)} 0\n{body}".encode()
    try:
        (mesh,) = geometries(name, "off", text)
    except SceneError:  # a word is not a number, or there is no such vertex
        return None
    return RawMesh(NAME, mesh["vertices"], mesh["faces"])


def _rows(element: Element, lines: Lines) -> Rows:
    rows = rows_of_lines(element, [words for _, words in lines])
    rows.lines = np.array([number for number, _ in lines], np.intp)
    return rows


def _counts(name: str, rows: Lines) -> tuple[int, int]:
    number, words = rows[0] if rows else (1, [])
    if len(words) < 2 or not all(map(_is_whole, words[:2])):
        raise SceneError(f"{name} line {number}: counts are {' '.join(words)!r}; they must be whole numbers")
    return int(words[0]), int(words[1])


def _is_whole(word: str) -> bool:
    """Return whether a word is a whole number of at least 0 that an int64 holds."""
    return word.isdecimal() and word.isascii() and len(word) < 18

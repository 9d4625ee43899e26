"""Wavefront OBJ. trimesh reads the geometry, after a check for errors that it ignores.

trimesh takes index 0 for the first vertex, counts negative indices from the end of the file and not from the
face's own line, and drops short lines and the uvs and normals of faces of mixed forms. So every line is
checked, and faces that it would misread are rewritten. trimesh gets only the lines of v, vt, vn and f, with
numbers in place of the names of materials, which may contain any characters.

Damaged lines: numbers that a v lacks are 0, as in Blender. A v with something else leaves out its faces, a vt
or vn with something else counts as one of zeros, and a damaged f is left out. A corner of an f that refers to
a vt or vn that does not exist has none.
"""

from __future__ import annotations

import re
from bisect import bisect
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..arrays.vec import Ints
from .losses import Losses
from .polygons import fans_by_size, triangulate, turned_fans
from .repair import RawMesh, Table
from .sources import LoadLimits
from .text_lines import NUMBER, check_lines, words
from .trimesh_library import geometries

UNSEEN = ("", "o", "g")  # keywords without an effect on the look of a surface
OFF = ("off", "0")  # values that switch a keyword off
NAMED = ("usemtl", "mtllib", "o ", "g ")  # statements with a name, which may contain a #
LEAST = {"v": 3, "vt": 1, "vn": 3, "f": 3}  # least number of words of a line
MOST = {"v": 6, "vt": 2, "vn": 3}  # number of words of a line that are read
# the replacement of a damaged line, and the words for it in the note
INSTEAD = {
    "v": ("v nan nan nan", "its faces are left out"),
    "vt": ("vt 0 0", "0 0 in its place"),
    "vn": ("vn 0 0 0", "left out"),
}
LEFT_OUT = ("", "left out")
INDEX = r"[-+]?0{0,99}\d{1,19}"
CORNER = re.compile(rf"{INDEX}(/({INDEX})?(/{INDEX})?)?/*", re.ASCII)
PLAIN = {"1": [0], "1/1": [0, 1], "1//1": [0, 2], "1/1/1": [0, 1, 2]}  # which of v, vt, vn a corner has


@dataclass
class Obj:
    """The content of an OBJ file."""

    raws: list[RawMesh] = field(default_factory=list)  # by material; colors sRGB, NaN where a line has none
    libraries: list[str] = field(default_factory=list)  # material files, as written
    ignored: dict[str, int] = field(default_factory=dict)  # keyword that is not read -> its first line
    points: Table | None = None  # (n, 3), or (n, 6) with sRGB colors, of a file without lines of f


class Kind(NamedTuple):
    """The kind of a line, whatever its digits."""

    keyword: str = ""  # v, vt, vn or f; empty for all others
    width: int = 0  # number of words that follow
    form: str = ""  # of f: the corners with 1 for every number; empty if they differ
    fault: str = ""  # the error in it


@dataclass
class _Class:
    """Groups whose faces have corners of one form and number: one mesh for trimesh.

    Its time grows with the square of the number of meshes.
    """

    faces: list[str] = field(default_factory=list)
    groups: list[tuple[str, int, Ints]] = field(default_factory=list)  # material, faces, corners of each


@dataclass
class _Lines:
    """The lines of a file. Lines are counted from 0."""

    losses: Losses
    texts: list[str]
    kinds: list[Kind]
    rows: dict[str, list[int]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})  # by keyword
    groups: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))  # of f, by material
    absent: dict[str, int] = field(default_factory=dict)  # keyword that only faces use -> its first line

    def face(self, at: int) -> tuple[str, str, str]:
        """Return keyword, place and value of a face for a note."""
        return "f", f"line {at + 1}", repr(self.texts[at][1:].strip()[:40])


def parse(losses: Losses, text: str, limits: LoadLimits | None = None) -> Obj:
    """Read OBJ text; damaged lines are noted.

    Raises
    ------
    SceneError
        If there are too many materials.
    """
    texts = _clean(text)
    lines, out, smooth = _Lines(losses, texts, check_lines(texts, _kind)), Obj(), []
    material, only_points = "", True
    for at, (keyword, width, _, fault) in enumerate(lines.kinds):
        only_points &= keyword != "f"
        if fault:
            keyword, width = _mend(lines, at)
        if keyword == "f":
            lines.groups[material].append(at)
        elif keyword:
            lines.rows[keyword].append(at)
            if width > MOST[keyword]:
                texts[at] = " ".join(words(texts[at])[: MOST[keyword] + 1])
            if width > 6 and keyword == "v":
                out.ignored.setdefault("numbers of v after the sixth", at + 1)
        else:
            keyword, _, rest = (word.strip() for word in texts[at].partition(" "))
            if keyword == "usemtl":
                material = rest
            elif keyword == "mtllib":
                out.libraries.append(rest)
            elif keyword == "s" and rest not in OFF:
                smooth.append(at + 1)
            elif keyword not in UNSEEN and rest not in OFF:
                out.ignored.setdefault(keyword, at + 1)
    if only_points:
        out.points = _points(lines)
    if not lines.groups:
        return out
    (limits or LoadLimits()).check_meshes(losses.name, len(lines.groups))
    added, classes = _faces(lines)
    if not classes:
        return out
    faces = [line for number, group in enumerate(classes) for line in (f"usemtl {number}", *group.faces)]
    meshes = geometries(losses.name, "obj", "\n".join(_tables(lines) + added + faces).encode())
    for keyword, at in lines.absent.items():
        losses.note(*lines.face(at), f"without {keyword}, as there is none")
    # trimesh lists the last mesh first
    raws = {
        raw.name: raw
        for group, mesh in zip(classes, reversed(meshes), strict=True)
        for raw in _raws(lines, group, mesh)
    }
    out.raws = [raws[material] for material in lines.groups]
    if smooth and any(raw.normals is None or not raw.normals.any(axis=1).all() for raw in out.raws):
        out.ignored["s, of faces without normals"] = smooth[0]
    return out


def _clean(text: str) -> list[str]:
    """Return the lines without comments; lines that a backslash continues are joined to their first line."""
    if "\\\n" in text:
        text = re.sub(
            r"(?m)^(?:.*\\\n)+.*", lambda m: m[0].replace("\\\n", " ") + "\n" * m[0].count("\\\n"), text
        )
    lines = map(str.strip, text.replace("\t", " ").split("\n"))
    return [x if "#" not in x or x.startswith(NAMED) else x.partition("#")[0].rstrip() for x in lines]


def _kind(number: int, line: str) -> Kind:
    """Return the kind of a line."""
    keyword, *rest = words(line) or [""]
    if keyword not in LEAST:
        return Kind(fault="is not OBJ" if keyword and not keyword.isidentifier() else "")
    pattern = CORNER if keyword == "f" else NUMBER
    if not all(map(pattern.fullmatch, rest)):
        return Kind(keyword, len(rest), fault="is malformed")
    if len(rest) < LEAST[keyword]:
        return Kind(keyword, len(rest), fault="is too short")
    forms = {re.sub(r"\d+", "1", word) for word in rest if keyword == "f"}
    return Kind(keyword, len(rest), forms.pop() if len(forms) == 1 else "")


def _mend(lines: _Lines, at: int) -> tuple[str, int]:
    """Replace a damaged line, which is noted; return the keyword and the width of its replacement."""
    text, (keyword, width, _, fault) = lines.texts[at], lines.kinds[at]
    instead, done = INSTEAD.get(keyword, LEFT_OUT)
    if keyword == "v" and width and fault == "is too short":
        instead, done = text + " 0" * (3 - width), "0 in place of the rest"
    part, value = (keyword, text[len(keyword) :].strip()) if keyword else ("the text", text)
    lines.losses.note(part, f"line {at + 1}", repr(value[:40]), done)
    lines.texts[at], lines.kinds[at] = instead, (kind := _kind(at, instead))
    return kind.keyword, kind.width


def _tables(lines: _Lines) -> list[str]:
    """Return the lines of v, vt and vn, padded so that all of one keyword have the same number of words."""
    written = []
    for keyword, least, fill in (("v", 3, " nan"), ("vt", 2, " 0"), ("vn", 3, "")):
        rows = lines.rows[keyword]
        width = min(MOST[keyword], max([least, *(lines.kinds[at].width for at in rows)]))
        written += [lines.texts[at] + fill * (width - lines.kinds[at].width) for at in rows]
    return written


def _points(lines: _Lines) -> Table:
    """Return the numbers of all lines of v, (n, 3), or (n, 6) where all have colors."""
    rows = lines.rows["v"]
    width = 6 if rows and all(lines.kinds[at].width >= 6 for at in rows) else 3
    return np.array([words(lines.texts[at])[1 : width + 1] for at in rows], np.float64).reshape(-1, width)


def _faces(lines: _Lines) -> tuple[list[str], list[_Class]]:
    """Return lines that follow those of the file, and the faces from which trimesh makes meshes.

    If one face of a group has a vt or a vn, all faces of the group get one: a vt of 0, and a vn of length 0
    for a face without normals, which is flat. Faces of vertices that do not exist leave their groups.
    """
    added: list[str] = []
    classes: dict[tuple[str, int], _Class] = defaultdict(_Class)
    for material, group in list(lines.groups.items()):
        faces = [lines.texts[at] for at in group]
        if not _is_plain(lines, group, faces):
            group, faces = _rewritten(lines, group)
            lines.groups[material] = group
            added += ["vt 0 0"] + ["vn 0 0 0"] * len(group)
        if not faces:
            del lines.groups[material]
            continue
        counts = np.array([lines.kinds[at].width for at in group])
        if counts.min() < counts.max():
            faces = [triangle for face in faces for triangle in _fan(face)]
        corners = words(faces[0])[1:]
        same = classes[re.sub(r"\d+", "1", corners[0]), len(corners)]
        same.faces += faces
        same.groups.append((material, len(faces), counts))
    return added, list(classes.values())


def _is_plain(lines: _Lines, group: list[int], faces: list[str]) -> bool:
    """Return True if all faces have the same form, and all indices count from 1 and are in range."""
    forms = {lines.kinds[at].form for at in group}
    columns = PLAIN.get(forms.pop() if len(forms) == 1 else "")
    if columns is None:
        return False
    sizes = np.array([len(rows) for rows in lines.rows.values()])
    text = "".join(face[1:] for face in faces).replace("/", " ")
    indices = np.fromstring(text, np.int64, sep=" ").reshape(-1, len(columns))
    return bool(indices.min() > 0 and (indices.max(axis=0) <= sizes[columns]).all())


def _rewritten(lines: _Lines, group: list[int]) -> tuple[list[int], list[str]]:
    """Return the faces of a group with indices from 1, and with those that `_faces` adds; first their lines.

    Those with a v that does not exist are left out.
    """
    by_line = {at: face for at in group if (face := _face(lines, at)) is not None}
    faces = list(by_line.values())
    for column, (keyword, rows) in enumerate(lines.rows.items()):
        if any(corner[column] for face in faces for corner in face):
            for number, face in enumerate(faces, 1):
                for corner in face:
                    corner[column] = corner[column] or len(rows) + (number if keyword == "vn" else 1)
    return list(by_line), [
        "f " + " ".join("/".join(str(i or "") for i in corner).rstrip("/") for corner in face)
        for face in faces
    ]


def _face(lines: _Lines, at: int) -> list[list[int]] | None:
    """Return the corners of a face in line `at`; None if one has a v that does not exist."""
    corners = []
    for word in words(lines.texts[at])[1:]:
        corners.append(_corner(lines, at, word))
        if not corners[-1][0]:
            return None
    return corners


def _corner(lines: _Lines, at: int, word: str) -> list[int]:
    """Return the indices from 1 of v, vt and vn at a corner of a face in line `at`; 0 for none."""
    corner = [0, 0, 0]
    for column, ((keyword, rows), text) in enumerate(zip(lines.rows.items(), word.split("/"), strict=False)):
        if not text:
            continue
        index, size, before = int(text), len(rows), bisect(rows, at)
        if column and not size:
            lines.absent.setdefault(keyword, at)
            continue
        corner[column] = index if index > 0 else before + 1 + index
        if index == 0 or not 0 < corner[column] <= size:
            corner[column] = 0
            what = f"there is no {keyword} {index}"
            lines.losses.note(*lines.face(at), f"without it, as {what}" if column else f"left out, as {what}")
    return corner


def _fan(face: str) -> list[str]:
    """Return the triangles of a face as trimesh makes them; trimesh is slow at groups of mixed polygons."""
    _, first, *others = face.split()
    if len(others) == 3:
        return [f"f {first} {others[0]} {others[1]}", f"f {others[1]} {others[2]} {first}"]
    return [f"f {first} {second} {third}" for second, third in pairwise(others)]


def _raws(lines: _Lines, same: _Class, mesh: dict[str, Any]) -> Iterator[RawMesh]:
    """Yield the mesh of each group of a class, from the mesh of all of them."""
    visual, normals, colors = mesh["visual"], mesh.get("vertex_normals"), mesh.get("vertex_colors")
    uvs, begin = visual and visual.uv, 0
    for material, size, counts in same.groups:
        faces, begin = mesh["faces"][begin : begin + size], begin + size
        used: Ints | slice = slice(None)
        if len(same.groups) > 1:
            used, inverse = np.unique(faces, return_inverse=True)
            faces = inverse.reshape(faces.shape)
        points = mesh["vertices"][used]
        faces, polygon = _triangles(counts, points, faces)
        raw = RawMesh(material, points, faces, lines=np.array(lines.groups[material])[polygon] + 1)
        raw.normals, raw.uvs, raw.colors = (
            None if values is None else values[used] for values in (normals, uvs, colors)
        )
        yield raw


def _triangles(counts: Ints, points: Table, faces: Ints) -> tuple[Ints, Ints]:
    """Return triangles, and the polygon of each, from the faces that trimesh read."""
    corners, order = faces.ravel(), fans_by_size
    if len(corners) != counts.sum():  # those are triangles of fans
        corners, order = np.empty(counts.sum(), np.intp), turned_fans
        corners[order(counts).corner] = faces
    corner, polygon = triangulate(points, corners, counts, order)
    return corners[corner], polygon

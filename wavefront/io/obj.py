"""Wavefront OBJ: trimesh reads the geometry, after a check for what it would misread or pass over.

trimesh takes index 0 for the first vertex, counts backwards from the end of the file and not from the face's
own line, and drops short lines, and the uvs and normals of faces that mix forms. It gets the lines of v, vt,
vn and f and no others, with numbers for the names of materials, which may hold anything.
"""

from __future__ import annotations

import re
from bisect import bisect
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from .lines import NUMBER, check_lines, words
from .repair import RawMesh, warn
from .trimesh_loading import geometries

SILENT = ("", "o", "g")  # keywords that say nothing about what a surface looks like
OFF = ("off", "0")  # values with which a keyword asks for nothing
LEAST = {"v": 3, "vt": 1, "vn": 3, "f": 3}  # words that a line must have
INDEX = r"[-+]?0{0,99}\d{1,19}"
CORNER = re.compile(rf"{INDEX}(/({INDEX})?(/{INDEX})?)?/*", re.ASCII)
PLAIN = {"1": [0], "1/1": [0, 1], "1//1": [0, 2], "1/1/1": [0, 1, 2]}  # which of v, vt, vn a corner has

Rows = dict[str, list[int]]  # the lines of v, vt and vn, from 0


@dataclass
class Obj:
    """What an OBJ file says."""

    raws: list[RawMesh] = field(default_factory=list)  # by material; colors sRGB, NaN where a line has none
    libraries: list[str] = field(default_factory=list)  # material files, as written
    ignored: dict[str, int] = field(default_factory=dict)  # what is not read -> its first line


class Kind(NamedTuple):
    """What a line is, whatever its digits."""

    keyword: str = ""  # v, vt, vn or f; empty for all others
    width: int = 0  # how many words follow
    form: str = ""  # of f: how all corners look, with 1 for every number; empty if they differ


def parse(name: str, text: str, strict: bool = False) -> Obj:
    """Read OBJ text; `name` is for messages.

    Raises
    ------
    SceneError
        Naming the file, the line, what stands there and what is allowed.
    """
    lines = _clean(text)
    kinds = check_lines(lines, partial(_check, name))
    out, material, smooth = Obj(), "", []
    rows: Rows = {"v": [], "vt": [], "vn": []}
    groups: dict[str, list[int]] = {}  # the lines of f, from 0, by material
    for at, (keyword, width, _) in enumerate(kinds):
        if keyword == "f":
            groups.setdefault(material, []).append(at)
        elif keyword:
            rows[keyword].append(at)
            if width > 6 and keyword == "v":
                out.ignored.setdefault("numbers of v after the sixth", at + 1)
        else:
            keyword, _, rest = lines[at].partition(" ")
            if keyword == "usemtl":
                material = rest.strip()
            elif keyword == "mtllib":
                out.libraries.append(rest.strip())
            elif keyword == "s" and rest.strip() not in OFF:
                smooth.append(at + 1)
            elif keyword not in SILENT and rest.strip() not in OFF:
                out.ignored.setdefault(keyword, at + 1)
    if not groups:
        raise SceneError(f"{name}: has no faces")
    written = _tables(lines, kinds, rows) + _faces(name, lines, kinds, rows, list(groups.values()), strict)
    out.raws = _read(name, "\n".join(written).encode())
    for raw, (material, group) in zip(out.raws, groups.items(), strict=True):
        numbers, triangles = np.array(group) + 1, np.array([kinds[at].width - 2 for at in group])
        raw.name = material
        # of quads alone, trimesh lists all first halves, then all second halves
        raw.lines = np.tile(numbers, 2) if (triangles == 2).all() else np.repeat(numbers, triangles)
    if smooth and any(raw.normals is None or not raw.normals.any(axis=1).all() for raw in out.raws):
        out.ignored["s, of faces without normals"] = smooth[0]
    return out


def _clean(text: str) -> list[str]:
    """Return the lines without comments; what a backslash continues stays on its first line."""
    if "\\\n" in text:
        text = re.sub(
            r"(?m)^(?:.*\\\n)+.*", lambda m: m[0].replace("\\\n", " ") + "\n" * m[0].count("\\\n"), text
        )
    lines = list(map(str.strip, text.replace("\t", " ").split("\n")))
    if "#" not in text:
        return lines
    # a name may hold a #, so only whole-line comments and those behind numbers go
    named = ("usemtl", "mtllib", "o ", "g ")
    return [x if "#" not in x or x.startswith(named) else x.partition("#")[0].rstrip() for x in lines]


def _check(name: str, number: int, line: str) -> Kind:
    """Return the kind of a line; raise a SceneError if no line of its form is right."""
    keyword, *rest = words(line) or [""]
    place = f"{name} line {number}"
    if keyword not in LEAST:
        if keyword and not keyword.isidentifier():
            raise SceneError(f"{place}: {line[:40]!r} is not OBJ")
        return Kind()
    pattern, rule, what, must = (
        (CORNER, "; a corner is v, v/vt, v//vn or v/vt/vn", "corners", "needs")
        if keyword == "f"
        else (NUMBER, ", which is not a number", "numbers", "must have")
    )
    for word in rest:
        if not pattern.fullmatch(word):
            raise SceneError(f"{place}: {keyword} holds {word!r}{rule}")
    if len(rest) < LEAST[keyword]:
        has = f"{keyword} has {len(rest)} {what} ({line[len(keyword) :].strip()!r})"
        raise SceneError(f"{place}: {has}; it {must} at least {LEAST[keyword]}")
    forms = {re.sub(r"\d+", "1", word) for word in rest}
    return Kind(keyword, len(rest), forms.pop() if len(forms) == 1 else "")


def _tables(lines: list[str], kinds: list[Kind], rows: Rows) -> list[str]:
    """Return the lines of v, vt and vn, all of one keyword with the same number of words."""
    colored = any(kinds[at].width >= 6 for at in rows["v"])
    out = []
    for keyword, width, fill in (("v", 6 if colored else 3, "nan"), ("vt", 2, "0"), ("vn", 3, "0")):
        for at in rows[keyword]:
            right = kinds[at].width == width
            out.append(lines[at] if right else " ".join([*words(lines[at]), *[fill] * width][: width + 1]))
    return out


def _faces(
    name: str, lines: list[str], kinds: list[Kind], rows: Rows, groups: list[list[int]], strict: bool
) -> list[str]:
    """Return lines of f of which trimesh makes a mesh for each group.

    What stands among them besides is for the faces that have no vt or vn, while others of their group have:
    a vt of 0, and a vn of length 0 for each face, which is flat.
    """
    written: list[str] = []
    absent: dict[str, str] = {}  # of vt and vn, where the first is that no line gives
    for number, group in enumerate(groups):
        faces = [lines[at] for at in group]
        if not _is_plain(faces, {kinds[at].form for at in group}, rows):
            faces = _rewritten(name, lines, group, rows, absent)
            written += ["vt 0 0"] + ["vn 0 0 0"] * len(group)
        if len({kinds[at].width for at in group}) > 1:
            faces = [triangle for face in faces for triangle in _fan(face)]
        written += [f"usemtl {number}", *faces]
    for what in absent.values():
        warn(what, strict)
    return written


def _is_plain(faces: list[str], forms: set[str], rows: Rows) -> bool:
    """Return True if all faces have the same form, and all indices count from 1 and are in range."""
    columns = PLAIN.get(forms.pop() if len(forms) == 1 else "")
    if columns is None:
        return False
    limits = np.array([len(row) for row in rows.values()])[columns]
    text = "".join(face[1:] for face in faces).replace("/", " ")
    indices = np.fromstring(text, np.int64, sep=" ").reshape(-1, len(columns))
    return bool(indices.min() > 0 and (indices.max(axis=0) <= limits).all())


def _rewritten(
    name: str, lines: list[str], group: list[int], rows: Rows, absent: dict[str, str]
) -> list[str]:
    """Return the faces with indices from 1, all with a vt and a vn if any has: one after the file's."""
    faces = [[_corner(name, at, word, rows, absent) for word in words(lines[at])[1:]] for at in group]
    for column, keyword in enumerate(rows):
        if any(corner[column] for face in faces for corner in face):
            for number, face in enumerate(faces, 1):
                for corner in face:
                    corner[column] = corner[column] or len(rows[keyword]) + (number if keyword == "vn" else 1)
    texts = (
        ["/".join(str(index or "") for index in corner).rstrip("/") for corner in face] for face in faces
    )
    return ["f " + " ".join(corners) for corners in texts]


def _corner(name: str, at: int, word: str, rows: Rows, absent: dict[str, str]) -> list[int]:
    """Return the indices from 1 of v, vt and vn at a corner of a face in line `at`; 0 for none."""
    corner = [0, 0, 0]
    for column, (keyword, text) in enumerate(zip(rows, word.split("/"), strict=False)):
        if not text:
            continue
        index, size, before = int(text), len(rows[keyword]), bisect(rows[keyword], at)
        message = f"{name} line {at + 1}: f uses {keyword} {index}; "
        if column and not size:
            absent.setdefault(keyword, message + "there is none, so all are left out")
            continue
        corner[column] = index if index > 0 else before + 1 + index
        if index == 0 or not 0 < corner[column] <= size:
            limit = f"in [1, {size}], or in [-{before}, -1] counting back" if size else "left out"
            raise SceneError(f"{message}it must be {limit}")
    return corner


def _fan(face: str) -> list[str]:
    """Return the triangles of a face as trimesh makes them, which takes it long where polygons mix."""
    _, first, *others = face.split()
    if len(others) == 3:
        return [f"f {first} {others[0]} {others[1]}", f"f {others[1]} {others[2]} {first}"]
    return [f"f {first} {second} {third}" for second, third in pairwise(others)]


def _read(name: str, data: bytes) -> list[RawMesh]:
    from trimesh.exchange.obj import load_obj
    from trimesh.geometry import triangulate_quads

    return [
        RawMesh(
            "",
            mesh["vertices"],
            triangulate_quads(mesh["faces"]),
            mesh.get("vertex_normals"),
            mesh["visual"] and mesh["visual"].uv,
            colors=mesh.get("vertex_colors"),
        )
        # it lists the last one first
        for mesh in reversed(geometries(name, "obj", partial(load_obj, skip_materials=True), data))
    ]

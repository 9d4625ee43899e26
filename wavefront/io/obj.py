"""Wavefront OBJ. trimesh reads the geometry, after a check for errors that it ignores.

trimesh takes index 0 for the first vertex, counts negative indices from the end of the file and not from the
face's own line, and drops short lines and the uvs and normals of faces of mixed forms. So every line is
checked, and lines that it would misread are rewritten. trimesh gets only the lines of v, vt, vn and f, with
numbers in place of the names of materials, which may contain any characters.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from io import StringIO
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .repair import RawMesh, warn
from .trimesh_loading import typed_errors
from .words import Rows, sort_lines

NAMES = ("o", "g")  # keywords without an effect on the look of a surface
OFF = ("off", "0")  # values that switch a keyword off
INDEX = b"0123456789+-/ "
# which of v, vt, vn a corner has, by its number of slashes; row 3 is for two adjacent slashes
GIVEN = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]], bool)


@dataclass
class Obj:
    """The content of an OBJ file."""

    raws: list[RawMesh] = field(default_factory=list)  # by material; colors sRGB, NaN where a line has none
    libraries: list[str] = field(default_factory=list)  # material files, as written
    ignored: dict[str, int] = field(default_factory=dict)  # keyword that is not read -> its first line
    smooth: int | None = None  # first line that requests smooth faces


def parse(name: str, text: str, strict: bool = False) -> Obj:
    """Read OBJ text; `name` is for messages.

    Raises
    ------
    SceneError
        If a line is malformed. The message names the file, the line, its text and what is allowed.
    """
    lines = _clean(text)
    (*tables, faces), others = sort_lines(lines, "v", "vt", "vn", "f")
    out, materials, changes = _statements(name, lines, others)
    for rows, least in zip(tables, (3, 1, 3), strict=True):
        rows.check_numbers(name, least)
    if not faces.texts:
        raise SceneError(f"{name}: has no faces")
    long = tables[0].widths > 6
    if long.any():
        out.ignored["numbers of v after the sixth"] = int(tables[0].numbers[long.argmax()])
    names: dict[str, int] = {}
    label = np.array([names.setdefault(x, len(names)) for x in materials])[
        np.searchsorted(changes, faces.numbers)
    ]
    written = _check_faces(name, faces, tables, label, strict)
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    groups.sort(key=lambda group: int(group[0]))  # materials in the order of their first use
    titles = list(names)
    with typed_errors(name, "obj"):
        meshes = _read(written, groups)
    for group, mesh in zip(groups, meshes, strict=True):
        out.raws.append(_raw(titles[label[group[0]]], mesh, faces, group))
    if out.smooth and any(raw.normals is None or not raw.normals.any(axis=1).all() for raw in out.raws):
        out.ignored["s, of faces without normals"] = out.smooth
    return out


def _clean(text: str) -> list[str]:
    """Return the lines without comments; lines that a backslash continues are joined to their first line."""
    if "\\\n" in text:
        text = re.sub(
            r"(?m)^(?:.*\\\n)+.*", lambda m: m[0].replace("\\\n", " ") + "\n" * m[0].count("\\\n"), text
        )
    lines = list(map(str.strip, text.replace("\t", " ").split("\n")))
    if "#" not in text:
        return lines
    # a name may contain a #, so only whole-line comments and comments after numbers are removed
    named = ("usemtl", "mtllib", "o ", "g ")
    return [x if "#" not in x or x.startswith(named) else x.partition("#")[0].rstrip() for x in lines]


def _statements(name: str, lines: list[str], others: NDArray[np.intp]) -> tuple[Obj, list[str], list[int]]:
    """Read all lines but geometry; also return the materials in order, and where all but the first begin."""
    out, materials, changes = Obj(), [""], []
    for at in others.tolist():
        keyword, _, rest = lines[at].partition(" ")
        if keyword == "usemtl":
            materials.append(rest.strip())
            changes.append(at + 1)
        elif keyword == "mtllib":
            out.libraries.append(rest.strip())
        elif not keyword.isidentifier():
            raise SceneError(f"{name} line {at + 1}: {lines[at][:40]!r} is not OBJ")
        elif keyword == "s" and rest.strip() not in OFF:
            out.smooth = out.smooth or at + 1
        elif keyword not in NAMES and rest.strip() not in OFF:
            out.ignored.setdefault(keyword, at + 1)
    return out, materials, changes


def _check_faces(
    name: str, faces: Rows, tables: list[Rows], label: NDArray[np.intp], strict: bool
) -> tuple[list[str], list[str]]:
    """Return the lines of v, vt, vn, and the corners of every face, in a form that trimesh reads correctly.

    If one face of a material (`label`) has a vt or a vn, all faces of the material get one: a vt of 0, and a
    vn of length 0 for a face without normals, which is flat.
    """
    index, given = _indices(name, faces)
    parent = np.repeat(np.arange(len(label)), faces.widths)
    at, group, as_written = faces.numbers[parent], label[parent], given.copy()
    right = bool((index[given] > 0).all())
    lines = []
    for column, (rows, fill) in enumerate(zip(tables, ("nan", "0", "0"), strict=True)):
        width = (6 if rows.widths.max(initial=0) >= 6 else 3, 2, 3)[column]
        lines += [rows.keyword + f"\n{rows.keyword}".join(rows.resized(width, fill))] if rows.texts else []
        has = given[:, column]
        if column and not rows.texts and has.any():
            i = has.argmax()
            what = f"f uses {rows.keyword} {index[i, column]}; there is none, so all are left out"
            warn(f"{name} line {at[i]}: {what}", strict)
            has[:] = False
        _resolve(name, rows, index[:, column], has, at)
        absent = (np.bincount(group[has], minlength=label.max() + 1) > 0)[group] & ~has
        if absent.any():
            _, rank = np.unique(parent[absent] * (column == 2), return_inverse=True)
            index[absent, column] = len(rows.texts) + rank
            lines += [f"{rows.keyword} " + " ".join("0" * width)] * (int(rank.max()) + 1)
            has[absent] = True
    if right and (given == as_written).all():
        return lines, faces.texts
    corners = (
        "/".join(str(i + 1) if there else "" for i, there in zip(*corner, strict=True)).rstrip("/")
        for corner in zip(index.tolist(), given.tolist(), strict=True)
    )
    return lines, [" " + " ".join(islice(corners, count)) for count in faces.widths.tolist()]


def _indices(name: str, faces: Rows) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the indices (k, 3) of all corners as written, and a mask of the indices that are given."""
    few = np.flatnonzero(faces.widths < 3)
    if len(few):
        text, number = faces.texts[few[0]].strip(), faces.numbers[few[0]]
        raise SceneError(
            f"{name} line {number}: f has {faces.widths[few[0]]} corners ({text!r}); it needs at least 3"
        )
    try:
        return _corners("".join(faces.texts))
    except (ValueError, OverflowError):
        number, word = faces.first_but(lambda word: _corners(" " + word)) or (0, "")
        raise SceneError(
            f"{name} line {number}: f holds {word!r}; a corner is v, v/vt, v//vn or v/vt/vn"
        ) from None


def _corners(text: str) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Read corners, each after a blank; raises ValueError or OverflowError."""
    text = re.sub(r"(?<=\d)/+(?= |$)", "", text) if "/ " in text or text.endswith("/") else text
    data = text.encode()
    form = _forms(data, len(text.split()))
    split = text.replace("/", " ")
    if data.translate(None, INDEX):
        raise ValueError
    numbers = np.fromstring(split, np.int64, sep=" ") if "-" not in text and "+" not in text else None
    if numbers is None or numbers.max(initial=0) >= 10**18:  # NumPy stops at signs and is limited to int64
        numbers = np.array(list(map(int, split.split())), np.int64)
    if form.max() >= len(GIVEN) or GIVEN[form].sum() != len(numbers):
        raise ValueError
    index = np.zeros((len(form), 3), np.int64)
    index[GIVEN[form]] = numbers
    return index, GIVEN[form]


def _forms(text: bytes, count: int) -> NDArray[np.intp]:
    """Return the row of `GIVEN` for each of `count` corners; a larger number for a malformed corner."""
    if b"/" not in text:
        return np.zeros(count, np.intp)
    codes = np.frombuffer(text, np.uint8)
    slash, blank = codes == ord("/"), codes == ord(" ")
    word = (np.cumsum(blank[:-1] & ~blank[1:]) - 1)[slash[1:]]  # positions of the slashes
    return np.bincount(word, minlength=count) + np.bincount(word[slash[:-1][slash[1:]]], minlength=count)


def _resolve(
    name: str, rows: Rows, index: NDArray[np.int64], given: NDArray[np.bool_], at: NDArray[np.intp]
) -> None:
    """Convert indices from 1, or back from the lines `at`, to indices from 0, in place."""
    before, size = np.searchsorted(rows.numbers, at), len(rows.texts)
    zero_based = np.where(index > 0, index - 1, before + index)
    bad = given & ((index == 0) | (zero_based < 0) | (zero_based >= size))
    if bad.any():
        i = bad.argmax()
        limit = f"in [1, {size}], or in [-{before[i]}, -1] counting back" if size else "left out"
        raise SceneError(f"{name} line {at[i]}: f uses {rows.keyword} {index[i]}; it must be {limit}")
    index[:] = zero_based


def _read(written: tuple[list[str], list[str]], groups: list[NDArray[np.intp]]) -> list[dict[str, Any]]:
    """Read the lines of `_check_faces` by trimesh; return one mesh for each group of faces."""
    from trimesh.exchange.obj import load_obj

    lines, faces = written
    for number, group in enumerate(groups):
        texts = [faces[i] for i in group.tolist()] if len(groups) > 1 else faces
        lines += [f"usemtl {number}", "f" + "\nf".join(texts)]
    # the loader is called directly: a trimesh object would round colors to 8 bits
    found = load_obj(StringIO("\n".join(lines)), skip_materials=True)["geometry"]
    return list(found.values())[::-1]  # the loader lists the last mesh first


def _raw(material: str, mesh: dict[str, Any], faces: Rows, group: NDArray[np.intp]) -> RawMesh:
    from trimesh.geometry import triangulate_quads

    raw = RawMesh(material, mesh["vertices"], triangulate_quads(mesh["faces"]), mesh.get("vertex_normals"))
    raw.uvs = None if mesh["visual"] is None else mesh["visual"].uv
    raw.colors = mesh.get("vertex_colors")
    numbers, triangles = faces.numbers[group], faces.widths[group] - 2
    # of a mesh of quads, trimesh lists all first halves, then all second halves
    raw.lines = np.tile(numbers, 2) if (triangles == 2).all() else np.repeat(numbers, triangles)
    return raw

"""Wavefront OBJ text -> arrays.

Own parser: every defect of the text is met with its line, and indices that count backwards, faces
that mix forms and several material files come out right.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError

MISSING = np.iinfo(np.int64).min  # an index that a face corner does not give
KINDS = ("v", "vt", "vn")
FILL = {"v": np.nan, "vt": 0.0, "vn": 0.0}  # what a line leaves out: of v, that is its colour
LEAST = {"v": 3, "vt": 1, "vn": 3}  # how many numbers a line must have
NAMES = ("o", "g")  # keywords that say nothing about what a surface looks like
OFF = ("off", "0")  # values with which a keyword asks for nothing
SMOOTHING = "s, of faces without normals"

Line = tuple[int, str]  # number in the file from 1, what follows the keyword
Table = NDArray[np.float64]


@dataclass
class Group:
    """Triangles of one material, with a vertex for each distinct (v, vt, vn)."""

    material: str | None
    vertices: Table  # (n, 3)
    faces: NDArray[np.intp]  # (m, 3)
    lines: NDArray[np.intp]  # (m,) line of the file that each triangle comes from
    normals: Table | None  # (n, 3); zero where the file gives none
    uvs: Table | None  # (n, 2)
    colors: Table | None  # (n, 3) as written, sRGB; NaN where a line has none


@dataclass
class Obj:
    """What an OBJ file says."""

    groups: list[Group]
    libraries: list[str]  # material files, as written
    ignored: dict[str, int] = field(default_factory=dict)  # keyword -> first line of what is not read


@dataclass
class _Lines:
    """The lines of a file, sorted by keyword."""

    tables: dict[str, list[Line]] = field(default_factory=lambda: {kind: [] for kind in KINDS})
    faces: dict[str | None, list[Line]] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    smooth: int | None = None  # first line that asks for smooth faces
    ignored: dict[str, int] = field(default_factory=dict)


def parse(path: str | os.PathLike[str], text: str) -> Obj:
    """Read OBJ text; `path` is for messages.

    Raises
    ------
    SceneError
        Naming the file, the line, what stands there and what is allowed.
    """
    name = os.fspath(path)
    lines = _sort(name, text)
    tables = {kind: _table(name, kind, lines.tables[kind]) for kind in KINDS}
    rows = {kind: np.array([number for number, _ in lines.tables[kind]], np.int64) for kind in KINDS}
    if tables["v"].shape[1] > 6:
        line = rows["v"][np.argmax(~np.isnan(tables["v"][:, 6]))]
        lines.ignored["numbers of v after the sixth"] = int(line)
    groups = [_group(name, key, faces, tables, rows) for key, faces in lines.faces.items()]
    if not groups:
        raise SceneError(f"{name}: has no faces")
    if lines.smooth is not None and any(_has_flat(group) for group in groups):
        lines.ignored[SMOOTHING] = lines.smooth
    return Obj(groups, lines.libraries, lines.ignored)


def _sort(name: str, text: str) -> _Lines:
    """Split text into lines by keyword."""
    out = _Lines()
    current: list[Line] = []
    material: str | None = None
    for number, line in enumerate(_joined(text), 1):
        keyword, _, rest = line.partition(" ")
        if keyword == "f":
            if not current:
                out.faces[material] = current = out.faces.get(material, current)
            current.append((number, rest))
        elif keyword in out.tables:
            out.tables[keyword].append((number, rest))
        elif keyword == "usemtl":
            material = rest.strip() or None
            current = out.faces.get(material, [])
        elif keyword == "mtllib":
            out.libraries.append(rest.strip())
        elif keyword and not keyword.isidentifier():
            raise SceneError(f"{name} line {number}: {line[:40]!r} is not OBJ")
        elif not keyword or keyword in NAMES or rest.strip() in OFF:
            continue
        elif keyword == "s":
            out.smooth = number if out.smooth is None else out.smooth
        else:
            out.ignored.setdefault(keyword, number)
    return out


def _joined(text: str) -> list[str]:
    """Return the lines without comments; what a backslash continues stays on its first line."""
    lines = text.replace("\t", " ").split("\n")
    for i in range(len(lines) - 2, -1, -1):
        if lines[i].endswith("\\"):
            lines[i] = lines[i][:-1] + " " + lines[i + 1]
            lines[i + 1] = ""
    # a name may hold a #, so only whole-line comments and those behind numbers go
    return [_bare(line) if "#" in line else line for line in map(str.strip, lines)]


def _bare(line: str) -> str:
    at = line.find("#")
    if at and line.startswith(("usemtl", "mtllib", "o ", "g ")):
        return line
    return line[:at].rstrip()


def _table(name: str, kind: str, lines: list[Line]) -> Table:
    """Numbers of all lines of one kind, (n, columns); short lines are filled up."""
    if not lines:
        return np.empty((0, LEAST[kind]))
    widths = np.array([len(rest.split()) for _, rest in lines])
    short = np.flatnonzero(widths < LEAST[kind])
    if len(short):
        number, rest = lines[short[0]]
        raise SceneError(
            f"{name} line {number}: {kind} has {widths[short[0]]} numbers ({rest.strip()!r}); "
            f"it must have at least {LEAST[kind]}"
        )
    try:
        values = list(map(float, " ".join(rest for _, rest in lines).split()))
    except ValueError:
        raise SceneError(_not_numbers(name, kind, lines)) from None
    columns = np.arange(widths.max())
    out = np.full((len(lines), len(columns)), FILL[kind])
    out[columns < widths[:, None]] = values
    return out


def _not_numbers(name: str, kind: str, lines: list[Line]) -> str:
    for number, rest in lines:
        for word in rest.split():
            try:
                float(word)
            except ValueError:
                return f"{name} line {number}: {kind} holds {word!r}, which is not a number"
    raise AssertionError("every word is a number")


def _group(
    name: str,
    material: str | None,
    lines: list[Line],
    tables: dict[str, Table],
    rows: dict[str, NDArray[np.int64]],
) -> Group:
    """Turn the face lines of one material into triangles."""
    numbers = np.array([number for number, _ in lines], np.intp)
    counts = np.array([len(rest.split()) for _, rest in lines])
    few = np.flatnonzero(counts < 3)
    if len(few):
        number, rest = lines[few[0]]
        raise SceneError(
            f"{name} line {number}: f has {counts[few[0]]} corners ({rest.strip()!r}); it needs at least 3"
        )
    corners = _corners(name, lines)
    at = np.repeat(numbers, counts)
    for column, kind in enumerate(KINDS):
        corners[:, column] = _absolute(name, kind, corners[:, column], at, rows[kind])
    triangles, parent = _fans(counts)
    corners[:, 2] = _unshared(corners[:, 2], counts)
    unique, inverse = _distinct(corners)
    return Group(
        material,
        tables["v"][unique[:, 0], :3],
        inverse[triangles],
        numbers[parent],
        _optional(tables["vn"], unique[:, 2], 3),
        _optional(tables["vt"], unique[:, 1], 2),
        tables["v"][unique[:, 0], 3:6] if tables["v"].shape[1] >= 6 else None,
    )


def _has_flat(group: Group) -> bool:
    """Tell whether the file leaves out normals of any face."""
    return group.normals is None or not group.normals.any(axis=1).all()


def _corners(name: str, lines: list[Line]) -> NDArray[np.int64]:
    """Indices (v, vt, vn) of every corner as written, (k, 3), `MISSING` where there is none."""
    words = " ".join(rest for _, rest in lines).split()
    if any(map(str.endswith, words, repeat("/"))):
        words = [word.rstrip("/") for word in words]
    slashes = np.fromiter(map(str.count, words, repeat("/")), np.intp, len(words))
    out = np.full((len(words), 3), MISSING, np.int64)
    try:
        if slashes.max() > 2:
            raise ValueError
        for count in np.unique(slashes):
            chosen = np.flatnonzero(slashes == count)
            joined = " ".join(words if len(chosen) == len(words) else map(words.__getitem__, chosen.tolist()))
            parts = joined.replace("//", f"/{MISSING}/").replace(" ", "/").split("/")
            out[chosen, : count + 1] = np.array(list(map(int, parts)), np.int64).reshape(-1, count + 1)
    except (ValueError, OverflowError):
        raise SceneError(_not_corners(name, lines)) from None
    return out


def _not_corners(name: str, lines: list[Line]) -> str:
    for number, rest in lines:
        for word in rest.split():
            parts = word.rstrip("/").split("/")
            try:
                if not parts[0] or len(parts) > 3:
                    raise ValueError
                np.array([int(part) for part in parts if part], np.int64)
            except (ValueError, OverflowError):
                return f"{name} line {number}: f holds {word!r}; a corner is v, v/vt, v//vn or v/vt/vn"
    raise AssertionError("every corner is well formed")


def _absolute(
    name: str,
    kind: str,
    index: NDArray[np.int64],
    at: NDArray[np.intp],
    rows: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Turn indices from 1, or backwards from the face's own line, into indices from 0."""
    before = np.searchsorted(rows, at)
    zero_based = np.where(index > 0, index - 1, before + index)
    missing = index == MISSING
    bad = np.flatnonzero(~missing & ((index == 0) | (zero_based < 0) | (zero_based >= len(rows))))
    if len(bad):
        i = bad[0]
        limit = f"in [1, {len(rows)}], or in [-{before[i]}, -1] counting back" if len(rows) else "left out"
        raise SceneError(f"{name} line {at[i]}: f uses {kind} {index[i]}; it must be {limit}")
    return np.where(missing, MISSING, zero_based)


def _fans(counts: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Split polygons with `counts` corners into triangles: (m, 3) corner numbers, (m,) polygons."""
    parent = np.repeat(np.arange(len(counts)), counts - 2)
    first = (np.cumsum(counts) - counts)[parent]
    step = np.arange(len(parent)) - (np.cumsum(counts - 2) - (counts - 2))[parent]
    triangles = np.stack([first, first + step + 1, first + step + 2], axis=1)
    # the second half of a quad starts, and quads alone are ordered, as in trimesh, so that a mesh
    # that trimesh has read renders the same as its file
    second = (counts[parent] == 4) & (step == 1)
    triangles[second] = np.roll(triangles[second], -1, axis=1)
    if (counts == 4).all():
        order = np.argsort(step, kind="stable")
        return triangles[order], parent[order]
    return triangles, parent


def _unshared(normal: NDArray[np.int64], counts: NDArray[np.intp]) -> NDArray[np.int64]:
    """Give faces without normals, among faces with them, corners of their own: they are flat."""
    if (normal == MISSING).all():
        return normal
    face = np.repeat(np.arange(len(counts)), counts)
    return np.where(normal == MISSING, -1 - face, normal)


def _distinct(corners: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return the distinct rows (u, 3) in order of first use, and for each row its number (k,)."""
    order = np.lexsort(corners.T[::-1])
    new = np.r_[True, np.any(np.diff(corners[order], axis=0) != 0, axis=1)]
    label = np.empty(len(corners), np.intp)
    label[order] = np.cumsum(new) - 1
    first = np.full(int(new.sum()), len(corners))
    np.minimum.at(first, label, np.arange(len(corners)))
    rank = np.empty(len(first), np.intp)
    by_use = np.argsort(first)
    rank[by_use] = np.arange(len(first))
    return corners[first[by_use]], rank[label]


def _optional(table: Table, index: NDArray[np.int64], width: int) -> Table | None:
    """Gather rows of normals or uvs; zero where there is no index, None if there is none at all."""
    given = index >= 0
    if not given.any():
        return None
    out = np.zeros((len(index), width))
    rows = table[index[given], :width]
    out[given, : rows.shape[1]] = rows
    return out

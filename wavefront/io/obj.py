"""Wavefront OBJ.

Every line is checked, but lines that differ only in their digits only once, and all numbers of lines of one
form are read at once.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from ..arrays.vec import Ints
from ..core.errors import SceneError
from .repair import RawMesh, Table, warn
from .sources import LoadLimits
from .text_lines import NUMBER, check_lines, words

UNSEEN = ("", "o", "g")  # keywords without an effect on the look of a surface
OFF = ("off", "0")  # values that switch a keyword off
NAMED = ("usemtl", "mtllib", "o ", "g ")  # statements with a name, which may contain a #
LEAST = {"v": 3, "vt": 1, "vn": 3, "f": 3}  # least number of words of a line
MOST = {"v": 6, "vt": 2, "vn": 3}  # number of words of a line that are read
NUMBERS = (NUMBER, ", which is not a number", "numbers", "must have")
INDEX = r"[-+]?0{0,99}\d{1,19}"
CORNER = re.compile(rf"{INDEX}(/({INDEX})?(/{INDEX})?)?/*", re.ASCII)
CORNERS = (CORNER, "; a corner is v, v/vt, v//vn or v/vt/vn", "corners", "needs")
ABSENT = np.iinfo(np.int64).min  # in place of an index that a corner does not have


@dataclass
class Obj:
    """The content of an OBJ file."""

    raws: list[RawMesh] = field(default_factory=list)  # by material; colors sRGB, NaN where a line has none
    libraries: list[str] = field(default_factory=list)  # material files, as written
    ignored: dict[str, int] = field(default_factory=dict)  # keyword that is not read -> its first line
    points: Table | None = None  # (n, 3), or (n, 6) with sRGB colors, of a file without faces


class Kind(NamedTuple):
    """The kind of a line, whatever its digits."""

    keyword: str = ""  # v, vt, vn or f; empty for all others
    width: int = 0  # number of words that follow
    form: str = ""  # of f: the corners with 1 for every number; empty if they differ


@dataclass
class _Lines:
    """The lines of a file. Lines are counted from 0."""

    name: str  # of the file
    texts: list[str]
    kinds: list[Kind]
    rows: dict[str, list[int]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})  # by keyword
    groups: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))  # of f, by material


def parse(name: str, text: str, strict: bool = False, limits: LoadLimits | None = None) -> Obj:
    """Read OBJ text; `name` is for messages.

    Raises
    ------
    SceneError
        If a line is malformed. The message names the file, the line, its text and what is allowed.
    """
    texts = _clean(text)
    lines, out, smooth = _Lines(name, texts, check_lines(texts, partial(_check, name))), Obj(), []
    material = ""
    for at, (keyword, width, _) in enumerate(lines.kinds):
        if keyword == "f":
            lines.groups[material].append(at)
        elif keyword:
            lines.rows[keyword].append(at)
            if width > MOST[keyword]:
                texts[at] = " ".join(words(texts[at])[: MOST[keyword] + 1])
            if width > 6 and keyword == "v":
                out.ignored.setdefault("numbers of v after the sixth", at + 1)
        else:
            keyword, _, rest = (part.strip() for part in texts[at].partition(" "))
            if keyword == "usemtl":
                material = rest
            elif keyword == "mtllib":
                out.libraries.append(rest)
            elif keyword == "s" and rest not in OFF:
                smooth.append(at + 1)
            elif keyword not in UNSEEN and rest not in OFF:
                out.ignored.setdefault(keyword, at + 1)
    tables = {keyword: _table(lines, keyword) for keyword in lines.rows}
    if not lines.groups:
        is_colored = all(lines.kinds[at].width >= 6 for at in lines.rows["v"])
        out.points = tables["v"][:-1, : 6 if is_colored else 3]
        return out
    (limits or LoadLimits()).check_meshes(name, len(lines.groups))
    face = np.array([row for group in lines.groups.values() for row in group])  # their lines
    widths = np.array([lines.kinds[row].width for row in face.tolist()])
    corner = _resolved(lines, face, widths, _indices(lines, face, widths), strict)
    ends = np.cumsum([len(group) for group in lines.groups.values()])[:-1]
    parts = np.split(face, ends), np.split(widths, ends), np.split(corner, np.cumsum(widths)[ends - 1])
    out.raws = [_mesh(*part, tables) for part in zip(lines.groups, *parts, strict=True)]
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


def _check(name: str, number: int, line: str) -> Kind:
    """Return the kind of a line; raise a SceneError if lines of its form are malformed."""
    keyword, *rest = words(line) or [""]
    place = f"{name} line {number}"
    if keyword not in LEAST:
        if keyword and not keyword.isidentifier():
            raise SceneError(f"{place}: {line[:40]!r} is not OBJ")
        return Kind()
    pattern, rule, what, must = CORNERS if keyword == "f" else NUMBERS
    for word in rest:
        if not pattern.fullmatch(word):
            raise SceneError(f"{place}: {keyword} holds {word!r}{rule}")
    if len(rest) < LEAST[keyword]:
        has = f"{keyword} has {len(rest)} {what} ({line[len(keyword) :].strip()!r})"
        raise SceneError(f"{place}: {has}; it {must} at least {LEAST[keyword]}")
    forms = {_form(word) for word in rest if keyword == "f"}
    return Kind(keyword, len(rest), forms.pop() if len(forms) == 1 else "")


def _form(corner: str) -> str:
    """Return a corner of a face with 1 for every number."""
    return re.sub(r"\d+", "1", corner)


def _table(lines: _Lines, keyword: str) -> Table:
    """Return the numbers of all lines of v, vt or vn, and a row of zeros; columns that a line lacks are 0.

    Colors that a line of v lacks are NaN.
    """
    rows, fill = lines.rows[keyword], " nan" if keyword == "v" else " 0"
    width = max([2 if keyword == "vt" else 3, *(min(lines.kinds[at].width, MOST[keyword]) for at in rows)])
    padded = (lines.texts[at][len(keyword) :] + fill * (width - lines.kinds[at].width) for at in rows)
    numbers = np.fromstring(" ".join(padded) + " 0" * width, sep=" ")
    return numbers.reshape(-1, width)


def _indices(lines: _Lines, at: Ints, width: Ints) -> Ints:
    """Return the indices (c, 3) of v, vt and vn, as written, of all corners of faces in lines (m,)."""
    found = np.full((width.sum(), 3), ABSENT)
    same: dict[tuple[str, int], tuple[list[int], list[str]]] = defaultdict(lambda: ([], []))
    for line, begin in zip(at.tolist(), (np.cumsum(width) - width).tolist(), strict=True):
        _, count, form = lines.kinds[line]
        if form:
            places, texts = same[form, count]
            places.append(begin)
            texts.append(lines.texts[line][1:])
        for k, word in enumerate(() if form else words(lines.texts[line])[1:]):
            places, texts = same[_form(word), 1]
            places.append(begin + k)
            texts.append(word)
    for (form, count), (places, texts) in same.items():
        columns = [column for column, index in enumerate(form.split("/")) if index]
        numbers = np.fromstring(" ".join(texts).replace("/", " "), np.int64, sep=" ")
        corners = np.add.outer(places, np.arange(count)).reshape(-1, 1)
        found[corners, columns] = np.maximum(numbers, ABSENT + 1).reshape(len(corners), len(columns))
    return found


def _resolved(lines: _Lines, at: Ints, width: Ints, written: Ints, strict: bool) -> Ints:
    """Return indices (c, 3) that count from 1, 0 for none, after a check; negative ones count back."""
    line = np.repeat(at, width)
    before = np.stack([np.searchsorted(rows, line) for rows in lines.rows.values()], 1)
    sizes = np.array([len(rows) for rows in lines.rows.values()])
    index = np.where(written < 0, before + 1 + written, written)
    given = written != ABSENT
    for column, keyword in enumerate(lines.rows):
        if column and not sizes[column] and given[:, column].any():
            first = int(given[:, column].argmax())
            message = f"f uses {keyword} {written[first, column]}; there is none, so all are left out"
            warn(f"{lines.name} line {line[first] + 1}: {message}", strict)
            given[:, column] = False
    wrong = np.flatnonzero((given & ((index < 1) | (index > sizes))).ravel())
    if wrong.size:
        corner, column = divmod(int(wrong[0]), 3)
        size, back = sizes[column], before[corner, column]
        limit = f"in [1, {size}], or in [-{back}, -1] counting back" if size else "left out"
        word = words(lines.texts[line[corner]])[1 + corner - int(np.flatnonzero(line == line[corner])[0])]
        uses = f"f uses {list(lines.rows)[column]} {int(word.split('/')[column])}"
        raise SceneError(f"{lines.name} line {line[corner] + 1}: {uses}; it must be {limit}")
    return np.where(given, index, 0)


def _mesh(material: str, at: Ints, width: Ints, corner: Ints, tables: dict[str, Table]) -> RawMesh:
    """Return the mesh of faces in lines (m,) with so many corners (m,), whose indices are (c, 3).

    If one corner has a vt or a vn, all get one: a vt of 0, and a vn of length 0 for a face without normals,
    which is flat.
    """
    rows: dict[str, Ints] = {}
    vertex = np.zeros(len(corner), np.int64)
    face = np.repeat(np.arange(width.size), width)
    for column, (keyword, table) in enumerate(tables.items()):
        index = corner[:, column]
        if index.any():
            index = np.where(index > 0, index, len(table) + (face if keyword == "vn" else 0))
            several = int(index.max()) + 1
            pairs, vertex = _distinct(vertex * several + index)
            of, index = np.divmod(pairs, several)
            rows = {before: row.take(of) for before, row in rows.items()}
            rows[keyword] = np.minimum(index, len(table)) - 1
    values = {keyword: tables[keyword][row] for keyword, row in rows.items()}
    count = width - 2
    face = np.repeat(np.arange(width.size), count)
    number = np.arange(face.size) - (np.cumsum(count) - count).take(face)  # of the triangle in its face
    first = (np.cumsum(width) - width).take(face)
    triangles = np.stack([first, first + number + 1, first + number + 2], 1)
    second = (count.take(face) == 2) & (number == 1)
    triangles[second] = np.roll(triangles[second], -1, 1)
    if (count == 2).all():  # first all first halves, then all second halves
        order = np.argsort(number, kind="stable")
        triangles, face = triangles.take(order, 0), face.take(order)
    raw = RawMesh(material, values["v"][:, :3], vertex.take(triangles), values.get("vn"))
    raw.uvs, raw.colors = values.get("vt"), values["v"][:, 3:6] if values["v"].shape[1] > 5 else None
    raw.lines = at.take(face) + 1
    return raw


def _distinct(index: Ints) -> tuple[Ints, Ints]:
    """Return the distinct numbers (k,) of some (c,) in rising order, and the place of each in these."""
    low, high = int(index.min()), int(index.max())
    if high - low > 4 * index.size:
        values, place = np.unique(index, return_inverse=True)
        return values, place
    there = np.zeros(high - low + 1, np.bool_)
    there[index - low] = True
    return np.flatnonzero(there) + low, (np.cumsum(there) - 1).take(index - low)

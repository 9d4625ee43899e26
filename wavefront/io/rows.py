"""Rows of numbers and lists as whole columns, as PLY and OFF have them, and the faces in such lists.

Damaged rows are marked, or noted and left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bools, Doubles, Ints
from ..core.plural import plural
from .losses import Losses
from .polygons import fans_by_size, triangulate
from .text_lines import NUMBER

NAME = "geometry_0"  # of the mesh of a file with one


class Property(NamedTuple):
    """A property of an element, with the code of NumPy for its type."""

    name: str
    kind: str
    length: str = ""  # of a list, that of its length

    @property
    def size(self) -> int:
        """The bytes of one value."""
        return int(self.kind[1])


@dataclass
class Element:
    """One kind of element of the header."""

    name: str
    count: int  # rows, as the header says
    properties: list[Property] = field(default_factory=list)


@dataclass
class Rows:
    """The rows of an element that are there."""

    element: Element
    count: int
    columns: dict[str, NDArray[Any]] = field(default_factory=dict)  # (count,), by the name of the property
    lists: dict[str, tuple[Ints, NDArray[Any]]] = field(default_factory=dict)  # lengths (count,), all values
    bad: Bools | None = None  # (count,) where a row lacks something
    long: Bools | None = None  # (count,) where words follow that are not read
    lines: Ints | None = None  # (count,) of a text

    def place(self, row: Any) -> str:
        """Return where a row is, for messages."""
        return f"{self.element.name} {row}" if self.lines is None else f"line {self.lines[row]}"

    def table(self, names: Iterable[str]) -> Doubles | None:
        """Return columns (count, k), None if one is missing."""
        columns = [self.columns.get(name) for name in names]
        numbers = [_as(column, "f8") for column in columns if column is not None]
        return np.stack(numbers, 1) if len(numbers) == len(columns) else None

    def units(self, names: Iterable[str]) -> Doubles | None:
        """Return columns as `table`, divided by the largest whole number of their type.

        Larger types than two bytes often have bytes in them.
        """
        kinds = {prop.name: prop.kind for prop in self.element.properties}
        table = self.table(names := tuple(names))
        if table is None:
            return None
        for i, name in enumerate(names):
            if kinds[name][0] != "f":
                byte = kinds[name] not in ("u1", "u2") and table[:, i].max(initial=0) <= 255
                table[:, i] /= 255 if byte else np.iinfo(kinds[name]).max
        return table


def rows_of_lines(element: Element, lines: list[list[str]]) -> Rows:
    """Return the rows of an element, each from the words of a line."""
    widths = np.array([len(words) for words in lines], np.intp)
    values = _numbers([word for words in lines for word in words])
    end = np.cumsum(widths)
    at, bad = end - widths, np.zeros(len(lines), np.bool_)
    rows = Rows(element, len(lines), bad=bad)
    padded = np.append(values, np.nan)
    for prop in element.properties:
        column = np.where(at < end, padded[np.minimum(at, len(values))], np.nan)
        bad |= at >= end
        at = at + 1
        if prop.length:
            whole = (column >= 0) & (column <= end - at) & (column == np.rint(column))
            counts = np.where(whole, column, 0).astype(np.intp)
            bad |= ~whole
            rows.lists[prop.name] = counts, values[ranges(at, counts)]
            at = at + counts
        else:
            rows.columns[prop.name] = _as(column, "f4") if prop.kind == "f4" else column
    rows.long = (at < end) & ~bad
    return rows


def _as(values: NDArray[Any], kind: str) -> NDArray[Any]:
    """Return values as numbers of a type: a signaling NaN as any NaN, and too large values as infinite."""
    with np.errstate(all="ignore"):
        return values.astype(kind)


def _numbers(words: list[str]) -> Doubles:
    """Return the numbers of words, NaN for those that are none."""
    try:
        if "_" not in "".join(words):
            return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        pass
    numbers = (float(word) if NUMBER.fullmatch(word) else np.nan for word in words)
    return np.fromiter(numbers, np.float64, len(words))


def ranges(starts: Ints, counts: Ints) -> Ints:
    """Return the numbers from each start on, as many as its count, one range after the other."""
    return np.repeat(starts - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


class Faces(NamedTuple):
    """Triangles of the faces of a file."""

    triangles: Ints  # (m, 3) vertices
    row: Ints  # (m,) of each
    corner: Ints  # (m, 3) numbers of the corners, counted through all rows


NONE = Faces(np.zeros((0, 3), np.intp), np.zeros(0, np.intp), np.zeros((0, 3), np.intp))


def note_damage(losses: Losses, elements: dict[str, Rows]) -> None:
    """Note rows that are missing or damaged."""
    for name, rows in elements.items():
        absent = rows.element.count - rows.count
        if absent and rows.element.properties:
            done = "missing, as the file ends before"
            losses.note(f"the last {plural(absent, 'row')} of {name}", done=done)
        note_rows(losses, rows, rows.bad, "with too few or malformed words")
        note_rows(losses, rows, rows.long, "with more words", "these are not read")


def note_rows(losses: Losses, rows: Rows, chosen: Bools | None, what: str, done: str = "left out") -> None:
    """Note the chosen rows (count,), if there are any."""
    if chosen is not None and chosen.any():
        count = plural(int(chosen.sum()), f"row of {rows.element.name}", f"rows of {rows.element.name}")
        losses.note(f"{count} {what}, first: {rows.place(int(chosen.argmax()))}", done=done)


def bad_rows(rows: Rows) -> Bools:
    """Return which rows (count,) lack something."""
    return np.zeros(rows.count, np.bool_) if rows.bad is None else rows.bad


def faces_of_rows(losses: Losses, rows: Rows, named: str, points: Doubles) -> Faces:
    """Return the triangles of the faces whose vertices are in a list of rows; damaged faces are noted."""
    counts, values = rows.lists[named]
    with np.errstate(all="ignore"):
        corners = values.astype(np.intp)
    inside = (corners == values) & (corners >= 0) & (corners < len(points))
    row = np.repeat(np.arange(rows.count), counts)
    lost, short = np.zeros(rows.count, np.bool_), counts < 3
    lost[row[~inside]] = True
    note_rows(losses, rows, short & ~bad_rows(rows), "with fewer than 3 corners")
    note_rows(losses, rows, lost, f"with a vertex beyond the {len(points)}")
    sound = np.flatnonzero(~(lost | short | bad_rows(rows)))
    places = np.flatnonzero(np.isin(row, sound)) if len(sound) < rows.count else np.arange(len(row))
    corner, polygon = triangulate(points, corners[places], counts[sound], fans_by_size)
    corner = places[corner]
    return Faces(corners[corner], sound[polygon], corner)

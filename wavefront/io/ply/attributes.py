"""Attributes of vertices and faces in PLY files, by the names that Mitsuba gives them.

Source: the documentation of Mitsuba 3, plugin "ply".
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ...arrays.vec import Ints
from ..repair import Table
from ..rows import Rows

SERIES = (("r", "g", "b"), ("red", "green", "blue"), ("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"))
OWN = re.compile(r"n?[xyz]|[uvst]|texture_[uv]|vertex_ind\w+")  # properties that are no attributes


def ply_attributes(rows: dict[str, Rows], face: Ints) -> dict[str, Table]:
    """Return the attributes of a file, (n, 1 or 3) for each name, given the face (m,) of each triangle."""
    found: dict[str, Table] = {}
    for kind in ("vertex", "face"):
        columns = rows[kind].columns if kind in rows else {}
        names = [name for name in columns if not OWN.fullmatch(name)]

        def add(name: str, parts: Sequence[str], kind: str = kind) -> None:
            values = rows[kind].units(parts)
            if values is not None:
                found.setdefault(f"{kind}_{name}", values if kind == "vertex" else values[face])

        for colors in (("r", "g", "b"), ("red", "green", "blue")):
            if set(colors) <= set(names):
                add("color", colors)
        for name in names:
            prefix, separator, last = name.rpartition("_")
            series = next((each for each in SERIES if last == each[0]), None)
            if separator and series is not None:
                parts = [f"{prefix}_{each}" for each in series]
                add(prefix, parts if set(parts) <= set(names) else [name])
    return found

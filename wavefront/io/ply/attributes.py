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
    attributes: dict[str, Table] = {}
    for kind in ("vertex", "face"):
        columns = rows[kind].columns if kind in rows else {}
        names = [name for name in columns if not OWN.fullmatch(name)]

        def add(name: str, components: Sequence[str], kind: str = kind) -> None:
            values = rows[kind].units(components)
            if values is not None:
                attributes.setdefault(f"{kind}_{name}", values if kind == "vertex" else values[face])

        for colors in (("r", "g", "b"), ("red", "green", "blue")):
            if set(colors) <= set(names):
                add("color", colors)
        for name in names:
            prefix, separator, last = name.rpartition("_")
            series = next((suffixes for suffixes in SERIES if last == suffixes[0]), None)
            if separator and series is not None:
                components = [f"{prefix}_{suffix}" for suffix in series]
                add(prefix, components if set(components) <= set(names) else [name])
    return attributes

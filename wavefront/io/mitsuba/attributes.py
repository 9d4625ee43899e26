"""Attributes of vertices and faces in PLY files, by the names that Mitsuba gives them.

Source: the documentation of Mitsuba 3, plugin "ply".
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...arrays.vec import Ints
from ...core.errors import SceneError
from ..description.entity import Entity
from ..ply.rows import Rows
from ..repair import RawMesh, Table, with_face_colors

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


def with_attribute(name: str, raw: RawMesh, entity: Entity) -> RawMesh:
    """Return a mesh whose colors are the attribute that the textures of its shape show."""
    wanted = sorted(_shown(entity))
    there = [each for each in wanted if each in raw.attributes]
    for each in wanted:
        if each not in there[:1]:
            entity.lose(f"the attribute {each!r}")
    if not there:
        return raw
    values = raw.attributes[there[0]]
    rgba = np.hstack([values if values.shape[1] == 3 else np.repeat(values, 3, 1), np.ones((len(values), 1))])
    if there[0].startswith("face_"):
        if len(rgba) != len(raw.faces):
            raise SceneError(f"{name}: has {len(rgba)} rows of {there[0]} and {len(raw.faces)} triangles")
        return with_face_colors(raw, rgba)
    raw.colors = rgba
    return raw


def _shown(entity: Entity) -> set[str]:
    """Return the names of the attributes that a plugin and those in it show."""
    if entity.type == "mesh_attribute":
        return {entity.text("name")}
    return {name for value in entity.values.values() if isinstance(value, Entity) for name in _shown(value)}

"""Attributes of vertices and faces in PLY files, by the names that Mitsuba gives them.

Source: the documentation of Mitsuba 3, plugin "ply".
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...core.errors import SceneError
from ..repair import RawMesh, Table, with_face_colors
from .nodes import Node

SERIES = (("r", "g", "b"), ("red", "green", "blue"), ("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"))
OWN = re.compile(r"n?[xyz]|[uvst]|texture_[uv]|vertex_ind\w+")  # properties that are no attributes


def ply_attributes(elements: dict[str, Any]) -> dict[str, Table]:
    """Return the attributes of the elements of a file, as trimesh keeps them: (n, 1 or 3) for each name."""
    found: dict[str, Table] = {}
    for kind in ("vertex", "face"):
        element = elements.get(kind, {})
        names = [name for name in element.get("properties", {}) if not OWN.fullmatch(name)]
        for colors in (("r", "g", "b"), ("red", "green", "blue")):
            if set(colors) <= set(names):
                found[f"{kind}_color"] = _columns(element, colors)
        for name in names:
            prefix, separator, last = name.rpartition("_")
            series = next((each for each in SERIES if last == each[0]), None)
            if separator and series is not None:
                parts = [f"{prefix}_{each}" for each in series]
                columns = parts if set(parts) <= set(names) else [name]
                found.setdefault(f"{kind}_{prefix}", _columns(element, columns))
    return found


def with_attribute(name: str, raw: RawMesh, node: Node) -> RawMesh:
    """Return a mesh whose colors are the attribute that the textures of its shape show."""
    wanted = sorted(_shown(node))
    there = [each for each in wanted if each in raw.attributes]
    for each in wanted:
        if each not in there[:1]:
            node.lose(f"the attribute {each!r}")
    if not there:
        return raw
    values = raw.attributes[there[0]]
    rgba = np.hstack([values if values.shape[1] == 3 else np.repeat(values, 3, 1), np.ones((len(values), 1))])
    if there[0].startswith("face_"):
        if len(rgba) != len(raw.faces):
            raise SceneError(f"{name}: has {len(rgba)} rows of {there[0]} and {len(raw.faces)} triangles")
        return with_face_colors(name, raw, rgba)
    raw.colors = rgba
    return raw


def _shown(node: Node) -> set[str]:
    """Return the names of the attributes that a plugin and those in it show."""
    if node.plugin == "mesh_attribute":
        return {node.text("name")}
    return {name for value in node.values.values() if isinstance(value, Node) for name in _shown(value)}


def _columns(element: dict[str, Any], names: Any) -> Table:
    columns = [np.asarray(element["data"][name]).reshape(-1) for name in names]
    scale = [np.iinfo(each.dtype).max if each.dtype.kind in "ui" else 1 for each in columns]
    return np.stack([each.astype(np.float64) / most for each, most in zip(columns, scale, strict=True)], 1)

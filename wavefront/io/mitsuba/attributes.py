"""Attributes of vertices and faces, which a texture of Mitsuba may show."""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ..description.entity import Entity
from ..repair import RawMesh, with_face_colors


def with_attribute(name: str, raw: RawMesh, entity: Entity) -> RawMesh:
    """Return a mesh whose colors are the attribute that the textures of its shape show."""
    wanted = sorted(_shown(entity))
    available = [attribute for attribute in wanted if attribute in raw.attributes]
    for attribute in wanted:
        if attribute not in available[:1]:
            entity.lose(f"the attribute {attribute!r}")
    if not available:
        return raw
    values = raw.attributes[available[0]]
    rgba = np.hstack([values if values.shape[1] == 3 else np.repeat(values, 3, 1), np.ones((len(values), 1))])
    if available[0].startswith("face_"):
        if len(rgba) != len(raw.faces):
            raise SceneError(f"{name}: has {len(rgba)} rows of {available[0]} and {len(raw.faces)} triangles")
        return with_face_colors(raw, rgba)
    raw.colors = rgba
    return raw


def _shown(entity: Entity) -> set[str]:
    """Return the names of the attributes that a plugin and those in it show."""
    if entity.type == "mesh_attribute":
        return {entity.text("name")}
    return {name for value in entity.values.values() if isinstance(value, Entity) for name in _shown(value)}

"""The state of a scene, which tells whether it was changed."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..camera import Camera
from ..core.parameter import Parametrized
from ..lights import Light
from ..media import BaseMedium
from ..shapes import Shape
from ..textures.base import BaseTexture
from .scene import Scene

GIVEN = ("_material", "_emission")  # attributes of shapes that a user assigns
FEW = 64  # numbers of an array that are compared; of larger ones it is which array it is
PARTS = (Parametrized, Shape, Light, BaseMedium, BaseTexture, Camera)


def scene_state(scene: Scene) -> Any:
    """Return the state of a scene, which differs once an object of it has been changed or replaced.

    Elements of large arrays are not looked at.
    """
    seen: dict[int, Any] = {}
    elements = [*scene.shapes, *scene.lights, scene.medium]
    return [id(element) for element in elements], [_state(element, seen) for element in elements], list(seen)


def _state(value: Any, seen: dict[int, Any]) -> Any:
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.size <= FEW else id(value)
    if isinstance(value, str | bytes | int | float | bool | None):
        return value
    if isinstance(value, tuple | list):
        return [_state(element, seen) for element in value[:FEW]], len(value)
    if not isinstance(value, PARTS) or id(value) in seen:
        return id(value)
    seen[id(value)] = value
    attributes = {
        name: field for name, field in vars(value).items() if name in GIVEN or not name.startswith("_")
    }
    return [(name, _state(field, seen)) for name, field in attributes.items()]

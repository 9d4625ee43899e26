"""The operations of a transform in scene files of Mitsuba."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...core.errors import SceneError, finite_array
from ...motion import Motion, Product
from ...shapes.transform import Matrix, rotation, translation
from ..description.entity import Entity
from ..description.placing import in_range
from ..description.views import looking
from ..text_lines import numbers

Attributes = Mapping[str, str]


def product(steps: list[tuple[str, Attributes, str]]) -> Matrix:
    """Return the matrix (4, 4) of operations, the first of which is applied first.

    Parameters
    ----------
    steps
        Name, attributes and place of each.

    Raises
    ------
    SceneError
        If one is malformed. The message names its place.
    """
    matrix = np.eye(4)
    for name, attributes, place in steps:
        if name.lower() not in OPERATIONS:
            raise SceneError(f"{place}: <{name}> is no operation; there are {', '.join(OPERATIONS)}")
        operation, known = OPERATIONS[name.lower()]
        unknown = attributes.keys() - set(known.split())
        if unknown:
            raise SceneError(f"{place}: <{name}> has the unknown attribute {min(unknown)!r}")
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = operation(place, attributes) @ matrix
    if not np.isfinite(matrix).all():
        raise SceneError(f"{steps[-1][2]}: the transform is not finite")
    return matrix


def to_world(entity: Entity) -> Matrix:
    """Return the transform of a plugin, (4, 4)."""
    return entity.or_default(np.eye(4), lambda: _checked(entity, "to_world"))


def moved(entity: Entity, converted: list[Any]) -> list[Any]:
    """Return the objects of a plugin, moving by its `to_world` if that is a motion."""
    motion = entity.values.get("to_world")
    if not isinstance(motion, Motion):
        return converted
    with entity.lost.part(entity.label, "its motion left out; it stands where it begins"):
        from_start = Product(motion, np.asarray(np.linalg.inv(motion.at(motion.start)), np.float64))
        return [element.transformed(from_start) for element in converted]
    return converted


def plain(value: Any) -> Any:
    """Return the array of a transform of Mitsuba; all else as it is."""
    return value if isinstance(value, Entity) else getattr(value, "matrix", value)


def _checked(entity: Entity, name: str) -> Matrix:
    value = entity.get(name, np.eye(4))
    value = value.at(value.start) if isinstance(value, Motion) else value
    matrix = finite_array(name, plain(value), (4, 4))
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        if matrix[3, :3].any() or not matrix[3, 3] > 0:
            raise SceneError(f"{name} has the last row {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
        entity.lost.note(f"{name} has the last row", entity.label, str(matrix[3].tolist()), "divided by it")
        matrix = matrix / matrix[3, 3]
    if not in_range(matrix[None])[0]:
        raise SceneError(f"{name} has an element of size {np.abs(matrix).max():g}, which is too large")
    return matrix


def vector(place: str, name: str, attributes: Mapping[str, str], default: float) -> list[float]:
    """Return (3,) given as a value, or as x, y and z."""
    if "value" not in attributes:
        return [
            numbers(place, f"{name} {x}", attributes[x], (1,))[0] if x in attributes else default
            for x in "xyz"
        ]
    if attributes.keys() & {"x", "y", "z"}:
        raise SceneError(f"{place}: {name} has a value, and x, y or z; give one of them")
    values = numbers(place, name, attributes["value"], (1, 3))
    return values * (3 // len(values))


def _translate(place: str, attributes: Attributes) -> Matrix:
    return translation(f"{place}: <translate>", vector(place, "<translate>", attributes, 0.0))


def _rotate(place: str, attributes: Attributes) -> Matrix:
    axis = vector(place, "<rotate>", attributes, 0.0)
    (angle,) = numbers(place, "angle", attributes.get("angle", ""), (1,))
    return rotation(f"{place}: <rotate>", axis, angle, (0, 0, 0))


def _scale(place: str, attributes: Attributes) -> Matrix:
    return np.diag([*vector(place, "<scale>", attributes, 1.0), 1.0])


def _look_at(place: str, attributes: Attributes) -> Matrix:
    texts = (attributes.get("origin", ""), attributes.get("target", ""), attributes.get("up", "0 0 0"))
    rows = [
        np.array(numbers(place, name, text, (3,)))
        for name, text in zip(("origin", "target", "up"), texts, strict=True)
    ]
    return looking(f"{place}: <lookat>", *rows)


def _matrix(place: str, attributes: Attributes) -> Matrix:
    values = numbers(place, "<matrix>", attributes.get("value", ""), (9, 16))
    size = 3 if len(values) == 9 else 4
    matrix = np.eye(4)
    matrix[:size, :size] = np.reshape(values, (size, size))
    return matrix


OPERATIONS: dict[str, tuple[Callable[[str, Attributes], Matrix], str]] = {
    "translate": (_translate, "value x y z"),
    "rotate": (_rotate, "value x y z angle"),
    "scale": (_scale, "value x y z"),
    "lookat": (_look_at, "origin target up"),
    "matrix": (_matrix, "value"),
}

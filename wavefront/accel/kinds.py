"""The table of the kinds of curved primitives."""

from __future__ import annotations

from ..core.errors import SceneError
from ..shapes import CurvedShape
from .capsule import CapsulePrimitives
from .cylinder import CylinderPrimitives
from .distance_grid import DistanceGridPrimitives
from .primitives import CurvedPrimitives
from .sphere import SpherePrimitives

KINDS: tuple[type[CurvedPrimitives], ...] = (
    SpherePrimitives,
    CylinderPrimitives,
    CapsulePrimitives,
    DistanceGridPrimitives,
)


def kind_of(shape: CurvedShape) -> type[CurvedPrimitives]:
    """Return the kind of the primitives that a shape is made of.

    Raises
    ------
    SceneError
        If there is none.
    """
    for kind in KINDS:
        if isinstance(shape, kind.shapes):
            return kind
    raise SceneError(f"{shape.name}: cannot trace a {type(shape).__name__}")

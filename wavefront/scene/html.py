"""The HTML of a scene in notebooks: counts, bounds, and tables of its materials and lights."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from ..arrays.vec import Doubles
from ..camera import Camera
from ..core.html import table_html
from ..core.parameter import brief
from ..core.plural import plural
from ..lights import Light
from ..shapes import CurvedShape, Instance, Mesh, Shape


def scene_html(
    shapes: Sequence[Shape],
    lights: Sequence[Light],
    camera: Camera | None,
    bounds: Doubles | None,
) -> str:
    """Return a scene as HTML.

    Parameters
    ----------
    shapes, lights, camera
        What it holds.
    bounds
        (2, 3) lower and upper corner; None if there are no shapes.
    """
    lines = [", ".join(_counts(shapes, lights))]
    if bounds is not None:
        lines.append(f"bounds {brief(bounds[0])} to {brief(bounds[1])}")
    lines.append("no camera; the scene is framed" if camera is None else repr(camera))
    text = "<br>".join(escape(line) for line in lines)
    tables = table_html("Materials", _material_rows(shapes)) + table_html(
        "Lights", _light_rows(shapes, lights)
    )
    return f"<div><b>Scene</b><br>{text}{tables}</div>"


def _counts(shapes: Sequence[Shape], lights: Sequence[Light]) -> list[str]:
    """Return how many there are of each kind."""
    bare = [shape.mesh if isinstance(shape, Instance) else shape for shape in shapes]
    counts = {
        "shape": len(shapes),
        "instance": sum(isinstance(shape, Instance) for shape in shapes),
        "triangle": sum(len(shape.faces) for shape in bare if isinstance(shape, Mesh)),
        "curved primitive": sum(_curved(shape) for shape in bare),
        "light": len(lights) + sum(shape.emission is not None for shape in shapes),
    }
    return [plural(count, kind) for kind, count in counts.items() if count or kind in ("shape", "light")]


def _curved(shape: Shape) -> int:
    return shape.count if isinstance(shape, CurvedShape) else 0


def _material_rows(shapes: Sequence[Shape]) -> list[list[Any]]:
    """Return a row for each material: its name, its BSDF, and the shapes that have it."""
    users: dict[int, list[Shape]] = {}
    for shape in shapes:
        users.setdefault(id(shape.material), []).append(shape)
    rows = []
    for shapes_of in users.values():
        material = shapes_of[0].material
        of = shapes_of[0].name if len(shapes_of) == 1 else f"{len(shapes_of)} shapes"
        rows.append([material.name or "", repr(material.bsdf), of])
    return rows


def _light_rows(shapes: Sequence[Shape], lights: Sequence[Light]) -> list[list[Any]]:
    """Return the lights, and the shapes that emit."""
    rows = [[repr(light), ""] for light in lights]
    emitting = [shape for shape in shapes if shape.emission is not None]
    return rows + [[repr(shape), f"emits {brief(shape.emission)}"] for shape in emitting]

"""Scenes of extreme size are rendered in another unit of length, for the range of float32.

Ray queries and light samples multiply up to three lengths, and shading divides by squares of them. If a
scene is about 10¹³ or 10⁻¹⁴ units large, such products overflow or underflow in float32. Every length of
such a scene is multiplied by one power of two, which is exact. Radiance does not depend on the unit of
length; lengths that a render returns are divided by the factor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from operator import attrgetter
from typing import Any

import numpy as np

from ..arrays.vec import Doubles
from ..core.errors import SceneError
from ..lights import Light
from ..materials import Material
from ..media import BaseMedium
from ..shapes import CurvedShape, Instance, Mesh, Shape
from ..shapes.instance import of_class

# Radii of scenes that are not scaled. The upper limit is nearer: no part of a scene is larger than it.
MIN_RADIUS, MAX_RADIUS = 2.0**-20, 2.0**24
MAX_DISTANCE = 2.0**60  # of cameras and lights from the scene's center, in scaled units


def length_factor(radius: float) -> float:
    """Return 1 for a radius in the safe range, else the power of two that scales it into [1, 2)."""
    if radius == 0 or MIN_RADIUS <= radius <= MAX_RADIUS:
        return 1.0
    return 2.0 ** (1 - int(np.frexp(radius)[1]))


def scaled_shapes(shapes: Sequence[Shape], factor: float) -> list[Shape]:
    """Return shapes, and their materials, with all lengths multiplied by `factor`.

    Instanced meshes are traced in their own coordinates, so each has its own factor, which the transforms
    cancel. Shared meshes, materials and media stay shared.
    """
    placed = {id(mesh): mesh for mesh in map(attrgetter("mesh"), of_class(shapes, Instance))}
    factors = {key: length_factor(_radius(mesh)) for key, mesh in placed.items()}
    if factor == 1 and all(mesh_factor == 1 for mesh_factor in factors.values()):
        return list(shapes)
    materials: dict[int, Material] = {}
    media: dict[int, BaseMedium] = {}

    def material(unscaled: Material) -> Material:
        if id(unscaled) not in materials:
            materials[id(unscaled)] = scaled = unscaled.scaled(factor)
            if scaled.interior is not unscaled.interior and scaled.interior is not None:
                scaled.interior = media.setdefault(id(unscaled.interior), scaled.interior)
        return materials[id(unscaled)]

    meshes = {
        key: _with_material(mesh.lengths_times(factors[key]), material(mesh.material))
        for key, mesh in placed.items()
    }
    out: list[Shape] = []
    for shape in shapes:
        if isinstance(shape, Instance):
            resized: Shape = shape.with_mesh(factor, meshes[id(shape.mesh)], factors[id(shape.mesh)])
        elif isinstance(shape, Mesh | CurvedShape):
            resized = shape.lengths_times(factor)
        else:
            raise SceneError(f"{shape.name}: cannot scale a {type(shape).__name__}")
        out.append(_with_material(resized, material(shape.material)))
    return out


def _radius(mesh: Mesh) -> float:
    """Return half of the diagonal of a mesh's box."""
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) / 2


def _with_material(shape: Any, material: Material) -> Any:
    """Return a shape with a material; itself if it has that already."""
    if shape.material is material:
        return shape
    changed = copy(shape)
    changed.material = material
    return changed


def check_lights(lights: Iterable[Light], center: Doubles, factor: float) -> None:
    """Check that no light is so far away that float32 cannot square its distance.

    Raises
    ------
    SceneError
        If the position of one is.
    """
    for light in lights:
        if light.bounds is not None:
            for corner in light.bounds:
                check_distance(f"{type(light).__name__} position", corner, center, factor)


def check_distance(name: str, position: Doubles, center: Doubles, factor: float) -> None:
    """Check that float32 can square the distance of a position (3,) from the scene.

    Parameters
    ----------
    name
        Name of the position, for the message.
    center
        (3,) of the scene, scene units.
    factor
        Lengths are multiplied by this for the render.

    Raises
    ------
    SceneError
        If it cannot.
    """
    distance, limit = float(np.linalg.norm(position - center)), MAX_DISTANCE / factor
    if not distance <= limit:
        raise SceneError(
            f"{name} is {position.tolist()}, {distance:.3g} from the center of the scene; "
            f"in a scene of this size it must be at most {limit:.3g} from it"
        )

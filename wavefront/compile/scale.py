"""Scenes of extreme size, brought to a unit of length in which float32 has room.

Ray queries and light samples multiply up to three lengths, and shading divides by squares of them. Where a
scene is some 10¹³ units large, or 10⁻¹⁴, such products leave the range of float32 without a word. Such a
scene is rendered in another unit of length: every length is multiplied by one power of two, which rounds
nothing. What a picture holds is free of lengths; what a render returns in scene units is divided by the
factor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..lights import Light
from ..materials import Material
from ..shapes import Instance, Mesh, Shape, Sphere

# Radii of scenes that stay as they are. There is more room above: parts of a scene are only ever smaller.
SMALLEST, LARGEST = 2.0**-20, 2.0**24
FARTHEST = 2.0**60  # of cameras and lights from the scene's center, as the render counts lengths


def length_factor(radius: float) -> float:
    """Return the power of two that brings a radius beyond the safe range into [1, 2); within it 1."""
    if radius == 0 or SMALLEST <= radius <= LARGEST:
        return 1.0
    return 2.0 ** (1 - int(np.frexp(radius)[1]))


def scaled_shapes(shapes: Sequence[Shape], factor: float) -> list[Shape]:
    """Return shapes, and their materials, with all lengths multiplied by `factor`.

    Meshes that are placed by instances are traced in frames of their own, so each gets a factor of its
    own, and the transforms make up for it. What is shared stays shared.
    """
    placed = {id(shape.mesh): shape.mesh for shape in shapes if isinstance(shape, Instance)}
    own = {key: length_factor(_radius(mesh)) for key, mesh in placed.items()}
    if factor == 1 and all(each == 1 for each in own.values()):
        return list(shapes)
    materials: dict[int, Material] = {}

    def material(given: Material) -> Material:
        if id(given) not in materials:
            materials[id(given)] = given.scaled(factor)
        return materials[id(given)]

    meshes = {
        key: _with_material(mesh.scaled(own[key]), material(mesh.material)) for key, mesh in placed.items()
    }
    out: list[Shape] = []
    for shape in shapes:
        if isinstance(shape, Instance):
            part: Shape = shape.scaled(factor, meshes[id(shape.mesh)], own[id(shape.mesh)])
        elif isinstance(shape, Mesh | Sphere):
            part = shape.scaled(factor)
        else:
            raise SceneError(f"{shape.name}: cannot scale a {type(shape).__name__}")
        out.append(_with_material(part, material(shape.material)))
    return out


def _radius(mesh: Mesh) -> float:
    """Return half of the diagonal of a mesh's box."""
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) / 2


def _with_material(shape: Any, material: Material) -> Any:
    """Return a shape with this material: itself where it has it."""
    if shape.material is material:
        return shape
    changed = copy(shape)
    changed.material = material
    return changed


def check_lights(lights: Iterable[Light], center: NDArray[np.float64], factor: float) -> None:
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


def check_distance(
    name: str, position: NDArray[np.float64], center: NDArray[np.float64], factor: float
) -> None:
    """Check that float32 can square the distance of a position (3,) from the scene.

    Parameters
    ----------
    name
        Of the position, for the message.
    center
        (3,) of the scene, scene units.
    factor
        By which lengths are multiplied for the render.

    Raises
    ------
    SceneError
        If it cannot.
    """
    distance, limit = float(np.linalg.norm(position - center)), FARTHEST / factor
    if not distance <= limit:
        raise SceneError(
            f"{name} is {position.tolist()}, {distance:.3g} from the center of the scene; "
            f"in a scene of this size it must be at most {limit:.3g} from it"
        )

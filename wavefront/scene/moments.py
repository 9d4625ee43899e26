"""A scene that moves, at a time: still objects are shared, and many instances are placed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays.vec import Bools, Doubles
from ..motion import Keyframes, Together
from ..motion.quaternions import determinants
from ..shapes import Instance, Shape
from ..shapes.instance import placed_together

FLAT = 1e-30  # determinant of a matrix, relative to the cube of its largest element, that flattens a mesh
MOMENTS = 17  # times that say how far a moving scene reaches


class Moments:
    """The shapes of a scene that move.

    Parameters
    ----------
    shapes
        Of the scene.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._key = _identity(shapes)
        self._shapes = self._key[0]
        motions, forms = self._key[-2:]
        still = all(motion is None for motion in motions) and all(motion is None for motion in forms)
        moving = [] if still else [number for number, shape in enumerate(shapes) if shape.moves]
        placed = [number for number in moving if isinstance(shapes[number], Instance)]
        self.carried = [number for number in placed if shapes[number].motion is not None]
        known = set(self.carried)
        self.others = [number for number in moving if number not in known]
        self._may_flatten = any(type(shapes[number].motion) is not Keyframes for number in self.carried)
        self._motions = Together([shapes[number].motion for number in self.carried])  # type: ignore[misc]
        self.spans = {shapes[number].time_span for number in moving}

    @property
    def any(self) -> bool:
        """Whether a shape moves or deforms."""
        return bool(self.carried or self.others)

    def fits(self, shapes: Sequence[Shape]) -> bool:
        """Return whether these are still the shapes, with the same motions."""
        return self._key == _identity(shapes)

    def at(self, time: float) -> list[Shape]:
        """Return the shapes at a time; those that a motion flattens to nothing are left out."""
        shapes: list[Any] = list(self._shapes)
        deforming = {id(mesh): mesh for mesh in self._key[1] if mesh is not None and mesh.moves}
        forms = {number: mesh.at(time) for number, mesh in deforming.items()}
        for number in self.others:
            shape = shapes[number]
            if isinstance(shape, Instance):
                shapes[number] = shape.placed_as(forms[id(shape.mesh)], shape.transform)
            else:
                shapes[number] = forms.get(id(shape)) or shape.at(time)
        matrices = self._motions.at(time)
        instances = [shapes[number] for number in self.carried]
        for number, instance in zip(self.carried, placed_together(instances, matrices, forms), strict=True):
            shapes[number] = instance
        flat = np.flatnonzero(_flattens(matrices)) if self._may_flatten else ()
        for at in map(int, flat):
            shapes[self.carried[at]] = shapes[self.carried[at]].to_mesh().with_area()
        return [shape for shape in shapes if shape is not None]


def _identity(shapes: Sequence[Shape]) -> list[list[Any]]:
    """Return lists that differ once a shape is replaced, or has another mesh, motion or form."""
    values: list[dict[str, Any]] = list(map(vars, shapes))
    meshes = list(dict.fromkeys([attributes.get("mesh") for attributes in values]))
    mesh_of = [attributes.get("mesh") for attributes in values] if len(meshes) > 2 else []
    formed = [attributes.get("deformation") for attributes in values if "mesh" not in attributes]
    formed += [vars(mesh).get("deformation") for mesh in meshes if mesh is not None]
    return [list(shapes), meshes, mesh_of, [attributes.get("motion") for attributes in values], formed]


def _flattens(matrices: Doubles) -> Bools:
    """Return a mask (n,) of the matrices (n, 4, 4) that cannot be inverted."""
    largest = np.abs(matrices[:, :3, :3]).max((1, 2), initial=0)
    unit = matrices[:, :3, :3] / np.where(largest > 0, largest, 1)[:, None, None]
    return np.asarray(np.abs(determinants(unit)) <= FLAT)

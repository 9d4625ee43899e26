"""A scene that moves, at a time: still objects are shared, and many instances are placed together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, compress
from operator import attrgetter, not_
from typing import Any, NamedTuple, Self

import numpy as np

from ..arrays.vec import Bools, Doubles
from ..motion import Deformation, Keyframes, Motion, Together
from ..motion.quaternions import determinants
from ..shapes import Instance, Mesh, Shape
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
        self._identity = Identity.of(shapes)
        numbers = enumerate(shapes) if self._identity.moves else ()
        moving = [number for number, shape in numbers if shape.moves]
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
        return self._identity == Identity.of(shapes)

    def at(self, time: float) -> list[Shape]:
        """Return the shapes at a time; those that a motion flattens to nothing are left out."""
        shapes: list[Any] = list(self._identity.shapes)
        forms = {id(mesh): mesh.at(time) for mesh in dict.fromkeys(self._identity.meshes) if mesh.moves}
        for number in self.others:
            shape = shapes[number]
            if isinstance(shape, Instance):
                shapes[number] = shape.placed_as(forms[id(shape.mesh)], shape.transform)
            else:
                shapes[number] = forms.get(id(shape)) or shape.at(time)
        matrices = self._motions.at(time)
        alike = len(self.carried) == len(shapes)
        instances = shapes if alike else [shapes[number] for number in self.carried]
        placed = placed_together(instances, matrices, forms)
        if alike:
            shapes = placed
        else:
            for number, instance in zip(self.carried, placed, strict=True):
                shapes[number] = instance
        flat = np.flatnonzero(_flattens(matrices)) if self._may_flatten else ()
        for at in map(int, flat):
            shapes[self.carried[at]] = shapes[self.carried[at]].to_mesh().with_area()
        return [shape for shape in shapes if shape is not None]


class Identity(NamedTuple):
    """What differs once other shapes are there, or one has another mesh or motion, or another form."""

    shapes: list[Shape]
    motions: list[Motion | None]  # of each shape
    meshes: list[Mesh]  # of each instance
    deformations: list[Deformation | None]  # of the other shapes, and of each distinct mesh

    @classmethod
    def of(cls, shapes: Sequence[Shape]) -> Self:
        """Look at all shapes, without a loop over calls, which would take ten times as long."""
        kinds = list(map(type, shapes))
        placed = {kind for kind in set(kinds) if issubclass(kind, Instance)}
        is_placed = list(map(placed.__contains__, kinds))
        meshes = list(map(attrgetter("mesh"), compress(shapes, is_placed)))
        alone = [] if len(meshes) == len(kinds) else compress(shapes, map(not_, is_placed))
        formed = [shape.deformation for shape in (*alone, *dict.fromkeys(meshes))]
        return cls(list(shapes), list(map(attrgetter("motion"), shapes)), meshes, formed)

    @property
    def moves(self) -> bool:
        """Whether anything moves or deforms."""
        return any(motion is not None for motion in chain(self.motions, self.deformations))


def _flattens(matrices: Doubles) -> Bools:
    """Return a mask (n,) of the matrices (n, 4, 4) that cannot be inverted."""
    largest = np.abs(matrices[:, :3, :3]).max((1, 2), initial=0)
    unit = matrices[:, :3, :3] / np.where(largest > 0, largest, 1)[:, None, None]
    return np.asarray(np.abs(determinants(unit)) <= FLAT)

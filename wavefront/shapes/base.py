"""The contract of every shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..bsdfs import Diffuse
from ..core.errors import number, shape_of, text
from ..core.parameter import Parameter
from ..core.suggestions import Answers, suggests_keywords
from ..materials import Material, MaterialLike, as_material
from ..motion import Motion, Moving, Still, product
from .transform import affine, rotation, scaling, translation


class Checked(Parameter[Any]):
    """An attribute of a shape that is checked whenever it is assigned; in messages "bunny: vertices"."""

    def __set__(self, instance: Any, value: Any) -> None:
        """Store the converted value in the shape's own namespace."""
        vars(instance)[self._name] = self.convert(f"{instance.name}: {self._name}", value)


class Name(Parameter[str]):
    """The name of a shape, which is a text."""

    def __set__(self, instance: Any, value: Any) -> None:
        """Store the name in the shape's own namespace."""
        vars(instance)[self._name] = text(f"{type(instance).__name__} name", value)


class Shape(Moving, Answers, ABC):
    """Base class of shapes: a `Mesh`, an `Instance`, or one of curved primitives, such as a `Sphere`.

    Attributes
    ----------
    name
        Used in messages.
    framed
        Whether `Scene.framing_camera` shows all of it; False for a `Plane`.
    motion, moves, time_span
        Where it goes, a `Motion` such as `Keyframes` (None: nowhere); whether it moves or deforms, and from
        when to when, seconds. Its other attributes are those of its start; `at` gives other times.

    Examples
    --------
    >>> ball = wf.Sphere((0, 0, 0), 1, name="ball")
    >>> isinstance(ball, wf.Shape), ball.name
    (True, 'ball')
    """

    name = Name(text)
    framed: bool = True
    _material: Material | None = None  # the user's
    # attributes that a user may change on a shape that moves, and that it has at all times
    _given: tuple[str, ...] = ("name", "_material", "_emission", "colors")
    _rest: Any = None  # the shape that `motion` carries, where it is not this one

    @property
    def material(self) -> Material:
        """The material of the surface. An assigned `Bsdf` is wrapped; None restores the default."""
        return self.default_material if self._material is None else self._material

    @material.setter
    def material(self, material: MaterialLike | None) -> None:
        self._material = None if material is None else as_material(f"{self.name}: material", material)

    @property
    def has_material(self) -> bool:
        """True if the shape was given a material."""
        return self._material is not None

    @property
    @abstractmethod
    def default_material(self) -> Material:
        """The material of a shape without a given material."""

    @property
    @abstractmethod
    def emission(self) -> Any:
        """Radiance that leaves the surface, W·sr⁻¹·m⁻²: (3, 1) or a texture; None where it is dark."""

    @property
    @abstractmethod
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3), scene units."""

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return spheres, centers (n, 3) and radii (n,), whose convex hull contains the shape, closely."""
        corners = np.stack(np.meshgrid(*self.bounds.T), -1).reshape(-1, 3)
        return corners, np.zeros(len(corners))

    @suggests_keywords
    def transformed(self, matrix: ArrayLike | Motion) -> Any:
        """Return a copy that is transformed by an affine matrix; the shape itself does not change.

        Parameters
        ----------
        matrix
            (4, 4), for column vectors: the translation is its last column. A reflection keeps the front
            side. Texture coordinates of spheres, cylinders and capsules are those of shapes made there.
            Or a motion, such as `Keyframes`, by which the copy moves; that of a mesh is an `Instance`.

        Raises
        ------
        SceneError
            If the matrix is malformed, or scales a shape that is not made of triangles by several factors.

        Examples
        --------
        >>> wf.Box((0, 0, 0), 1).transformed(np.diag([2, 1, 1, 1])).bounds.tolist()
        [[-1.0, -0.5, -0.5], [1.0, 0.5, 0.5]]
        """
        if not self.moves and not isinstance(matrix, Motion):
            return self._transformed(matrix)
        placing = matrix if isinstance(matrix, Motion) else affine(f"{self.name}: transform matrix", matrix)
        return self._carried(placing)

    @abstractmethod
    def _transformed(self, matrix: ArrayLike) -> Self:
        """Return a copy of a still shape that is transformed by an affine matrix (4, 4)."""

    def _carried(self, placing: Motion | Doubles) -> Any:
        """Return a copy that a motion carries, or a matrix where the shape moves itself."""
        if self.motion is not None:
            placing = product(placing, self.motion)
        elif not isinstance(placing, Motion):
            placing = Still(placing, *self.time_span)
        assert isinstance(placing, Motion)
        rest = self if self._rest is None else self._rest
        start = min(placing.start, rest.time_span[0])
        moving: Any = rest.at(start)._transformed(placing.at(start))
        moving.motion, moving.deformation, moving._rest = placing, rest.deformation, rest
        moving._keep_given(self)
        return moving

    def at(self, time: float) -> Any:
        """Return the shape at a time, seconds; a shape that is still returns itself.

        Examples
        --------
        >>> mesh = wf.Mesh([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 0, 4), (1, 0, 4), (0, 1, 4)]],
        ...                [(0, 1, 2)], times=[0, 1])
        >>> mesh.at(0.25).bounds[0].tolist()
        [0.0, 0.0, 1.0]
        """
        if not self.moves:
            return self
        time = number("time", time)
        shape: Any = (self if self._rest is None else self._rest)._formed(time)
        if self.motion is not None:
            shape = shape._transformed(self.motion.at(time))
        shape._keep_given(self)
        return shape

    def _formed(self, time: float) -> Any:
        """Return a still copy that has the form of a time; its motion is not applied."""
        shape = copy(self)
        shape.motion = shape._rest = shape.deformation = None
        if self.deformation is not None:
            vars(shape).update(self.deformation.at(time))
        return shape

    def _keep_given(self, other: Shape) -> None:
        """Copy the attributes that a user may have changed from the same shape of another time."""
        vars(self).update({name: value for name, value in vars(other).items() if name in self._given})

    def translated(self, offset: ArrayLike) -> Self:
        """Return a copy that is moved by `offset` (3,), scene units.

        Raises
        ------
        SceneError
            If the offset is malformed.

        Examples
        --------
        >>> wf.Sphere((0, 0, 0), 1).translated((0, 1, 0)).center.tolist()
        [0.0, 1.0, 0.0]
        """
        moved: Self = self.transformed(translation(f"{self.name}: offset", offset))
        return moved

    @suggests_keywords
    def rotated(self, axis: ArrayLike, degrees: float, about: ArrayLike = (0, 0, 0)) -> Self:
        """Return a copy that is rotated about an axis, counter-clockwise as seen against the axis.

        Parameters
        ----------
        axis
            (3,) of any length, or "x", "y" or "z".
        degrees
            The angle.
        about
            (3,) a point of the axis, scene units.

        Raises
        ------
        SceneError
            If an argument is malformed, or the axis zero.

        Examples
        --------
        >>> wf.Sphere((1, 0, 0), 0.5).rotated("z", 90).center.tolist()
        [0.0, 1.0, 0.0]
        """
        turned: Self = self.transformed(rotation(self.name, axis, degrees, about))
        return turned

    def scaled(self, factor: ArrayLike) -> Self:
        """Return a copy whose lengths are multiplied, about the origin; the material is the same.

        Parameters
        ----------
        factor
            One number, or one for each axis (3,), which only meshes and instances take. None may be 0; an
            odd number of negative ones mirrors.

        Raises
        ------
        SceneError
            If a factor is 0 or not finite, or the shape takes only one factor.

        Examples
        --------
        >>> wf.Sphere((1, 0, 0), 0.5).scaled(2).bounds.tolist()
        [[1.0, -1.0, -1.0], [3.0, 1.0, 1.0]]
        """
        if shape_of(factor) == ():
            uniform = number(f"{self.name}: factor", factor, lambda x: x != 0, "other than 0")
            if uniform > 0 and not self.moves:
                return self.lengths_times(uniform)
        scaled: Self = self.transformed(scaling(f"{self.name}: factor", factor))
        return scaled

    def lengths_times(self, factor: float) -> Self:
        """Return a copy with all lengths multiplied by a factor above 0, without other rounding."""
        scaled: Self = self.transformed(scaling(f"{self.name}: factor", factor))
        return scaled


class CurvedShape(Shape):
    """Base class of shapes whose primitives are not triangles: one `Sphere`, or many of one kind."""

    colors: Doubles | None = None  # (count, 4) linear colors, or None if all are white
    _gray: Material | None = None  # the default material, once it was asked for

    @property
    def default_material(self) -> Material:
        """A gray `Diffuse`."""
        if self._gray is None:
            self._gray = Material(Diffuse(0.5))
        return self._gray

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of primitives."""

"""The contract of every shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..materials import Material, MaterialLike, as_material


class Checked:
    """An attribute of a shape that is converted and checked whenever it is assigned.

    Parameters
    ----------
    convert
        Called with the name for messages, such as "bunny: vertices", and the value; returns the value to
        store, or raises a SceneError.
    """

    def __init__(self, convert: Callable[[str, Any], Any]) -> None:
        self._convert, self._name = convert, ""

    def __set_name__(self, owner: type, name: str) -> None:
        """Record the name of the attribute."""
        self._name = name

    def __set__(self, shape: Any, value: Any) -> None:
        """Store the converted value in the shape's own namespace."""
        vars(shape)[self._name] = self._convert(f"{shape.name}: {self._name}", value)

    if TYPE_CHECKING:

        def __get__(self, shape: Any, owner: type) -> Any: ...


class Shape(ABC):
    """Base class of shapes: a `Mesh`, an `Instance`, or one of curved primitives, such as a `Sphere`.

    Attributes
    ----------
    name
        Used in messages.

    Examples
    --------
    >>> ball = wf.Sphere((0, 0, 0), 1, name="ball")
    >>> isinstance(ball, wf.Shape), ball.name
    (True, 'ball')
    """

    name: str
    _material: Material | None = None  # what was given

    @property
    def material(self) -> Material:
        """What the surface is made of. Assigning a `Bsdf` wraps it, None brings the default back."""
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
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner, (2, 3), scene units."""


class CurvedShape(Shape):
    """Base class of shapes whose primitives are not triangles: one `Sphere`, or many of one kind."""

    colors: NDArray[np.float64] | None = None  # (count, 4) linear colors, or None if all are white

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of primitives."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return the shape with all lengths multiplied by `factor`, and the same material."""

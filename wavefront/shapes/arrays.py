"""The base class of shapes of many curved primitives, given by arrays."""

from __future__ import annotations

from copy import copy
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import FLOAT32_MAX, Doubles
from ..core.errors import SceneError, as_array, exact, finite_array
from ..materials import MaterialLike
from ..motion import Motion
from .base import Checked, CurvedShape
from .colored import ColoredShape
from .mesh import FLOAT32_MIN
from .transform import points_by, similarities


def checked_radii(name: str, value: ArrayLike) -> Doubles:
    """Return radii (n,), or (1,) for a single number."""
    single = as_array(name, value).ndim == 0
    radii = finite_array(name, value, () if single else (None,)).reshape(-1)
    bad = np.flatnonzero(~((radii >= FLOAT32_MIN) & (radii <= FLOAT32_MAX)))
    if len(bad):
        where = f"[{bad[0]}]" if not single else ""
        limit = f"above 0, from {FLOAT32_MIN:.3g} to {FLOAT32_MAX:.3g}"
        raise SceneError(f"{name}{where} is {exact(radii[bad[0]])}; it must be {limit}")
    return radii


class PrimitiveArray(ColoredShape, CurvedShape):
    """Base class of `Spheres`, `Cylinders` and `Capsules`: n primitives with one material.

    Attributes
    ----------
    radii
        (n,) scene units, or (1,) if all have one.
    """

    radii = Checked(checked_radii)
    _points: ClassVar[tuple[str, ...]]  # the arrays of points

    def __init__(
        self, radii: ArrayLike, colors: ArrayLike | None, material: MaterialLike | None, name: str
    ) -> None:
        self.name = name
        self.radii = radii
        self.colors = colors
        self.material = material
        self.check()

    def __repr__(self) -> str:
        """Return the name and the number of primitives."""
        return f"<{type(self).__name__} {self.name!r}: {self.count}>"

    @property
    def emission(self) -> Any:
        """Radiance that leaves the surface: that of the material; None if dark."""
        return self.material.emission

    def placed(self, transforms: ArrayLike | Motion) -> Self:
        """Return copies that are moved, turned, mirrored or scaled by one factor, all in one shape.

        Parameters
        ----------
        transforms
            (4, 4) or (n, 4, 4) affine matrices, for column vectors; a copy for each. Texture
            coordinates are those of shapes that were made there. Or a motion, by which one copy moves.

        Raises
        ------
        SceneError
            If a transform is malformed, or does not scale alike in all directions, or there are several for a
            shape that moves.
        """
        if isinstance(transforms, Motion):
            moving: Self = self.transformed(transforms)
            return moving
        if self.moves:
            raise SceneError(f"{self.name}: moves; place each copy by itself, with transformed(...)")
        matrices, scale = similarities(f"{self.name}: transforms", transforms)
        shape = copy(self)
        for name in self._points:
            setattr(shape, name, points_by(matrices, getattr(self, name)))
        shape.radii = (scale[:, None] * np.broadcast_to(self.radii, self.count)).ravel()
        if self.colors is not None:
            vars(shape)["colors"] = np.tile(self.colors, (len(matrices), 1))  # they have been checked
        shape.check()
        return shape

    def _transformed(self, matrix: ArrayLike) -> Self:
        return self.placed(finite_array(f"{self.name}: transform matrix", matrix, (4, 4)))

    def check(self) -> None:
        """Check the arrays against each other; they may have been assigned one by one.

        Raises
        ------
        SceneError
            If there is no primitive, or an array does not have one row for each.
        """
        count = self.count
        if not count:
            raise SceneError(f"{self.name}: {self._points[0]} is empty; it must have at least one row")
        if len(self.radii) not in (1, count):
            raise SceneError(
                f"{self.name}: radii must be one number, or one for each of {count}, got {len(self.radii)}"
            )
        if self.colors is not None and len(self.colors) != count:
            raise SceneError(
                f"{self.name}: colors must have a row for each of {count}, got {len(self.colors)}"
            )

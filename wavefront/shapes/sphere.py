"""Analytic spheres."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import FLOAT32_MAX, Doubles
from ..core.errors import SceneError, finite_array, number, rotation_matrix
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from ..motion import Motion
from ..textures.parameter import Color
from .base import Checked
from .mesh import FLOAT32_MIN
from .sphere_emission import SphereEmission
from .transform import points_by, similarities


def _center(name: str, value: ArrayLike) -> Doubles:
    center = finite_array(name, value, (3,))
    beyond = np.flatnonzero(np.abs(center) > FLOAT32_MAX)
    if len(beyond):
        i = beyond[0]
        raise SceneError(f"{name}[{i}] is {center[i]:g}; its size must be at most {FLOAT32_MAX:.3g}")
    return center


def _radius(name: str, value: float) -> float:
    limit = f"above 0, from {FLOAT32_MIN:.3g} to {FLOAT32_MAX:.3g}"
    return number(name, value, lambda x: FLOAT32_MIN <= x <= FLOAT32_MAX, limit)


def _transform(name: str, value: ArrayLike | None) -> Doubles | None:
    return None if value is None else rotation_matrix(name, value)


class Sphere(SphereEmission):
    """A sphere, intersected exactly.

    Parameters
    ----------
    center
        (3,) scene units.
    radius
        Scene units, above 0.
    material
        The material of the surface: a `Material` or a `Bsdf`. The outside is the front.
    emission
        Emitted radiance, W·sr⁻¹·m⁻²: a color, at least 0, or a texture. It leaves the surface on both sides.
        By default that of the material, if it has one.
    transform
        (3, 3) rotation of the sphere, whose poles are at y and -y, and whose texture begins at -z.
    name
        Used in messages.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> ball = wf.Sphere((0, 1, 0), 1, material=wf.Mirror(0.9))
    >>> lamp = wf.Sphere((0, 3, 0), 0.2, emission=(20, 18, 15))
    """

    center = Checked(_center)
    radius = Checked(_radius)
    transform = Checked(_transform)

    @suggests_keywords
    def __init__(
        self,
        center: ArrayLike,
        radius: float,
        *,
        material: MaterialLike | None = None,
        emission: Color | None = None,
        transform: ArrayLike | None = None,
        name: str = "sphere",
    ) -> None:
        self.name = name
        self.center = center
        self.radius = radius
        self.transform = transform
        self.material = material
        self.emission = emission

    def __repr__(self) -> str:
        """Return the name, center and radius of the sphere."""
        return f"<Sphere {self.name!r}: center {self.center.tolist()}, radius {self.radius:g}>"

    @property
    def count(self) -> int:
        """Number of spheres."""
        return 1

    @property
    def centers(self) -> Doubles:
        """The center as one row, (1, 3)."""
        return self.center[None]

    @property
    def radii(self) -> Doubles:
        """The radius as an array, (1,)."""
        return np.array([self.radius])

    def _transformed(self, matrix: ArrayLike) -> Self:
        return self.placed(finite_array(f"{self.name}: transform matrix", matrix, (4, 4)))

    def lengths_times(self, factor: float) -> Self:
        """Return the sphere with all lengths multiplied by `factor`."""
        sphere = copy(self)
        sphere.center, sphere.radius = self.center * factor, self.radius * factor
        return sphere

    def placed(self, transform: ArrayLike | Motion) -> Self:
        """Return a copy that is moved, turned, mirrored or scaled by one factor.

        Parameters
        ----------
        transform
            (4, 4) affine matrix, for column vectors. A sphere with a `transform` turns with it; the texture
            coordinates of others are those of a sphere that was made there. Or a motion, by which it moves.

        Raises
        ------
        SceneError
            If the transform is malformed, or does not scale alike in all directions.
        """
        if self.moves or isinstance(transform, Motion):
            moving: Self = self.transformed(transform)
            return moving
        matrix = finite_array(f"{self.name}: transform", transform, (4, 4))
        matrices, scale = similarities(f"{self.name}: transform", matrix)
        sphere = copy(self)
        sphere.center, sphere.radius = points_by(matrices, self.centers)[0], self.radius * float(scale[0])
        if self.transform is not None:  # perhaps mirrored
            vars(sphere)["transform"] = matrices[0, :3, :3] / scale[0] @ self.transform
        return sphere

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3)."""
        return np.stack([self.center - self.radius, self.center + self.radius])

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return centers and radii."""
        return self.centers, np.broadcast_to(self.radii, self.count)

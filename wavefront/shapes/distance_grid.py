"""Surfaces given by signed distances on a grid."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import FLOAT32_MAX, Doubles, Floats, Ints, f4, length
from ..core.errors import SceneError, finite_array, flag
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from ..media.grid import grid_transform
from .base import Checked, CurvedShape
from .mesh import positions
from .transform import Matrix


def _values(name: str, value: ArrayLike) -> Floats:
    """Return a read-only grid (z, y, x) with values on both sides of 0."""
    grid = finite_array(name, value, (None, None, None))
    if min(grid.shape) < 2:
        raise SceneError(f"{name} has shape {grid.shape}; it must have at least 2 values along each axis")
    low, high = float(grid.min()), float(grid.max())
    if max(-low, high) > FLOAT32_MAX:
        raise SceneError(f"{name} are from {low:g} to {high:g}; their size must be at most {FLOAT32_MAX:.3g}")
    grid = grid.astype(f4)
    if not (grid.min() < 0 <= grid.max()):
        raise SceneError(f"{name} are from {low:g} to {high:g}; some must be below 0, inside, and others not")
    grid.flags.writeable = False
    return grid


def _placed(name: str, value: ArrayLike) -> Matrix:
    """Return the matrix (4, 4) from the unit cube."""
    matrix = grid_transform(name, value)
    positions(name, matrix[:3].T)
    return matrix


def _over_cells(combine: Callable[[Any, Any], Any], nodes: NDArray[Any]) -> NDArray[Any]:
    """Combine values at the corners of each cell of a grid."""
    for axis in range(3):
        nodes = np.moveaxis(nodes, axis, 0)
        nodes = np.moveaxis(combine(nodes[:-1], nodes[1:]), 0, axis)
    return nodes


class SignedDistanceGrid(CurvedShape):
    """The surface where signed distances on a grid are 0: sculpted, blended or measured shapes.

    Within a cell of the grid they are interpolated linearly along each axis, and the surface is intersected
    exactly.

    Parameters
    ----------
    values
        (z, y, x) the distances at the corners of cells, at least 2 along each axis: below 0 inside, which is
        the back, and at least 0 outside. Only where they are 0 counts, so any smooth function may be given.
        The surface ends at the border of the grid.
    transform
        Where the grid is, in the world: an affine matrix (4, 4) from the unit cube [0, 1]³, in which x is the
        last axis of the grid; or the lower and the upper corner of the box, (2, 3).
    smooth
        True interpolates shading normals between the cells; False takes those of the surface, which has
        faint creases where cells meet.
    material
        The material of the surface: a `Material` or a `Bsdf`. It cannot emit light.
    name
        Used in messages.

    Raises
    ------
    SceneError
        If an argument is malformed, a value is not finite, or all values are on one side of 0.

    Notes
    -----
    Texture coordinates are those of one corner, just above 0, everywhere.

    Source: H. Hansson-Söderlund, A. Evans and T. Akenine-Möller, "Ray Tracing of Signed Distance Function
    Grids", Journal of Computer Graphics Techniques 11(3), 2022.

    Examples
    --------
    >>> z, y, x = np.mgrid[-1:1:24j, -1:1:24j, -1:1:24j]
    >>> ring = np.sqrt((np.sqrt(x**2 + z**2) - 0.6) ** 2 + y**2) - 0.25
    >>> torus = wf.SignedDistanceGrid(ring, [(-1, -1, -1), (1, 1, 1)], material="copper")
    >>> wf.render(torus, spp=1, size=(16, 16), lighting="cloudy").shape
    (16, 16, 3)
    """

    values = Checked(_values)
    transform = Checked(_placed)
    _found: tuple[Floats, Ints] | None = None  # values, and their `cells`

    @suggests_keywords
    def __init__(
        self,
        values: ArrayLike,
        transform: ArrayLike = ((0, 0, 0), (1, 1, 1)),
        *,
        smooth: bool = True,
        material: MaterialLike | None = None,
        name: str = "signed distance grid",
    ) -> None:
        self.name = name
        self.values = values
        self.transform = transform
        self.smooth = flag(f"{name}: smooth", smooth)
        self.material = material

    def __repr__(self) -> str:
        """Return the name and the number of values along each axis."""
        return f"<SignedDistanceGrid {self.name!r}: {' × '.join(map(str, self.values.shape))}>"

    @property
    def emission(self) -> Any:
        """Radiance that leaves the surface: that of the material; None if dark."""
        return self.material.emission

    @property
    def cells(self) -> Ints:
        """The lowest corners of the cells that the surface crosses: their x, y and z, (3, count)."""
        if self._found is None or self._found[0] is not self.values:
            inside = self.values < 0
            crossed = _over_cells(np.logical_or, inside) & ~_over_cells(np.logical_and, inside)
            self._found = self.values, np.stack(np.nonzero(crossed)[::-1])
        return self._found[1]

    @property
    def count(self) -> int:
        """Number of cells that the surface crosses."""
        return self.cells.shape[1]

    @property
    def frame(self) -> tuple[Doubles, Doubles]:
        """The steps between values along x, y and z, as columns of (3, 3), and the place of the first one."""
        return self.transform[:3, :3] / (np.array(self.values.shape[::-1]) - 1.0), self.transform[:3, 3]

    def boxes(self) -> tuple[Doubles, Doubles]:
        """Return boxes around the surface in each cell: centers and half sizes, (3, count), scene units.

        In a plane across an axis the interpolated value has its extremes at the corners of the cell. So the
        surface reaches a face with values of both signs, or else as far as it crosses an edge along the axis.

        Source: H. Hansson-Söderlund and T. Akenine-Möller, "Tight Bounding Boxes for Voxels and Bricks in a
        Signed Distance Field Ray Tracer", Journal of Computer Graphics Techniques 12(1), 2023.
        """
        x, y, z = self.cells
        offset = np.arange(2)[:, None]
        corners = self.values[z + offset[:, None, None], y + offset[:, None], x + offset].astype(np.float64)
        low, high = np.empty((3, x.size)), np.empty((3, x.size))
        for axis in range(3):
            faces = np.moveaxis(corners, 2 - axis, 0).reshape(2, 4, -1)
            first, second = inside = faces < 0
            with np.errstate(all="ignore"):
                place = np.where(first != second, faces[0] / (faces[0] - faces[1]), np.nan)
            mixed = inside.any(1) & ~inside.all(1)
            low[axis] = np.where(mixed[0], 0, np.fmin.reduce(place))
            high[axis] = np.where(mixed[1], 1, np.fmax.reduce(place))
        steps, origin = self.frame
        middle, half = self.cells + (low + high) / 2, (high - low) / 2
        centers = [row[0] * middle[0] + row[1] * middle[1] + row[2] * middle[2] for row in steps]
        halves = [row[0] * half[0] + row[1] * half[1] + row[2] * half[2] for row in np.abs(steps)]
        return np.stack(centers) + origin[:, None], np.stack(halves)

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner of the surface, (2, 3)."""
        centers, halves = self.boxes()
        return np.stack([(centers - halves).min(1), (centers + halves).max(1)])

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return balls around the surface in each cell."""
        centers, halves = self.boxes()
        return centers.T, length(halves).astype(np.float64)

    def _transformed(self, matrix: ArrayLike) -> Self:
        shape = copy(self)
        shape.transform = finite_array(f"{self.name}: transform matrix", matrix, (4, 4)) @ self.transform
        return shape

    def lengths_times(self, factor: float) -> Self:
        """Return the shape with all lengths multiplied by `factor`."""
        shape = copy(self)
        shape.transform = np.diag([factor, factor, factor, 1.0]) @ self.transform
        return shape

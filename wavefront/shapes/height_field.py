"""Height fields as meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Doubles, Ints
from ..core.errors import SceneError, as_array, finite_array, flag, one_of, shape_of
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from .mesh import Mesh


@suggests_keywords
def HeightField(
    z: ArrayLike,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    *,
    up: str = "y",
    smooth: bool = True,
    colors: ArrayLike | None = None,
    material: MaterialLike | None = None,
    name: str = "height field",
) -> Mesh:
    """Return a height field over a grid as a mesh: terrain, or a function of two variables.

    Parameters
    ----------
    z
        (rows, columns) heights, scene units, at least 2 rows and columns. NaN makes a hole.
    x, y
        Positions of the columns (columns,) and of the rows (rows,), scene units, strictly increasing or
        decreasing. By default 0, 1, 2, ..., like the pixels of an image that is seen from above.
    up
        "y", the default of this package: a point is (x, z, -y). Or "z": a point is (x, y, z), which
        `render(up="z")` shows upright.
    smooth
        True computes shading normals from the slopes; False shows facets.
    colors
        (rows, columns, 3) or (rows, columns, 4), as `colors` of `Mesh`: `wf.srgb(cmap(z))`.
    material, name
        As for `Mesh`. Texture coordinates run from 0 to 1 along x and y.

    Raises
    ------
    SceneError
        If an argument is malformed, or there is no face.

    Examples
    --------
    >>> x = y = np.linspace(-3, 3, 60)
    >>> z = np.exp(-(x**2 + y[:, None] ** 2))
    >>> hill = wf.HeightField(z, x, y, material="clay")
    >>> wf.render(hill, spp=1, size=(16, 16), lighting="cloudy").shape
    (16, 16, 3)
    """
    one_of(f"{name}: up", up, ("y", "z"))
    heights = (
        np.asarray(z, np.float64) if len(shape_of(z)) == 2 else finite_array(f"{name}: z", z, (None, None))
    )
    rows, columns = heights.shape
    if rows < 2 or columns < 2:
        raise SceneError(f"{name}: z has shape {heights.shape}; it must have 2 rows and 2 columns at least")
    if np.isinf(heights).any():
        i, j = np.argwhere(np.isinf(heights))[0]
        raise SceneError(f"{name}: z[{i}][{j}] is {heights[i, j]}; it must be finite, or NaN for a hole")
    across, along = _places(f"{name}: x", x, columns), _places(f"{name}: y", y, rows)
    exists = np.isfinite(heights).ravel()
    points = np.stack([*np.meshgrid(across, along), np.where(np.isfinite(heights), heights, 0)], -1)
    faces = _faces(rows, columns, reverse=(across[0] < across[-1]) != (along[0] < along[-1]))
    faces = faces[exists[faces].all(1)]
    if not len(faces):
        raise SceneError(f"{name}: z has no three heights beside each other that are not NaN")
    vertices = points.reshape(-1, 3)
    if up == "y":
        vertices = np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], 1)
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return Mesh(
        vertices,
        faces,
        normals=_normals(vertices, faces) if flag(f"{name}: smooth", smooth) else None,
        uvs=np.stack([u.ravel(), v.ravel()], 1),
        colors=None if colors is None else _by_point(name, colors, heights.shape),
        material=material,
        name=name,
    )


def _places(name: str, places: ArrayLike | None, count: int) -> Doubles:
    """Return the places of rows or columns, (count,)."""
    if places is None:
        return np.arange(count, dtype=np.float64)
    array = finite_array(name, places, (None,))
    step = np.diff(array)
    if len(array) != count or not ((step > 0).all() or (step < 0).all()):
        raise SceneError(f"{name} must be {count} numbers, strictly rising or falling")
    return array


def _faces(rows: int, columns: int, reverse: bool) -> Ints:
    """Return two triangles for each square of the grid, (m, 3), whose front is where z rises."""
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).reshape(-1, 1)
    right, above = 1, columns
    order = np.array([[0, right, right + above], [0, right + above, above]])
    faces: Ints = (corner[:, None] + order).reshape(-1, 3)
    return faces[:, ::-1] if reverse else faces


def _normals(vertices: Doubles, faces: Ints) -> Doubles:
    """Return normals at vertices, (n, 3): those of the faces around, weighted by their areas."""
    a, b, c = vertices.take(faces, 0).transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)
    corners = faces.ravel()
    return np.stack([np.bincount(corners, np.repeat(row, 3), len(vertices)) for row in areas.T], 1)


def _by_point(name: str, colors: ArrayLike, shape: tuple[int, int]) -> NDArray[np.generic]:
    """Return colors with a row for each point, of the same type."""
    array = as_array(f"{name}: colors", colors)
    if array.ndim != 3 or array.shape[:2] != shape:
        raise SceneError(f"{name}: colors must have shape {(*shape, 3)} or {(*shape, 4)}, got {array.shape}")
    return array.reshape(-1, array.shape[2])

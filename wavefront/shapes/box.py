"""Boxes and planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..bsdfs import NullSurface
from ..core.errors import SceneError, finite_array, in_brief, number, shape_of
from ..core.suggestions import suggests_keywords
from ..materials import Material, MaterialLike
from ..media import GridMedium
from ..textures.parameter import Color
from .mesh import Mesh, Rectangle

# of each side: the axes along u and v, whose cross product is the axis of the normal
SIDES = ((1, 2, 0), (2, 0, 1), (0, 1, 2))


@suggests_keywords
def Box(
    center: ArrayLike,
    size: ArrayLike,
    *,
    material: MaterialLike | None = None,
    emission: Color | None = None,
    name: str = "box",
) -> Mesh:
    """Return an axis-aligned box as a mesh of twelve triangles; its outside is the front.

    Parameters
    ----------
    center
        (3,) scene units.
    size
        Edge lengths along x, y and z (3,), or one for a cube, scene units, above 0.
    material, emission, name
        As for `Mesh`. Texture coordinates run from 0 to 1 over each side.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> crate = wf.Box((0, 0.5, 0), 1, material="clay").rotated("y", 30)
    >>> wf.Box((0, 1, 0), (4, 2, 4)).bounds.tolist()
    [[-2.0, 0.0, -2.0], [2.0, 2.0, 2.0]]
    """
    middle = finite_array(f"{name}: center", center, (3,))
    edges = finite_array(f"{name}: size", size, () if shape_of(size) == () else (3,))
    if not (edges > 0).all():
        raise SceneError(f"{name}: size is {edges.tolist()}; it must be above 0")
    half = np.broadcast_to(edges / 2, 3)
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = np.empty((6, 4, 3))
    for side, (u, v, axis) in enumerate(SIDES):
        for sign in (0, 1):
            quad_corners = corners[2 * side + sign]
            quad_corners[:, axis] = 2 * sign - 1
            quad_corners[:, u], quad_corners[:, v] = square[:, 0] * (2 * sign - 1), square[:, 1]
    quad = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        middle + half * corners.reshape(-1, 3),
        quad.reshape(-1, 3),
        uvs=np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (6, 1)),
        material=material,
        emission=emission,
        name=name,
    )


@suggests_keywords
def GridBox(medium: GridMedium, *, priority: int | None = None, name: str = "grid") -> Mesh:
    """Return the box of a `GridMedium` as an invisible shape that holds the medium.

    Parameters
    ----------
    medium
        The medium inside, and its place.
    priority, name
        As for `Material` and `Mesh`.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> smoke = wf.GridMedium(np.ones((4, 4, 4)), [(-1, 0, -1), (1, 2, 1)], absorption=2)
    >>> wf.GridBox(smoke).bounds.tolist()
    [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]
    """
    if not isinstance(medium, GridMedium):
        raise SceneError(f"{name}: medium must be a GridMedium, got {in_brief(medium)}")
    around = Material(NullSurface(), interior=medium, priority=priority)
    return Box((0.5, 0.5, 0.5), 1, material=around, name=name).transformed(medium.transform)


@suggests_keywords
def Plane(
    point: ArrayLike,
    normal: ArrayLike = (0, 1, 0),
    *,
    size: float = 200.0,
    material: MaterialLike | None = None,
    name: str = "plane",
) -> Mesh:
    """Return a large square in place of an infinite plane. It is not framed by the camera.

    A plane cannot be infinite, because ray queries need finite bounding boxes. The difference is a strip at
    the horizon: seen from a height h above it, the edge of the square lies atan(2h / size) below the horizon,
    0.6° for h = 1 and a size of 200. A plane of a size of 1e4 or more costs precision: positions are float32.

    Parameters
    ----------
    point
        (3,) its middle, scene units.
    normal
        (3,) of its front, of any length.
    size
        Length of its edges, scene units, above 0.
    material, name
        As for `Mesh`. Texture coordinates are scene units from `point`, so that textures repeat.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> floor = wf.Plane((0, 0, 0), material=wf.Diffuse("tan"))
    >>> wf.render([floor, wf.Sphere((0, 1, 0), 1)], spp=1, size=(8, 8), lighting="cloudy").shape
    (8, 8, 3)
    """
    middle = finite_array(f"{name}: point", point, (3,))
    axis = finite_array(f"{name}: normal", normal, (3,))
    if not axis.any():
        raise SceneError(f"{name}: normal is {axis.tolist()}; it must not be zero")
    half = number(f"{name}: size", size, lambda x: x > 0, "above 0") / 2
    axis = axis / np.linalg.norm(axis)
    u = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    mesh = Rectangle(middle - half * (u + v), 2 * half * u, 2 * half * v, material=material, name=name)
    mesh.uvs = (2 * np.asarray(mesh.uvs) - 1) * half
    mesh.framed = False
    return mesh

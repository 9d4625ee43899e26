"""Points as spheres, and edges and lines as capsules."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, finite_array
from ..materials import MaterialLike
from ..suggestions import suggests_keywords
from .mesh import Mesh
from .segments import Capsules
from .spheres import Spheres


@suggests_keywords
def Points(
    points: Any,
    radius: ArrayLike,
    colors: ArrayLike | None = None,
    *,
    material: MaterialLike | None = None,
    name: str = "points",
) -> Spheres:
    """Return a sphere at each point.

    Parameters
    ----------
    points
        (n, 3) scene units, or a `trimesh.PointCloud`, whose colors are taken if it has any.
    radius
        One number, or (n,), scene units.
    colors
        (n, 3) or (n, 4), as of `Spheres`.
    material, name
        As for `Spheres`.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> cloud = wf.Points(np.random.default_rng(1).random((100, 3)), radius=0.01)
    """
    if hasattr(points, "vertices"):
        given = getattr(points, "colors", None)
        if colors is None and given is not None and len(given) == len(points.vertices):
            colors = given
        points = points.vertices
    return Spheres(points, radius, colors, material=material, name=name)


@suggests_keywords
def Edges(
    lines: Any, radius: ArrayLike, *, material: MaterialLike | None = None, name: str = "edges"
) -> Capsules:
    """Return a capsule for each edge of a mesh, or each piece of lines.

    Parameters
    ----------
    lines
        A `Mesh`, a `trimesh.Trimesh`, a path of trimesh (`Path3D`, or `Path2D` at z = 0, with its arcs as
        trimesh divides them), the points (n, 3) of one line, or a list of such lines.
    radius
        One number, or one for each capsule, scene units.
    material, name
        As for `Capsules`.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range, or there is no edge.

    Examples
    --------
    >>> triangle = wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> wires = wf.Edges(triangle, radius=0.02, material=wf.Conductor.named("copper", roughness=0.2))
    """
    starts, ends = _ends_of_mesh(lines) if hasattr(lines, "faces") else _ends_of_lines(name, lines)
    if not len(starts):
        raise SceneError(f"{name}: has no edges")
    return Capsules(starts, ends, radius, material=material, name=name)


def _ends_of_mesh(mesh: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends (n, 3) of the edges of a mesh, each once.

    Vertices in one place count as one, so that an edge between faces that share no vertices is there once.
    """
    vertices = np.asarray(mesh.vertices, np.float64)
    if isinstance(mesh, Mesh):
        mesh.check()
    places, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[np.asarray(mesh.faces)]
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
    return places[pairs[:, 0]], places[pairs[:, 1]]


def _ends_of_lines(name: str, lines: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends (n, 3) of the pieces of lines."""
    given, of_path = lines, hasattr(lines, "entities")
    if of_path:
        given = [entity.discrete(lines.vertices, scale=lines.scale) for entity in lines.entities]
    if not isinstance(given, Iterable):
        raise SceneError(f"{name}: lines must be a mesh, a path, or points (n, 3), got {lines!r}")
    parts = list(given)
    if parts and np.ndim(parts[0]) == 1:
        parts = [parts]
    starts, ends = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for number, part in enumerate(parts):
        points = np.asarray(part)
        if of_path and points.shape[-1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        points = finite_array(f"{name}: lines[{number}]", points, (None, 3))
        starts.append(points[:-1])
        ends.append(points[1:])
    return np.concatenate(starts), np.concatenate(ends)

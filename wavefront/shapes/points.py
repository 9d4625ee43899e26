"""Points as spheres, and edges and lines as capsules."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..colors import srgb
from ..core.errors import SceneError, as_array, called, finite_array, warn_caller
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from .arrays import checked_radii
from .mesh import Mesh, positions
from .over_time import over_time
from .segments import Capsules
from .spheres import Spheres

FEW = 8  # points, whose radius follows from the nearest neighbor
NEIGHBOR = 4  # of more: a point of a square grid has as many neighbors at the same distance
MOST_DISTANCES, LEAST_POINTS = 1 << 22, 64  # that are looked at to choose a radius


@suggests_keywords
def Points(
    points: Any,
    radius: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    *,
    material: MaterialLike | None = None,
    name: str = "points",
    cmap: Any = None,
    clim: ArrayLike | None = None,
    times: ArrayLike | None = None,
) -> Spheres:
    """Return a sphere at each point.

    Parameters
    ----------
    points
        (n, 3) scene units, or (t, n, 3) for several times; or a `trimesh.PointCloud`, a point cloud of Open3D
        or points of PyVista, whose colors are taken if it has any.
    radius
        One number, or (n,), scene units. By default half of the median distance of a point to its fourth
        nearest neighbor, so that spheres on a grid touch, and of eight points or fewer to its nearest; a
        warning states it.
    colors
        (n, 3) or (n, 4), as of `Spheres`.
    material, name, cmap, clim, times
        As for `Spheres`.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range, or a single point has no radius.

    Examples
    --------
    >>> points = np.random.default_rng(1).random((100, 3))
    >>> by_height = wf.Points(points, radius=0.01, colors=points[:, 2], cmap="viridis")
    >>> cloud = wf.Points(np.random.default_rng(1).random((100, 3)), radius=0.01)
    """
    places, cloud_colors = cloud_arrays(points)
    colors = cloud_colors if colors is None else colors
    start, moving = over_time(name, times, {"points": places})
    at_start = positions(f"{name}: points", start["points"])
    if not len(at_start):
        raise SceneError(f"{name}: points is empty; it must have at least one row")
    if radius is None:
        radius = usual_radius(at_start)
        warn_caller(f"{name}: {len(at_start)} points are shown as spheres of radius {radius:.3g}")
    radii = checked_radii(f"{name}: radius", radius)
    with called(f"{name}: radius", f"{name}: radii"):
        centers = at_start if moving is None else places
        return Spheres(
            centers, radii, colors, material=material, name=name, cmap=cmap, clim=clim, times=times
        )


@suggests_keywords
def Edges(
    lines: Any, radius: ArrayLike, *, material: MaterialLike | None = None, name: str = "edges"
) -> Capsules:
    """Return a capsule for each edge of a mesh, or for each segment of lines.

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
        raise SceneError(f"{name}: lines has no edges")
    radii = checked_radii(f"{name}: radius", radius)
    with called(f"{name}: radius", f"{name}: radii"):
        return Capsules(starts, ends, radii, material=material, name=name)


def cloud_arrays(points: Any) -> tuple[Any, Any]:
    """Return the points (n, 3) of an array or of an object that has some, and their colors, or None.

    Known are the attributes of trimesh (`vertices`, `colors`), of Open3D (`points`, `colors`, which are sRGB)
    and of PyVista (`points`, `point_data`).
    """
    if hasattr(points, "vertices"):
        raw_colors, places, kind = getattr(points, "colors", None), points.vertices, None
    elif hasattr(points, "points"):
        data = getattr(points, "point_data", None)
        raw_colors = getattr(points, "colors", None) if data is None else point_colors(data)
        places, kind = np.asarray(points.points), np.float64
    else:
        return points, None
    if raw_colors is None or len(raw_colors) != len(places):
        return places, None
    colors = np.asarray(raw_colors)
    return places, srgb(np.clip(colors, 0, 1)) if kind is not None and colors.dtype == kind else colors


def point_colors(data: Any) -> Any:
    """Return the colors of PyVista's `point_data`: an array of bytes, (n, 3) or (n, 4); None without one."""
    arrays = [np.asarray(data[name]) for name in data.keys()]  # noqa: SIM118
    colors = [
        rows for rows in arrays if rows.dtype == np.uint8 and rows.ndim == 2 and rows.shape[1] in (3, 4)
    ]
    return colors[0] if colors else None


def usual_radius(points: Doubles) -> float:
    """Return a radius for spheres at points (n, 3) so that they nearly touch: see `Points`."""
    count = len(points)
    if count < 2:
        raise SceneError("a radius for one point is not known, as it has no neighbor: give it a radius")
    sample = points[:: max(1, count // max(LEAST_POINTS, MOST_DISTANCES // count))]
    rank = NEIGHBOR if count > FEW else 1
    nearest = np.zeros(len(sample))
    for number, point in enumerate(sample):
        away = points - point
        squares = away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1] + away[:, 2] * away[:, 2]
        nearest[number] = np.partition(squares, rank)[rank]
    radius = 0.5 * float(np.sqrt(np.median(nearest)))
    return radius or 0.01 * float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0


def _ends_of_mesh(mesh: Any) -> tuple[Doubles, Doubles]:
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


def _ends_of_lines(name: str, lines: Any) -> tuple[Doubles, Doubles]:
    """Return the ends (n, 3) of the pieces of lines."""
    pieces, of_path = lines, hasattr(lines, "entities")
    if of_path:
        pieces = [entity.discrete(lines.vertices, scale=lines.scale) for entity in lines.entities]
    if not isinstance(pieces, Iterable):
        raise SceneError(f"{name}: lines must be a mesh, a path, or points (n, 3), got {lines!r}")
    polylines = list(pieces)
    if polylines and as_array(f"{name}: lines[0]", polylines[0]).ndim == 1:
        polylines = [polylines]
    starts, ends = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for number, polyline in enumerate(polylines):
        points = as_array(f"{name}: lines[{number}]", polyline)
        if of_path and points.shape[-1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        points = finite_array(f"{name}: lines[{number}]", points, (None, 3))
        starts.append(points[:-1])
        ends.append(points[1:])
    return np.concatenate(starts), np.concatenate(ends)

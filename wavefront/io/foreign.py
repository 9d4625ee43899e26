"""Meshes, points and lines of Open3D, read by their attributes, and the functions that such readers share."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..colors import srgb
from ..core.errors import SceneError, warn_caller
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from ..scene import Scene
from ..shapes import Capsules, Shape
from ..shapes.smoothing import AUTO, check_smooth
from .clouds import cloud
from .description.appearance import assign_material
from .description.contents import Contents
from .losses import Losses
from .repair import RawMesh, Table, build

LINE = 0.0025  # radius of lines, in parts of the diagonal of all


@suggests_keywords
def from_open3d(data: Any, *, smooth: bool | float | str = AUTO) -> Scene:
    """Convert an object of Open3D to a scene: `TriangleMesh`, `PointCloud` or `LineSet`, also of tensors.

    Colors of vertices and points are taken as sRGB, as Open3D shows them. Points become spheres and lines
    capsules of a radius that a warning states. Textures are not read.

    Parameters
    ----------
    data
        The object.
    smooth
        As for `load`.

    Raises
    ------
    SceneError
        If it is something else, or has no points.

    Examples
    --------
    >>> class Cloud:  # what this reads of an open3d.geometry.PointCloud
    ...     points = np.random.default_rng(1).random((20, 3))
    ...     colors = points
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")  # of the radius
    ...     print(wf.from_open3d(Cloud()).shapes)
    [<Spheres 'points': 20>]
    """
    name = "Open3D"
    if hasattr(data, "to_legacy"):
        data = data.to_legacy()
    if hasattr(data, "triangles") and hasattr(data, "vertices"):
        vertices = np.asarray(data.vertices, np.float64).reshape(-1, 3)
        raw = RawMesh(name, vertices, np.asarray(data.triangles, np.intp).reshape(-1, 3))
        raw.normals = _of_each(vertices, getattr(data, "vertex_normals", ()))
        colors = _of_each(vertices, getattr(data, "vertex_colors", ()))
        raw.colors = None if colors is None else opaque(srgb(np.clip(colors, 0, 1)))
        if len(getattr(data, "textures", ())):
            warn_caller(f"{name}: not honored: textures")
        return Scene(built(raw, smooth))
    if not hasattr(data, "points"):
        raise SceneError(
            f"expected a TriangleMesh, PointCloud or LineSet of Open3D, got {type(data).__name__}"
        )
    points = np.asarray(data.points, np.float64).reshape(-1, 3)
    if hasattr(data, "lines"):
        segments = np.asarray(data.lines, np.intp).reshape(-1, 2)
        colors = _of_each(segments, getattr(data, "colors", ()))
        return Scene([capsules(name, points, segments, _linear(colors))])
    return Scene(spheres(name, points, _linear(_of_each(points, getattr(data, "colors", ())))))


def _of_each(rows: Any, values: Any) -> Table | None:
    """Return an array (n, 3) with a row for each of `rows`; None if it is absent."""
    array = np.asarray(values, np.float64)
    return array if len(rows) and array.shape == (len(rows), 3) else None


def _linear(colors: Table | None) -> Table | None:
    """Return colors (n, 3) in sRGB as linear ones (n, 4)."""
    return None if colors is None else opaque(srgb(np.clip(colors, 0, 1)))


def opaque(colors: Any) -> Table:
    """Return linear colors (n, 3) or (n, 4) as (n, 4)."""
    ones = np.ones((len(colors), 4 - colors.shape[1]))
    return np.hstack([colors.astype(np.float64), ones])


def built(raw: RawMesh, smooth: bool | float | str) -> list[Shape]:
    """Return the mesh of an object, with its material, or that of its colors."""
    Contents.once([raw]).smooth(check_smooth("smooth", smooth))
    if raw.material is None:
        assign_material(raw, None)
    with Losses(raw.name) as losses:
        mesh = build(raw.name, raw, losses)
        if mesh is None:
            raise losses.nothing("has no faces")
    return [mesh]


def spheres(name: str, points: Table, colors: Any) -> list[Shape]:
    """Return a sphere at each point (n, 3), with linear colors (n, 4)."""
    with Losses(name) as losses:
        shape = cloud(losses, points, colors)
    if shape is None:
        raise SceneError(f"{name}: has no points")
    return [shape]


def capsules(name: str, points: Table, segments: Any, colors: Any) -> Capsules:
    """Return a capsule for each segment, pairs (k, 2) of points, with linear colors (k, 3) or (k, 4)."""
    if not len(segments):
        raise SceneError(f"{name}: has no lines")
    radius = LINE * float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    warn_caller(
        f"{name}: has no faces; {plural(len(segments), 'line')} become capsules of radius {radius:.3g} "
        "(wf.Capsules takes another)"
    )
    return Capsules(points[segments[:, 0]], points[segments[:, 1]], radius, colors, name=name)

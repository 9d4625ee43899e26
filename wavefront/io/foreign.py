"""Meshes, points and lines of PyVista and Open3D, read by their attributes: neither package is imported."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..colors import srgb
from ..core.errors import SceneError, warn_caller
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from ..scene import Scene
from ..shapes import Capsules, Shape
from ..shapes.points import point_colors
from ..shapes.smoothing import AUTO, check_smooth
from .appearance import assign_material
from .clouds import cloud
from .contents import Contents
from .losses import Losses
from .repair import RawMesh, Table, build, with_face_colors

LINE = 0.0025  # radius of lines, in parts of the diagonal of all


@suggests_keywords
def from_pyvista(data: Any, *, smooth: bool | float | str = AUTO) -> Scene:
    """Convert an object of PyVista to a scene: `PolyData`, or a grid, whose surface is taken.

    It takes points, faces, the point data "Normals", the active texture coordinates, and colors: the first
    array of bytes (n, 3) or (n, 4) of the point data, or else of the cell data, as sRGB. Data without faces
    become spheres or capsules of a radius that a warning states. Scalars are not shown; to color by
    them, set `shape.colors = wf.srgb(cmap(scalars))`.

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
    >>> class Surface:  # what this reads of a pyvista.PolyData
    ...     points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    ...     faces = np.array([3, 0, 1, 2])
    ...     point_data, cell_data = {}, {}
    >>> wf.from_pyvista(Surface()).shapes
    [<Mesh 'PyVista': 3 vertices, 1 face>]
    """
    name = "PyVista"
    if hasattr(data, "n_blocks"):
        return Scene(
            [
                shape
                for block in data
                if block is not None
                for shape in from_pyvista(block, smooth=smooth).shapes
            ]
        )
    if not hasattr(data, "faces") and hasattr(data, "extract_surface"):
        data = data.extract_surface()
    if not hasattr(data, "faces") or not hasattr(data, "points"):
        raise SceneError(f"expected a PolyData or a grid of PyVista, got {type(data).__name__}")
    corners = _corners(data)
    points, values = np.asarray(data.points, np.float64), data.point_data
    if len(corners):
        raw = RawMesh(name, points, corners)
        raw.normals = np.asarray(values["Normals"], np.float64) if "Normals" in values else None
        uvs = getattr(data, "active_texture_coordinates", None)
        raw.uvs = None if uvs is None else np.asarray(uvs, np.float64)[:, :2]
        colors, of_faces = point_colors(values), point_colors(data.cell_data)
        if colors is not None:
            raw.colors = _opaque(srgb(colors))
        elif of_faces is not None and len(of_faces) == len(corners):
            raw = with_face_colors(name, raw, _opaque(srgb(of_faces)))
        return Scene(_built(raw, smooth))
    lines = np.asarray(getattr(data, "lines", ()), np.intp)
    if lines.size:
        return Scene([_capsules(name, points, _segments(lines), None)])
    return Scene(_spheres(name, points, point_colors(values)))


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
        raw.colors = None if colors is None else _opaque(srgb(np.clip(colors, 0, 1)))
        if len(getattr(data, "textures", ())):
            warn_caller(f"{name}: not honored: textures")
        return Scene(_built(raw, smooth))
    if not hasattr(data, "points"):
        raise SceneError(
            f"expected a TriangleMesh, PointCloud or LineSet of Open3D, got {type(data).__name__}"
        )
    points = np.asarray(data.points, np.float64).reshape(-1, 3)
    if hasattr(data, "lines"):
        segments = np.asarray(data.lines, np.intp).reshape(-1, 2)
        found = _of_each(segments, getattr(data, "colors", ()))
        return Scene([_capsules(name, points, segments, found)])
    found = _of_each(points, getattr(data, "colors", ()))
    return Scene(_spheres(name, points, found))


def _corners(data: Any) -> Any:
    """Return the triangles (m, 3) of PolyData, whose faces are rows of a count and the indices."""
    flat = np.asarray(data.faces, np.intp).ravel()
    if flat.size % 4 or (flat[::4] != 3).any():
        flat = np.asarray(data.triangulate().faces, np.intp).ravel()
    return flat.reshape(-1, 4)[:, 1:]


def _segments(lines: Any) -> Any:
    """Return the pieces (k, 2) of polylines, which are rows of a count and the indices."""
    pieces, at = [np.zeros((0, 2), np.intp)], 0
    while at < lines.size:
        row = lines[at + 1 : at + 1 + lines[at]]
        pieces.append(np.stack([row[:-1], row[1:]], 1))
        at += 1 + lines[at]
    return np.concatenate(pieces)


def _of_each(rows: Any, values: Any) -> Table | None:
    """Return an array (n, 3) with a row for each of `rows`; None if it is absent."""
    array = np.asarray(values, np.float64)
    return array if len(rows) and array.shape == (len(rows), 3) else None


def _opaque(colors: Any) -> Table:
    """Return linear colors (n, 3) or (n, 4) as (n, 4)."""
    ones = np.ones((len(colors), 4 - colors.shape[1]))
    return np.hstack([colors.astype(np.float64), ones])


def _built(raw: RawMesh, smooth: bool | float | str) -> list[Shape]:
    Contents.once([raw]).smooth(check_smooth("smooth", smooth))
    assign_material(raw, None)
    with Losses(raw.name) as losses:
        mesh = build(raw.name, raw, losses)
    if mesh is None:
        raise SceneError(f"{raw.name}: has no faces")
    return [mesh]


def _spheres(name: str, points: Table, colors: Any) -> list[Shape]:
    linear = (
        None
        if colors is None
        else _opaque(srgb(colors if colors.dtype.kind == "u" else np.clip(colors, 0, 1)))
    )
    with Losses(name) as losses:
        found = cloud(losses, points, linear)
    if found is None:
        raise SceneError(f"{name}: has no points")
    return [found]


def _capsules(name: str, points: Table, segments: Any, colors: Table | None) -> Capsules:
    if not len(segments):
        raise SceneError(f"{name}: has no lines")
    radius = LINE * float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    warn_caller(
        f"{name}: has no faces; {plural(len(segments), 'line')} become capsules of radius {radius:.3g} "
        "(wf.Capsules takes another)"
    )
    linear = None if colors is None else srgb(np.clip(colors, 0, 1))
    return Capsules(points[segments[:, 0]], points[segments[:, 1]], radius, linear, name=name)

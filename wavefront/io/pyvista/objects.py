"""Datasets of PyVista, read by their attributes: PyVista itself is not imported."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...arrays.vec import Doubles, Ints
from ...bsdfs import Diffuse
from ...colors import srgb
from ...colors.maps import ColorMap
from ...core.errors import SceneError, warn_caller
from ...core.suggestions import suggests_keywords
from ...materials import Material
from ...scene import Scene
from ...shapes import Shape
from ...shapes.points import point_colors
from ...shapes.scalars import Coloring, check_count, lengths, map_material
from ...shapes.smoothing import AUTO
from ...textures.vertex_colors import VertexColors
from ..foreign import built, capsules, opaque, spheres
from ..polygons import triangulate
from ..repair import RawMesh, Table, with_face_colors

NAME = "PyVista"
GIVEN = "wavefront scalars"  # the name of an array that is given for a dataset


@dataclass(frozen=True)
class Look:
    """How a dataset is shown."""

    coloring: Coloring | None = None  # its scalars; None for the active ones
    colors: ColorMap | None = None  # in place of those of the coloring
    plain: bool = False  # without scalars and colors
    rgb: bool = False  # three or four numbers are colors
    material: Material | None = None  # of datasets without scalars and colors
    opacity: float = 1.0


@dataclass
class Shown:
    """The numbers or the colors of the points or cells of a dataset."""

    values: Any  # (n,) numbers, or (n, 4) linear colors
    colors: ColorMap | None  # of numbers


@suggests_keywords
def from_pyvista(
    data: Any,
    *,
    smooth: bool | float | str = AUTO,
    scalars: Any = None,
    cmap: Any = None,
    clim: Any = None,
) -> Scene:
    """Convert an object of PyVista to a scene: a dataset, or a `Plotter` with all that it shows.

    Of a dataset it takes points, faces, the point data "Normals" and the active texture coordinates; of a
    grid its surface. It shows what PyVista would plot: the active scalars of the points or cells by a
    colormap; bytes (n, 3) or (n, 4) are colors in sRGB, and floats of this shape in [0, 1] are taken for
    colors, with a warning. Data without faces become spheres or capsules of a radius that a warning states.

    Of a plotter it takes the camera and the size of its window, and of each visible actor the placement, the
    style, the color, the scalars with their colormap and limits, the opacity and the texture. The light is
    that of `render`, and text, axes and scalar bars are left out.

    Parameters
    ----------
    data
        The object.
    smooth
        As for `load`.
    scalars
        The name of an array of the data, "x", "y" or "z" for coordinates, or numbers, one for each point or
        cell. Vectors are shown by their length. By default the active ones.
    cmap, clim
        As for `render`.

    Raises
    ------
    SceneError
        If it is something else, or has no points, or no such array.

    Examples
    --------
    >>> class Surface:  # what this reads of a pyvista.PolyData
    ...     points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    ...     faces = np.array([3, 0, 1, 2])
    ...     point_data, cell_data = {}, {}
    >>> wf.from_pyvista(Surface()).shapes
    [<Mesh 'PyVista': 3 vertices, 1 face>]
    """
    coloring = None if scalars is None and cmap is None and clim is None else Coloring(scalars, cmap, clim)
    if hasattr(data, "renderer") and hasattr(data, "window_size"):
        from .plotter import from_plotter

        if coloring is not None:
            raise SceneError("scalars, cmap and clim are for datasets; a plotter has those of its actors")
        return from_plotter(data, smooth)
    return Scene(shapes_of(data, smooth, Look(coloring)))


def shapes_of(data: Any, smooth: bool | float | str, look: Look) -> list[Shape]:
    """Return the shapes of a dataset, or of the blocks of several.

    Raises
    ------
    SceneError
        As `from_pyvista` does.
    """
    if hasattr(data, "n_blocks"):
        blocks = _leaves(data)
        look = _with_common_limits(blocks, look)
        return [shape for block in blocks for shape in shapes_of(block, smooth, look)]
    data, look = _with_array(data, look)
    if not hasattr(data, "faces") and hasattr(data, "extract_surface"):
        data = _surface(data)
    if not hasattr(data, "faces") or not hasattr(data, "points"):
        raise SceneError(f"expected a PolyData, a grid or a Plotter of PyVista, got {type(data).__name__}")
    data = _of_triangles(data)
    points, corners = np.asarray(data.points, np.float64), _corners(data)
    if len(corners):
        return built(_mesh(data, points, corners, look), smooth)
    lines = np.asarray(getattr(data, "lines", ()), np.intp)
    return (
        [_lines(data, points, lines, look)] if lines.size else spheres(NAME, points, _of_points(data, look))
    )


def _leaves(data: Any) -> list[Any]:
    """Return the datasets of blocks, which may have blocks themselves."""
    if not hasattr(data, "n_blocks"):
        return [] if data is None else [data]
    return [leaf for block in data for leaf in _leaves(block)]


def _with_common_limits(blocks: list[Any], look: Look) -> Look:
    """Return the look of several datasets, whose scalars have the limits of all of them."""
    coloring = look.coloring or Coloring(None)
    if look.plain or look.colors is not None or coloring.clim is not None:
        return look
    arrays = [_array(block, look) for block in blocks if hasattr(block, "point_data")]
    values = [lengths("scalars", array) for array in arrays if array is not None and array.dtype != np.uint8]
    finite_arrays = [numbers[np.isfinite(numbers)] for numbers in values if np.isfinite(numbers).any()]
    if not finite_arrays:
        return look
    limits = min(finite.min() for finite in finite_arrays), max(finite.max() for finite in finite_arrays)
    return replace(look, coloring=replace(coloring, clim=limits))


def _with_array(data: Any, look: Look) -> tuple[Any, Look]:
    """Return a dataset with the numbers that are given for it as one of its arrays."""
    if look.coloring is None or look.coloring.scalars is None or isinstance(look.coloring.scalars, str):
        return data, look
    values = lengths("scalars", look.coloring.scalars)
    points, cells = len(data.points), int(data.n_cells)
    check_count(NAME, values, points, cells)
    data = data.copy(deep=False)
    (data.point_data if len(values) == points else data.cell_data)[GIVEN] = values
    return data, replace(look, coloring=replace(look.coloring, scalars=GIVEN))


def _surface(data: Any) -> Any:
    """Return the surface of a grid."""
    try:
        return data.extract_surface(algorithm="dataset_surface")
    except TypeError:  # before 0.47
        return data.extract_surface()


def _of_triangles(data: Any) -> Any:
    """Return PolyData whose faces are triangles."""
    flat = np.asarray(data.faces, np.intp).ravel()
    whole = not flat.size % 4 and not (flat[::4] != 3).any()
    if whole and not getattr(data, "n_strips", 0):
        return data
    triangles, starts = data.triangulate(), _starts(flat)
    lost = flat.size - 3 * len(starts) - np.asarray(triangles.faces).size // 4
    return _cut(data, flat, starts) if lost > 0 and not data.n_strips else triangles


def _starts(flat: Ints) -> Ints:
    """Return the starts of the rows of polygons; a row is a count and the indices."""
    width = int(flat[0]) + 1 if flat.size else 1
    if not flat.size % width and (flat[::width] == width - 1).all():
        return np.arange(0, flat.size, width)
    starts, at = [], 0
    while at < flat.size:
        starts.append(at)
        at += 1 + max(int(flat[at]), 0)
    return np.array(starts, np.intp)


def _cut(data: Any, flat: Ints, starts: Ints) -> Any:
    """Return PolyData of triangles, also of polygons that VTK leaves out, as they touch themselves."""
    counts, corners = flat[starts], np.delete(flat, starts)
    corner, polygon = triangulate(np.asarray(data.points, np.float64), corners, counts)
    cut = type(data)(np.asarray(data.points), faces=np.insert(corners[corner], 0, 3, axis=1).ravel())
    for name in list(data.point_data):
        cut.point_data[name] = data.point_data[name]
    for name in list(data.cell_data):
        cut.cell_data[name] = np.asarray(data.cell_data[name])[-len(counts) :][polygon]
    cut.set_active_scalars(data.active_scalars_name)
    return cut


def _corners(data: Any) -> Any:
    """Return the corners (m, 3) of the triangles of PolyData, whose faces are rows of 3 and the indices."""
    return np.asarray(data.faces, np.intp).reshape(-1, 4)[:, 1:]


def _mesh(data: Any, points: Table, corners: Any, look: Look) -> RawMesh:
    """Return the mesh of a dataset as it is shown."""
    raw, values = RawMesh(NAME, points, corners), data.point_data
    raw.normals = np.asarray(values["Normals"], np.float64) if "Normals" in values else None
    uvs = getattr(data, "active_texture_coordinates", None)
    raw.uvs = None if uvs is None else np.asarray(uvs, np.float64)[:, :2]
    shown = _shown(data, look)
    if shown is None:
        raw.material = look.material
        return raw
    # cells of points and lines come before the faces
    of_points = len(shown.values) == len(points) and not _of_cells(data, look)
    rows = shown.values if of_points else shown.values[len(shown.values) - len(corners) :]
    if not of_points:
        raw, rows = with_face_colors(raw, np.ones((len(corners), 4))), np.repeat(rows, 3, 0)
        raw.colors = None
    if shown.colors is None:
        raw.colors, raw.material = rows, _color_material(rows, look)
    else:
        raw.uvs, raw.material = shown.colors.coordinates(rows), map_material(shown.colors, look.opacity)
    return raw


def _color_material(colors: Doubles, look: Look) -> Material:
    """Return a material that shows the colors (n, 4) of vertices, and their opacity."""
    faint = bool((colors[:, 3] < 1).any()) or look.opacity < 1
    return Material(Diffuse(VertexColors()), alpha=VertexColors(look.opacity, channel=3) if faint else None)


def _of_points(data: Any, look: Look) -> Any:
    """Return the linear colors (n, 4) of points, or None."""
    shown = _shown(data, look)
    if shown is None or len(shown.values) != len(data.points):
        return None
    return shown.values if shown.colors is None else shown.colors.colors(shown.values)


def _lines(data: Any, points: Table, lines: Any, look: Look) -> Shape:
    """Return the pieces of polylines, which are rows of a count and the indices, with their colors."""
    pieces, numbers, at = [np.zeros((0, 2), np.intp)], [np.zeros(0, np.intp)], 0
    while at < lines.size:
        row = lines[at + 1 : at + 1 + lines[at]]
        pieces.append(np.stack([row[:-1], row[1:]], 1))
        numbers.append(np.full(len(row) - 1, len(numbers) - 1))
        at += 1 + lines[at]
    ends, shown = np.concatenate(pieces), _shown(data, look)
    if shown is None:
        return capsules(NAME, points, ends, None)
    values = shown.values[np.concatenate(numbers)] if _of_cells(data, look) else shown.values[ends].mean(1)
    return capsules(NAME, points, ends, values if shown.colors is None else shown.colors.colors(values))


def _shown(data: Any, look: Look) -> Shown | None:
    """Return the numbers or colors of points or cells that are shown; None if none are."""
    if look.plain:
        return None
    array = _array(data, look)
    if array is None:
        return None
    chosen = look.coloring is not None and look.coloring.scalars is not None
    if array.ndim == 2 and array.shape[1] in (3, 4) and (not chosen or look.rgb or array.dtype == np.uint8):
        if array.dtype == np.uint8:
            return Shown(opaque(srgb(array)), None)
        if array.dtype.kind == "f" and 0 <= array.min() <= array.max() <= 1:
            if look.rgb:
                return Shown(opaque(srgb(array)), None)
            warn_caller(f"{NAME}: {_name(data, look)!r} is taken for colors in sRGB, as rgb=True of PyVista")
            return Shown(opaque(srgb(array)), None)
    values = lengths("scalars", array)
    if look.colors is not None:
        return Shown(values, look.colors)
    coloring = look.coloring or Coloring(None)
    return Shown(values, coloring.map_of(values))


def _name(data: Any, look: Look) -> str | None:
    """Return the name of the array that is shown; None without active scalars."""
    if look.coloring is not None and look.coloring.scalars is not None:
        return str(look.coloring.scalars)
    return getattr(data, "active_scalars_name", None)


def _array(data: Any, look: Look) -> Any:
    """Return the array that is shown; without active scalars colors of points or cells, or None."""
    name = _name(data, look)
    if name is None:
        array = point_colors(data.point_data)
        array = point_colors(data.cell_data) if array is None else array
    else:
        known = {key: data.cell_data[key] for key in data.cell_data.keys()}  # noqa: SIM118
        known |= {key: data.point_data[key] for key in data.point_data.keys()}  # noqa: SIM118
        if name not in known:
            return (look.coloring or Coloring(name)).values(np.asarray(data.points), known)
        array = known[name]
    array = None if array is None else np.asarray(array)
    return None if array is None or array.dtype.kind not in "fiub" else array


def _of_cells(data: Any, look: Look) -> bool:
    """Return whether the array that is shown belongs to cells."""
    name = _name(data, look)
    if name is None:
        return point_colors(data.point_data) is None
    return name not in data.point_data and name in data.cell_data

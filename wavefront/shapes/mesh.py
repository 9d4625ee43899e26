"""Triangle meshes."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import FLOAT32_MAX, Doubles, Ints, cross, spans
from ..core.errors import SceneError, as_array, finite_array, flag, shape_of, warn_caller
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from ..materials import Material, MaterialLike
from ..motion import Motion
from ..textures.parameter import Color, color
from .base import Checked
from .colored import ColoredShape, mapped_colors
from .over_time import over_time
from .smoothing import AUTO, CREASE, check_smooth, crease_normals, facet_normals, split_vertices
from .transform import moved, moved_tangents
from .winding import settled

MOST_DOUBLINGS = 60  # log2 of the length, or its inverse, of vectors that are stored unchanged
AT_ONCE = 1 << 14  # faces whose area is found together, so that they fit the cache
FLOAT32_MIN = float(np.finfo(np.float32).tiny)


def _faces(name: str, faces: ArrayLike) -> Ints:
    array = as_array(name, faces)
    if array.size == 0:
        raise SceneError(f"{name.removesuffix(': faces')}: has no faces")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise SceneError(f"{name} must be integers of shape (m, 3), got {array.dtype} of shape {array.shape}")
    return array.astype(np.intp)


def positions(name: str, values: ArrayLike) -> Doubles:
    """Return positions (n, 3) that float32 can hold."""
    array = finite_array(name, values, (None, 3))
    _check_float32(name, array)
    return array


def _vectors(name: str, values: ArrayLike | None, width: int = 3) -> Doubles | None:
    """Return vectors (n, width) whose lengths have no meaning, scaled so that float32 can square them.

    They are scaled by powers of two, so their directions do not change.
    """
    if values is None:
        return None
    array = finite_array(name, values, (None, width))
    exponent = np.frexp(np.abs(array[:, :3]).max(1, initial=0))[1]
    extreme = np.flatnonzero(np.abs(exponent) > MOST_DOUBLINGS)
    if extreme.size:
        array = array.copy()
        array[extreme, :3] = np.ldexp(array[extreme, :3], -exponent[extreme, None])
    return array


def _coordinates(name: str, values: ArrayLike | None) -> Doubles | None:
    """Return texture coordinates (n, 2) that float32 can hold."""
    if values is None:
        return None
    array = finite_array(name, values, (None, 2))
    _check_float32(name, array)
    return array


def check_range(name: str, vertices: Doubles) -> None:
    """Raise a SceneError if a vertex (n, 3) of the shape `name` is beyond the range of float32."""
    _check_float32(f"{name}: vertices", vertices)


def _check_float32(name: str, rows: Doubles) -> None:
    bad = np.argwhere(np.abs(rows) > FLOAT32_MAX)
    if len(bad):
        i, j = bad[0]
        raise SceneError(f"{name}[{i}][{j}] is {rows[i, j]:g}; its size must be at most {FLOAT32_MAX:.3g}")


class Mesh(ColoredShape):
    """A triangle mesh.

    Parameters
    ----------
    vertices
        (n, 3) positions, scene units; kept in float64.
    faces
        (m, 3) vertex indices, counter-clockwise seen from the front. No ray hits a face of zero area; a
        warning counts those.
    normals
        (n, 3) shading normals; without them the facets are flat, unless `smooth` says otherwise. If nearly
        all oppose the faces, they are turned, or the faces of a closed mesh that face inwards; a warning says
        so.
    uvs, uvs1
        (n, 2) texture coordinates, and a second set of them.
    tangents
        (n, 4) tangents, the axes of red in normal maps: unit vectors perpendicular to the normals, and 1 or
        -1 if green is normal × tangent or its opposite, as in glTF. By default both axes follow from the
        texture coordinates, as for bump maps. Tangents need normals.
    colors
        (n, 3) RGB, or (n, 4) with opacity. Floats are linear, in [0, 1]; uint8 and uint16, as trimesh
        gives them, are decoded from sRGB, except the opacity. A given material shows them by a parameter
        `VertexColors`.
    material
        The material of the surface: a `Material` or a `Bsdf`. By default a `Diffuse` that shows the `colors`,
        or is gray.
    emission
        Emitted radiance of the front side, W·sr⁻¹·m⁻²: one number or three, or a `Texture` or
        `VertexColors`, at least 0. By default that of the material, if it has one.
    two_sided
        Whether the emission leaves the back side as well.
    name
        Used in messages.
    smooth
        Computes the normals. True averages those of all faces around a vertex. A crease angle in degrees
        averages only faces that are within this angle of each other. "auto" is the angle for files, 60°.
        Vertices at one position count as one. Vertices on creases are split, so that the mesh may have more
        of them. Not with `normals`.
    times
        (t,) seconds, rising, of vertices (t, n, 3), and of normals (t, n, 3) if any: the mesh deforms.
        Between them vertices move straight on. `vertices` is then the form of the start; `at` returns others,
        each with its own computed normals.

    cmap, clim
        Then `colors` are numbers, one each, that a colormap of matplotlib shows, by its name, such as
        "viridis"; and the numbers at its ends, by default the least and the greatest.

    Arrays are copied: later changes to them do not change the mesh.

    Raises
    ------
    SceneError
        If an array has a wrong shape, a value is not finite, a position or a texture coordinate is
        beyond float32, an index is out of range, there is no face, there are tangents without normals, or
        normals that are to be computed.

    Examples
    --------
    >>> vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    >>> triangle = wf.Mesh(vertices, [(0, 1, 2)], material=wf.Diffuse((0.8, 0.2, 0.1)))
    >>> triangle.faces.shape
    (1, 3)
    """

    vertices = Checked(positions)
    faces = Checked(_faces)
    normals = Checked(_vectors)
    uvs, uvs1 = Checked(_coordinates), Checked(_coordinates)
    tangents = Checked(partial(_vectors, width=4))
    _smooth: bool | float | str | None = None  # of computed normals, where it deforms
    _given = "name", "_material", "_emission", "two_sided"

    @suggests_keywords
    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        uvs1: ArrayLike | None = None,
        tangents: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        material: MaterialLike | None = None,
        emission: Color | None = None,
        two_sided: bool = False,
        name: str = "mesh",
        smooth: bool | float | str = False,
        cmap: Any = None,
        clim: ArrayLike | None = None,
        times: ArrayLike | None = None,
    ) -> None:
        self.name = name
        if times is not None:
            _check_forms(name, vertices, normals, tangents)
        start, self.deformation = over_time(name, times, {"vertices": vertices, "normals": normals})
        self.vertices = start["vertices"]
        self.faces = faces
        self.normals = start["normals"]
        self.uvs, self.uvs1 = uvs, uvs1
        self.tangents = tangents
        self.colors = mapped_colors(name, colors, cmap, clim)
        self.check()
        if self.normals is not None and self.tangents is None and self.deformation is None:
            self.faces, self.normals = settled(name, self.vertices, self.faces, self.normals)
        self._warn_of_zero_area()
        if check_smooth(f"{name}: smooth", smooth) is not False:
            if normals is not None:
                raise SceneError(f"{name}: has normals; then smooth must be False")
            self.compute_normals(smooth)
        self.material = material
        self.emission = emission
        self.two_sided = flag(f"{name}: two_sided", two_sided)

    def __repr__(self) -> str:
        """Return the name and the size of the mesh."""
        vertices = plural(len(self.vertices), "vertex", "vertices")
        return f"<Mesh {self.name!r}: {vertices}, {plural(len(self.faces), 'face')}>"

    @property
    def emission(self) -> Any:
        """Radiance that leaves the front side: the mesh's own, or else its material's; None if dark."""
        return self.emission_by(self.material)

    @emission.setter
    def emission(self, emission: Any) -> None:
        self._emission = None if emission is None else color(f"{self.name}: emission", emission, np.inf)

    def emission_by(self, material: Material) -> Any:
        """Return the emission where the mesh has this material."""
        return material.emission if self._emission is None else self._emission

    def check(self) -> None:
        """Check the arrays against each other; they may have been assigned one by one.

        Raises
        ------
        SceneError
            If a face has an invalid index, an array does not have one row for each vertex, or there are
            tangents without normals.
        """
        count = len(self.vertices)
        if self.faces.max() >= count or self.faces.min() < 0:
            i, j = np.argwhere((self.faces < 0) | (self.faces >= count))[0]
            limit = f"in [0, {count - 1}]" if count else "that of a vertex, and vertices has none"
            raise SceneError(f"{self.name}: faces[{i}][{j}] is {self.faces[i, j]}; it must be {limit}")
        for name in ("normals", "uvs", "uvs1", "tangents", "colors"):
            values = getattr(self, name)
            if values is not None and len(values) != count:
                raise SceneError(
                    f"{self.name}: {name} must have a row for each of "
                    f"{plural(count, 'vertex', 'vertices')}, got {len(values)}"
                )
        if self.tangents is not None and self.normals is None:
            raise SceneError(f"{self.name}: has tangents without normals; pass both")

    def compute_normals(self, smooth: bool | float | str) -> None:
        """Compute the normals from the faces, in place of those that there are.

        Parameters
        ----------
        smooth
            As of the constructor; False shows the facets.

        Raises
        ------
        SceneError
            If it is malformed.
        """
        smooth = check_smooth(f"{self.name}: smooth", smooth)
        self.normals = self.tangents = None
        if self.deformation is not None:  # each form gets its own
            self._rest = copy(self if self._rest is None else self._rest)
            self._rest.normals = self._rest.tangents = self._rest._rest = None
            self._rest._smooth = smooth
        if smooth is False:
            return
        degrees = 180.0 if smooth is True else CREASE if smooth == AUTO else float(smooth)
        corners = crease_normals(self.vertices, self.faces, degrees)
        if corners is not None:
            self._split(corners)

    def keep_facets(self) -> None:
        """Give a mesh without normals those of its facets, which look the same."""
        if self.normals is None:
            self._split(np.repeat(facet_normals(self.vertices, self.faces).T[:, None], 3, 1))

    def _split(self, corners: Doubles) -> None:
        """Give the corners of the faces normals (m, 3, 3): vertices with several are split."""
        faces, normals, origin = split_vertices(self.faces, corners)
        self.faces, self.vertices, self.normals = faces, self.vertices[origin], normals
        for name in ("uvs", "uvs1", "colors"):
            values = getattr(self, name)
            if values is not None:
                setattr(self, name, values[origin])

    def _warn_of_zero_area(self) -> None:
        flat = _faces_of_zero_area(self.vertices, self.faces)
        if flat.size:
            warn_caller(
                f"{self.name}: dropped {plural(flat.size, 'face')} of zero area, first: face {flat[0]}"
            )

    def with_area(self) -> Self | None:
        """Return the mesh without the faces that have no area; None if there are no others."""
        flat = _faces_of_zero_area(self.vertices, self.faces)
        if not flat.size:
            return self
        mesh, faces = copy(self), np.delete(self.faces, flat, 0)
        vars(mesh)["faces"] = faces  # they have been checked
        return mesh if len(faces) else None

    def _carried(self, placing: Motion | Doubles) -> Any:
        """Return an instance that moves; or a copy by a matrix, where the mesh deforms."""
        from .instance import Instance  # here, as an instance has a mesh

        return Instance(self, placing) if isinstance(placing, Motion) else super()._carried(placing)

    def _formed(self, time: float) -> Self:
        mesh: Self = super()._formed(time)
        if self._smooth is not None:
            mesh.compute_normals(self._smooth)
        return mesh

    def unshaded(self) -> Self:
        """Return the mesh without the normals that are computed for each of its forms."""
        if self._rest is None or self._rest._smooth is None:
            return self
        plain = copy(self)
        plain._rest = copy(self._rest)
        plain._rest._smooth = None
        return plain

    def _transformed(self, matrix: ArrayLike) -> Self:
        placing = finite_array(f"{self.name}: transform matrix", matrix, (4, 4))
        mesh = copy(self)
        mesh.vertices, mesh.faces, mesh.normals = moved(placing, self.vertices, self.faces, self.normals)
        mesh.tangents = moved_tangents(placing, self.tangents)
        return mesh

    def lengths_times(self, factor: float) -> Self:
        """Return the mesh with all lengths multiplied by `factor`."""
        mesh = copy(self)
        mesh.vertices = self.vertices * factor
        return mesh

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3), of the vertices that faces use."""
        rows = np.ascontiguousarray(self.hull()[0].T)
        return np.stack([rows.min(1), rows.max(1)])

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return the vertices that faces use, as spheres of radius 0."""
        used = np.zeros(len(self.vertices), np.bool_)
        used[self.faces] = True
        points = self.vertices[used]
        return points, np.zeros(len(points))


def _check_forms(name: str, vertices: Any, normals: Any, tangents: Any) -> None:
    """Raise a SceneError if arrays of a mesh that deforms are not given for all its times."""
    if len(shape_of(vertices)) != 3:
        raise SceneError(f"{name}: times are given; then vertices must have shape (t, n, 3)")
    if normals is not None and shape_of(normals) != shape_of(vertices):
        raise SceneError(
            f"{name}: normals have the shape {shape_of(normals)}; of a mesh that deforms they must have that "
            f"of its vertices, {shape_of(vertices)}"
        )
    if tangents is not None:
        raise SceneError(f"{name}: deforms; then it cannot have tangents")


def _faces_of_zero_area(vertices: Doubles, faces: Ints) -> Ints:
    """Return the numbers of the faces whose corners lie on a line, or in a point."""
    numbers = []
    for block in spans(len(faces), AT_ONCE):
        a, b, c = np.ascontiguousarray(vertices.take(faces[block], 0).transpose(1, 2, 0))
        flat = np.flatnonzero(~cross(b - a, c - a).any(0))
        numbers.append(block.start + flat)
    flat = np.concatenate(numbers)
    if flat.size:  # lengths are divided by the longest, so that squares of small ones do not underflow
        a, b, c = vertices.take(faces[flat], 0).transpose(1, 2, 0)
        edges = np.stack([b - a, c - a])
        longest = np.abs(edges).max((0, 1))
        first, second = edges / np.where(longest > 0, longest, 1)
        flat = flat[~cross(first, second).any(0)]
    return flat


@suggests_keywords
def Rectangle(
    corner: ArrayLike,
    edge_u: ArrayLike,
    edge_v: ArrayLike,
    *,
    material: MaterialLike | None = None,
    emission: Color | None = None,
    two_sided: bool = False,
    name: str = "rectangle",
) -> Mesh:
    """Return a parallelogram as a mesh of two triangles; the front is where edge_u × edge_v points.

    Parameters
    ----------
    corner, edge_u, edge_v
        (3,) a corner and the two edges that leave it, scene units.
    material, emission, two_sided, name
        As for `Mesh`. Texture coordinates run from 0 to 1 along the edges.

    Raises
    ------
    SceneError
        If an argument is malformed, or the edges are parallel.

    Examples
    --------
    >>> floor = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))
    >>> lamp = wf.Rectangle((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), emission=5)
    """
    origin = finite_array(f"{name}: corner", corner, (3,))
    u = finite_array(f"{name}: edge_u", edge_u, (3,))
    v = finite_array(f"{name}: edge_v", edge_v, (3,))
    if not np.linalg.norm(np.cross(u, v)) > 0:
        raise SceneError(f"{name}: edge_u {u.tolist()} and edge_v {v.tolist()} span no area")
    return Mesh(
        np.stack([origin, origin + u, origin + u + v, origin + v]),
        [[0, 1, 2], [0, 2, 3]],
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1]],
        material=material,
        emission=emission,
        two_sided=two_sided,
        name=name,
    )

"""Meshes of USD, with the primvars that their materials read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import SceneError
from ...core.plural import plural
from ..polygons import triangulate
from ..repair import RawMesh
from .gprims import gprim
from .materials import COORDINATES, Look, Materials
from .values import value_of


@dataclass
class _Triangles:
    """The triangles of a prim."""

    prim: Any
    points: Any  # (n, 3)
    face: Any  # (m,) of which each triangle is a part
    corner: Any  # (m, 3) numbers of its corners, among those of all faces
    point: Any  # (m, 3) numbers of the points there

    def by_corner(self, chosen: Any) -> tuple[Any, dict[str, Any]]:
        """Return faces of the chosen triangles (m,), each of three vertices of its own.

        Also the row of each vertex in the values of a primvar, by its interpolation.
        """
        point, corner = self.point[chosen].ravel(), self.corner[chosen].ravel()
        face = np.repeat(self.face[chosen], 3)
        rows = {"vertex": point, "varying": point, "uniform": face, "faceVarying": corner}
        return np.arange(len(point)).reshape(-1, 3), rows | {"constant": np.zeros_like(point)}

    def by_point(self, chosen: Any) -> tuple[Any, dict[str, Any]]:
        """Return the same with a vertex for each point that they use."""
        faces, there = self.point[chosen], np.zeros(len(self.points), np.bool_)
        there[faces] = True
        used = np.flatnonzero(there)
        if len(used) < len(there):
            faces = (np.cumsum(there) - 1)[faces]
        return faces, {"vertex": used, "varying": used, "constant": np.zeros_like(used)}


class Meshes:
    """The meshes of a stage."""

    def __init__(self, materials: Materials) -> None:
        self.materials, self.time, self.lose = materials, materials.time, materials.lose

    def of(self, prim: Any) -> list[RawMesh]:
        """Return the meshes of a prim, one for each material."""
        return self._parts(prim) if str(prim.GetTypeName()) == "Mesh" else [self._solid(prim)]

    def one_color(self, prim: Any, name: str) -> Any:
        """Return a color (3,) of all of a prim, None if it has none."""
        given = self._primvar(prim, name, 3)
        if given is not None and len(given[0]) > 1:
            self.lose(prim, f"primvars:{name} of {len(given[0])} colors; the first one in their place")
        return None if given is None else given[0][0]

    def _solid(self, prim: Any) -> RawMesh:
        """Return the mesh of a prim that is no mesh."""
        look, raw = self.materials.of(prim), gprim(prim, self.time)
        color = self.one_color(prim, look.primvars.get("colors", "displayColor"))
        if color is not None:
            raw.colors = np.tile(color, (len(raw.vertices), 1))
        raw.name = str(prim.GetName())
        raw.material, raw.emission = look.material_for(raw), look.emission
        return raw

    def _parts(self, prim: Any) -> list[RawMesh]:
        from pxr import UsdShade

        mesh = self._triangles(prim)
        left = np.ones(len(mesh.face), bool)
        parts = []
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.isin(mesh.face, np.asarray(subset.GetIndicesAttr().Get(self.time) or [], int)) & left
            left &= ~chosen
            parts.append((subset.GetPrim(), chosen))
        return [self._part(mesh, each, chosen) for each, chosen in [*parts, (prim, left)] if chosen.any()]

    def _part(self, mesh: _Triangles, prim: Any, chosen: Any) -> RawMesh:
        """Return the chosen triangles of a mesh, with the look of a prim: that of the mesh or of a subset."""
        look = self.materials.of(prim)
        given = self._primvars(mesh.prim, look)
        by_corner = any(kind in ("uniform", "faceVarying") for _, kind in given.values())
        faces, index = mesh.by_corner(chosen) if by_corner else mesh.by_point(chosen)
        values = {}
        for field, (table, kind) in given.items():
            rows = index.get(kind)
            if rows is None or (rows.size and rows.max() >= len(table)):
                what = f"{look.primvars.get(field, field)} has {plural(len(table), 'value')}"
                raise SceneError(f"{mesh.prim.GetPath()}: {what}, too few for {kind!r}")
            values[field] = table[rows]
        raw = RawMesh(str(prim.GetName()), mesh.points[index["vertex"]], faces, **values, smooth=True)
        raw.material, raw.emission = look.material_for(raw), look.emission
        return raw

    def _primvars(self, prim: Any, look: Look) -> dict[str, tuple[Any, str]]:
        """Return values and interpolation of what a mesh has for a look, by field of a `RawMesh`."""
        usual = {"normals": "normals", "uvs": self._first_coordinates(prim), "colors": "displayColor"}
        found = {}
        for field, name in (usual | look.primvars).items():
            width = 2 if field in COORDINATES else 3
            given = self._primvar(prim, name, width)
            if given is None and field in look.primvars:
                self.lose(prim, f"primvars:{name}, which is missing; zeros in its place")
                given = np.zeros((1, width)), "constant"
            if given is not None:
                found[field] = given
        return found

    def _triangles(self, prim: Any) -> _Triangles:
        """Return the triangles of a mesh."""
        points = np.asarray(value_of(prim, self.time, "points", []), float).reshape(-1, 3)
        counts = np.asarray(value_of(prim, self.time, "faceVertexCounts", []), np.intp)
        corners = np.asarray(value_of(prim, self.time, "faceVertexIndices", []), np.intp)
        if (counts < 3).any() or counts.sum() != len(corners):
            raise SceneError(f"{prim.GetPath()}: faceVertexCounts do not fit the {len(corners)} indices")
        if corners.size and not (corners.min() >= 0 and corners.max() < len(points)):
            raise SceneError(f"{prim.GetPath()}: faceVertexIndices are beyond the {len(points)} points")
        if (
            value_of(prim, self.time, "subdivisionScheme") != "none"
            and prim.GetAttribute("subdivisionScheme").IsAuthored()
        ):
            self.lose(prim, "subdivisionScheme; the mesh of its control points in its place")
        holes = np.asarray(value_of(prim, self.time, "holeIndices", []), np.intp)
        corner, face = triangulate(points, corners, counts, holes=holes)
        if value_of(prim, self.time, "orientation") == "leftHanded":
            corner = corner[:, [0, 2, 1]]
        return _Triangles(prim, points, face, corner, corners[corner])

    def _first_coordinates(self, prim: Any) -> str:
        """Return the name of the texture coordinates of a mesh whose material reads none."""
        from pxr import UsdGeom

        found = UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues()
        names = [each.GetPrimvarName() for each in found if str(each.GetTypeName()) == "texCoord2f[]"]
        return "st" if "st" in names or not names else str(names[0])

    def _primvar(self, prim: Any, name: str, width: int) -> tuple[Any, str] | None:
        """Return the values (n, width) of a primvar and its interpolation, None if there is none."""
        from pxr import UsdGeom

        given = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        if given and given.HasValue():
            values, kind = given.ComputeFlattened(self.time), str(given.GetInterpolation())
        else:
            values = value_of(prim, self.time, name) if name == "normals" else None
            kind = str(UsdGeom.Mesh(prim).GetNormalsInterpolation())
        if values is None or not len(values):
            return None
        table = np.asarray(values, float)
        if table.ndim != 2 or table.shape[1] != width:
            raise SceneError(f"{prim.GetPath()}: {name} must have rows of {width} numbers")
        return table, kind

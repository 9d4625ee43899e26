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
from .materials import COORDINATES, OPACITY, UNCOLORED, Look, Materials
from .values import value_of

DEFAULT_SCHEME = "subdivisionScheme is not set, which stands for catmullClark"
WIDTHS = {"normals": 3, "colors": 3, OPACITY: 1, **dict.fromkeys(COORDINATES, 2)}  # numbers of a row
CONTROL_MESH = "the control mesh is shown, as usdview does unless it is told to refine"


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
        faces, is_used = self.point[chosen], np.zeros(len(self.points), np.bool_)
        is_used[faces] = True
        used = np.flatnonzero(is_used)
        if len(used) < len(is_used):
            faces = (np.cumsum(is_used) - 1)[faces]
        return faces, {"vertex": used, "varying": used, "constant": np.zeros_like(used)}


class Meshes:
    """The meshes of a stage."""

    def __init__(self, materials: Materials) -> None:
        self.materials, self.time, self.lose = materials, materials.time, materials.lose
        self._without: frozenset[str] = frozenset()

    def of(self, prim: Any, without: frozenset[str] = frozenset()) -> list[tuple[Any, RawMesh]]:
        """Return the meshes of a prim, one for each material, each after the prim to which that is bound.

        Primvars of the names `without` count as missing; their readers have values otherwise.
        """
        self._without = without
        return self._parts(prim) if str(prim.GetTypeName()) == "Mesh" else [(prim, self._solid(prim))]

    def one(self, prim: Any, name: str, field: str) -> Any:
        """Return a value (w,) of a primvar for all of a prim, None if it has none."""
        primvar = self._primvar(prim, name, WIDTHS[field])
        if primvar is not None and len(primvar[0]) > 1:
            self.lose(prim, f"primvars:{name} of {len(primvar[0])} values; the first one in their place")
        return None if primvar is None else primvar[0][0]

    def _solid(self, prim: Any) -> RawMesh:
        """Return the mesh of a prim that is no mesh."""
        look, raw = self.materials.of(prim), gprim(prim, self.time)
        usual = {"colors": "displayColor", OPACITY: "displayOpacity"} if look.material is None else {}
        values = {}
        for field, name in (usual | look.primvars).items():
            if field in ("colors", OPACITY) and name not in self._without:
                value = self.one(prim, name, field)
                if value is None and field in look.primvars:
                    value = self._instead(prim, field, look)[0]
                if value is not None:
                    values[field] = np.tile(value, (len(raw.vertices), 1))
        raw.colors = _fields(values).get("colors")
        raw.name = str(prim.GetName())
        raw.material, raw.emission = look.material_for(raw), look.emission
        return raw

    def _parts(self, prim: Any) -> list[tuple[Any, RawMesh]]:
        from pxr import UsdShade

        mesh = self._triangles(prim)
        left = np.ones(len(mesh.face), bool)
        subsets = []
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.isin(mesh.face, np.asarray(subset.GetIndicesAttr().Get(self.time) or [], int)) & left
            left &= ~chosen
            subsets.append((subset.GetPrim(), chosen))
        return [
            (look_prim, self._part(mesh, look_prim, chosen))
            for look_prim, chosen in [*subsets, (prim, left)]
            if chosen.any()
        ]

    def _part(self, mesh: _Triangles, prim: Any, chosen: Any) -> RawMesh:
        """Return the chosen triangles of a mesh, with the look of a prim: that of the mesh or of a subset."""
        look = self.materials.of(prim)
        primvars = self._primvars(mesh.prim, look)
        most = {kind: rows.max(initial=-1) for kind, rows in mesh.by_corner(chosen)[1].items()}
        primvars = {
            field: primvar
            for field, primvar in primvars.items()
            if self._fits(mesh.prim, field, *primvar, most)
        }
        by_corner = any(kind in ("uniform", "faceVarying") for *_, kind in primvars.values())
        faces, index = mesh.by_corner(chosen) if by_corner else mesh.by_point(chosen)
        values = {field: table[index[kind]] for field, (_, table, kind) in primvars.items()}
        raw = RawMesh(
            str(prim.GetName()), mesh.points[index["vertex"]], faces, **_fields(values), smooth=True
        )
        raw.material, raw.emission = look.material_for(raw), look.emission
        raw.two_sided = bool(value_of(mesh.prim, self.time, "doubleSided", False))
        return raw

    def _fits(self, prim: Any, field: str, name: str, table: Any, kind: str, most: dict[str, int]) -> bool:
        """Return whether a primvar has values enough; usdview leaves out the others, too."""
        if kind in most and most[kind] < len(table):
            return True
        what = f"{name} has {plural(len(table), 'value')}, too few for {kind!r}"
        self.lose(prim, what, "left out")
        return False

    def _primvars(self, prim: Any, look: Look) -> dict[str, tuple[str, Any, str]]:
        """Return name, values and interpolation of the primvars of a look, by the fields of a `RawMesh`."""
        usual = {"normals": "normals", "uvs": self._first_coordinates(prim)}
        if look.material is None:
            usual |= {"colors": "displayColor", OPACITY: "displayOpacity"}
        primvars = {}
        for field, name in (usual | look.primvars).items():
            if name in self._without:
                continue
            width = WIDTHS[field]
            primvar = self._primvar(prim, name, width)
            if primvar is None and field in look.primvars:
                primvar = self._instead(prim, field, look), "constant"
            if primvar is not None:
                primvars[field] = name, *primvar
        return primvars

    def _instead(self, prim: Any, field: str, look: Look) -> Any:
        """Return a row for a primvar that a mesh lacks: the fallback of its reader, or else zeros."""
        if field in look.fallbacks:
            return np.asarray(look.fallbacks[field], float).reshape(1, -1)
        self.lose(prim, f"primvars:{look.primvars[field]}, which is missing; zeros in its place")
        return np.zeros((1, WIDTHS[field]))

    def _triangles(self, prim: Any) -> _Triangles:
        """Return the triangles of a mesh."""
        points = np.asarray(value_of(prim, self.time, "points", []), float).reshape(-1, 3)
        counts, corners, bad = self._polygons(prim, len(points))
        if value_of(prim, self.time, "subdivisionScheme") != "none":
            self._note_subdivision(prim)
        holes = np.asarray(value_of(prim, self.time, "holeIndices", []), np.intp)
        corner, face = triangulate(points, corners, counts, holes=np.concatenate([holes, bad]))
        if value_of(prim, self.time, "orientation") == "leftHanded":
            corner = corner[:, [0, 2, 1]]
        return _Triangles(prim, points, face, corner, corners[corner])

    def _polygons(self, prim: Any, points: int) -> tuple[Any, Any, Any]:
        """Return the counts (k,) of corners of the faces, their points, and the numbers of faces left out.

        Raises
        ------
        SceneError
            If no face is left.
        """
        counts = np.asarray(value_of(prim, self.time, "faceVertexCounts", []), np.intp)
        corners = np.asarray(value_of(prim, self.time, "faceVertexIndices", []), np.intp)
        ends = np.cumsum(np.maximum(counts, 0))
        fit = int(np.searchsorted(ends, len(corners), "right"))
        if fit < len(counts) or (ends[-1] if len(ends) else 0) != len(corners):
            what = f"faceVertexCounts add up to {ends[-1] if len(ends) else 0}"
            done = f"{plural(len(counts) - fit, 'face')} and what is beyond left out"
            self.lose(prim, f"{what} for {len(corners)} faceVertexIndices", done)
        counts, ends = np.maximum(counts[:fit], 0), ends[:fit]
        corners = corners[: ends[-1]] if fit else corners[:0]
        small = counts < 3
        if small.any():
            small_faces = f"faceVertexCounts has {plural(int(small.sum()), 'face')} of less than 3 corners"
            self.lose(prim, small_faces, "left out")
        beyond = (corners < 0) | (corners >= points)
        bad = np.unique(np.searchsorted(ends, np.flatnonzero(beyond), "right"))
        if len(bad):
            wrong = f"faceVertexIndices has {corners[beyond][0]}; there are {points} points"
            self.lose(prim, wrong, f"{plural(len(bad), 'face')} left out")
        if len(counts) and len(np.union1d(np.flatnonzero(small), bad)) == len(counts):
            raise SceneError("has no faces")
        return counts, np.where(beyond, 0, corners), bad

    def _note_subdivision(self, prim: Any) -> None:
        """Note a subdivision surface, of which usdview shows the control mesh, too, unless it is refined."""
        if prim.GetAttribute("subdivisionScheme").IsAuthored():
            self.lose(prim, "subdivisionScheme; the mesh of its control points in its place")
        else:
            self.materials.files.losses.notice(DEFAULT_SCHEME, str(prim.GetPath()), CONTROL_MESH)

    def _first_coordinates(self, prim: Any) -> str:
        """Return the name of the texture coordinates of a mesh whose material reads none."""
        from pxr import UsdGeom

        primvars = UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues()
        names = [
            primvar.GetPrimvarName() for primvar in primvars if str(primvar.GetTypeName()) == "texCoord2f[]"
        ]
        return "st" if "st" in names or not names else str(names[0])

    def _primvar(self, prim: Any, name: str, width: int) -> tuple[Any, str] | None:
        """Return the values (n, width) of a primvar and its interpolation, None if there is none."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        if primvar and primvar.HasValue():
            values, kind = primvar.ComputeFlattened(self.time), str(primvar.GetInterpolation())
        else:
            values = value_of(prim, self.time, name) if name == "normals" else None
            kind = str(UsdGeom.Mesh(prim).GetNormalsInterpolation())
        if values is None or not len(values):
            return None
        table = np.asarray(values, float)
        table = table[:, None] if table.ndim == 1 else table
        if table.ndim == 2 and table.shape[1] > width:
            table = table[:, :width]  # of a texCoord3f, or of colors with an opacity
        if table.ndim != 2 or table.shape[1] != width:
            self.lose(prim, f"{name} must have rows of {width} numbers", "left out")
            return None
        return table, kind


def _fields(values: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a `RawMesh`, in which opacities are a part of the colors."""
    opacity = values.pop(OPACITY, None)
    if opacity is not None and (opacity != 1).any():
        colors = values.get("colors", np.full((len(opacity), 3), UNCOLORED))
        values["colors"] = np.column_stack([colors, opacity])
    return values

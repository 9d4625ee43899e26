"""Meshes, materials and placements of trimesh objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import SceneError
from ..shapes.transform import Matrix
from . import visuals
from .appearance import MaterialSpec, assign_material, is_faint
from .contents import Contents
from .placing import Places
from .repair import RawMesh, warn, with_face_colors
from .trimesh_loading import import_trimesh

if TYPE_CHECKING:
    import trimesh

# objects of trimesh without faces, and what makes shapes of them
WITHOUT_FACES = {"PointCloud": "Points", "Path2D": "Edges", "Path3D": "Edges"}
Z_UP = ("stl", "stl_ascii", "3mf")  # formats with z up
FLAT = ("glb", "gltf")  # formats in which meshes without normals have flat facets
BARE = ("obj", "ply")  # formats whose materials may lack a color; trimesh then invents a gray one


def read(geometry: Any, source: str, strict: bool) -> Contents:
    """Return the meshes of a trimesh object with their materials and placements."""
    trimesh = import_trimesh()
    specs = _Visuals()
    numbers: dict[int, int] = {}
    raws: list[RawMesh] = []
    nodes = _nodes(geometry, trimesh)
    for mesh, name, _, _ in nodes:
        if id(mesh) not in numbers:
            numbers[id(mesh)] = len(raws)
            raws.append(_raw(mesh, name, source))
            specs.assign_material(raws[-1], mesh, {geometry.source.file_type, mesh.source.file_type})
    if specs.lost:
        listed = ", ".join(f"{what} (mesh {where!r})" for what, where in specs.lost.items())
        warn(f"{source}: not honored: {listed}", strict)
    of = np.array([numbers[id(mesh)] for mesh, *_ in nodes], np.intp)
    matrices = np.array([matrix for *_, matrix, _ in nodes]).reshape(-1, 4, 4)
    several = np.bincount(of, minlength=len(raws)).take(of) > 1
    names = [node if placed else "" for (*_, node), placed in zip(nodes, several, strict=True)]
    types = {getattr(mesh.source, "file_type", None) for mesh in (geometry, *(mesh for mesh, *_ in nodes))}
    contents = Contents(raws, Places(of, matrices, names), flat=not types.isdisjoint(FLAT))
    contents.up = None if types.isdisjoint(Z_UP) else "z"
    return contents


def _nodes(geometry: Any, trimesh: Any) -> list[tuple[Any, str, Matrix, str]]:
    """Return every mesh with its name, its matrix to world space, and the name of its node."""
    if isinstance(geometry, trimesh.Trimesh):
        return [(geometry, str(geometry.metadata.get("name") or ""), np.eye(4), "")]
    if not isinstance(geometry, trimesh.Scene):
        kind = type(geometry).__name__
        hint = f"; wf.{WITHOUT_FACES[kind]}(it, radius) is a shape" if kind in WITHOUT_FACES else ""
        raise SceneError(f"expected a trimesh.Trimesh or trimesh.Scene, got {kind}{hint}")
    out = []
    for node in geometry.graph.nodes_geometry:
        with np.errstate(all="ignore"):  # a matrix that is not finite is reported where it is used
            matrix, key = geometry.graph[node]
        mesh = geometry.geometry[key]
        if isinstance(mesh, trimesh.Trimesh):
            out.append((mesh, str(key), np.asarray(matrix, np.float64), str(node)))
    # trimesh lists the meshes of these files in reverse order
    if geometry.source is not None and geometry.source.file_type in ("obj", "glb", "gltf"):
        out.reverse()
    return out


def _raw(mesh: trimesh.Trimesh, name: str, source: str) -> RawMesh:
    # reading `vertex_normals` would compute them; the cache shows whether they exist
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache.cache else None
    uvs = getattr(mesh.visual, "uv", None)
    vertices = np.asarray(mesh.vertices, np.float64)
    if uvs is not None and (np.ndim(uvs) != 2 or len(uvs) != len(vertices)):
        uvs = None
    raw = RawMesh(name, vertices, np.asarray(mesh.faces), normals)
    raw.uvs = None if uvs is None else np.asarray(uvs, np.float64)[:, :2]
    raw.colors = visuals.vertex_colors(mesh)
    painted = visuals.face_colors(mesh)
    return raw if painted is None else with_face_colors(source, raw, painted)


class _Visuals:
    """The materials of trimesh visuals, each made once, and their unsupported properties."""

    def __init__(self) -> None:
        self._specs: dict[int, MaterialSpec] = {}
        self.lost: dict[str, str] = {}  # property -> its first place

    def assign_material(self, raw: RawMesh, mesh: trimesh.Trimesh, file_types: set[str | None]) -> None:
        """Give a raw mesh its material and emission; `file_types` are the formats that it was read from."""
        visual: Any = mesh.visual
        spec = self._spec(getattr(visual, "material", None), not file_types.isdisjoint(BARE))
        for what in spec.lost if spec is not None else ():
            self.lost.setdefault(what, raw.name)
        painted = visual.kind == "face"
        if not assign_material(raw, spec) or (painted and raw.colors is None):
            self.lost.setdefault("face colors" if painted else "vertex colors", raw.name)
        shown = {visual.kind, "face"} if visuals.shows_face_colors(mesh) else {visual.kind}
        for element in ("vertex", "face"):
            if element not in shown and visuals.ply_has_colors(mesh, element):
                self.lost.setdefault(f"{element} colors", raw.name)
        if spec is None and is_faint(raw) and not visuals.is_gltf(mesh):  # where it has no effect
            self.lost.setdefault("opacity of vertex colors", raw.name)

    def _spec(self, material: Any, bare: bool) -> MaterialSpec | None:
        if material is None or visuals.is_blank(material):
            return None
        if id(material) not in self._specs:
            self._specs[id(material)] = visuals.spec(material, f"trimesh material {material.name!r}", bare)
        return self._specs[id(material)]

"""Meshes, materials and placements of trimesh objects, read as in their files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import f4
from ...core.errors import SceneError
from ...shapes.transform import Matrix
from ..description.appearance import MaterialSpec, assign_material, from_srgb, is_faint
from ..description.contents import Contents
from ..description.placing import Places
from ..losses import Losses
from ..repair import RawMesh, Table, with_face_colors
from ..trimesh_library import import_trimesh
from ..trimesh_materials import is_blank, material_spec

if TYPE_CHECKING:
    import trimesh

# objects of trimesh without faces, and the functions that make shapes of them
WITHOUT_FACES = {"PointCloud": "Points", "Path2D": "Edges", "Path3D": "Edges"}
Z_UP = ("stl", "stl_ascii", "3mf")  # formats with z up
FLAT = ("glb", "gltf")  # formats in which meshes without normals have flat facets
INVENTED = 102  # code of the colors of trimesh's SimpleMaterial where none are given
BARE = ("obj", "ply")  # formats whose materials may lack a color; trimesh then invents a gray one


def read(geometry: Any, source: str, losses: Losses) -> Contents:
    """Return the meshes of a trimesh object with their materials and placements."""
    trimesh = import_trimesh()
    specs = _Visuals(losses)
    numbers: dict[int, int] = {}
    raws: list[RawMesh] = []
    nodes = _nodes(geometry, trimesh)
    for mesh, name, _, _ in nodes:
        if id(mesh) not in numbers:
            numbers[id(mesh)] = len(raws)
            raws.append(_raw(mesh, name))
            specs.assign_material(raws[-1], mesh, {geometry.source.file_type, mesh.source.file_type})
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


def _raw(mesh: trimesh.Trimesh, name: str) -> RawMesh:
    # reading `vertex_normals` would compute them; the cache shows whether they exist
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache.cache else None
    uvs = getattr(mesh.visual, "uv", None)
    vertices = np.asarray(mesh.vertices, np.float64)
    if uvs is not None and (np.ndim(uvs) != 2 or len(uvs) != len(vertices)):
        uvs = None
    raw = RawMesh(name, vertices, np.asarray(mesh.faces), normals)
    raw.uvs = None if uvs is None else np.asarray(uvs, np.float64)[:, :2]
    raw.colors = _vertex_colors(mesh)
    painted = _face_colors(mesh)
    return raw if painted is None else with_face_colors(raw, painted)


class _Visuals:
    """The materials of trimesh visuals, each made once, and their unsupported properties."""

    def __init__(self, losses: Losses) -> None:
        self._specs: dict[int, MaterialSpec] = {}
        self._losses = losses

    def assign_material(self, raw: RawMesh, mesh: trimesh.Trimesh, file_types: set[str | None]) -> None:
        """Give a raw mesh its material and emission; `file_types` are the formats that it was read from."""
        visual: Any = mesh.visual
        spec = self._spec(getattr(visual, "material", None), not file_types.isdisjoint(BARE))
        for what in spec.lost if spec is not None else ():
            self._lose(what, raw)
        painted = visual.kind == "face"
        if not assign_material(raw, spec) or (painted and raw.colors is None):
            self._lose("face colors" if painted else "vertex colors", raw)
        shown = {visual.kind, "face"} if _shows_face_colors(mesh) else {visual.kind}
        for element in ("vertex", "face"):
            if element not in shown and _ply_has_colors(mesh, element):
                self._lose(f"{element} colors", raw)
        if spec is None and is_faint(raw) and not _is_gltf(mesh):  # where it has no effect
            self._lose("opacity of vertex colors", raw)

    def _lose(self, what: str, raw: RawMesh) -> None:
        self._losses.note(what, f"mesh {raw.name!r}")

    def _spec(self, material: Any, bare: bool) -> MaterialSpec | None:
        if material is None or is_blank(material):
            return None
        if id(material) not in self._specs:
            self._specs[id(material)] = material_spec(material, self._losses, bare)
        return self._specs[id(material)]


def _vertex_colors(mesh: Any) -> Table | None:
    """Return the vertex colors of a trimesh mesh, linear (n, 4), if it has any.

    Those of glTF files are linear. All others are sRGB, as programs display them and as in PLY files.
    """
    visual = mesh.visual
    if visual.kind == "vertex":
        codes = np.asarray(visual.vertex_colors)
        linear = _is_gltf(mesh)
    elif "color" in getattr(visual, "vertex_attributes", {}):
        codes = np.asarray(visual.vertex_attributes["color"])  # beside a material; only glTF has these
        linear = True
    else:
        return None
    if codes.ndim != 2 or codes.shape[1] not in (3, 4) or len(codes) != len(mesh.vertices):
        return None
    if linear:
        unit = f4(np.iinfo(codes.dtype).max) if codes.dtype.kind == "u" else f4(1)
        return (codes.astype(f4) / unit).astype(np.float64)
    return _decoded(codes)


def _decoded(codes: NDArray[Any]) -> Table:
    return np.column_stack([from_srgb(codes[:, :3] / 255.0), codes[:, 3:] / 255.0])


def _face_colors(mesh: Any) -> Table | None:
    """Return the colors of the faces of a trimesh mesh, linear (m, 4), if the mesh shows them.

    They are sRGB codes in the mesh, as those of vertices are.
    """
    if not _shows_face_colors(mesh):
        return None
    if mesh.visual.kind == "face":
        return _decoded(np.asarray(mesh.visual.face_colors))
    return _decoded(np.asarray(type(mesh.visual)(face_colors=_ply_face_colors(mesh)).face_colors))


def _shows_face_colors(mesh: Any) -> bool:
    """Return whether a trimesh mesh shows a color for each of its faces.

    Of a PLY file with colors of vertices and faces, trimesh uses those of the vertices. If these are all
    white, they are defaults of some program, and the colors of the faces count.
    """
    if mesh.visual.kind == "face":
        return np.shape(mesh.visual.face_colors) == (len(mesh.faces), 4)
    if mesh.visual.kind != "vertex" or not _ply_has_colors(mesh, "face"):
        return False
    white = bool((np.asarray(mesh.visual.vertex_colors) == 255).all())
    return white and len(_ply_face_colors(mesh)) == len(mesh.faces)


def _ply_face_colors(mesh: Any) -> NDArray[Any]:
    """Return the colors of faces as stored in the PLY file, (m, 3 or 4)."""
    element = mesh.metadata["_ply_raw"]["face"]
    names = [name for name in ("red", "green", "blue", "alpha") if name in element["properties"]]
    return np.column_stack([np.asarray(element["data"][name]) for name in names])


def _is_gltf(mesh: Any) -> bool:
    """Return whether trimesh read a mesh from a glTF file: it marks such meshes."""
    return "from_gltf_primitive" in mesh.metadata


def _ply_has_colors(mesh: Any, element: str) -> bool:
    """Return whether the vertices or faces of a mesh's PLY file have colors.

    trimesh ignores both if there are texture coordinates, and those of faces if vertices have colors.
    """
    raw = mesh.metadata.get("_ply_raw", {}).get(element, {})
    return "red" in raw.get("properties", {})

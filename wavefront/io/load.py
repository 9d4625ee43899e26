"""Scenes and meshes from files, and from trimesh objects. The only file that imports trimesh."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..bsdfs import Bsdf
from ..camera import Camera
from ..errors import SceneError, finite_array
from ..lights import DirectionalLight, PointLight, SpotLight
from ..progress import Progress, phase
from ..scene import Scene
from ..shapes import Mesh
from ..shapes.transform import moved, moved_tangents
from . import dae, gltf, mtl, obj, off, ply, stl, threemf, trimesh_view, visuals
from .appearance import Look, dress, is_faint
from .files import beside, decode, read_bytes
from .gltf_materials import Materials
from .placing import MAX_INSTANCES, Places, place_meshes, place_shapes
from .repair import Raw, build, warn, with_face_colors

if TYPE_CHECKING:
    import trimesh

BARE = ("obj", "ply")  # files whose materials may lack a colour, where trimesh makes a grey one up
EXTENSIONS = (".obj", ".ply", ".stl", ".glb", ".gltf", ".off", ".dae", ".3mf")
PathLike = str | os.PathLike[str]
T = TypeVar("T")


def load(
    path: PathLike,
    *,
    strict: bool = False,
    progress: Progress = None,
    max_instances: int = MAX_INSTANCES,
) -> Scene:
    """Read a scene: .obj (with its .mtl), .ply, .stl, .glb, .gltf, .off, .dae, .3mf.

    The last two need the packages of the extra `formats`: `pip install pycollada lxml networkx`.

    A mesh that several nodes of a glTF file have is read once, and becomes an `Instance` for each.

    Parameters
    ----------
    path
        The file. Files that it refers to are read only from its own folder.
    strict
        Refuse what would otherwise be repaired or left out with a warning.
    progress
        Where reading takes more than 2 s, True or None shows a line that says so; False shows nothing.
    max_instances
        How many meshes a glTF file may place; one of a few bytes may place millions.

    Raises
    ------
    SceneError
        Naming the file, the line or element, the value and the limit.
    """
    with _phase(path, progress):
        name, contents = _contents(path, strict, True, max_instances)
        shapes = _some(name, place_shapes(name, contents.raws, contents.places, strict))
        return Scene(shapes, contents.lights, contents.camera)


def load_mesh(
    path: PathLike,
    material: Bsdf | None = None,
    transform: ArrayLike | None = None,
    *,
    strict: bool = False,
    progress: Progress = None,
) -> Mesh:
    """Read all geometry of a file as one mesh.

    Parameters
    ----------
    path
        As for `load`.
    material
        What the mesh is made of. Without it, the material and the emission of the file, which must
        then have only one.
    transform
        (4, 4) matrix applied to the vertices.
    strict, progress
        As for `load`.

    Raises
    ------
    SceneError
        As for `load`.
    """
    with _phase(path, progress):
        meshes = load_meshes(path, strict=strict, materials=material is None)
        return join(meshes, Path(path).stem, material, transform)


def load_meshes(path: PathLike, *, strict: bool = False, materials: bool = True) -> list[Mesh]:
    """Read the meshes of a file, one for each material and node; arguments as for `load`."""
    name, contents = _contents(path, strict, materials)
    return _some(name, place_meshes(name, contents.raws, contents.places, strict))


def _phase(path: PathLike, progress: Progress) -> AbstractContextManager[None]:
    return phase(f"loading {os.path.basename(os.fspath(path))}", progress)


def from_trimesh(geometry: Any) -> Scene:
    """Turn a `trimesh.Trimesh` or `trimesh.Scene` into a scene, as if it had been read from a file.

    Normals are used where the object holds them: given by its file, or computed because somebody
    asked for `vertex_normals`. Trimesh's own exporters follow the same rule. Geometry that stands in a
    scene's graph several times becomes an `Instance` for each.

    The camera and the lights of a trimesh scene are used if somebody set them. The camera's resolution is
    the size of the picture; a camera without a transform is placed to see all of the scene. Colors of lights
    are linear. The lights that trimesh makes up for its viewer do not count.

    What trimesh itself does not keep cannot count: of glTF it rounds base colours to 8 bits, and drops
    extensions, lights, tangents and the scale of normal maps; of MTL it keeps the image of `map_Kd`
    only. `load` reads all of these.

    Raises
    ------
    SceneError
        If it is something else, or has no faces.
    """
    source = "trimesh object"
    contents = _from_trimesh(geometry, source, strict=False)
    shapes = _some(source, place_shapes(source, contents.raws, contents.places, strict=False))
    scene = Scene(shapes, trimesh_view.lights(geometry))
    trimesh_view.add_camera(scene, geometry)
    return scene


def join(
    meshes: list[Mesh], name: str, material: Bsdf | None = None, transform: ArrayLike | None = None
) -> Mesh:
    """Return one mesh with the triangles of all.

    Raises
    ------
    SceneError
        If there are several materials and `material` does not say which to use.
    """
    if material is None and len({id(mesh.material) for mesh in meshes}) > 1:
        raise SceneError(f"{name}: has {len(meshes)} materials; pass one, or use wf.load")
    matrix = np.eye(4) if transform is None else finite_array("transform", transform, (4, 4))
    if np.linalg.det(matrix) == 0:
        raise SceneError("transform is singular; it must be invertible")
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)])
    normals = _joined([mesh.normals for mesh in meshes])
    raw = Raw(name, *moved(matrix, vertices, faces, normals))
    raw.uvs = _joined([mesh.uvs for mesh in meshes])
    raw.uvs1 = _joined([mesh.uvs1 for mesh in meshes])
    raw.tangents = moved_tangents(matrix, _joined([mesh.tangents for mesh in meshes]))
    raw.colors = _joined([mesh.colors for mesh in meshes])
    raw.material = meshes[0].material if material is None else material
    if material is None:
        glow = meshes[0].emission
        raw.emission = glow[:, 0] if isinstance(glow, np.ndarray) else glow
        raw.two_sided = meshes[0].two_sided
    mesh = build(name, raw)
    if mesh is None:
        raise SceneError(f"{name}: transform leaves no face with an area")
    return mesh


def _joined(parts: list[np.ndarray | None]) -> np.ndarray | None:
    """Concatenate what every part has."""
    there = [part for part in parts if part is not None]
    return np.concatenate(there) if len(there) == len(parts) else None


@dataclass
class Contents:
    """What a file holds."""

    raws: list[Raw]
    places: Places
    lights: Sequence[DirectionalLight | PointLight | SpotLight] = ()
    camera: Camera | None = None


def _contents(
    path: PathLike, strict: bool, materials: bool, max_instances: int = MAX_INSTANCES
) -> tuple[str, Contents]:
    """Read a file of any kind; also return its name for messages."""
    name = os.fspath(path)
    extension = Path(name).suffix.lower()
    if extension not in EXTENSIONS:
        raise SceneError(f"{name}: extension {extension!r} is not one of {', '.join(EXTENSIONS)}")
    data = read_bytes(path)
    if extension != ".3mf":
        _refuse(name, data)
    try:
        if extension == ".obj":
            return name, _once(_read_obj(path, data, strict, materials))
        if extension in (".glb", ".gltf"):
            return name, _read_gltf(path, data, strict, materials, max_instances)
        if extension == ".stl":
            return name, _once(stl.parse(name, data, strict))
        if extension == ".ply":
            return name, _read_ply(path, data, strict, materials)
        if extension == ".off":
            return name, _from_trimesh(off.parse(name, data, strict, materials), name, strict)
        if extension == ".dae":
            return name, _from_trimesh(dae.parse(path, data, strict, materials), name, strict)
        return name, _from_trimesh(threemf.parse(name, data, strict, materials), name, strict)
    except MemoryError as error:
        raise SceneError(f"{name}: does not fit in memory") from error


def _once(raws: list[Raw]) -> Contents:
    """Return meshes that stand where their vertices are."""
    return Contents(raws, Places.once(len(raws)))


def _refuse(name: str, data: bytes) -> None:
    """Refuse files that are empty, or archives under another name."""
    if not data:
        raise SceneError(f"{name}: is empty")
    if data[:4] in (b"PK\x03\x04", b"PK\x05\x06") or data[:2] == b"\x1f\x8b":
        raise SceneError(f"{name}: is an archive; unpack it first")


def _some(name: str, shapes: list[T]) -> list[T]:
    if not shapes:
        raise SceneError(f"{name}: has no faces")
    return shapes


def _read_gltf(path: PathLike, data: bytes, strict: bool, materials: bool, max_instances: int) -> Contents:
    document = gltf.Document(path, data)
    with document.inside("the file"):
        found = gltf.contents(document, max_instances)
        looks = Materials(document)
        for raw, number in found.raws:
            # without a material, the mesh is as plain as in memory
            if materials and not dress(raw, None if number is None else looks.look(number)):
                document.lose("vertex colours", f"mesh {raw.name!r}")
    if document.lost and materials:
        listed = ", ".join(f"{what} ({where})" for what, where in document.lost.items())
        warn(f"{document.name}: not honoured: {listed}", strict)
    return Contents([raw for raw, _ in found.raws], found.places, found.lights, found.camera)


def _read_obj(path: PathLike, data: bytes, strict: bool, materials: bool) -> list[Raw]:
    name = os.fspath(path)
    parsed = obj.parse(name, decode(data), strict)
    if parsed.ignored:
        listed = ", ".join(f"{keyword} (line {line})" for keyword, line in parsed.ignored.items())
        warn(f"{name}: not honoured: {listed}", strict)
    looks = _libraries(path, parsed.libraries, strict) if materials else {}
    for raw in parsed.raws:
        raw.colors = None if raw.colors is None else visuals.from_srgb(raw.colors)
        if materials and not dress(raw, looks.get(raw.name)):
            warn(f"{name}: not honoured: vertex colours (material {raw.name!r})", strict)
    absent = ", ".join(repr(raw.name) for raw in parsed.raws if raw.name and raw.name not in looks)
    if looks and absent:
        warn(f"{name}: not in its material files: {absent}", strict)
    if materials and absent and not parsed.libraries:
        warn(f"{name}: names no material file for its materials {absent}", strict)
    return parsed.raws


def _libraries(path: PathLike, libraries: list[str], strict: bool) -> dict[str, Look]:
    """Read the material files; a missing one is announced and left out."""
    looks: dict[str, Look] = {}
    for library in dict.fromkeys(libraries):
        file = beside(path, library)
        if not os.path.exists(file):  # False, too, for names that no file can have
            warn(f"{os.fspath(path)}: material file {library!r} is missing", strict)
            continue
        looks.update(mtl.looks(mtl.parse(file, decode(read_bytes(file)), strict), strict))
    return looks


def _read_ply(path: PathLike, data: bytes, strict: bool, materials: bool) -> Contents:
    name = os.fspath(path)
    found, claimed = ply.parse(path, data, strict, materials)
    contents = _from_trimesh(found, name, strict)
    faces = sum(len(raw.faces) for raw in contents.raws)
    if faces < claimed:
        raise SceneError(f"{name}: claims {claimed} of face; {faces} can be read")
    return contents


def _from_trimesh(geometry: Any, source: str, strict: bool) -> Contents:
    """Return the meshes of a trimesh object with materials, and where they stand."""
    import trimesh

    looks = _Visuals()
    numbers: dict[int, int] = {}
    raws: list[Raw] = []
    nodes = _nodes(geometry, trimesh)
    for mesh, name, _ in nodes:
        if id(mesh) not in numbers:
            numbers[id(mesh)] = len(raws)
            raws.append(_raw(mesh, name, source))
            looks.dress(raws[-1], mesh, {geometry.source.file_type, mesh.source.file_type})
    if looks.lost:
        listed = ", ".join(f"{what} (mesh {where!r})" for what, where in looks.lost.items())
        warn(f"{source}: not honoured: {listed}", strict)
    of = np.array([numbers[id(mesh)] for mesh, _, _ in nodes], np.intp)
    return Contents(raws, Places(of, np.array([matrix for *_, matrix in nodes]).reshape(-1, 4, 4)))


def _nodes(geometry: Any, trimesh: Any) -> list[tuple[Any, str, np.ndarray]]:
    """Return every mesh with its name and its matrix to world space."""
    if isinstance(geometry, trimesh.Trimesh):
        return [(geometry, str(geometry.metadata.get("name") or ""), np.eye(4))]
    if not isinstance(geometry, trimesh.Scene):
        raise SceneError(f"expected a trimesh.Trimesh or trimesh.Scene, got {type(geometry).__name__}")
    out = []
    for node in geometry.graph.nodes_geometry:
        matrix, key = geometry.graph[node]
        mesh = geometry.geometry[key]
        if isinstance(mesh, trimesh.Trimesh):
            out.append((mesh, str(key), np.asarray(matrix, np.float64)))
    # trimesh lists what these files hold last first
    if geometry.source is not None and geometry.source.file_type in ("obj", "glb", "gltf"):
        out.reverse()
    return out


def _raw(mesh: trimesh.Trimesh, name: str, source: str) -> Raw:
    # asking for `vertex_normals` would compute them; the cache tells whether they are there
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache.cache else None
    uvs = getattr(mesh.visual, "uv", None)
    vertices = np.asarray(mesh.vertices, np.float64)
    if uvs is not None and (np.ndim(uvs) != 2 or len(uvs) != len(vertices)):
        uvs = None
    raw = Raw(name, vertices, np.asarray(mesh.faces), normals)
    raw.uvs = None if uvs is None else np.asarray(uvs, np.float64)[:, :2]
    raw.colors = visuals.vertex_colours(mesh)
    painted = visuals.face_colours(mesh)
    return raw if painted is None else with_face_colors(source, raw, painted)


class _Visuals:
    """The looks of trimesh visuals, each made once, and what is lost of them."""

    def __init__(self) -> None:
        self._looks: dict[int, Look] = {}
        self.lost: dict[str, str] = {}  # what -> where first

    def dress(self, raw: Raw, mesh: trimesh.Trimesh, file_types: set[str | None]) -> None:
        """Give a raw mesh its material and emission; `file_types` tells what it was read from."""
        visual: Any = mesh.visual
        look = self._look(getattr(visual, "material", None), not file_types.isdisjoint(BARE))
        for what in look.lost if look is not None else ():
            self.lost.setdefault(what, raw.name)
        painted = visual.kind == "face"
        if not dress(raw, look) or (painted and raw.colors is None):
            self.lost.setdefault("face colours" if painted else "vertex colours", raw.name)
        shown = {visual.kind, "face"} if visuals.shows_face_colors(mesh) else {visual.kind}
        for element in ("vertex", "face"):
            if element not in shown and visuals.ply_has_colours(mesh, element):
                self.lost.setdefault(f"{element} colours", raw.name)
        if look is None and is_faint(raw) and not visuals.is_gltf(mesh):  # where it has no say
            self.lost.setdefault("opacity of vertex colours", raw.name)

    def _look(self, material: Any, bare: bool) -> Look | None:
        if material is None or visuals.is_blank(material):
            return None
        if id(material) not in self._looks:
            self._looks[id(material)] = visuals.look(material, f"trimesh material {material.name!r}", bare)
        return self._looks[id(material)]

"""glTF 2.0 (.gltf, .glb): geometry, nodes, cameras and lights.

Source: Khronos Group, glTF 2.0 specification and the ratified KHR extensions. Everything is read
from the JSON itself, so numbers are exact and every index is checked.
"""

from __future__ import annotations

import base64
import binascii
import json
import os
import struct
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import SceneError
from ..lights import DirectionalLight, PointLight, SpotLight
from .files import beside, read_bytes
from .repair import Raw, wide

COMPONENTS: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
READ = ("TEXCOORD_0", "TEXCOORD_1", "COLOR_0")  # of the numbered attributes of a mesh
TRIANGLES, STRIP, FAN = 4, 5, 6
MAX_ELEMENTS = 2**28  # in one accessor, whatever backs it
MAX_INSTANCES = 2**20  # of one node by EXT_mesh_gpu_instancing
INSTANCE_ATTRIBUTES: dict[str, list[float]] = {  # what an instance without it has
    "TRANSLATION": [0, 0, 0],
    "ROTATION": [0, 0, 0, 1],
    "SCALE": [1, 1, 1],
}
HEIGHT = 512  # pixels of a camera's picture; files give its shape only
Matrix = NDArray[np.float64]


class Document:
    """The JSON of a file and the bytes that it refers to. Lookups that fail name the file and the element."""

    def __init__(self, path: str | os.PathLike[str], data: bytes) -> None:
        self.path = path
        self.name = os.fspath(path)
        text, self._binary = _chunks(self.name, data) if data[:4] == b"glTF" else (data, None)
        try:
            self.json = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise SceneError(f"{self.name}: not glTF: its JSON is damaged: {error}") from error
        if not isinstance(self.json, dict):
            raise SceneError(f"{self.name}: not glTF: its JSON is a {type(self.json).__name__}")
        version = str(self.json.get("asset", {}).get("version", ""))
        if not version.startswith("2"):
            raise SceneError(f"{self.name}: is glTF version {version!r}; only version 2 is read")
        self._buffers: dict[int, bytes] = {}
        self.lost: dict[str, str] = {}  # what is not honoured -> where it was first met

    def lose(self, what: str, where: str) -> None:
        """Note a property that is not honoured."""
        self.lost.setdefault(what, where)

    def get(self, kind: str, index: Any) -> dict[str, Any]:
        """Return element `index` of the array `kind`."""
        items = self.json.get(kind, [])
        if not isinstance(index, int) or not 0 <= index < len(items):
            raise SceneError(f"{self.name}: {kind}[{index!r}] does not exist; there are {len(items)}")
        if not isinstance(items[index], dict):
            raise SceneError(f"{self.name}: {kind}[{index}] is not an object")
        return items[index]

    def uri(self, uri: str, where: str) -> bytes:
        """Return what a URI holds: data in the file itself, or a file beside it."""
        if not uri.startswith("data:"):
            return read_bytes(beside(self.path, unquote(uri)))
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise SceneError(f"{self.name}: {where} has damaged base64 data: {error}") from error

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer."""
        if index not in self._buffers:
            item = self.get("buffers", index)
            if "uri" in item:
                data = self.uri(item["uri"], f"buffers[{index}]")
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                raise SceneError(f"{self.name}: buffers[{index}] has no data")
            if len(data) < item.get("byteLength", 0):
                raise SceneError(
                    f"{self.name}: buffers[{index}] has {len(data)} bytes; it claims {item['byteLength']}"
                )
            self._buffers[index] = data
        return self._buffers[index]

    def view(self, index: int) -> tuple[bytes, int, int, int]:
        """Return (buffer, first byte, end, stride or 0) of a buffer view."""
        item = self.get("bufferViews", index)
        data = self.buffer(item.get("buffer", -1))
        start, length = _count(item.get("byteOffset", 0)), _count(item.get("byteLength", 0))
        if start + length > len(data):
            raise SceneError(
                f"{self.name}: bufferViews[{index}] ends at byte {start + length}; its buffer has {len(data)}"
            )
        return data, start, start + length, _count(item.get("byteStride", 0))

    def accessor(self, index: int) -> NDArray[Any]:
        """Return the elements of an accessor, (count, width); normalised integers become float32."""
        item = self.get("accessors", index)
        where = f"{self.name}: accessors[{index}]"
        kind, width = COMPONENTS.get(item.get("componentType", 0)), WIDTHS.get(item.get("type", ""))
        count = _count(item.get("count", 0))
        if kind is None or width is None:
            raise SceneError(
                f"{where} is {item.get('type')!r} of {item.get('componentType')!r}, which glTF does not have"
            )
        if count * width > MAX_ELEMENTS:
            raise SceneError(f"{where} has {count} elements; the limit is {MAX_ELEMENTS // width}")
        if "bufferView" in item:
            values = self._strided(item["bufferView"], item.get("byteOffset", 0), count, width, kind, where)
        else:
            values = np.zeros((count, width), kind)
        if "sparse" in item:
            values = self._sparse(item["sparse"], values, where)
        return _normalised(values) if item.get("normalized") else values

    def _strided(
        self, view: int, offset: int, count: int, width: int, kind: type[np.generic], where: str
    ) -> NDArray[Any]:
        data, start, end, stride = self.view(view)
        size = np.dtype(kind).itemsize * width
        stride = stride or size
        start += _count(offset)
        if count and start + (count - 1) * stride + size > end:
            raise SceneError(f"{where} has {count} elements, which its buffer view cannot hold")
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, data, start, (stride, np.dtype(kind).itemsize)).copy()

    def _sparse(self, sparse: dict[str, Any], values: NDArray[Any], where: str) -> NDArray[Any]:
        count = _count(sparse.get("count", 0))
        at, new = sparse["indices"], sparse["values"]
        kind = COMPONENTS.get(at.get("componentType", 0), np.uint32)
        index = self._strided(at["bufferView"], at.get("byteOffset", 0), count, 1, kind, where)[:, 0]
        if count and index.max() >= len(values):
            raise SceneError(f"{where} replaces element {index.max()}; it has {len(values)}")
        values = values.copy()
        width = values.shape[1]
        values[index] = self._strided(
            new["bufferView"], new.get("byteOffset", 0), count, width, values.dtype.type, where
        )
        return values


@dataclass
class Contents:
    """What a file holds, in world space."""

    # mesh, material, placement; a mesh that several nodes have is one object
    raws: list[tuple[Raw, int | None, Matrix]] = field(default_factory=list)
    lights: list[DirectionalLight | PointLight | SpotLight] = field(default_factory=list)
    camera: Camera | None = None


def contents(document: Document) -> Contents:
    """Walk the nodes of the default scene.

    Raises
    ------
    SceneError
        If an element is missing or malformed.
    """
    out = Contents()
    meshes: dict[int, list[tuple[Raw, int | None]]] = {}
    for node, matrix in _walk(document):
        if "mesh" in node:
            if node["mesh"] not in meshes:
                meshes[node["mesh"]] = _primitives(document, node["mesh"])
            for place in _places(document, node, matrix):
                out.raws += [(raw, material, place) for raw, material in meshes[node["mesh"]]]
        if "camera" in node:
            _add_camera(document, out, node["camera"], matrix)
        if "skin" in node:
            document.lose("skin", f"node {node.get('name', '?')!r}")
        light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if light is not None:
            _add_light(document, out, light, matrix)
    if len(document.json.get("scenes", [])) > 1:
        document.lose("further scenes", "the file")
    if document.json.get("animations"):
        document.lose("animations", "the file")
    # the walk meets the last node first, as trimesh does
    out.raws.reverse()
    return out


def _walk(document: Document) -> list[tuple[dict[str, Any], Matrix]]:
    """Return every node of the scene with its matrix from local to world, (4, 4)."""
    if "scenes" in document.json:
        roots = document.get("scenes", document.json.get("scene", 0)).get("nodes", [])
    else:
        nodes = document.json.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [i for i in range(len(nodes)) if i not in children]
    stack = [(index, np.eye(4)) for index in roots]
    seen: set[int] = set()
    out = []
    while stack:
        index, parent = stack.pop()
        node = document.get("nodes", index)
        if index in seen:
            raise SceneError(f"{document.name}: nodes[{index}] is reached twice; nodes must form a tree")
        seen.add(index)
        matrix = parent @ _local(document, index, node)
        out.append((node, matrix))
        stack += [(child, matrix) for child in node.get("children", [])]
    return out


def _local(document: Document, index: int, node: dict[str, Any]) -> Matrix:
    """Return a node's own matrix: given, or translation · rotation · scale."""
    where = f"{document.name}: nodes[{index}]"
    if "matrix" in node:
        return floats(where + ".matrix", node["matrix"], 16).reshape(4, 4).T
    return _composed(
        floats(where + ".translation", node.get("translation", [0, 0, 0]), 3),
        floats(where + ".rotation", node.get("rotation", [0, 0, 0, 1]), 4),
        floats(where + ".scale", node.get("scale", [1, 1, 1]), 3),
    )


def _places(document: Document, node: dict[str, Any], matrix: Matrix) -> list[Matrix]:
    """Return where a node's mesh stands: once, or as often as EXT_mesh_gpu_instancing says."""
    attributes = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes")
    if not attributes:
        return [matrix]
    where = f"{document.name}: EXT_mesh_gpu_instancing of node {node.get('name', '?')!r}"
    for name in attributes.keys() - INSTANCE_ATTRIBUTES.keys():
        document.lose(f"{name} of instances", f"node {node.get('name', '?')!r}")
    counts = {name: document.get("accessors", index).get("count") for name, index in attributes.items()}
    count = _count(next(iter(counts.values())))
    if len(set(counts.values())) > 1 or count > MAX_INSTANCES:
        listed = ", ".join(f"{number} of {name}" for name, number in counts.items())
        raise SceneError(f"{where} has {listed}; it must be as many of each, at most {MAX_INSTANCES}")
    parts = []
    for name, neutral in INSTANCE_ATTRIBUTES.items():
        values = _attribute(document, attributes, name, len(neutral), where, count)
        parts.append(np.tile(neutral, (count, 1)) if values is None else wide(values))
        bad = np.argwhere(~np.isfinite(parts[-1]))
        if len(bad):
            raise SceneError(
                f"{where} has {name}[{bad[0][0]}] {parts[-1][bad[0][0]].tolist()}; it must be finite"
            )
    return [matrix @ _composed(*part) for part in zip(*parts, strict=True)]


def _composed(translation: Matrix, rotation: Matrix, scale: Matrix) -> Matrix:
    """Return translation · rotation · scale as a matrix; the rotation is a quaternion."""
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation(rotation) * scale
    matrix[:3, 3] = translation
    return matrix


def _rotation(quaternion: Matrix) -> Matrix:
    """Return the (3, 3) matrix of a quaternion x, y, z, w; zero means no rotation."""
    size = float(quaternion @ quaternion)
    if size == 0:
        return np.eye(3)
    x, y, z, w = quaternion * np.sqrt(2 / size)
    return np.array(
        [
            [1 - y * y - z * z, x * y - z * w, x * z + y * w],
            [x * y + z * w, 1 - x * x - z * z, y * z - x * w],
            [x * z - y * w, y * z + x * w, 1 - x * x - y * y],
        ]
    )


def _primitives(document: Document, index: int) -> list[tuple[Raw, int | None]]:
    """Return the parts of a mesh with the numbers of their materials."""
    mesh = document.get("meshes", index)
    name = str(mesh.get("name", f"mesh{index}"))
    if "weights" in mesh or any("targets" in part for part in mesh.get("primitives", [])):
        document.lose("morph targets", f"mesh {name!r}")
    out = []
    for number, part in enumerate(mesh.get("primitives", [])):
        mode = part.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN):
            document.lose("points and lines", f"mesh {name!r}")
            continue
        label = name if len(mesh["primitives"]) == 1 else f"{name}_{number}"
        out.append((_primitive(document, part, mode, label), part.get("material")))
    return out


def _primitive(document: Document, part: dict[str, Any], mode: int, name: str) -> Raw:
    where = f"{document.name}: {name!r}"
    attributes = part.get("attributes", {})
    if "KHR_draco_mesh_compression" in part.get("extensions", {}) or "POSITION" not in attributes:
        raise SceneError(f"{where} has no POSITION that can be read")
    vertices = _attribute(document, attributes, "POSITION", 3, where)
    assert vertices is not None
    if "indices" in part:
        indices = document.accessor(part["indices"])[:, 0]
        if indices.dtype.kind != "u":
            raise SceneError(f"{where} has indices of type {indices.dtype}; they must be unsigned")
    else:
        indices = np.arange(len(vertices))
    uvs = _upright(_attribute(document, attributes, "TEXCOORD_0", 2, where, len(vertices)))
    uvs1 = _upright(_attribute(document, attributes, "TEXCOORD_1", 2, where, len(vertices)))
    colors = _attribute(document, attributes, "COLOR_0", (3, 4), where, len(vertices))
    for extra in attributes:
        if extra.startswith(("COLOR_", "TEXCOORD_")) and extra not in READ:
            document.lose(extra, f"mesh {name!r}")
    tangents = _attribute(document, attributes, "TANGENT", 4, where, len(vertices))
    normals = _attribute(document, attributes, "NORMAL", 3, where, len(vertices))
    return Raw(
        name,
        wide(vertices),
        _triangles(where, indices.astype(np.intp), mode),
        None if normals is None else wide(normals),
        None if uvs is None else wide(uvs),
        None if uvs1 is None else wide(uvs1),
        None if tangents is None else wide(tangents),
        None if colors is None else wide(colors),
    )


def _upright(coordinates: NDArray[Any] | None) -> NDArray[np.float32] | None:
    """Return texture coordinates with v upwards, as floats: quantised ones may be whole numbers."""
    if coordinates is None:
        return None
    with np.errstate(invalid="ignore"):
        upright = coordinates.astype(np.float32)
        upright[:, 1] = 1 - upright[:, 1]  # glTF counts v downwards
    return upright


def _attribute(
    document: Document,
    attributes: dict[str, Any],
    key: str,
    widths: int | tuple[int, ...],
    where: str,
    count: int | None = None,
) -> NDArray[Any] | None:
    if key not in attributes:
        return None
    values = document.accessor(attributes[key])
    allowed = (widths,) if isinstance(widths, int) else widths
    if values.shape[1] not in allowed:
        listed = " or ".join(map(str, allowed))
        raise SceneError(f"{where} has {key} with {values.shape[1]} components; it must have {listed}")
    if count is not None and len(values) != count:
        raise SceneError(f"{where} has {len(values)} of {key}; it has {count} vertices")
    return values


def _triangles(where: str, indices: NDArray[np.intp], mode: int) -> NDArray[np.intp]:
    """Return faces (m, 3) of a list, strip or fan of triangles."""
    if mode == TRIANGLES:
        if len(indices) % 3:
            raise SceneError(f"{where} has {len(indices)} indices; triangles need a multiple of 3")
        return indices.reshape(-1, 3)
    if len(indices) < 3:
        raise SceneError(f"{where} has {len(indices)} indices; a strip or fan needs at least 3")
    if mode == FAN:
        first = np.full(len(indices) - 2, indices[0])
        return np.stack([first, indices[1:-1], indices[2:]], axis=1)
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    faces[1::2] = faces[1::2, [1, 0, 2]]  # every second triangle of a strip runs the other way
    return faces


def _add_camera(document: Document, out: Contents, index: int, matrix: Matrix) -> None:
    if out.camera is not None:
        document.lose("further cameras", f"cameras[{index}]")
        return
    try:
        out.camera = _camera(document.get("cameras", index), matrix)
    except SceneError as error:
        raise SceneError(f"{document.name}: cameras[{index}]: {error}") from error


def _camera(camera: dict[str, Any], matrix: Matrix) -> Camera:
    kind = str(camera.get("type"))
    lens = camera.get(kind, {})
    if kind == "perspective":
        fov, aspect = _positive(lens, "yfov", None), _positive(lens, "aspectRatio", 1)
        return camera_at(matrix, float(np.degrees(fov)), aspect)
    if kind == "orthographic":
        half_width, half_height = _positive(lens, "xmag", None), _positive(lens, "ymag", None)
        size = _size(half_width / half_height)
        return Camera.orthographic(*_pose(matrix), height=2 * half_height, size=size)
    raise SceneError(f"type is {kind!r}; it must be 'perspective' or 'orthographic'")


def camera_at(matrix: Matrix, fov: float, aspect: float) -> Camera:
    """Return a camera from its matrix to world space (it looks along -z, y is up), fov in degrees."""
    origin, target, up = _pose(matrix)
    return Camera.look_at(origin, target, up, fov=fov, size=_size(aspect))


def _pose(matrix: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return where a camera is, what it looks at, and what is up; a scale of its node has no say."""
    origin = matrix[:3, 3]
    return origin, origin - matrix[:3, 2] / (np.linalg.norm(matrix[:3, 2]) or 1.0), matrix[:3, 1]


def _size(aspect: float) -> tuple[int, int]:
    return max(1, round(HEIGHT * aspect)), HEIGHT


def _positive(lens: dict[str, Any], key: str, default: float | None) -> float:
    value = float(floats(key, [lens.get(key, default)], 1)[0])
    if not 0 < value < 1e30:
        raise SceneError(f"{key} is {value:g}; it must be above 0")
    return value


def _add_light(document: Document, out: Contents, index: int, matrix: Matrix) -> None:
    """Add a light of KHR_lights_punctual; candela are taken for W/sr."""
    lights = document.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    if not isinstance(index, int) or not 0 <= index < len(lights):
        raise SceneError(f"{document.name}: light {index!r} does not exist; there are {len(lights)}")
    light = lights[index]
    if "range" in light:
        document.lose("range of a light", f"light {index}")
    where = f"{document.name}: light {index}"
    colour = floats(where + " color", light.get("color", [1, 1, 1]), 3)
    strength = colour * floats(where + " intensity", [light.get("intensity", 1)], 1)
    place, forward = matrix[:3, 3], -matrix[:3, 2]
    if light.get("type") == "point":
        out.lights.append(PointLight(place, strength))
    elif light.get("type") == "directional":
        out.lights.append(DirectionalLight(forward, strength))
    elif light.get("type") == "spot":
        spot = light.get("spot", {})
        inner, outer = floats(
            where + " cone", [spot.get("innerConeAngle", 0), spot.get("outerConeAngle", np.pi / 4)], 2
        )
        if not 0 <= inner < outer <= np.pi / 2:
            raise SceneError(f"{where}: cone angles are {inner:g} and {outer:g}; 0 <= inner < outer <= π/2")
        angle = float(np.degrees(2 * outer))
        out.lights.append(
            SpotLight(place, strength, direction=forward, angle=angle, blend=float(1 - inner / outer))
        )
    else:
        document.lose(f"{light.get('type')} light", f"light {index}")


def floats(where: str, value: Any, count: int) -> Matrix:
    """Return `count` finite numbers of the JSON, or raise a SceneError that names them."""
    good = isinstance(value, list) and len(value) == count
    if not good or not all(
        isinstance(x, int | float) and not isinstance(x, bool) and np.isfinite(x) for x in value
    ):
        raise SceneError(f"{where} is {value!r}; it must be {count} finite numbers")
    return np.array(value, np.float64)


def _count(value: Any) -> int:
    if not isinstance(value, int) or value < 0:
        raise SceneError(f"{value!r} stands where glTF has a count of bytes or elements")
    return value


def _normalised(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind == "f":
        return values
    scaled = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    return np.maximum(scaled, np.float32(-1))


def _chunks(name: str, data: bytes) -> tuple[bytes, bytes | None]:
    """Split a .glb into its JSON and its binary chunk."""
    if len(data) < 20:
        raise SceneError(f"{name}: ends early: {len(data)} bytes")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise SceneError(f"{name}: is glTF version {version}; only version 2 is read")
    if length > len(data):
        raise SceneError(f"{name}: claims {length} bytes; it has {len(data)}")
    parts: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise SceneError(f"{name}: a chunk claims {size} bytes; {length - at - 8} are there")
        parts.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in parts:
        raise SceneError(f"{name}: has no JSON chunk")
    return parts[b"JSON"], parts.get(b"BIN\0")

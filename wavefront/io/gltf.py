"""glTF 2.0 (.gltf, .glb): the content of the default scene, with its cameras and lights.

Source: Khronos Group, glTF 2.0 specification and the ratified KHR extensions. Everything is read
from the JSON itself, so numbers are exact, and every index is checked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..camera import Camera
from ..core.errors import LimitError, SceneError, exact, printable
from ..lights import DirectionalLight, PointLight, SpotLight
from ..shapes.transform import Matrix
from .gltf_document import Document, floats, shown
from .gltf_meshes import primitives
from .gltf_nodes import Node, count_placements, placements, walk
from .placing import Places
from .repair import RawMesh

HEIGHT = 512  # pixels of a camera's picture; files give only its aspect ratio


@dataclass
class GltfContents:
    """The content of a file."""

    raws: list[tuple[RawMesh, int | None]] = field(default_factory=list)  # meshes, numbers of their materials
    places: Places = field(default_factory=Places)  # of the meshes
    lights: list[DirectionalLight | PointLight | SpotLight] = field(default_factory=list)
    camera: Camera | None = None


def contents(document: Document) -> GltfContents:
    """Read the default scene.

    Parameters
    ----------
    document
        The file.

    Raises
    ------
    SceneError
        If an element is missing or malformed, or the nodes place more meshes than its limits allow.
    """
    out = GltfContents()
    numbers: dict[int, list[int]] = {}  # by mesh of the file: the indices of its parts among `out.raws`
    of: list[int] = []  # index among `out.raws` of each placed mesh
    where: list[Matrix] = []
    names: list[str] = []
    for node in walk(document):
        json = node.json
        if "mesh" in json:
            with document.inside(f"nodes[{node.index}]"):
                parts = _parts(document, out, numbers, json["mesh"])
                document.files.limits.check_meshes(document.name, len(out.raws))
                count = count_placements(document, node)
                total = len(of) + count * len(parts)
                if total > document.files.limits.instances:
                    raise LimitError(
                        f"its nodes place {total} meshes so far; the limit is "
                        f"{document.files.limits.instances} (LoadLimits.instances)"
                    )
                of += parts * count
                names += _names_of_parts(node, len(parts)) * count
                where.append(placements(document, node, count).repeat(len(parts), 0))
        if len(json.keys() & {"camera", "skin", "extensions"}):
            with document.inside(f"nodes[{node.index}]"):
                _add_others(document, out, node)
    if len(document.json.get("scenes", [])) > 1:
        document.lose("further scenes", "the file")
    if document.json.get("animations"):
        document.lose("animations", "the file")
    # the walk meets the last node first, as trimesh does
    if of:
        out.places = Places(np.array(of[::-1], np.intp), np.concatenate(where)[::-1], names[::-1])
    return out


def _names_of_parts(node: Node, parts: int) -> list[str]:
    """Return the names of the shapes of a node; "" if it has none."""
    name = printable(str(node.json.get("name") or ""))
    return [f"{name}_{part}" if name and parts > 1 else name for part in range(parts)]


def _parts(document: Document, out: GltfContents, numbers: dict[int, list[int]], mesh: Any) -> list[int]:
    """Return the indices of a mesh's parts among `out.raws`; the mesh is read at its first use."""
    if not isinstance(mesh, int) or mesh not in numbers:
        found = primitives(document, mesh)
        numbers[mesh] = list(range(len(out.raws), len(out.raws) + len(found)))
        out.raws += found
    return numbers[mesh]


def _add_others(document: Document, out: GltfContents, node: Node) -> None:
    """Add the camera and the light of a node."""
    if "skin" in node.json:
        document.lose("skin", node.label)
    if "camera" in node.json:
        _add_camera(document, out, node.json["camera"], node.matrix)
    light = node.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
    if light is not None:
        _add_light(document, out, light, node.matrix)


def _add_camera(document: Document, out: GltfContents, index: Any, matrix: Matrix) -> None:
    if out.camera is not None:
        document.lose("further cameras", f"cameras[{shown(index)}]")
        return
    camera = document.get("cameras", index)
    with document.inside(f"cameras[{index}]"):
        out.camera = _camera(camera, matrix)


def _camera(camera: dict[str, Any], matrix: Matrix) -> Camera:
    kind = camera.get("type")
    lens = camera.get(str(kind), {})
    if kind == "perspective":
        fov, aspect = _positive(lens, "yfov", None), _positive(lens, "aspectRatio", 1)
        return camera_at(matrix, float(np.degrees(fov)), _size(aspect))
    if kind == "orthographic":
        half_width, half_height = _positive(lens, "xmag", None), _positive(lens, "ymag", None)
        size = _size(half_width / half_height)
        return Camera.orthographic(*_pose(matrix), height=2 * half_height, size=size)
    raise SceneError(f"type is {shown(kind)}; it must be 'perspective' or 'orthographic'")


def camera_at(matrix: Matrix, fov: float, size: tuple[int, int]) -> Camera:
    """Return a camera from its matrix to world space (it looks along -z, y is up), fov in degrees."""
    origin, target, up = _pose(matrix)
    return Camera.look_at(origin, target, up, fov=fov, size=size)


def _pose(matrix: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return the origin, target and up vector of a camera; the scale of its node has no effect."""
    origin, backward, up = matrix[:3, 3], _near_one(matrix[:3, 2]), _near_one(matrix[:3, 1])
    return origin, origin - backward / (np.linalg.norm(backward) or 1.0), up


def _near_one(vector: Matrix) -> Matrix:
    """Return a vector multiplied by a power of two, so that its size is about 1 and it can be squared."""
    _, exponent = np.frexp(np.abs(vector).max())
    return np.ldexp(vector, -exponent)


def _size(aspect: float) -> tuple[int, int]:
    """Return (width, height) in pixels of a picture with a given aspect ratio."""
    return max(1, round(HEIGHT * aspect)), HEIGHT


def _positive(lens: dict[str, Any], key: str, default: float | None) -> float:
    value = float(floats(key, [lens.get(key, default)], 1)[0])
    if not 0 < value < 1e30:
        raise SceneError(f"{key} is {exact(value)}; it must be above 0")
    return value


def _add_light(document: Document, out: GltfContents, index: Any, matrix: Matrix) -> None:
    """Add a light of KHR_lights_punctual; candela count as W/sr."""
    lights = document.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    if not isinstance(index, int) or not 0 <= index < len(lights):
        raise SceneError(f"light {shown(index)} does not exist; there are {len(lights)}")
    with document.inside(f"light {index}"):
        light = lights[index]
        if "range" in light:
            document.lose("range of a light", f"light {index}")
        found = punctual_light(light, matrix)
        if found is None:
            document.lose(f"{light.get('type')} light", f"light {index}")
        else:
            out.lights.append(found)


def punctual_light(light: dict[str, Any], matrix: Matrix) -> DirectionalLight | PointLight | SpotLight | None:
    """Return a light of KHR_lights_punctual by the matrix of its node to the scene; None for other types.

    Raises
    ------
    SceneError
        If a value is malformed or out of range.
    """
    color = floats("color", light.get("color", [1, 1, 1]), 3)
    with np.errstate(over="ignore"):
        strength = color * floats("intensity", [light.get("intensity", 1)], 1)
    place, forward = matrix[:3, 3], -matrix[:3, 2]
    match light.get("type"):
        case "point":
            return PointLight(place, strength)
        case "directional":
            return DirectionalLight(forward, strength)
        case "spot":
            spot = light.get("spot", {})
            inner, outer = floats(
                "cone", [spot.get("innerConeAngle", 0), spot.get("outerConeAngle", np.pi / 4)], 2
            )
            if not (0 <= inner <= outer <= np.pi / 2 and outer > 0):
                raise SceneError(
                    f"cone angles are {inner:g} and {outer:g}; 0 <= inner <= outer <= π/2, outer > 0"
                )
            angle, blend = float(np.degrees(2 * outer)), float(1 - inner / outer)
            return SpotLight(place, strength, direction=forward, angle=angle, blend=blend)
    return None

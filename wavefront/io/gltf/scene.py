"""glTF 2.0 (.gltf, .glb): the content of the default scene, with its cameras and lights.

Source: Khronos Group, glTF 2.0 specification and the ratified KHR extensions. Everything is read
from the JSON itself, so numbers are exact, and every index is checked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...camera import Camera
from ...core.errors import LimitError, SceneError, exact, printable
from ...motion import Motion, Product
from ...motion.track import Track
from ...shapes.transform import IDENTITY, Matrix
from ..description.contents import Contents
from ..description.numbers import floats, shown
from ..description.placing import Places
from ..description.punctual import punctual_light
from ..description.views import camera_at, pose_of
from ..repair import RawMesh
from .animations import names, read_clip
from .document import OF_CANDELA, Document
from .meshes import Primitive, primitives
from .nodes import INSTANCING, Node, count_placements, placements, walk
from .posing import Joints, PosedMesh, Skin, held, pose, read_skin, target_weights

HEIGHT = 512  # pixels of a camera's picture; files give only its aspect ratio


def contents(document: Document, animation: str | int | bool | None) -> tuple[Contents, list[Any]]:
    """Return the contents of the default scene, and the number of each mesh's material, None for none.

    Parameters
    ----------
    document
        The file.
    animation
        Name or number of what moves it, as of `load`.

    Raises
    ------
    SceneError
        If an element is missing or malformed, there is no such animation, or the nodes place more meshes than
        its limits allow.
    """
    clip = read_clip(document, animation)
    out, nodes = Contents(flat=True, animations=names(document)), walk(document, clip)
    meshes = _Meshes(document, {node.index: node for node in nodes}, clip.weights)
    for node in nodes:
        if not node.shown:
            continue
        if "mesh" in node.json:
            with document.part(f"nodes[{node.index}]"):
                meshes.place(node)
        if "camera" in node.json or "extensions" in node.json:
            _add_others(document, out, node)
    if len(document.items("scenes")) > 1:
        document.lose("further scenes", "the file")
    out.raws, out.places = [raw for raw, _ in meshes.raws], meshes.places()
    return out, [number for _, number in meshes.raws]


class _Meshes:
    """The meshes of the nodes, each read once, and where they stand.

    Parameters
    ----------
    document
        The file.
    nodes
        By their numbers in the file.
    weights
        Of morph targets over time, by the numbers of nodes.
    """

    def __init__(self, document: Document, nodes: dict[int, Node], weights: dict[int, Track]) -> None:
        self._document, self._nodes, self._weights = document, nodes, weights
        self._matrices = {index: node.matrix for index, node in nodes.items()}
        self.raws: list[tuple[RawMesh, Any]] = []  # with the numbers of their materials
        self._primitives: dict[int, list[Primitive]] = {}
        self._skins: dict[int, Skin] = {}
        self._joints: dict[int, Joints] = {}  # of skins that move
        self._made: dict[Any, list[int]] = {}  # indices among `raws`, by mesh, skin and weights
        self._skinned: set[int] = set()  # of them
        self._of: list[int] = []  # index among `raws` of each placed mesh
        self._where: list[Matrix] = []
        self._motions: list[Motion | None] = []
        self._names: list[str] = []

    def place(self, node: Node) -> None:
        """Place the mesh of a node.

        Raises
        ------
        SceneError
            If the mesh cannot be read, or there are more placements than the limits allow.
        """
        document, limits = self._document, self._document.files.limits
        numbers = self._parts(node)
        limits.check_meshes(document.name, len(self.raws))
        if not numbers:
            return
        local = self._placements(node, numbers)
        total = len(self._of) + len(local) * len(numbers)
        if total > limits.instances:
            most = f"{limits.instances} (LoadLimits.instances)"
            place = f"{document.name}: nodes[{node.index}]"
            raise LimitError(f"{place}: its nodes place {total} meshes so far; the limit is {most}")
        self._of += numbers * len(local)
        self._names += _names_of_parts(node, len(numbers)) * len(local)
        where = (node.matrix @ local).repeat(len(numbers), 0)
        motions = _motions(node, local)
        by_joints = [number in self._skinned for number in numbers]
        if self._skinned:  # whose joints place them
            where[by_joints * len(local)] = IDENTITY
        self._where.append(where)
        self._motions += [None if skinned else motion for motion in motions for skinned in by_joints]

    def places(self) -> Places:
        """Return the placements; the walk meets the last node first, as trimesh does."""
        if not self._of:
            return Places()
        of, where = np.array(self._of[::-1], np.intp), np.concatenate(self._where)[::-1]
        return Places(of, where, self._names[::-1], motions=self._motions[::-1])

    def _placements(self, node: Node, parts: list[int]) -> Matrix:
        """Return the matrices (n, 4, 4) of the instances of a node to the node."""
        document = self._document
        if "extensions" not in node.json:
            return IDENTITY[None]
        with document.part(f"nodes[{node.index}].{INSTANCING}", "the mesh once in its place"):
            count = count_placements(document, node)
            if len(self._of) + count * len(parts) > document.files.limits.instances:
                return np.broadcast_to(IDENTITY, (count, 4, 4))  # which is refused
            return placements(document, node, count)
        return IDENTITY[None]

    def _parts(self, node: Node) -> list[int]:
        """Return the indices of a mesh's parts among `raws`; the mesh is read at its first use."""
        mesh: Any = node.json["mesh"]
        own_node = (
            node.index if node.index in self._weights else None
        )  # a node whose weights move has its own mesh
        key = repr(mesh), repr(node.json.get("skin")), repr(node.json.get("weights")), own_node
        if key not in self._made:
            if not isinstance(mesh, int) or mesh not in self._primitives:
                self._primitives[mesh] = primitives(self._document, mesh)
            first = len(self.raws)
            self.raws += [
                (self._posed(node, primitive), primitive.material) for primitive in self._primitives[mesh]
            ]
            self._made[key] = list(range(first, len(self.raws)))
            self._skinned |= {
                first + number
                for number, primitive in enumerate(self._primitives[mesh])
                if primitive.bend.joints is not None and self._skin(node) is not None
            }
        return self._made[key]

    def _posed(self, node: Node, primitive: Primitive) -> RawMesh:
        """Return the mesh of a primitive at the start of the animation, with how it deforms."""
        document, skin, count = self._document, self._skin(node), len(primitive.bend.targets)
        weights = np.zeros(count)
        if skin is None and not count:
            return primitive.raw
        if count:
            with document.part(f"nodes[{node.index}].weights", "0 in their place"):
                mesh = document.get("meshes", node.json["mesh"])
                weights = target_weights(mesh, node.json, count)
        bend = primitive.bend
        if skin is not None:
            bend = held(document.files.losses, primitive.place, bend, skin)
        moving = self._weights.get(node.index) if count else None
        joints = None if skin is None else self._joints_of(node.json["skin"], skin)
        if moving is None and (joints is None or not joints.move):
            return pose(primitive.raw, bend, weights, skin, self._matrices)
        deformation = PosedMesh(primitive.raw, bend, weights if moving is None else moving, skin, joints)
        return replace(deformation.posed(deformation.start), deformation=deformation)

    def _joints_of(self, number: int, skin: Skin) -> Joints:
        """Return the joints of a skin over time, which several meshes may share."""
        if number not in self._joints:
            nodes = (self._nodes[index] for index in skin.nodes)
            places = [node.matrix if node.motion is None else node.motion for node in nodes]
            self._joints[number] = Joints(skin.nodes, places)
        return self._joints[number]

    def _skin(self, node: Node) -> Skin | None:
        """Return the skin of a node, None without one or if it is damaged."""
        index = node.json.get("skin")
        if index is None:
            return None
        with self._document.part(f"nodes[{node.index}].skin", "the mesh by its node in its place"):
            if not isinstance(index, int) or index not in self._skins:
                self._skins[index] = read_skin(self._document, index, self._matrices)
            return self._skins[index]
        return None


def _motions(node: Node, local: Matrix) -> list[Motion | None]:
    """Return the motions to the scene of the instances of a node, by their matrices (n, 4, 4) to the node."""
    if node.motion is None or (len(local) == 1 and np.array_equal(local[0], IDENTITY)):
        return [node.motion] * len(local)
    return [Product(node.motion, matrix) for matrix in local]


def _names_of_parts(node: Node, count: int) -> list[str]:
    """Return the names of the shapes of a node; "" if it has none."""
    name = printable(str(node.json.get("name") or ""))
    return [f"{name}_{number}" if name and count > 1 else name for number in range(count)]


def _add_others(document: Document, out: Contents, node: Node) -> None:
    """Add the camera and the light of a node."""
    if "camera" in node.json:
        with document.part(f"nodes[{node.index}].camera"):
            _add_camera(document, out, node.json["camera"], node)
    with document.part(f"nodes[{node.index}].extensions"):
        light = node.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if light is not None:
            _add_light(document, out, light, node)


def _add_camera(document: Document, out: Contents, index: Any, node: Node) -> None:
    if out.camera is not None:
        document.lose("further cameras", f"cameras[{shown(index)}]")
        return
    camera = document.get("cameras", index)
    with document.inside(f"cameras[{index}]"):
        out.camera = _camera(camera, node.matrix)
        out.camera.motion = node.motion


def _camera(camera: dict[str, Any], matrix: Matrix) -> Camera:
    kind = camera.get("type")
    lens = camera.get(str(kind), {})
    if kind == "perspective":
        fov, aspect = _positive(lens, "yfov", None), _positive(lens, "aspectRatio", 1)
        return camera_at(matrix, float(np.degrees(fov)), _size(aspect))
    if kind == "orthographic":
        half_width, half_height = _positive(lens, "xmag", None), _positive(lens, "ymag", None)
        size = _size(half_width / half_height)
        return Camera.orthographic(*pose_of(matrix), height=2 * half_height, size=size)
    raise SceneError(f"type is {shown(kind)}; it must be 'perspective' or 'orthographic'")


def _size(aspect: float) -> tuple[int, int]:
    """Return (width, height) in pixels of a picture with a given aspect ratio."""
    return max(1, round(HEIGHT * aspect)), HEIGHT


def _positive(lens: dict[str, Any], key: str, default: float | None) -> float:
    value = float(floats(key, [lens.get(key, default)], 1)[0])
    if not 0 < value < 1e30:
        raise SceneError(f"{key} is {exact(value)}; it must be above 0")
    return value


def _add_light(document: Document, out: Contents, index: Any, node: Node) -> None:
    """Add a light of KHR_lights_punctual; candela count as W/sr, of 1 lm/W."""
    lights = document.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    if not isinstance(index, int) or not 0 <= index < len(lights):
        raise SceneError(f"light {shown(index)} does not exist; there are {len(lights)}")
    with document.inside(f"light {index}"):
        light = lights[index]
        if "range" in light:
            document.lose("range of a light", f"light {index}")
        matrix = node.matrix if node.motion is None else IDENTITY
        lamp = punctual_light(light, matrix, document.files.losses, f"light {index}")
        if lamp is None:
            document.lose(f"{light.get('type')} light", f"light {index}")
        else:
            lamp.efficacy = OF_CANDELA
            out.lights = [*out.lights, lamp if node.motion is None else lamp.transformed(node.motion)]

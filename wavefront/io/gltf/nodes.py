"""Nodes of glTF: the tree, its matrices, and nodes with instances of a mesh.

Source: Khronos Group, glTF 2.0 specification, chapter 3.5, and EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.vec import Ints
from ...core.errors import SceneError
from ...motion import Motion, Product, Together
from ...motion.keyframes import composed
from ...shapes.transform import IDENTITY, Matrix
from ..description.numbers import is_row, shown, table
from ..description.placing import MAX_ELEMENT, in_range
from ..repair import wide
from .animations import Clip
from .document import Document
from .meshes import attribute

TOO_LARGE = f"has an element whose size is above {MAX_ELEMENT:g}"
INSTANCING = "EXT_mesh_gpu_instancing"
INSTANCE_ATTRIBUTES: dict[str, list[float]] = {  # values of an instance without the attribute
    "TRANSLATION": [0, 0, 0],
    "ROTATION": [0, 0, 0, 1],
    "SCALE": [1, 1, 1],
}


@dataclass
class Node:
    """A node of the scene."""

    index: int  # in the file
    json: dict[str, Any]
    matrix: Matrix  # (4, 4) to the scene, at the start of the animation
    shown: bool  # whether the scene has it; others may be joints
    motion: Motion | None = None  # to the scene

    @property
    def label(self) -> str:
        """Name of the node, for messages."""
        return f"node {self.json.get('name', '?')!r}"


def walk(document: Document, clip: Clip) -> list[Node]:
    """Return every node of the default scene, and of all where there are skins, as a clip moves them.

    The last of a node's children comes first. Nodes that are missing or malformed, that are reached twice, or
    whose matrices are beyond the supported range are left out, which is noted.
    """
    way = _Walk(document, clip)
    way.follow(_roots(document))
    count = len(way.indices)
    if document.items("skins"):
        way.follow([index for index in _tops(document) if index not in way.seen])
    return way.nodes(count)


class _Walk:
    """The nodes that are met on the way from roots to their children."""

    def __init__(self, document: Document, clip: Clip) -> None:
        self._document, self._clip = document, clip
        self.seen: set[int] = set()
        self.indices: list[int] = []
        self._found: list[dict[str, Any]] = []
        self._parents: list[int] = []  # index of the parent in `_found`, -1 for none
        self._depths: list[int] = []

    def follow(self, roots: list[Any]) -> None:
        """Add nodes and all below them."""
        document = self._document
        stack = [(index, -1, 0) for index in roots]
        while stack:
            index, parent, depth = stack.pop()
            with document.part(f"nodes[{shown(index)}]"):
                node = document.get("nodes", index)
                if index in self.seen:
                    raise SceneError("is reached twice; nodes must form a tree")
                self.seen.add(index)
                children = node.get("children", [])
                if not isinstance(children, list):
                    document.files.losses.note(
                        f"nodes[{index}].children", value=shown(children), done="left out"
                    )
                    children = []
                stack += [(child, len(self.indices), depth + 1) for child in children]
                self.indices.append(index)
                self._found.append(node)
                self._parents.append(parent)
                self._depths.append(depth)

    def nodes(self, count: int) -> list[Node]:
        """Return the nodes, of which the first `count` are shown."""
        local = _local(self._document, self.indices, self._found)
        matrices = _to_scene(local, np.array(self._parents, np.intp), np.array(self._depths, np.intp))
        motions = self._motions(local)
        if motions:
            start = min(motion.start for motion in motions.values())
            matrices[list(motions)] = Together(list(motions.values())).at(start)
        sound = in_range(matrices)
        for at in np.flatnonzero(~sound).tolist():
            place = f"nodes[{self.indices[at]}]"
            self._document.files.losses.note(f"its matrix to the scene {TOO_LARGE}", place, done="left out")
        return [
            Node(self.indices[at], self._found[at], matrices[at], at < count, motions.get(at))
            for at in np.flatnonzero(sound).tolist()
        ]

    def _motions(self, local: Matrix) -> dict[int, Motion]:
        """Return the motions to the scene of the nodes that move by themselves or by a node above them."""
        motions: dict[int, Motion] = {}
        fixed: dict[int, Matrix] = {}  # to the scene, of others above those that move
        for at, (index, parent) in enumerate(zip(self.indices, self._parents, strict=True)):
            own: Motion | None = None
            with self._document.part(f"nodes[{index}]", "at rest"):
                own = self._clip.motion(index, self._found[at])
            above = motions.get(parent)
            if own is None and above is None:
                if self._clip.nodes:
                    fixed[at] = local[at] if parent < 0 else fixed[parent] @ local[at]
                continue
            around = above if above is not None else fixed.get(parent)
            inner = own if own is not None else local[at]
            motions[at] = inner if around is None else Product(around, inner)
        return motions


def _roots(document: Document) -> list[Any]:
    """Return the indices of the root nodes of the default scene, or of another where it is damaged."""
    scenes, index = document.items("scenes"), document.json.get("scene", 0)
    if scenes or "scene" in document.json:
        with document.part(f"scenes[{shown(index)}]", "another in its place"):
            return _nodes_of(document, index)
        with document.part("scenes[0]", "all nodes in its place"):
            return _nodes_of(document, 0)
    return _tops(document)


def _nodes_of(document: Document, index: Any) -> list[Any]:
    roots = document.get("scenes", index).get("nodes", [])
    if not isinstance(roots, list):
        raise SceneError(f"nodes is {shown(roots)}; it must be a list")
    return roots


def _tops(document: Document) -> list[Any]:
    """Return the indices of the nodes that are no children."""
    nodes = document.items("nodes")
    lists = [node.get("children") for node in nodes if isinstance(node, dict)]
    children = {
        child for group in lists if isinstance(group, list) for child in group if isinstance(child, int)
    }
    return [index for index in range(len(nodes)) if index not in children]


def _to_scene(local: Matrix, parents: Ints, depths: Ints) -> Matrix:
    """Return matrices (n, 4, 4) to the scene from the matrices to the parents, level by level."""
    world = np.empty((len(local) + 1, 4, 4))
    world[-1] = np.eye(4)  # the parent of the roots
    order = np.argsort(depths, kind="stable")
    levels = np.split(order, np.flatnonzero(np.diff(depths[order])) + 1)
    with np.errstate(over="ignore", invalid="ignore"):
        for level in levels:
            world[level] = world[parents[level]] @ local[level]
    return world[:-1]


def _local(document: Document, indices: list[int], nodes: list[dict[str, Any]]) -> Matrix:
    """Return the local matrices (n, 4, 4) of nodes: as given, or translation · rotation · scale."""

    def rows(key: str, default: list[float], width: int, at: Ints) -> Matrix:
        values = [nodes[i].get(key, default) for i in at.tolist()]
        try:
            return table(values, width, lambda row: key)
        except SceneError:
            for row, value in enumerate(values):
                if not is_row(value, width):
                    where = f"nodes[{indices[at[row]]}]"
                    document.files.losses.note(key, where, shown(value), f"{default} in its place")
                    values[row] = default
            return table(values, width, lambda row: key)

    out = np.empty((len(nodes), 4, 4))
    has_matrix = np.array(["matrix" in node for node in nodes], np.bool_)
    at = np.flatnonzero(has_matrix)
    out[at] = rows("matrix", IDENTITY.ravel().tolist(), 16, at).reshape(-1, 4, 4).transpose(0, 2, 1)
    for i in at[(out[at, 3] != IDENTITY[3]).any(1)].tolist():
        last = f"the last row of nodes[{indices[i]}].matrix"
        document.files.losses.note(last, value=str(out[i, 3].tolist()), done="[0, 0, 0, 1] in its place")
        out[i, 3] = IDENTITY[3]
    at = np.flatnonzero(~has_matrix)
    factors = (rows(name.lower(), neutral, len(neutral), at) for name, neutral in INSTANCE_ATTRIBUTES.items())
    out[at] = composed(*factors)
    return out


def count_placements(document: Document, node: Node) -> int:
    """Return the number of a node's instances: one, or the number in EXT_mesh_gpu_instancing."""
    attributes = _instancing(node)
    if not attributes:
        return 1
    counts = {
        name: document.count(f"accessors[{index}]", document.get("accessors", index), "count")
        for name, index in attributes.items()
    }
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{number} of {name}" for name, number in counts.items())
        raise SceneError(f"{_place(document, node)} has {listed}; it must be as many of each")
    return next(iter(counts.values()))


def placements(document: Document, node: Node, count: int) -> Matrix:
    """Return the matrices (count, 4, 4) of a node's instances to the node."""
    attributes = _instancing(node)
    if not attributes:
        return IDENTITY[None]
    where = _place(document, node)
    for name in attributes.keys() - INSTANCE_ATTRIBUTES.keys():
        document.lose(f"{name} of instances", node.label)
    parts = []
    for name, neutral in INSTANCE_ATTRIBUTES.items():
        values = attribute(document, attributes, name, len(neutral), where, count)
        parts.append(np.tile(np.array(neutral, np.float64), (count, 1)) if values is None else wide(values))
        bad = np.flatnonzero(~np.isfinite(parts[-1]).all(1))
        if bad.size:
            value = parts[-1][bad[0]].tolist()
            raise SceneError(f"{where} has {name}[{bad[0]}] {value}; it must be finite")
    with np.errstate(over="ignore", invalid="ignore"):
        matrices = composed(*parts)
        bad = np.flatnonzero(~in_range(node.matrix @ matrices))
    if bad.size:
        raise SceneError(f"{where}: the matrix of instance {bad[0]} to the scene {TOO_LARGE}")
    return matrices


def _instancing(node: Node) -> dict[str, Any]:
    """Return the attributes of EXT_mesh_gpu_instancing; none if the node does not have it."""
    extension = node.json.get("extensions", {}).get(INSTANCING, {})
    return extension.get("attributes") or {}


def _place(document: Document, node: Node) -> str:
    return f"{document.name}: {INSTANCING} of {node.label}"

"""Nodes of glTF: the tree, its matrices, and nodes with instances of a mesh.

Source: Khronos Group, glTF 2.0 specification, chapter 3.5, and EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays.vec import Ints
from ..core.errors import SceneError
from ..shapes.transform import Matrix
from .gltf_document import Document, shown, table
from .gltf_meshes import attribute
from .placing import MAX_ELEMENT, in_range
from .repair import wide

TOO_LARGE = f"has an element whose size is above {MAX_ELEMENT:g}"
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
    matrix: Matrix  # (4, 4) to the scene

    @property
    def label(self) -> str:
        """Name of the node, for messages."""
        return f"node {self.json.get('name', '?')!r}"


def walk(document: Document) -> list[Node]:
    """Return every node of the default scene; the last of a node's children comes first.

    Raises
    ------
    SceneError
        If a node is missing or malformed, is reached twice, or has a matrix beyond the supported range.
    """
    stack = [(index, -1, 0) for index in _roots(document)]
    seen: set[int] = set()
    indices: list[int] = []
    found: list[dict[str, Any]] = []
    parents: list[int] = []  # index of the parent in `found`, -1 for none
    depths: list[int] = []
    while stack:
        index, parent, depth = stack.pop()
        node = document.get("nodes", index)
        if index in seen:
            raise SceneError(f"{document.name}: nodes[{index}] is reached twice; nodes must form a tree")
        seen.add(index)
        own = node.get("children")
        if own is not None:
            if not isinstance(own, list):
                raise SceneError(f"{document.name}: nodes[{index}].children is not a list")
            number = len(indices)
            stack += [(child, number, depth + 1) for child in own]
        indices.append(index)
        found.append(node)
        parents.append(parent)
        depths.append(depth)
    matrices = _to_scene(_local(document, indices, found), np.array(parents, np.intp), np.array(depths))
    bad = np.flatnonzero(~in_range(matrices))
    if bad.size:
        raise SceneError(f"{document.name}: nodes[{indices[bad[0]]}]: its matrix to the scene {TOO_LARGE}")
    return [Node(*each) for each in zip(indices, found, matrices, strict=True)]


def _roots(document: Document) -> list[Any]:
    """Return the indices of the root nodes of the default scene."""
    if "scenes" in document.json:
        index = document.json.get("scene", 0)
        roots = document.get("scenes", index).get("nodes", [])
        if not isinstance(roots, list):
            raise SceneError(f"{document.name}: scenes[{index}].nodes is {shown(roots)}; it must be a list")
        return roots
    with document.inside("nodes"):
        nodes = document.json.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        return [i for i in range(len(nodes)) if i not in children]


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

    def rows(key: str, default: list[float] | None, width: int, at: Ints) -> Matrix:
        values = [nodes[i].get(key, default) for i in at.tolist()]
        return table(values, width, lambda row: f"{document.name}: nodes[{indices[at[row]]}].{key}")

    out = np.empty((len(nodes), 4, 4))
    given = np.array(["matrix" in node for node in nodes], np.bool_)
    at = np.flatnonzero(given)
    out[at] = rows("matrix", None, 16, at).reshape(-1, 4, 4).transpose(0, 2, 1)
    bad = at[(out[at, 3] != (0, 0, 0, 1)).any(1)]
    if bad.size:
        where = f"{document.name}: nodes[{indices[bad[0]]}].matrix"
        raise SceneError(f"{where} has the last row {out[bad[0], 3].tolist()}; it must be [0, 0, 0, 1]")
    at = np.flatnonzero(~given)
    parts = (rows(name.lower(), neutral, len(neutral), at) for name, neutral in INSTANCE_ATTRIBUTES.items())
    out[at] = _composed(*parts)
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
    """Return the matrices (count, 4, 4) of a node's instances to the scene."""
    attributes = _instancing(node)
    if not attributes:
        return node.matrix[None]
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
        matrices = node.matrix @ _composed(*parts)
    bad = np.flatnonzero(~in_range(matrices))
    if bad.size:
        raise SceneError(f"{where}: the matrix of instance {bad[0]} to the scene {TOO_LARGE}")
    return matrices


def _instancing(node: Node) -> dict[str, Any]:
    """Return the attributes of EXT_mesh_gpu_instancing; none if the node does not have it."""
    extension = node.json.get("extensions", {}).get("EXT_mesh_gpu_instancing", {})
    return extension.get("attributes") or {}


def _place(document: Document, node: Node) -> str:
    return f"{document.name}: EXT_mesh_gpu_instancing of {node.label}"


def _composed(translation: Matrix, rotation: Matrix, scale: Matrix) -> Matrix:
    """Return translation (n, 3) · rotation (n, 4) · scale (n, 3) as matrices (n, 4, 4)."""
    matrix = np.zeros((len(translation), 4, 4))
    with np.errstate(over="ignore", invalid="ignore"):
        matrix[:, :3, :3] = _rotation(rotation) * scale[:, None]
    matrix[:, :3, 3] = translation
    matrix[:, 3, 3] = 1
    return matrix


def _rotation(quaternion: Matrix) -> Matrix:
    """Return the matrices (n, 3, 3) of quaternions x, y, z, w (n, 4) of any length; 0 means no rotation."""
    with np.errstate(over="ignore", divide="ignore"):
        size = (quaternion[:, None] @ quaternion[:, :, None])[:, 0, 0]
        factor = np.where(size > 0, np.sqrt(2 / size), 0)
    x, y, z, w = (quaternion * factor[:, None]).T
    out = np.empty((len(quaternion), 3, 3))
    out[:, 0] = np.stack([1 - y * y - z * z, x * y - z * w, x * z + y * w], 1)
    out[:, 1] = np.stack([x * y + z * w, 1 - x * x - z * z, y * z - x * w], 1)
    out[:, 2] = np.stack([x * z - y * w, y * z + x * w, 1 - x * x - y * y], 1)
    return out

"""Skins and morph targets of glTF: the mesh of a primitive in a pose.

Source: Khronos Group, glTF 2.0 specification, chapters 3.7.2.2 (morph targets) and 3.7.3 (skins).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arrays.vec import FLOAT32_MAX, Bools, Doubles, Ints
from ...core.plural import plural
from ...motion import Motion, Together
from ...motion.track import Track
from ...shapes.transform import Matrix
from ..description.numbers import floats
from ..description.placing import MAX_ELEMENT
from ..losses import Losses
from ..repair import FormOverTime, RawMesh, Table
from .document import Document

MORPHED = {"POSITION": "vertices", "NORMAL": "normals", "TANGENT": "tangents"}  # attributes with targets


@dataclass
class Bend:
    """How the vertices of a primitive move."""

    targets: list[dict[str, Table]] = field(default_factory=list)  # (n, 3) differences by attribute
    joints: Ints | None = None  # (n, k) number among the joints of a skin
    weights: Doubles | None = None  # (n, k) of these joints


@dataclass
class Skin:
    """The joints of a skin."""

    nodes: list[int]  # in the file, one for each joint
    inverse: Matrix  # (j, 4, 4) from the mesh to each joint, where the mesh is bound


def pose(
    raw: RawMesh, bend: Bend, weights: Doubles, skin: Skin | None, matrices: Mapping[int, Matrix]
) -> RawMesh:
    """Return a mesh in a pose, which the matrices of the nodes and the weights of its targets give.

    Parameters
    ----------
    raw
        The mesh as it is stored.
    bend
        How its vertices move.
    weights
        Of its morph targets, (t,).
    skin
        Its joints; the mesh is then in the space of the scene, whatever the matrix of its own node.
    matrices
        (4, 4) to the scene of each node that is a joint, by its number in the file.
    """
    with np.errstate(all="ignore"):  # what is not finite is left out where the mesh is built
        if weights.any():
            raw = _morphed(raw, bend.targets, weights)
        if skin is None or bend.joints is None or bend.weights is None:
            return raw
        joints = np.array([matrices[node] for node in skin.nodes]).reshape(-1, 4, 4) @ skin.inverse
        return _skinned(raw, bend.joints, bend.weights, joints)


class Joints:
    """The joints of a skin over time.

    Parameters
    ----------
    nodes
        Their numbers in the file.
    places
        Of each the motion to the scene, or the matrix (4, 4) of one that stays.
    """

    def __init__(self, nodes: list[int], places: Sequence[Motion | Matrix]) -> None:
        self._nodes, self._together = nodes, Together(places)
        moving = [place for place in places if isinstance(place, Motion)]
        self.move = bool(moving)
        self.start = min((motion.start for motion in moving), default=np.inf)
        self.end = max((motion.end for motion in moving), default=-np.inf)
        self.keys = np.concatenate([np.zeros(0), *(motion.keys for motion in moving)])
        self._last: tuple[float, dict[int, Matrix]] = np.nan, {}  # as several meshes may have one skin

    def at(self, time: float) -> Mapping[int, Matrix]:
        """Return the matrices (4, 4) to the scene at a time, by the numbers of the nodes."""
        if self._last[0] != time:
            self._last = time, dict(zip(self._nodes, self._together.at(time), strict=True))
        return self._last[1]


class PosedMesh(FormOverTime):
    """The mesh of a primitive in the poses of an animation.

    Parameters
    ----------
    raw, bend, skin
        As for `pose`.
    weights
        Of its morph targets, over time or (t,) that stay.
    joints
        Of its skin.
    """

    def __init__(
        self,
        raw: RawMesh,
        bend: Bend,
        weights: Track | Doubles,
        skin: Skin | None,
        joints: Joints | None,
    ) -> None:
        self._raw, self._bend, self._weights, self._skin, self._joints = raw, bend, weights, skin, joints
        self._kept: Bools | None = None  # faces of the mesh that was built
        spans = [(each.start, each.end) for each in (weights,) if isinstance(each, Track)]
        spans += [(joints.start, joints.end)] if joints is not None and joints.move else []
        self.start, self.end = min(span[0] for span in spans), max(span[1] for span in spans)

    @property
    def keys(self) -> Doubles:
        """The times of the keys of its targets and joints."""
        targets = self._weights.times if isinstance(self._weights, Track) else np.zeros(0)
        return np.unique(np.concatenate([targets, [] if self._joints is None else self._joints.keys]))

    def posed(self, time: float) -> RawMesh:
        """Return the mesh in the pose of a time."""
        weights = self._weights.at(time) if isinstance(self._weights, Track) else self._weights
        joints = {} if self._joints is None else self._joints.at(time)
        return pose(self._raw, self._bend, weights[: len(self._bend.targets)], self._skin, joints)

    def keeping(self, faces: Bools) -> PosedMesh:
        """Return the deformation of a mesh that has only some of the faces, by a mask (m,)."""
        deformation = copy(self)
        deformation._kept = faces
        return deformation

    def at(self, time: float) -> Mapping[str, Any]:
        """Return vertices, faces, and normals and tangents if there are any, at a time."""
        posed = self.posed(time)
        vertices = posed.vertices
        sound = np.asarray((np.abs(vertices) <= FLOAT32_MAX).all(1))  # false for NaN
        if not sound.all():
            vertices = np.where(sound[:, None], vertices, 0.0)
        faces = posed.faces if self._kept is None else posed.faces[self._kept]
        found = {"normals": posed.normals, "tangents": posed.tangents if posed.normals is not None else None}
        return {"vertices": vertices, "faces": faces, **{k: v for k, v in found.items() if v is not None}}


def held(losses: Losses, place: str, bend: Bend, skin: Skin) -> Bend:
    """Return how vertices move whose joints are all of a skin and whose weights add up to one, or to zero.

    What is not so in the file is noted, with its place.
    """
    if bend.joints is None or bend.weights is None:
        return bend
    there = (bend.joints >= 0) & (bend.joints < len(skin.nodes))
    absent = bend.joints[~there & (bend.weights != 0)]
    if len(absent):
        of = f"joint {absent[0]} of the {len(skin.nodes)} of its skin"
        losses.note(of, place, "missing", "without effect")
    weights = np.where(there & np.isfinite(bend.weights), bend.weights, 0)
    total = weights.sum(1, keepdims=True)
    loose = int((total <= 0).sum())
    if loose:
        losses.note(f"{plural(loose, 'vertex', 'vertices')} without joints", place, done="left in place")
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1), 0)
    return Bend(bend.targets, np.where(there, bend.joints, 0), weights)


def _morphed(raw: RawMesh, targets: list[dict[str, Table]], weights: Doubles) -> RawMesh:
    changed: dict[str, Any] = {}
    for target, weight in zip(targets, weights.tolist(), strict=True):
        for attribute, difference in target.items() if weight else ():
            name = MORPHED[attribute]
            there = changed.get(name, getattr(raw, name))
            if there is not None:
                changed[name] = there.copy()
                changed[name][:, :3] += weight * difference
    return replace(raw, **changed)


def _skinned(raw: RawMesh, joints: Ints, weights: Doubles, matrices: Matrix) -> RawMesh:
    """Return a mesh moved by the weighted mean of the matrices (j, 4, 4) of its joints."""
    mean = np.zeros((len(joints), 3, 4))
    for number, weight in zip(joints.T, weights.T, strict=True):
        mean += weight[:, None, None] * matrices[number, :3]
    mean[~weights.any(1)] = np.eye(4)[:3]  # without joints
    linear, shift = mean[:, :, :3], mean[:, :, 3]
    cofactors = _cofactors(linear)
    side = np.where((linear[:, 0] * cofactors[:, 0]).sum(1) < 0, -1.0, 1.0)  # -1 where it mirrors
    turned = side.take(raw.faces, mode="clip").sum(1, keepdims=True) < 0
    faces = np.where(turned, raw.faces[:, [0, 2, 1]], raw.faces)
    normals, tangents = raw.normals, raw.tangents
    if normals is not None:
        normals = side[:, None] * _turned(cofactors, normals)
    if tangents is not None:
        tangents = np.column_stack([_turned(linear, tangents[:, :3]), side * tangents[:, 3]])
    return replace(
        raw, vertices=_turned(linear, raw.vertices) + shift, faces=faces, normals=normals, tangents=tangents
    )


def _turned(matrices: Matrix, vectors: Table) -> Table:
    """Return vectors (n, 3), each multiplied by its matrix (n, 3, 3)."""
    x, y, z = vectors.T[:, :, None]
    return matrices[:, :, 0] * x + matrices[:, :, 1] * y + matrices[:, :, 2] * z


def _cofactors(matrices: Matrix) -> Matrix:
    """Return matrices (n, 3, 3) that turn normals: the inverse transpose times the determinant."""
    first, second, third = matrices.transpose(1, 0, 2)
    return np.stack([np.cross(second, third), np.cross(third, first), np.cross(first, second)], 1)


def read_skin(document: Document, index: Any, nodes: Mapping[int, Matrix]) -> Skin:
    """Return a skin whose joints are all among `nodes`.

    Raises
    ------
    SceneError
        If it is malformed, or a joint is no node.
    """
    item = document.get("skins", index)
    with document.inside(f"skins[{index}]"):
        joints = item["joints"]
        for joint in joints:
            if type(joint) is not int or joint not in nodes:
                document.get("nodes", joint)
                raise ValueError(f"joint nodes[{joint}] is left out")
        if not joints:
            raise ValueError("it has no joints")
        inverse = np.tile(np.eye(4), (len(joints), 1, 1))
        if "inverseBindMatrices" in item:
            values = document.accessor(item["inverseBindMatrices"])
            if values.shape[1] != 16 or len(values) < len(joints):
                raise ValueError(f"it has {len(values)} inverseBindMatrices for {len(joints)} joints")
            inverse = values[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
            if not (np.abs(inverse) <= MAX_ELEMENT).all():
                raise ValueError("inverseBindMatrices have elements that are not finite or too large")
        return Skin(joints, inverse)


def target_weights(mesh: dict[str, Any], node: dict[str, Any], count: int) -> Doubles:
    """Return the weights (count,) of the morph targets of a mesh at rest: those of its node, or its own."""
    given = node.get("weights", mesh.get("weights"))
    return np.zeros(count) if given is None else floats("weights", given, count)

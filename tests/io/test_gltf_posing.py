"""glTF: skins and morph targets at rest, and the one function that poses a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import Bend, RawMesh, Skin, pose

import wavefront as wf

TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # a quarter about z


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.gltf"


def moved(*shift: float, scale: float = 1.0) -> Any:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = shift
    return matrix


def skinned(
    nodes: list[dict[str, Any]], roots: list[int], joints: list[int], inverse: Any = None, **more: Any
) -> Any:
    """A triangle whose corners hang on the joints 0, 1 and 0 and 1 of a skin."""
    build = Builder()
    build.json["nodes"], build.json["scenes"][0]["nodes"] = nodes, roots
    build.json["skins"] = [{"joints": joints}]
    if inverse is not None:
        columns = np.array([each.T.ravel() for each in inverse], np.float32)
        build.json["skins"][0]["inverseBindMatrices"] = build.accessor(columns)
    attributes = {
        "POSITION": TRIANGLE,
        "JOINTS_0": np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.uint8),
        "WEIGHTS_0": np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0]], np.float32),
    }
    build.mesh({**attributes, **more})
    return build


def corners(path: Path, build: Any) -> Any:
    (mesh,) = wf.load(build.gltf(path), strict=True).shapes
    return np.asarray(mesh.vertices)  # type: ignore[attr-defined]


def test_only_joints_place_a_skinned_mesh(path: Path) -> None:
    """Not its own node, nor those above it."""
    above = {"children": [1, 2], "translation": [9, 9, 9]}
    nodes = [
        above,
        {"mesh": 0, "skin": 0, "scale": [7, 7, 7]},
        {"translation": [-9, -9, -9], "children": [3, 4]},
    ]
    nodes += [{"translation": [1, 0, 0]}, {"translation": [0, 2, 0], "scale": [3, 3, 3]}]
    found = corners(path, skinned(nodes, [0], [3, 4], [np.eye(4), moved(-1, 0, 0)]))
    first, second = moved(1, 0, 0), moved(0, 2, 0, scale=3) @ moved(-1, 0, 0)
    due = [
        (np.array(m) @ [*v, 1])[:3]
        for m, v in zip((first, second, (first + second) / 2), TRIANGLE, strict=True)
    ]
    np.testing.assert_allclose(found, due, atol=1e-6)


def test_joints_may_be_outside_of_the_scene(path: Path) -> None:
    nodes = [{"mesh": 0, "skin": 0}, {"children": [2], "translation": [0, 0, 1]}, {"translation": [2, 0, 0]}]
    found = corners(path, skinned(nodes, [0], [2, 2]))
    np.testing.assert_allclose(found, TRIANGLE + np.array([2, 0, 1]), atol=1e-6)


def test_normals_and_tangents_turn_with_the_joints_and_mirrored_faces_turn_back(path: Path) -> None:
    half = float(np.sqrt(0.5))
    joint = {"rotation": [0, 0, half, half], "scale": [1, 1, -2]}
    slanted = np.tile(np.float32([[0.6, 0, 0.8]]), (3, 1))
    tangents = np.tile(np.float32([[1, 0, 0, 1]]), (3, 1))
    build = skinned([{"mesh": 0, "skin": 0}, joint], [0, 1], [1, 1], NORMAL=slanted, TANGENT=tangents)
    (mesh,) = wf.load(build.gltf(path), strict=True).shapes
    assert isinstance(mesh, wf.Mesh)
    due = np.array([0, 0.6, -0.4]) / np.hypot(0.6, 0.4)  # by the inverse transpose
    np.testing.assert_allclose(mesh.normals, np.tile(due, (3, 1)), atol=1e-6)
    np.testing.assert_allclose(mesh.tangents, np.tile([0, 1, 0, -1], (3, 1)), atol=1e-6)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] < 0  # the side of the normals


def test_a_skin_in_two_scenes_nodes_is_two_meshes(path: Path) -> None:
    """The same mesh by its node, and by its skin."""
    nodes = [{"mesh": 0, "skin": 0}, {"mesh": 0, "translation": [0, 0, 5]}, {"translation": [4, 0, 0]}]
    build = skinned(nodes, [0, 1, 2], [2, 2])
    shapes = wf.load(build.gltf(path), strict=True).shapes
    lows = sorted(shape.bounds[0].tolist() for shape in shapes)
    assert lows == [[0, 0, 5], [4, 0, 0]]


@pytest.mark.parametrize(
    ("joints", "weights", "message"),
    [
        (
            [[5, 0, 0, 0]] * 3,
            [[0.5, 0.5, 0, 0]] * 3,
            "joint 5 of the 2 of its skin is missing; without effect",
        ),
        ([[1, 0, 0, 0]] * 3, [[0, 0, 0, 0]] * 3, "3 vertices without joints; left in place"),
    ],
)
def test_damaged_influences_are_noted(path: Path, joints: Any, weights: Any, message: str) -> None:
    nodes = [{"mesh": 0, "skin": 0}, {"translation": [3, 0, 0]}, {}]
    more = {"JOINTS_0": np.array(joints, np.uint16), "WEIGHTS_0": np.array(weights, np.float32)}
    with pytest.warns(UserWarning, match=message):
        (mesh,) = wf.load(skinned(nodes, [0, 1, 2], [1, 2], **more).gltf(path)).shapes
    shift = 0 if "without joints" in message else 3
    np.testing.assert_allclose(mesh.bounds[0], [shift, 0, 0])


@pytest.mark.parametrize(
    ("skin", "message"),
    [
        ({"joints": []}, "it has no joints"),
        ({"joints": [9]}, r"nodes\[9\] does not exist"),
        (
            {"joints": [1, 2], "inverseBindMatrices": 0},
            "it has 3 inverseBindMatrices for 2 joints|inverseBindM",
        ),
        ({}, "joints"),
        ({"joints": [0.5]}, "does not exist"),
    ],
)
def test_a_damaged_skin_leaves_the_mesh_to_its_node(path: Path, skin: Any, message: str) -> None:
    build = skinned([{"mesh": 0, "skin": 0, "translation": [8, 0, 0]}, {}, {}], [0, 1, 2], [1, 2])
    build.json["skins"] = [skin]
    with pytest.warns(
        UserWarning, match=rf"nodes\[0\]\.skin: .*{message}.*; the mesh by its node in its place"
    ):
        (mesh,) = wf.load(build.gltf(path)).shapes
    np.testing.assert_allclose(mesh.bounds[0], [8, 0, 0])


def morphed(weights: dict[str, Any], of_node: Any = None, **target: Any) -> Any:
    build = Builder()
    build.mesh({"POSITION": TRIANGLE, "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1))})
    one = {key: build.accessor(np.array(value, np.float32)) for key, value in target.items()}
    two = {"POSITION": build.accessor(np.tile(np.float32([[0, 0, 1]]), (3, 1)))}
    build.json["meshes"][0] |= weights
    build.json["meshes"][0]["primitives"][0]["targets"] = [one, two]
    if of_node is not None:
        build.json["nodes"][0]["weights"] = of_node
    return build


@pytest.mark.parametrize(
    ("of_mesh", "of_node", "due"),
    [
        (None, None, [0, 0, 0]),
        ([0, 0], None, [0, 0, 0]),
        ([1, 0], None, [2, 0, 0]),
        ([0.5, 2], None, [1, 0, 2]),
        ([0.5, 2], [0, 1], [0, 0, 1]),  # those of the node go first
        (None, [-1, 0], [-2, 0, 0]),
    ],
)
def test_morph_targets_by_their_default_weights(path: Path, of_mesh: Any, of_node: Any, due: Any) -> None:
    weights = {} if of_mesh is None else {"weights": of_mesh}
    found = corners(path, morphed(weights, of_node, POSITION=[[2, 0, 0]] * 3))
    np.testing.assert_allclose(found, TRIANGLE + np.array(due), atol=1e-6)


def test_normals_are_morphed_and_other_attributes_named(path: Path) -> None:
    build = morphed({"weights": [1, 0]}, NORMAL=[[1, 0, 0]] * 3)
    (mesh,) = wf.load(build.gltf(path), strict=True).shapes
    np.testing.assert_allclose(mesh.normals, [[0.5**0.5, 0, 0.5**0.5]] * 3, atol=1e-6)  # type: ignore[attr-defined]
    build = morphed({"weights": [1, 0]}, COLOR_0=[[1, 0, 0]] * 3)
    with pytest.warns(UserWarning, match="not honored: mesh 'mesh0': COLOR_0 of morph targets"):
        wf.load(build.gltf(path))


def test_wrong_weights_count_as_0(path: Path) -> None:
    with pytest.warns(UserWarning, match=r"nodes\[0\]\.weights: weights is \[1\]; .*; 0 in their place"):
        (mesh,) = wf.load(morphed({"weights": [1]}, POSITION=[[2, 0, 0]] * 3).gltf(path)).shapes
    np.testing.assert_allclose(mesh.bounds[0], [0, 0, 0])


def test_a_pose_takes_any_matrices_of_the_nodes() -> None:
    """As an animation has it: targets first, then the joints."""
    raw = RawMesh("arm", TRIANGLE.astype(np.float64), np.array([[0, 1, 2]]))
    bend = Bend([{"POSITION": np.full((3, 3), 2.0)}], np.zeros((3, 1), np.intp), np.ones((3, 1)))
    skin = Skin([7], moved(0, 0, 1)[None])
    matrix = np.eye(4)
    matrix[:3, :3] = TURN
    posed = pose(raw, bend, np.array([0.5]), skin, {7: matrix})
    np.testing.assert_allclose(posed.vertices, (TRIANGLE + np.array([1, 1, 2])) @ TURN.T, atol=1e-12)
    assert raw.vertices.tolist() == TRIANGLE.tolist()
    np.testing.assert_allclose(pose(raw, bend, np.array([0.5]), None, {}).vertices, TRIANGLE + 1, atol=1e-12)

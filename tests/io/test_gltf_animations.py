"""glTF: animations of nodes, of joints and of the weights of morph targets.

Ten files of Khronos (AnimatedCube, AnimatedMorphCube, AnimatedMorphSphere, AnimatedTriangle, BoxAnimated,
BrainStem, CesiumMan, RiggedFigure, RiggedSimple, SimpleMorph) and four of the kinds below were compared with
Blender 5.0.1 by its importer. At five keys each, all vertices differ by at most 1e-5 of the size. Between
keys they differ by at most 5e-5, as Blender turns by the linear interpolation of quaternions; it does not use
the tangents of splines.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import SceneError, rotation

import wavefront as wf

HALF = float(np.sqrt(0.5))
Channels = list[tuple[int, str, str, Any, Any]]  # node, path, way, times, values


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.gltf"


def add_clip(build: Any, channels: Channels, name: str | None = None) -> Any:
    clip: dict[str, Any] = {"channels": [], "samplers": []}
    for node, target, way, times, values in channels:
        table = np.array(values, np.float32)
        table = table.reshape(-1, 1) if target == "weights" else table.reshape(-1, table.shape[-1])
        sampler = {"input": build.accessor(np.array(times, np.float32)), "output": build.accessor(table)}
        clip["samplers"].append({**sampler, "interpolation": way})
        clip["channels"].append(
            {"sampler": len(clip["samplers"]) - 1, "target": {"node": node, "path": target}}
        )
    build.json.setdefault("animations", []).append(clip if name is None else {**clip, "name": name})
    return build


def of_nodes(nodes: list[dict[str, Any]], channels: Channels, roots: tuple[int, ...] = (0,)) -> Any:
    build = Builder()
    build.json["nodes"], build.json["scenes"][0]["nodes"] = nodes, list(roots)
    return add_clip(build.mesh(), channels)


def vertices(scene: wf.Scene, time: float, shape: int = 0) -> Any:
    found = scene.at(time).shapes[shape]
    mesh = found.to_mesh() if isinstance(found, wf.Instance) else found
    assert isinstance(mesh, wf.Mesh)
    return mesh.vertices


def turned(axis: str, degrees: float) -> Any:
    return rotation("test", axis, degrees, (0, 0, 0))[:3, :3]


def test_translations_by_steps_lines_and_splines(path: Path) -> None:
    keys, places = [0.5, 1, 2], [[1, 0, 0], [3, 0, 0], [3, 4, 0]]
    slopes = np.array([[0, 0, 0], [0, 0, 6], [0, 0, 0]])
    splines = np.stack([slopes, places, slopes], 1)
    due = {
        "STEP": {0: (1, 0, 0), 0.75: (1, 0, 0), 1.999: (3, 0, 0), 2: (3, 4, 0), 9: (3, 4, 0)},
        "LINEAR": {0: (1, 0, 0), 0.75: (2, 0, 0), 1.5: (3, 2, 0), 9: (3, 4, 0)},
        # halfway between two keys: the mean, and an eighth of the time between times the difference of slopes
        "CUBICSPLINE": {0.5: (1, 0, 0), 0.75: (2, 0, -6 / 16), 1.5: (3, 2, 6 / 8), 9: (3, 4, 0)},
    }
    for way, moments in due.items():
        values = splines if way == "CUBICSPLINE" else places
        build = of_nodes([{"mesh": 0}], [(0, "translation", way, keys, values)])
        scene = wf.load(build.gltf(path), strict=True)
        assert (scene.start, scene.end, scene.duration) == (0.5, 2, 1.5)
        for time, place in moments.items():
            np.testing.assert_allclose(vertices(scene, time), TRIANGLE + np.array(place), atol=1e-6)


def test_rotations_turn_evenly_the_shorter_way(path: Path) -> None:
    quarter = [0, 0, HALF, HALF]
    for end in (quarter, [-each for each in quarter]):
        build = of_nodes([{"mesh": 0}], [(0, "rotation", "LINEAR", [0, 3], [[0, 0, 0, 1], end])])
        scene = wf.load(build.gltf(path))
        np.testing.assert_allclose(vertices(scene, 1), TRIANGLE @ turned("z", 30).T, atol=1e-6)
    zero = [0, 0, 0, 0]
    splines = [[zero, [0, 0, 0, 1], zero], [zero, quarter, zero]]
    scene = wf.load(of_nodes([{"mesh": 0}], [(0, "rotation", "CUBICSPLINE", [0, 1], splines)]).gltf(path))
    np.testing.assert_allclose(vertices(scene, 0.5), TRIANGLE @ turned("z", 45).T, atol=1e-6)


def test_what_a_clip_does_not_move_of_a_node_stays(path: Path) -> None:
    node = {"mesh": 0, "translation": [5, 0, 0], "scale": [2, 2, 2]}
    scene = wf.load(of_nodes([node], [(0, "rotation", "STEP", [0], [[0, 0, HALF, HALF]])]).gltf(path))
    np.testing.assert_allclose(vertices(scene, 0), 2 * TRIANGLE @ turned("z", 90).T + (5, 0, 0), atol=1e-6)


def test_nodes_move_within_moving_nodes(path: Path) -> None:
    """A mesh that slides along an arm that turns, below a node that stays."""
    nodes: list[dict[str, Any]] = [
        {"children": [1], "translation": [0, 0, 7]},
        {"children": [2, 3]},
        {"children": [4], "translation": [1, 0, 0]},
        {"mesh": 0, "translation": [0, 2, 0]},
        {"mesh": 0},
    ]
    turn = (1, "rotation", "LINEAR", [0, 1], [[0, 0, 0, 1], [0, 0, HALF, HALF]])
    slide = (4, "translation", "LINEAR", [0, 2], [[0, 0, 0], [4, 0, 0]])
    scene = wf.load(of_nodes(nodes, [turn, slide]).gltf(path), strict=True)
    arm = turned("z", 45).T
    by_place = sorted((vertices(scene, 0.5, k) for k in (0, 1)), key=lambda found: found[0, 0])
    np.testing.assert_allclose(by_place[0], (np.add(TRIANGLE, (0, 2, 0))) @ arm + (0, 0, 7), atol=1e-6)
    np.testing.assert_allclose(by_place[1], (np.add(TRIANGLE, (2, 0, 0))) @ arm + (0, 0, 7), atol=1e-6)
    still = scene.at(0.5).shapes
    assert isinstance(still[0], wf.Instance)
    assert isinstance(still[1], wf.Instance)
    assert still[0].mesh is still[1].mesh
    assert still[0].mesh is scene.at(1).shapes[0].mesh  # type: ignore[attr-defined]


def test_instances_of_a_node_move_with_it(path: Path) -> None:
    build = of_nodes([{"mesh": 0}], [(0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [0, 0, 2]])])
    places = build.accessor(np.array([[1, 0, 0], [2, 0, 0]], np.float32))
    build.json["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}
    }
    scene = wf.load(build.gltf(path), strict=True)
    lows = sorted(shape.bounds[0].tolist() for shape in scene.at(0.5).shapes)
    assert lows == [[1, 0, 1], [2, 0, 1]]


def test_cameras_and_lights_move_with_their_nodes(path: Path) -> None:
    nodes = [{"mesh": 0}, {"camera": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}]
    slide = [[0, 0, 0], [0, 0, 8]]
    channels: Channels = [(node, "translation", "LINEAR", [0, 1], slide) for node in (1, 2)]
    channels += [(2, "rotation", "STEP", [0, 1], [[0, 0, 0, 1], [0, HALF, 0, HALF]])]
    build = of_nodes(nodes, channels, (0, 1, 2))
    build.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5}}]
    build.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 3}]}}
    scene = wf.load(build.gltf(path), strict=True)
    still = scene.at(0.25)
    assert still.camera is not None
    assert still.camera.origin.tolist() == [0, 0, 2]
    assert scene.camera is not None
    assert scene.camera.motion is not None
    (spot,) = still.lights
    assert isinstance(spot, wf.SpotLight)
    assert spot.position.tolist() == [0, 0, 2]
    np.testing.assert_allclose(spot.direction, [0, 0, -1], atol=1e-6)
    last = scene.at(1).lights[0]
    assert isinstance(last, wf.SpotLight)
    np.testing.assert_allclose(last.direction, [-1, 0, 0], atol=1e-6)
    assert still.has_lights_of_file
    assert scene.shapes[0].moves is False


def arm() -> Any:
    """A triangle that hangs on two joints, below a node that is moved and must not count."""
    build = Builder()
    build.json["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        {"children": [2]},
        {"translation": [0, 1, 0]},
    ]
    build.json["scenes"][0]["nodes"] = [0, 1]
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 1, 3] = -1
    columns = build.accessor(inverse.transpose(0, 2, 1).reshape(2, 16).astype(np.float32))
    build.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": columns}]
    joints = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.25, 0.75, 0, 0]], np.float32)
    normals = np.tile(np.float32([[0, 0, 1]]), (3, 1))
    return build.mesh({"POSITION": TRIANGLE, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights})


def test_joints_move_a_skinned_mesh(path: Path) -> None:
    turn = [[0, 0, 0, 1], [HALF, 0, 0, HALF]]
    channels: Channels = [
        (2, "rotation", "LINEAR", [0, 1], turn),
        (1, "translation", "STEP", [0.5], [[2, 0, 0]]),
        (0, "translation", "LINEAR", [0, 1], [[9, 9, 9], [5, 5, 5]]),  # of the mesh, which must not count
    ]
    build = add_clip(arm(), channels)
    scene = wf.load(build.gltf(path), strict=True)
    for time, degrees in ((0, 0), (0.5, 45), (2, 90)):
        first, second = np.eye(4), np.eye(4)
        first[:3, 3] = 2, 0, 0
        second[:3, :3], second[:3, 3] = turned("x", degrees), (2, 1, 0)
        second = second @ [[1, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 0], [0, 0, 0, 1]]
        mixed = 0.25 * first + 0.75 * second
        due = [(m @ [*v, 1])[:3] for m, v in zip((first, second, mixed), TRIANGLE, strict=True)]
        np.testing.assert_allclose(vertices(scene, time), due, atol=1e-6)
        normal = scene.at(time).shapes[0].normals[1]  # type: ignore[attr-defined]
        np.testing.assert_allclose(normal, turned("x", degrees)[:, 2], atol=1e-6)
    # what is read of it at once is that moment
    still = wf.load(path, time=0.5)
    assert not still.moves
    np.testing.assert_array_equal(vertices(still, 0), vertices(scene, 0.5))


def test_joints_that_mirror_at_times_turn_faces_back(path: Path) -> None:
    flip: Channels = [(node, "scale", "STEP", [0, 1], [[1, 1, 1], [-1, 1, 1]]) for node in (1, 2)]
    scene = wf.load(add_clip(arm(), flip[:1]).gltf(path), strict=True)
    for time, side in ((0, 1), (1, 1)):
        mesh = scene.at(time).shapes[0]
        assert isinstance(mesh, wf.Mesh)
        a, b, c = mesh.vertices[mesh.faces[0]]
        assert np.sign(np.cross(b - a, c - a)[2]) == side
        assert np.sign(mesh.normals[0, 2]) == side


def test_weights_of_morph_targets_move(path: Path) -> None:
    build = Builder().mesh({"POSITION": TRIANGLE})
    targets = [np.tile(np.float32([shift]), (3, 1)) for shift in ((2, 0, 0), (0, 0, 1))]
    build.json["meshes"][0]["primitives"][0]["targets"] = [
        {"POSITION": build.accessor(each)} for each in targets
    ]
    build.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [0, 5, 0]}]
    build.json["scenes"][0]["nodes"] = [0, 1]
    build.json["meshes"][0]["weights"] = [0, 1]
    add_clip(build, [(0, "weights", "LINEAR", [0, 2], [[0, 0], [1, 4]])])
    scene = wf.load(build.gltf(path), strict=True)
    found = sorted((vertices(scene, 1, k) for k in (0, 1)), key=lambda each: each[0, 1])
    np.testing.assert_allclose(found[0], np.add(TRIANGLE, (1, 0, 2)), atol=1e-6)
    np.testing.assert_allclose(found[1], np.add(TRIANGLE, (0, 5, 1)), atol=1e-6)  # the node without a channel
    assert [shape.moves for shape in scene.shapes].count(True) == 1


def test_a_morphed_mesh_moves_with_its_node(path: Path) -> None:
    build = Builder().mesh({"POSITION": TRIANGLE})
    target = build.accessor(np.tile(np.float32([[2, 0, 0]]), (3, 1)))
    build.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    channels = [
        (0, "weights", "LINEAR", [0, 2], [[0], [1]]),
        (0, "translation", "LINEAR", [0, 4], [[0, 0, 0], [0, 0, 4]]),
    ]
    scene = wf.load(add_clip(build, channels).gltf(path), strict=True)
    np.testing.assert_allclose(vertices(scene, 1), np.add(TRIANGLE, (1, 0, 1)), atol=1e-6)
    assert scene.duration == 4
    build.json["nodes"][0] |= {"scale": [3, 3, 3]}
    build.json["animations"][0]["channels"].pop()
    np.testing.assert_allclose(
        vertices(wf.load(build.gltf(path)), 1), 3 * (np.add(TRIANGLE, (1, 0, 0))), atol=1e-6
    )


def test_normals_are_computed_in_each_pose_where_they_are_asked_for(path: Path) -> None:
    build = Builder().mesh(
        {"POSITION": np.vstack([TRIANGLE, [[1, 1, 0]]]).astype(np.float32)},
        np.array([0, 1, 2, 2, 1, 3], np.uint16),
    )
    target = build.accessor(np.float32([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1]]))
    build.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    scene = wf.load(add_clip(build, [(0, "weights", "LINEAR", [0, 1], [[0], [1]])]).gltf(path), smooth=True)
    bent = scene.at(1).shapes[0]
    want = wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], [(0, 1, 2), (2, 1, 3)], smooth=True)
    assert isinstance(bent, wf.Mesh)
    assert bent.normals is not None
    assert want.normals is not None
    np.testing.assert_allclose(bent.normals[bent.faces], want.normals[want.faces], atol=1e-6)
    assert wf.load(path).at(1).shapes[0].normals is None  # type: ignore[attr-defined]


def test_faces_that_are_flat_at_the_start_are_there_later(path: Path) -> None:
    build = Builder().mesh({"POSITION": np.zeros((3, 3), np.float32)})
    target = build.accessor(TRIANGLE)
    build.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    scene = wf.load(add_clip(build, [(0, "weights", "LINEAR", [0, 1], [[0], [1]])]).gltf(path), strict=True)
    np.testing.assert_allclose(vertices(scene, 1), TRIANGLE)


def clips(path: Path) -> Path:
    build = of_nodes([{"mesh": 0}], [(0, "translation", "STEP", [0], [[1, 0, 0]])])
    add_clip(build, [(0, "translation", "STEP", [0, 3], [[2, 0, 0], [4, 0, 0]])], "Run")
    add_clip(build, [(0, "translation", "STEP", [0], [[3, 0, 0]])], "Walk")
    return Path(build.gltf(path))


@pytest.mark.parametrize(
    ("animation", "due"), [(None, 1), ("0", 1), (0, 1), ("Run", 2), (1, 2), ("Walk", 3), (2, 3), (False, 0)]
)
def test_clips_by_name_and_number(path: Path, animation: Any, due: float) -> None:
    scene = wf.load(clips(path), animation=animation, strict=True)
    assert scene.animations == ("0", "Run", "Walk")
    assert scene.at(0).bounds[0, 0] == due
    assert scene.moves is (animation is not False)
    assert wf.load(path, time=3, animation="Run").bounds[0, 0] == 4


@pytest.mark.parametrize(
    ("animation", "message"),
    [
        ("Ran", r"animation is 'Ran'; it must be one of 0, Run, Walk.*did you mean 'Run'"),
        (3, "animation is 3; it must be at least 0 and below 3"),
        (-1, "animation is -1; it must be"),
        (True, "animation is True; it must be one of"),
        (1.5, "animation is 1.5; it must be one of"),
    ],
)
def test_clips_that_are_not_there(path: Path, animation: Any, message: str) -> None:
    with pytest.raises(SceneError, match=rf"a\.gltf.*{message}"):
        wf.load(clips(path), animation=animation)


def test_files_without_animations(path: Path, tmp_path: Path) -> None:
    build = Builder().mesh()
    with pytest.raises(SceneError, match="animation is 'Run'; the file has none"):
        wf.load(build.gltf(path), animation="Run")
    ply = tmp_path / "a.obj"
    ply.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match=r"a\.obj: animation is 0; the file has none"):
        wf.load(ply, animation=0)
    assert wf.load(ply, time=3, animation=False).animations == ()
    with pytest.raises(SceneError, match="time is inf; it must be finite"):
        wf.load(ply, time=np.inf)


def test_a_node_that_is_scaled_to_nothing_is_left_out_then(path: Path) -> None:
    channels = [(0, "scale", "LINEAR", [0, 1], [[0, 0, 0], [1, 1, 1]])]
    scene = wf.load(of_nodes([{"mesh": 0}, {"mesh": 0}], channels, (0, 1)).gltf(path), strict=True)
    assert len(scene.at(0).shapes) == 1
    assert len(scene.at(0.5).shapes) == 2
    assert scene.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]


Change = Any


def change(key: str, value: Any) -> Change:
    def act(build: Any) -> None:
        build.json["animations"][0][key][0] |= value

    return act


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (
            change("channels", {"sampler": 5}),
            r"channels\[0\]: sampler 5 does not exist; there are 1; left out",
        ),
        (change("channels", {"target": {"node": 7, "path": "scale"}}), r"nodes\[7\] does not exist"),
        (
            change("channels", {"target": {"node": 0, "path": "color"}}),
            "target.path is 'color'; it must be one of",
        ),
        (
            change("channels", {"target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {}}}}),
            r"not honored: animations\[0\]\.channels\[0\]: KHR_animation_pointer",
        ),
        (
            change("channels", {"target": {"node": 0, "path": "weights"}}),
            r"meshes\[.*|has 6 numbers for 2 times",
        ),
        (
            change("samplers", {"interpolation": "SMOOTH"}),
            "interpolation 'SMOOTH' is unknown; LINEAR in its place",
        ),
        (change("samplers", {"interpolation": "CUBICSPLINE"}), "has 6 numbers for 2 times of 9"),
        (change("samplers", {"output": 99}), r"accessors\[99\] does not exist"),
        (change("samplers", {"input": "late"}), "input|accessors"),
    ],
)
def test_damaged_channels_are_left_out(path: Path, act: Change, message: str) -> None:
    build = of_nodes([{"mesh": 0}], [(0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [1, 0, 0]])])
    act(build)
    with pytest.warns(UserWarning, match=message):
        scene = wf.load(build.gltf(path))
    assert scene.moves is ("LINEAR in its place" in message)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0, np.nan], [[0, 0, 0], [1, 0, 0]], "input must be finite numbers, one for each key"),
        ([0, 1], [[0, 0, 0], [np.inf, 0, 0]], "has values that are not finite"),
        (
            [0, 1, 1, 0.5, 2],
            [[0, 0, 0], [1, 0, 0], [7, 0, 0], [8, 0, 0], [2, 0, 0]],
            "2 keys at times that do not rise",
        ),
    ],
)
def test_damaged_keys(path: Path, times: Any, values: Any, message: str) -> None:
    build = of_nodes([{"mesh": 0}], [(0, "translation", "LINEAR", times, values)])
    with pytest.warns(UserWarning, match=message):
        scene = wf.load(build.gltf(path))
    assert scene.at(1.5).bounds[0, 0] == (1.5 if scene.moves else 0)


def test_extensions_of_visibility_are_named(path: Path) -> None:
    build = of_nodes([{"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": False}}}], [])
    build.json["extensionsUsed"] = ["KHR_node_visibility"]
    with pytest.warns(UserWarning, match="not honored: the file: KHR_node_visibility|KHR_node_visibility"):
        wf.load(build.gltf(path))


def test_a_channel_without_a_node_is_ignored(path: Path) -> None:
    build = of_nodes([{"mesh": 0}], [(0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [1, 0, 0]])])
    build.json["animations"][0]["channels"][0]["target"].pop("node")
    assert not wf.load(build.gltf(path), strict=True).moves

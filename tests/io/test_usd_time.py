"""Stages of USD whose attributes have time samples: each moment is read from the file."""

from __future__ import annotations

import pickle
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import Shutter, exposed_scene, write_image

import wavefront as wf

pytest.importorskip("pxr")

HEAD = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 10
    endTimeCode = 30
    timeCodesPerSecond = 10
)
"""
BOARD = """def Mesh "%s"
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    %s
    uniform token subdivisionScheme = "none"
}
"""
STILL = BOARD % ("still", "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]")
BENT = BOARD % (
    "bent",
    """point3f[] points.timeSamples = {
        10: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], 30: [(0, 0, 4), (1, 0, 0), (0, 1, 0)] }""",
)
SLID = """def Xform "slid"
{
    double3 xformOp:translate.timeSamples = { 10: (0, 0, 0), 20: (2, 0, 0), 30: (2, 6, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Sphere "ball"
    {
        double radius = 1
    }
}
"""
BLINKS = """def Sphere "blinks"
{
    token visibility.timeSamples = { 10: "inherited", 20: "invisible" }
}
"""
LAMP = """def SphereLight "lamp"
{
    float inputs:intensity.timeSamples = { 10: 1, 30: 3 }
    double3 xformOp:translate.timeSamples = { 10: (0, 5, 0), 30: (4, 5, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
CAMERA = """def Camera "camera"
{
    float focalLength.timeSamples = { 10: 50, 30: 100 }
    double3 xformOp:translate.timeSamples = { 10: (0, 0, 5), 30: (0, 0, 9) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def stage(folder: Path, body: str, head: str = HEAD) -> Path:
    path = folder / "a.usda"
    path.write_text(head + body)
    return path


def named(scene: wf.Scene) -> dict[str, Any]:
    return {shape.name: shape for shape in scene.shapes}


def test_what_has_time_samples_moves(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, STILL + BENT + SLID + BLINKS + LAMP + CAMERA))
    assert (scene.start, scene.end, scene.duration) == (1, 3, 2)
    assert scene.moves
    start, middle = named(scene), named(scene.at(1.5))
    assert start["ball"].center.tolist() == [0, 0, 0]
    assert middle["ball"].center.tolist() == [1, 0, 0]
    assert named(scene.at(2.5))["ball"].center.tolist() == [2, 3, 0]
    np.testing.assert_allclose(middle["bent"].vertices[0], [0, 0, 1])
    assert "blinks" in start
    assert "blinks" in middle
    later = scene.at(2)
    assert "blinks" not in named(later)
    np.testing.assert_allclose(named(later)["lamp"].center, [2, 5, 0])
    np.testing.assert_allclose(named(later)["lamp"].emission, 2 * start["lamp"].emission)
    assert later.camera is not None
    assert later.camera.origin.tolist() == [0, 0, 7]
    assert later.camera.fov == pytest.approx(2 * np.degrees(np.arctan(15.2908 / 150)))
    assert not later.moves
    assert later.moment == 2


def test_what_stands_still_is_shared(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, STILL + SLID))
    still = scene.at(2)
    assert named(still)["still"] is named(scene)["still"]
    assert named(still)["ball"] is not named(scene)["ball"]
    added = wf.Box((0, 0, 0), 1).transformed(wf.Keyframes([1, 2], [np.eye(4), np.diag([2, 2, 2, 1])]))
    camera = wf.Camera.look_at((0, 0, 9), (0, 0, 0))
    scene.add(added, wf.PointLight((0, 1, 0), 3))
    scene.camera = camera
    still = scene.at(2)
    assert still.shapes[-1].bounds.tolist() == [[-1, -1, -1], [1, 1, 1]]
    assert still.lights == scene.lights
    assert still.camera is camera


def test_copies_of_the_scene_move_as_it_does(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, STILL + SLID + CAMERA))
    for copied in (pickle.loads(pickle.dumps(scene)), deepcopy(scene)):
        still = copied.at(2)
        assert [shape.name for shape in still.shapes] == ["still", "ball"]
        assert still.shapes[0] is copied.shapes[0]
        assert still.shapes[1].center.tolist() == [2, 0, 0]
        assert still.camera.origin.tolist() == [0, 0, 7]


def test_a_camera_that_moves_is_blurred(tmp_path: Path) -> None:
    passing = CAMERA.replace("10: (0, 0, 5), 30: (0, 0, 9)", "10: (-2, 0, 5), 30: (3, 0, 5)")
    scene = wf.load(stage(tmp_path, STILL + passing.replace("30: 100", "30: 50")))
    given: Any = {"size": (24, 16), "progress": False, "workers": 1, "lighting": None}
    scene.add(wf.Environment(1))
    blurred = wf.render(scene, 128, aovs="alpha", shutter=(1.5, 2.5), **given).alpha
    times = 1.5 + (np.arange(16) + 0.5) / 16
    stills = [wf.render(scene.at(time), 8, aovs="alpha", **given).alpha for time in times]
    assert np.abs(blurred - np.mean(stills, 0)).max() < 0.12
    of_user = wf.Camera.look_at((0, 0, 9), (0, 0, 0))
    wf.render(scene, 1, camera=of_user, shutter=(1.5, 2.5), **given)
    still = wf.render(scene, 1, shutter=(9, 10), **given)  # all is over
    np.testing.assert_array_equal(still.rgb, wf.render(scene.at(9), 1, **given).rgb)


def test_a_blurred_picture_reads_its_file_once_for_each_time(tmp_path: Path, calls_of: Any) -> None:
    scene = wf.load(stage(tmp_path, STILL + SLID + CAMERA))
    scene.add(wf.Environment(1))
    given: Any = {"size": 4, "progress": False, "workers": 1, "lighting": None}
    assert scene.reach.shape == (2, 3)  # reads a few times
    reads = calls_of("wavefront.io.load.read")
    wf.render(scene, 1, shutter=(1.2, 1.4), **given)
    assert len(reads) == 9
    scene.at(float(np.linspace(1.2, 1.4, 9)[3]))
    assert len(reads) == 9
    first, second = (named(scene.at(2.7))["ball"] for _ in range(2))
    assert len(reads) == 10
    first.material = wf.Mirror(0.5)
    assert second.material is not first.material
    assert named(scene.at(2.7))["ball"].material is not first.material
    for time in np.linspace(1, 3, 12).tolist():
        scene.at(time)
    assert len(reads) == 22
    scene.at(2.7)
    assert len(reads) == 23  # it was too long ago


SPOT = """def SphereLight "spot" (apiSchemas = ["ShapingAPI"])
{
    float inputs:intensity = 20000
    bool treatAsPoint = true
    float inputs:shaping:cone:angle = 25
    double3 xformOp:translate.timeSamples = { 10: (-1, 0.5, 4), 30: (1.5, 0.5, 4) }
    double xformOp:rotateY.timeSamples = { 10: -15, 30: 15 }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
}
"""


def test_lights_and_balls_that_move_are_blurred(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, STILL + SLID + SPOT))
    assert isinstance(scene.lights[0], wf.SpotLight)
    scene.add(wf.Rectangle((-3, -3, -1), (8, 0, 0), (0, 8, 0)), wf.Environment(0.05))
    camera = wf.Camera.look_at((0.5, 0.5, 9), (0.5, 0.5, 0), fov=40, size=(24, 16))
    given: Any = {"camera": camera, "progress": False, "workers": 1, "denoise": False, "lighting": None}
    blurred = wf.render(scene, 256, shutter=(1, 3), **given).rgb
    times = 1 + 2 * (np.arange(32) + 0.5) / 32
    stills = np.mean([wf.render(scene.at(time), 8, **given).rgb for time in times], 0)
    off = np.abs(blurred - stills).mean() / stills.mean()
    assert off < 0.05
    assert np.abs(wf.render(scene.at(2), 32, **given).rgb - stills).mean() / stills.mean() > 3 * off


def test_a_lamp_that_spins_is_on_its_way_at_all_times(tmp_path: Path) -> None:
    """Also where it points away from where it points in the middle of the time."""
    spinning = SPOT.replace("{ 10: -15, 30: 15 }", "{ 10: 0, 30: 360 }")
    scene, shutter = wf.load(stage(tmp_path, STILL + spinning)), Shutter(1, 3)
    exposed = exposed_scene(scene, shutter)
    times = np.linspace(1, 3, 33)
    turns = exposed.lights[0](times)[:, :3, :3]
    axes = turns @ turns[16].T @ exposed.scene.lights[0].direction
    wanted = [scene.at(time).lights[0].direction for time in times.tolist()]
    np.testing.assert_allclose(axes, wanted, atol=1e-6)
    assert wanted[0] @ wanted[16] == pytest.approx(-1)


DOME = """def DomeLight "dome"
{
    asset inputs:texture:file = @sky.exr@
    double xformOp:rotateX.timeSamples = { 10: 20, 30: 380 }
    double3 xformOp:translate.timeSamples = { 10: (0, 0, 0), 30: (9, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""


def test_a_dome_that_spins_is_seen_as_at_each_time(tmp_path: Path) -> None:
    write_image(tmp_path / "sky.exr", np.random.default_rng(1).random((6, 12, 3)).astype(np.float32))
    scene = wf.load(stage(tmp_path, STILL + DOME))
    scene.camera = wf.Camera.look_at((0, 0, -9), (0, 0, -10), fov=90, size=(8, 8))
    steps = list(wf.trace(scene, shutter=(1.2, 2.8)))
    seen, paths = steps[-1].light, next(step.paths for step in steps if step.stage == "generate")
    for lane in range(0, 64, 9):
        (sky,) = scene.at(paths.time[lane]).lights
        due = sky.record(np.zeros(3)).le(paths.direction[:, [lane]])[:, 0]
        np.testing.assert_allclose(seen[:, paths.slot[lane]], due, rtol=1e-4)


def test_a_dome_that_stands_still_is_no_light_that_turns(tmp_path: Path) -> None:
    write_image(tmp_path / "sky.exr", np.ones((6, 12, 3), np.float32) + np.eye(6, 12)[:, :, None])
    still = DOME.replace(".timeSamples = { 10: 20, 30: 380 }", " = 20")
    still = still.replace(".timeSamples = { 10: (0, 0, 0), 30: (9, 0, 0) }", " = (0, 0, 0)")
    exposed = exposed_scene(wf.load(stage(tmp_path, BENT + still)), Shutter(1, 3))
    assert exposed.movers
    assert not exposed.lights


def test_a_moment_is_what_is_read_at_its_time(tmp_path: Path) -> None:
    path = stage(tmp_path, STILL + BENT + LAMP)
    given: Any = {"spp": 2, "size": (12, 8), "progress": False, "workers": 1, "view": "front"}
    frames = list(wf.render_frames(path, [1, 2], **given))
    scene = wf.load(path)
    for time, image in zip((1, 2), frames, strict=True):
        np.testing.assert_array_equal(image.rgb, wf.render(scene.at(time), **given).rgb)
    np.testing.assert_array_equal(
        named(wf.load(path, time=2))["bent"].vertices, named(scene.at(2))["bent"].vertices
    )
    assert wf.load(path, time=2).moves is False


def test_times_are_seconds_also_without_a_range(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, SLID, '#usda 1.0\n(metersPerUnit = 1\nupAxis = "Y")\n'))
    assert (scene.start, scene.end) == (10 / 24, 30 / 24)
    assert named(scene.at(15 / 24))["ball"].center.tolist() == [1, 0, 0]
    assert not wf.load(stage(tmp_path, STILL)).moves


def test_framing_and_ground_are_those_of_all_times(tmp_path: Path) -> None:
    scene = wf.load(stage(tmp_path, SLID))
    np.testing.assert_allclose(scene.at(1).reach, [[-1, -1, -1], [3, 7, 1]])
    first, last = (scene.at(at).framing_camera() for at in (1, 3))
    np.testing.assert_array_equal(first.to_matrix(), last.to_matrix())

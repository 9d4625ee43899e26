"""Scenes of Mitsuba whose plugins move: `<animation>`, and motions in dictionaries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import write_image

import wavefront as wf

SLIDE = """<animation name="to_world">
    <transform time="1"><translate x="1"/></transform>
    <transform time="3"><rotate z="1" angle="90"/><translate x="3"/></transform>
</animation>"""
LIGHT = f'<emitter type="point"><float name="intensity" value="3"/>{SLIDE}</emitter>'
CAMERA = f"""<sensor type="perspective"><float name="fov" value="40"/>
    <float name="shutter_open" value="1"/><float name="shutter_close" value="1.5"/>{SLIDE}</sensor>"""


def load(folder: Path, body: str, **options: Any) -> wf.Scene:
    path = folder / "a.xml"
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return wf.load(path, **{"strict": True, **options})


def turned(degrees: float, x: float) -> Any:
    matrix = wf.shapes.transform.rotation("test", "z", degrees, (0, 0, 0))
    matrix[0, 3] = x
    return matrix


KINDS = ["cube", "sphere", "rectangle", "disk", "cylinder"]


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_move(tmp_path: Path, kind: str) -> None:
    scene = load(tmp_path, f'<shape type="{kind}">{SLIDE}</shape>')
    assert (scene.start, scene.end) == (1, 3)
    still = '<shape type="%s"><transform name="to_world"><matrix value="%s"/></transform></shape>'
    for time, matrix in ((1, turned(0, 1)), (2, turned(45, 2)), (9, turned(90, 3))):
        text = " ".join(map(str, matrix.ravel().tolist()))
        due = load(tmp_path, still % (kind, text)).bounds
        np.testing.assert_allclose(scene.at(time).bounds, due, atol=1e-6)


def test_emitters_and_sensors_move_and_the_shutter_is_that_of_the_sensor(tmp_path: Path) -> None:
    scene = load(tmp_path, f'<shape type="cube"/>{LIGHT}{CAMERA}')
    still = scene.at(2)
    assert scene.settings["shutter"] == (1, 1.5)
    assert still.camera is not None
    np.testing.assert_allclose(still.camera.origin, [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(still.camera.rotation[:, 1], turned(45, 0)[:3, 1], atol=1e-12)
    (lamp,) = still.lights
    assert isinstance(lamp, wf.PointLight)
    np.testing.assert_allclose(lamp.position, [2, 0, 0], atol=1e-12)
    quiet = load(tmp_path, f'<shape type="cube"/>{CAMERA.replace(SLIDE, "")}')
    assert "shutter" not in quiet.settings


def test_instances_move(tmp_path: Path) -> None:
    group = '<shape type="shapegroup" id="g"><shape type="cube"/></shape>'
    scene = load(tmp_path, f'{group}<shape type="instance"><ref id="g"/>{SLIDE}</shape>')
    np.testing.assert_allclose(scene.at(3).bounds, [[2, -1, -1], [4, 1, 1]], atol=1e-12)


def test_dictionaries_take_keyframes() -> None:
    slide = wf.Keyframes([0, 1], [turned(0, 0), turned(0, 4)])
    scene = wf.from_mitsuba({"type": "scene", "ball": {"type": "sphere", "to_world": slide}}, strict=True)
    assert scene.at(0.5).shapes[0].center.tolist() == [2, 0, 0]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("", r"<animation> has no transform with a time"),
        ('<transform time="late"/>', "time"),
        ('<transform time="0"/><translate x="1"/>', "<translate> cannot be inside <animation>"),
        (
            '<transform time="0"/><transform time="1"><scale x="0"/></transform>',
            "singular.*first transform in its place",
        ),
        ('<transform time="0"/><transform time="1"><scale x="-1"/></transform>', "one mirrors"),
    ],
)
def test_damaged_animations(tmp_path: Path, keys: str, message: str) -> None:
    body = f'<shape type="cube"><animation name="to_world">{keys}</animation></shape>'
    with pytest.warns(UserWarning, match=message):
        scene = load(tmp_path, body, strict=False)
    assert scene.duration == 0
    np.testing.assert_allclose(scene.bounds, [[-1, -1, -1], [1, 1, 1]])


def test_motion_of_what_cannot_move_is_left_out(tmp_path: Path) -> None:
    """A sky can turn, but not be stretched."""
    stretched = SLIDE.replace('<rotate z="1" angle="90"/>', '<scale x="3"/>')
    sky = f'<emitter type="constant">{stretched}</emitter>'
    with pytest.warns(UserWarning, match="its motion left out"):
        scene = load(tmp_path, f'{sky}<shape type="cube"/>', strict=False)
    assert scene.duration == 0


def test_environment_maps_turn_while_the_shutter_is_open(tmp_path: Path) -> None:
    write_image(tmp_path / "sky.exr", np.random.default_rng(1).random((6, 12, 3)).astype(np.float32))
    image = '<string name="filename" value="sky.exr"/>'
    scene = load(tmp_path, f'<shape type="sphere"/><emitter type="envmap">{image}{SLIDE}</emitter>')
    scene.camera = wf.Camera.look_at((0, 0, 9), (0, 0, 10), fov=90, size=(4, 4))
    steps = list(wf.trace(scene, shutter=(1, 3)))
    paths = next(step.paths for step in steps if step.stage == "generate")
    for lane in range(16):
        due = scene.at(paths.time[lane]).lights[0].record(np.zeros(3)).le(paths.direction[:, [lane]])[:, 0]
        np.testing.assert_allclose(steps[-1].light[:, paths.slot[lane]], due, rtol=1e-4)

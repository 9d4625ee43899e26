"""Cameras that frame a scene: how much of the picture it fills, from where, and what is up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from inside import VIEWS, main

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 0, 9), (0, 0, 0))
SIZES = [(64, 64), (40, 96), (160, 16)]
FAST: dict[str, Any] = {"spp": 1, "size": (8, 8), "progress": False}


def box(*sides: float) -> wf.Mesh:
    made = trimesh.creation.box(sides)
    return wf.Mesh(made.vertices + np.array((3, -2, 5)), made.faces)


def shapes() -> dict[str, list[wf.Shape]]:
    """Flat, tall, long, round, many, placed."""
    ball = trimesh.creation.icosphere(3)
    turned = trimesh.transformations.rotation_matrix(1.0, (1, 2, 3), (4, 4, 4))
    return {
        "plate": [box(4, 0.1, 3)],
        "tower": [box(0.3, 7, 0.3)],
        "beam": [box(0.2, 0.2, 9)],
        "cube": [box(1, 1, 1)],
        "ball": [wf.Sphere((2, 1, 0), 0.5)],
        "facets": [wf.Mesh(ball.vertices, ball.faces)],
        "balls": [wf.Spheres([(0, 0, 0), (3, 0, 0), (0, 1, 1)], [0.5, 0.1, 0.3])],
        "cylinder": [wf.Cylinders([(0, 0, 0)], [(0, 1, 0)], 1.0)],
        "capsules": [wf.Capsules([(0, 0, 0), (1, 1, 1)], [(0, 2, 0), (1, 1, 4)], [0.2, 0.5])],
        "placed": wf.Instance.many(box(1, 2, 3), [np.eye(4), turned]),
        "triangle": [wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1e-3, 1)], [(0, 1, 2)])],
    }


def covered(scene: wf.Scene, camera: wf.Camera) -> np.ndarray:
    """Return where the scene is in the picture, (height, width)."""
    lit = wf.Scene(scene.shapes, wf.Environment(1))
    layers = wf.render(lit, 1, camera=camera, aovs="depth", max_bounces=1, progress=False).layers
    return np.isfinite(layers["depth"])


def reach(camera: wf.Camera, points: np.ndarray) -> np.ndarray:
    """Return the least and greatest place of points (n, 3) in the picture, of its sides, (2, 2)."""
    pixels, depth = camera.project(points)
    assert (depth > 0).all()
    return np.stack([pixels.min(0), pixels.max(0)]) / camera.size


@pytest.mark.parametrize(
    ("name", "size"),
    [
        pytest.param(
            name, size, marks=pytest.mark.slow if number and size != SIZES[number % len(SIZES)] else []
        )
        for number, name in enumerate(shapes())
        for size in SIZES
    ],
)
def test_a_scene_fills_85_percent_of_the_picture(name: str, size: tuple[int, int]) -> None:
    """Of the width or the height, by rays; it is in the middle, and nothing is cut."""
    scene = wf.Scene(shapes()[name])
    pixels = (8 * size[0], 8 * size[1]) if min(size) < 20 else (3 * size[0], 3 * size[1])
    there = covered(scene, scene.framing_camera(size=pixels))
    rows, columns = np.flatnonzero(there.any(1)), np.flatnonzero(there.any(0))
    filled = np.array([np.ptp(columns) + 1, np.ptp(rows) + 1]) / pixels
    assert 0.8 < filled.max() < 0.9
    for found, side in ((columns, pixels[0]), (rows, pixels[1])):
        assert found[0] > 0.04 * side
        assert found[-1] < 0.96 * side
        assert (found[0] + found[-1] + 1) / side == pytest.approx(1, abs=0.06)


def test_a_ball_fills_as_much_from_near() -> None:
    """Where the picture is wide, its outline is no longer a circle; lines of sight touch the ball."""
    scene = wf.Scene(wf.Sphere((2, 1, 0), 0.5))
    for fov in (20, 100):
        there = covered(scene, scene.framing_camera(fov, (200, 200)))
        for axis in (0, 1):
            assert np.flatnonzero(there.any(axis)).size / 200 == pytest.approx(0.85, abs=0.011)


@given(
    sides=st.tuples(*[st.floats(1e-3, 1e3)] * 3),
    direction=st.sampled_from(sorted(VIEWS)) | st.tuples(*[st.floats(-1, 1)] * 2, st.just(0.5)),
    aspect=st.floats(0.05, 20),
    fov=st.floats(5, 120),
    up=st.sampled_from(["y", "z", "-x", (1, 2, 3)]),
)
def test_every_corner_of_any_box_is_in_any_picture(sides, direction, aspect, fov, up) -> None:
    mesh = box(*sides)
    size = max(1, round(400 * min(1, aspect))), max(1, round(400 * min(1, 1 / aspect)))
    camera = wf.Scene([mesh]).framing_camera(fov, size, direction=direction, up=up)
    low, high = reach(camera, mesh.vertices)
    assert (low > 0.074).all()
    assert (high < 0.926).all()
    assert 0.845 < (high - low).max() <= 0.8501
    np.testing.assert_allclose(low + high, 1, atol=2e-3)


@pytest.mark.parametrize("factor", [1e-30, 1e-6, 1e6, 1e30])
def test_size_does_not_matter(factor: float) -> None:
    scene, other = wf.Scene(box(1, 2, 3)), wf.Scene(box(1, 2, 3).scaled(factor))
    here, there = scene.framing_camera(), other.framing_camera()
    np.testing.assert_allclose(here.rotation, there.rotation, atol=1e-12)
    np.testing.assert_allclose(here.origin * factor, there.origin, rtol=1e-9)


def test_many_instances_are_framed_by_boxes(monkeypatch) -> None:
    monkeypatch.setattr("wavefront.shapes.instance.MOST_HULL", 10)
    instances = shapes()["placed"]
    camera = wf.Scene(instances).framing_camera()
    low, high = reach(camera, np.concatenate([each.to_mesh().vertices for each in instances]))
    assert low.min() > 0.07
    assert high.max() < 0.93


@pytest.mark.parametrize(
    ("view", "y_up", "z_up"),
    [
        ("front", (0, 0, 1), (0, -1, 0)),
        ("back", (0, 0, -1), (0, 1, 0)),
        ("left", (-1, 0, 0), (-1, 0, 0)),
        ("right", (1, 0, 0), (1, 0, 0)),
        ("top", (0, 1, 0), (0, 0, 1)),
        ("bottom", (0, -1, 0), (0, 0, -1)),
        ("iso", (1, 1, 1), (1, -1, 1)),
    ],
)
def test_views_have_names(view: str, y_up: tuple, z_up: tuple) -> None:
    scene = wf.Scene(box(1, 2, 3))
    for up, direction in (("y", y_up), ("z", z_up)):
        expected = np.array(direction) / np.linalg.norm(direction)
        camera = scene.framing_camera(direction=view, up=up)
        np.testing.assert_allclose(camera.rotation[:, 2], expected, atol=1e-12)
    named, given = (wf.render(box(1, 2, 3), **FAST, view=each).rgb for each in (view, y_up))
    np.testing.assert_array_equal(named, given)


def test_the_default_is_three_quarter() -> None:
    x, y, z = wf.Scene(box(1, 2, 3)).framing_camera().rotation[:, 2]
    assert np.degrees([np.arctan2(x, z), np.arcsin(y)]) == pytest.approx([35, 22], abs=0.05)
    pictures = [wf.render(box(1, 2, 3), **FAST, view=each).rgb for each in (None, "three_quarter")]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"view": "fronl"}, "view is 'fronl'; .* one of three_quarter, front, back, .*did you mean 'front'"),
        ({"view": (0, 0, 0)}, r"view is \[0.0, 0.0, 0.0\]; it must not be zero"),
        ({"view": "top", "camera": CAMERA}, "view='top' does not go with camera=<Camera"),
        ({"fov": 20, "camera": CAMERA}, "fov=20.0 does not go with camera=<Camera"),
        ({"fov": 0}, "fov"),
        ({"up": "Q"}, "up is 'Q'"),
    ],
)
def test_bad_views_are_errors(settings: dict, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **settings)


def test_a_view_counts_more_than_the_camera_of_the_scene() -> None:
    own = wf.Camera.look_at((0, 0, 30), (0, 0, 0), size=(12, 10))
    scene = wf.Scene(box(1, 2, 3), wf.Environment(1), own)
    bare = wf.Scene(box(1, 2, 3), wf.Environment(1))
    framed = wf.render(scene, 1, view="top", fov=20)
    np.testing.assert_array_equal(framed.rgb, wf.render(bare, 1, view="top", fov=20, size=(12, 10)).rgb)
    with pytest.raises(wf.SceneError, match="fov is 20; the scene has a camera of its own"):
        wf.render(scene, 1, fov=20)


def test_a_session_frames_again() -> None:
    scene = box(1, 2, 3)
    with wf.Session(scene, 1, view="left", size=(8, 8), progress=False) as session:
        first = session.run().rgb
        session.set_camera(wf.Camera.look_at((0, 0, 30), (0, 0, 0), size=(8, 8)))
        session.run()
        session.set_camera(None, (8, 8))
        np.testing.assert_array_equal(session.run().rgb, first)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("name", ["beam", "tower", "balls", "placed"])
@pytest.mark.first(1)
def test_a_turntable_cuts_nothing(name: str, up: str) -> None:
    scene = wf.Scene(shapes()[name])
    found = [covered(scene, each) for each in wf.turntable(scene, 12, size=(96, 72), up=up)]
    there = np.any(found, 0)
    assert not np.concatenate([there[0], there[-1], there[:, 0], there[:, -1]]).any()
    spans = [np.ptp(np.flatnonzero(each.any(axis))) / (96, 72)[axis] for each in found for axis in (0, 1)]
    assert 0.65 < max(spans) < 0.9


def ups(mesh: trimesh.Trimesh, tmp_path: Any, kind: str) -> wf.Scene:
    path = tmp_path / f"a.{kind}"
    mesh.export(path)
    return wf.load(path)


@pytest.mark.parametrize(
    ("kind", "up"), [("stl", "z"), ("3mf", "z"), ("obj", "y"), ("ply", "y"), ("glb", "y")]
)
def test_up_follows_the_file_type(tmp_path, capsys, kind: str, up: str) -> None:
    """The picture is that of the axis by name; `info` says it in one line."""
    if kind == "3mf":
        pytest.importorskip("lxml")
    mesh = trimesh.creation.box((1, 2, 3))
    scene = ups(mesh, tmp_path, kind)
    assert scene.vertical().tolist() == np.eye(3)["xyz".index(up)].tolist()
    path = str(tmp_path / f"a.{kind}")
    found, named = (wf.render(path, **FAST, **how).rgb for how in ({}, {"up": up}))
    np.testing.assert_array_equal(found, named)
    assert main(["info", path]) == 0
    said = {"stl": "z, by the file or its format; --up changes it", "obj": "y (assumed; up='z' turns it)"}
    said |= {"3mf": said["stl"], "ply": said["obj"], "glb": "y, the default; --up changes it"}
    assert f"\nup: {said[kind]}\n" in capsys.readouterr().out
    read = trimesh.load(path)
    first = wf.render([wf.Sphere((0, 0, 0), 0.1), read], **FAST, aovs="normal").layers["normal"]
    again = wf.render([wf.Sphere((0, 0, 0), 0.1), read], **FAST, aovs="normal", up=up).layers["normal"]
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("axis", ["X", "Y", "Z", None])
def test_up_of_dae_is_its_own(tmp_path, axis: str | None) -> None:
    pytest.importorskip("collada")
    path = tmp_path / "a.dae"
    text = trimesh.creation.box().export(file_type="dae").decode()
    start, end = text.index("<up_axis>"), text.index("</up_axis>") + len("</up_axis>")
    path.write_text(text[:start] + ("" if axis is None else f"<up_axis> {axis}_UP </up_axis>") + text[end:])
    expected = np.eye(3)["XYZ".index(axis or "Y")]
    np.testing.assert_array_equal(wf.load(path).vertical(), expected)


def test_up_of_a_scene_can_be_set() -> None:
    scene = wf.Scene(box(1, 2, 3), up="z")
    picture = wf.render(wf.Scene(box(1, 2, 3)), **FAST, up="z")
    np.testing.assert_array_equal(wf.render(scene, **FAST).rgb, picture.rgb)
    (own,), (named,) = wf.turntable(scene, 1), wf.turntable(scene, 1, up="z")
    assert own.rotation.tolist() == named.rotation.tolist()
    with pytest.raises(wf.SceneError, match="up is 'w'"):
        scene.up = "w"

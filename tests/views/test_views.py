"""Many views: cameras that move, renders of several cameras, animations."""

import tracemalloc
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import Image, main

import wavefront as wf

SCENE = [wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((0.8, 0.3, 0.2))), wf.Environment(1)]


def look(*origin: float) -> wf.Camera:
    return wf.Camera.look_at(origin, (0, 0, 0), size=(24, 16))


def flat(value: float, size: tuple[int, int] = (6, 4)) -> Image:
    return Image(np.full((size[1], size[0], 3), value, np.float32))


@pytest.mark.parametrize(("up", "expected"), [("y", (4, 1, 0)), ("z", (0, 1, 4)), ((1, 0, 0), (0, -4, 1))])
def test_orbit_turns_around_the_vertical_line(up: object, expected: tuple[float, ...]) -> None:
    """Counterclockwise, seen from above; what was in the middle stays there."""
    start = wf.Camera.look_at((0, 1, 4), (0, 0, 0.001), (0.3, 0.9, 0.1))
    camera = wf.orbit(start, (0, 0, 0), 90, up)
    if up == "z":
        expected = (-1, 0, 4)
    assert np.allclose(camera.origin, expected)
    assert np.allclose(camera.rotation.T @ camera.rotation, np.eye(3))
    center = start.project([(0, 0, 0)])
    assert np.allclose(camera.project([(0, 0, 0)])[0], center[0])
    assert np.allclose(wf.orbit(camera, (0, 0, 0), -90, up).rotation, start.rotation)


def test_turntables_go_around_once() -> None:
    cameras = wf.turntable(SCENE, 4, size=(24, 16))
    angles = np.unwrap([np.arctan2(camera.origin[0], camera.origin[2]) for camera in cameras])
    assert np.allclose(np.diff(angles), np.pi / 2)
    assert np.allclose([camera.origin[1] for camera in cameras], cameras[0].origin[1])
    assert {camera.size for camera in cameras} == {(24, 16)}


def test_turntables_start_at_the_camera_of_the_scene() -> None:
    camera = look(3, 2, 1)
    first, *_ = wf.turntable(wf.Scene(SCENE[:1], camera=camera), 3)
    assert np.allclose(first.origin, camera.origin)
    assert np.allclose(first.rotation, camera.rotation)


@given(st.integers(0, 2**32 - 1), st.integers(2, 20))
def test_interpolated_cameras_pass_through_the_given_ones(seed: int, parts: int) -> None:
    rng = np.random.default_rng(seed)
    given_cameras = [look(*rng.normal(size=3) * 5) for _ in range(3)]
    path = wf.interpolate_cameras(given_cameras, 2 * parts + 1)
    for camera, at in zip(given_cameras, (path[0], path[parts], path[-1]), strict=True):
        assert np.allclose(camera.origin, at.origin)
        assert np.allclose(camera.rotation, at.rotation, atol=1e-6)
    for camera in path:
        assert np.allclose(camera.rotation.T @ camera.rotation, np.eye(3), atol=1e-9)
        assert np.linalg.det(camera.rotation) == pytest.approx(1)


def test_rotations_take_the_shortest_way_at_constant_speed() -> None:
    ends = wf.orbit(look(0, 0, 4), (0, 0, 0), 20), wf.orbit(look(0, 0, 4), (0, 0, 0), -20)
    middle = wf.interpolate_cameras(ends, 5)
    angles = [np.degrees(np.arctan2(c.rotation[0, 2], c.rotation[2, 2])) for c in middle]
    assert np.allclose(angles, [20, 10, 0, -10, -20])


def test_half_turns_can_be_interpolated() -> None:
    ends = look(0, 0, 4), wf.orbit(look(0, 0, 4), (0, 0, 0), 180)
    middle = wf.interpolate_cameras(ends, 3)[1]
    assert np.allclose(middle.rotation.T @ middle.rotation, np.eye(3), atol=1e-9)
    assert abs(middle.rotation[2, 2]) < 1e-6


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wf.turntable(SCENE, 0), "n is 0; it must be a whole number from 1 to 1000000"),
        (lambda: wf.turntable(SCENE, 2.5), "n is 2.5; it must be a whole number from 1 to 1000000"),
        (lambda: wf.interpolate_cameras([look(1, 1, 1)], 4), "cameras is .*; it must be at least 2"),
        (lambda: wf.orbit(look(1, 1, 1), (0, 0), 4), "center"),
        (lambda: wf.orbit(look(1, 1, 1), (0, 0, 0), float("nan")), "degrees"),
        (lambda: next(wf.render_many(SCENE, [])), "cameras is empty"),
        (lambda: next(wf.render_many(SCENE, 3)), "cameras must be a list of cameras, .*, got 3"),
        (lambda: next(wf.render_many(SCENE, look(1, 1, 1))), "cameras must be a list of cameras, .*<Camera"),
        (lambda: wf.save_animation("a", [flat(0)]), "a: has no extension; it must be one of .gif"),
        (lambda: wf.save_animation("a.gif", []), "a.gif: there are no images"),
        (lambda: wf.save_animation("a.gif", [flat(0)], fps=0), "fps is 0"),
        (lambda: wf.save_animation("a.webm", [flat(0)]), "extension is '.webm'; it must be one of .gif"),
        (lambda: wf.save_animation("a{}.xyz", [flat(0)]), "a0.xyz: extension"),
        (lambda: wf.save_animation("a{{.png", [flat(0)]), "has no place for a number"),
        (lambda: wf.save_animation("a{name}.png", [flat(0)]), "no pattern for numbers"),
        (lambda: wf.save_animation("a.gif", [flat(0), flat(0, (3, 3))]), "one size, got 6x4 and 3x3"),
    ],
)
def test_errors(call, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(wf.SceneError, match=message):
        call()
    assert not list(tmp_path.iterdir())


def test_each_view_is_what_render_gives() -> None:
    cameras = [look(0, 0, 4), look(4, 1, 0)]
    views = list(wf.render_many(SCENE, cameras, 4, seed=3, progress=False))
    for camera, image in zip(cameras, views, strict=True):
        assert np.array_equal(image.rgb, wf.render(SCENE, 4, camera=camera, seed=3, progress=False).rgb)


def test_the_scene_is_compiled_once(calls_of: Any) -> None:
    calls = calls_of("wavefront.drive.prepared_scene.compile_scene")
    assert len(list(wf.render_many(SCENE, wf.turntable(SCENE, 5, size=(8, 8)), 1, progress=False))) == 5
    assert len(calls) == 1


@pytest.mark.parametrize("extension", [".gif", ".png", pytest.param(".mp4", marks=pytest.mark.slow)])
def test_animations_are_read_back(extension: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{extension}"
    values = (0.0, 0.2, 0.6, 1.0)
    assert wf.save_animation(path, (flat(v, (32, 16)) for v in values), fps=10) == 4
    frames = iio.imread(path, plugin="pyav" if extension == ".mp4" else None)
    assert frames.shape == (4, 16, 32, 3)
    expected = [flat(v).to_uint8()[0, 0, 0] for v in values]
    assert np.abs(frames[:, 8, 16, 0].astype(int) - expected).max() <= (6 if extension == ".mp4" else 0)


@pytest.mark.slow
def test_a_video_is_written_frame_by_frame(tmp_path: Path) -> None:
    """Its memory does not grow with the number of images: an hour of HD would take half a terabyte."""
    codes, peaks = 160 * 120 * 3, []
    for count in (10, 60):
        tracemalloc.start()
        wf.save_animation(tmp_path / "a.mp4", (flat(0.5, (160, 120)) for _ in range(count)))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 10 * codes


def test_numbered_files(tmp_path: Path) -> None:
    pattern = str(tmp_path / "frame_{:03d}.exr")
    wf.save_animation(pattern, (flat(v) for v in (0.25, 0.5)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame_000.exr", "frame_001.exr"]
    assert (wf.Image.load(tmp_path / "frame_001.exr").rgb == 0.5).all()


ENDS = [KeyboardInterrupt(), wf.Interrupted("stop", flat(0.5)), wf.RenderError("failed", flat(0.5))]


@pytest.mark.parametrize("error", ENDS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("name", ["a.gif", "a{}.png"])
def test_images_before_an_error_are_saved(name: str, error: BaseException, tmp_path: Path) -> None:
    """So that Ctrl-C loses no more than one of many pictures; the error is of its kind still."""

    def images(values):
        yield from map(flat, values)
        raise error

    path = tmp_path / name
    kind = wf.RenderError if isinstance(error, wf.RenderError) else wf.Interrupted
    with pytest.raises(kind, match=r"(interrupted|stop|failed); .* has the 2 pictures before it") as caught:
        wf.save_animation(path, images((0.25, 0.75)))
    assert caught.value.image is getattr(error, "image", None)
    written = sorted(tmp_path.iterdir())
    assert [frame.shape for each in written for frame in iio.imread(each, index=...)] == [(4, 6, 3)] * 2
    for each in written:
        each.unlink()
    with pytest.raises(type(error)):
        wf.save_animation(path, images(()))
    assert not list(tmp_path.iterdir())


def test_the_command_writes_an_animation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    out = tmp_path / "spin.gif"
    arguments = ["--frames", "3", "--spp", "1", "--size", "16x12", "--lighting", "even", "--quiet"]
    assert main(["turntable", str(mesh), "-o", str(out), *arguments]) == 0
    assert iio.imread(out).shape == (3, 12, 16, 3)
    assert capsys.readouterr().out == f"{out}: 3 pictures\n"
    assert main(["turntable", str(mesh), "-o", str(tmp_path / "no" / "spin.gif")]) != 0

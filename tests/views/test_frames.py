"""Frames of scenes that move: each is the picture of its moment, whoever renders it, and however often."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from gltf_builder import Builder
from inside import main

import wavefront as wf

QUIET: Any = {"progress": False, "workers": 1}
SMALL: Any = {"size": (20, 16), "seed": 3, **QUIET}


def moved(x: float, y: float = 0, z: float = 0) -> Any:
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


SLIDE = wf.Keyframes([0, 2], [moved(-1), moved(1)])


def ball(**more: Any) -> wf.Sphere:
    return wf.Sphere((0, 0, 0), 0.5, material=wf.Diffuse((0.8, 0.3, 0.2)), **more)


def moving(**more: Any) -> wf.Scene:
    still = wf.Box((0, -1, 0), 1)
    return wf.Scene([ball().transformed(SLIDE), still], [wf.Environment(1)], **more)


def bits(image: wf.Image) -> bytes:
    return image.rgb.tobytes()


def lonely() -> wf.Scene:
    """Without light, camera and ground, which are chosen."""
    return wf.Scene([wf.Box((0, 0, 0), 1).transformed(SLIDE), wf.Box((0, -2, 0), 1)])


def seen() -> wf.Scene:
    """In which the camera alone moves."""
    path = wf.Keyframes([0, 2], [moved(-1, 0, 5), moved(1, 1, 5)])
    return wf.Scene([ball()], [wf.Environment(1)], wf.Camera.from_matrix(path, 30, size=(20, 16)))


def lit() -> wf.Scene:
    lamp = wf.PointLight((0, 2, 2), 20).transformed(SLIDE)
    return wf.Scene([ball(), wf.Box((0, -1, 0), 1)], [lamp])


@pytest.mark.parametrize("make", [moving, lonely, seen, lit])
def test_each_frame_is_what_render_gives(make: Any) -> None:
    scene, times = make(), [0, 0.5, 0.5, 1.75]
    frames = list(wf.render_frames(scene, times, 4, **SMALL))
    due = [wf.render(make().at(each), 4, **SMALL) for each in times]
    assert [bits(each) for each in frames] == [bits(each) for each in due]
    assert bits(frames[0]) != bits(frames[3])


def test_frames_of_a_function_of_time() -> None:
    def spin(time: float) -> Any:
        return [wf.Box((0, 0, 0), 1).rotated("y", 90 * time), wf.Environment(1)]

    frames = list(wf.render_frames(spin, [0, 0.5], 4, **SMALL))
    assert [bits(each) for each in frames] == [bits(wf.render(spin(each), 4, **SMALL)) for each in (0, 0.5)]
    colored = next(wf.render_frames(lambda time: wf.Box((0, 0, 0), 1), [0], 4, material="gold", **SMALL))
    assert bits(colored) == bits(wf.render(wf.Box((0, 0, 0), 1), 4, material="gold", **SMALL))


def test_a_function_may_change_what_it_returned_before() -> None:
    box, still = wf.Box((0, 0, 0), 1), wf.Box((0, -2, 0), 1)
    scene = wf.Scene([box, still], [wf.Environment(1)])
    corners = box.vertices.copy()

    def lifted(time: float) -> wf.Scene:
        box.vertices[:, 1] = corners[:, 1] + time
        return scene

    frames = [bits(each) for each in wf.render_frames(lifted, [0, 1], 2, **SMALL)]
    assert frames == [bits(wf.render(lifted(each), 2, **SMALL)) for each in (0, 1)]
    assert frames[0] != frames[1]


def test_a_given_camera_moves_too() -> None:
    path = wf.Keyframes([0, 2], [moved(-1, 0, 5), moved(1, 0, 5)])
    camera = wf.Camera.from_matrix(path, 30, size=(20, 16))
    frames = list(wf.render_frames(moving(), [0, 1], 2, camera=camera, **QUIET))
    for each, image in zip((0, 1), frames, strict=True):
        assert bits(image) == bits(wf.render(moving().at(each), 2, camera=camera.at(each), **QUIET))


def test_a_shutter_is_open_around_the_time_of_a_frame() -> None:
    frames = list(wf.render_frames(moving(), [0.5, 1], 4, fps=2, shutter=0.5, **SMALL))
    for each, image in zip((0.5, 1), frames, strict=True):
        due = wf.render(moving(), 4, shutter=(each - 0.125, each + 0.125), **SMALL)
        assert bits(image) == bits(due)
        assert bits(image) != bits(wf.render(moving().at(each), 4, **SMALL))


@pytest.mark.parametrize(
    ("fps", "due"),
    [(None, 6), (8, 2), (0.1, 1), (12, 3)],
)
def test_times_by_frames_per_second(fps: float | None, due: int) -> None:
    scene = wf.Scene(
        [ball().transformed(wf.Keyframes([1, 1.25], [moved(-1), moved(1)]))], [wf.Environment(1)]
    )
    frames = list(wf.render_frames(scene, fps=fps, spp=1, **{**SMALL, "size": (2, 2)}))
    assert len(frames) == due
    last = 1 + (due - 1) / (fps or 24)
    assert bits(frames[-1]) == bits(wf.render(scene.at(last), 1, **{**SMALL, "size": (2, 2)}))


def test_only_what_moves_is_built_anew(calls_of: Any) -> None:
    compiled = calls_of("wavefront.drive.prepared_scene.compile_scene")
    built = calls_of("wavefront.accel.cache.make_accelerator")
    list(wf.render_frames(seen(), [0, 1, 2], 1, **QUIET))
    assert (len(compiled), len(built)) == (1, 1)
    list(wf.render_frames(lit(), [0, 1, 2], 1, **SMALL))
    assert (len(compiled), len(built)) == (4, 2)  # the tree is kept where a light moves
    list(wf.render_frames(lambda time: lit().at(time), [0, 1, 2], 1, **SMALL))
    assert (len(compiled), len(built)) == (7, 3)


def beside_a_wall(**more: Any) -> wf.Scene:
    """A box that moves up over the top of a wall of 128 triangles."""
    wall = np.concatenate([wf.Rectangle((k, 0, -1), (1, 0, 0), (0, 1, 0)).vertices for k in range(64)])
    faces = np.arange(256).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    rise = wf.Keyframes([0, 2], [moved(0, 0.1), moved(0.3, 2)])
    shapes = [wf.Mesh(wall - (32, 0, 0), faces), wf.Box((0, 0, 0), 1).transformed(rise)]
    camera = wf.Camera.look_at((0, 1, 5), (0, 1, 0), fov=40, size=(20, 16))
    return wf.Scene(shapes, [wf.Environment(1)], camera, **more)


@pytest.mark.parametrize("accel", ["numpy", "auto"])
@pytest.mark.parametrize("shutter", [None, 0.5])
def test_the_tree_of_what_stands_still_is_kept(
    accel: str, shutter: float | None, calls_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wavefront.accel.apart.LEAST", 100)
    built = calls_of("wavefront.accel.cache.make_accelerator")
    times = [0, 0.5, 1.75]
    given: Any = {"shutter": shutter, "accel": accel, **QUIET}
    frames = list(wf.render_frames(beside_a_wall(), times, 2, **given))
    assert [len(call.args[0].triangles) for call in built].count(128) == 1
    for each, image in zip(times, frames, strict=True):
        if shutter is None:
            due = wf.render(beside_a_wall().at(each), 2, accel=accel, **QUIET)
        else:
            opened = each - shutter / 48, each + shutter / 48
            due = wf.render(beside_a_wall(), 2, accel=accel, **{**QUIET, "shutter": opened})
        assert bits(image) == bits(due)
    monkeypatch.setattr("wavefront.accel.apart.LEAST", 1000)
    joined = wf.render(beside_a_wall().at(0.5), 2, accel=accel, **QUIET)
    if shutter is None:
        np.testing.assert_allclose(frames[1].rgb, joined.rgb, rtol=1e-4)


def test_moments_of_a_scene_share_its_trees_as_in_the_viewer(
    calls_of: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wavefront.accel.apart.LEAST", 100)
    built = calls_of("wavefront.accel.cache.make_accelerator")
    scene = beside_a_wall()
    for each in (0, 1.25, 0.5):
        wf.Session(scene.at(each), 1, **QUIET).close()
    assert [len(call.args[0].triangles) for call in built] == [128, 12, 12, 12]


def test_files_are_read_once(tmp_path: Path, calls_of: Any) -> None:
    path = animated(tmp_path / "a.gltf")
    reads = calls_of("wavefront.io.load.read")
    frames = list(wf.render_frames(path, [0, 1], 2, animation="Go", **SMALL))
    assert len(reads) == 1
    for each, image in zip((0, 1), frames, strict=True):
        assert bits(image) == bits(wf.render(wf.load(path, time=each, animation="Go"), 2, **SMALL))


def animated(path: Path) -> Path:
    build = Builder().mesh()
    keys = build.accessor(np.float32([0, 1]))
    places = build.accessor(np.float32([[0, 0, 0], [0, 0, 1]]))
    clip = {
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": keys, "output": places}],
    }
    build.json["animations"] = [clip, {**clip, "name": "Go"}]
    return Path(build.gltf(path))


# --- Checkpoints ----------------------------------------------------------------------------------------


def test_frames_go_on_where_they_ended(tmp_path: Path, calls_of: Any) -> None:
    kept = {**SMALL, "checkpoint": str(tmp_path / "f_{:02d}.wfck")}
    times = [0, 0.5, 1]
    due = [bits(each) for each in wf.render_frames(moving(), times, 4, **SMALL)]
    begun = wf.render_frames(moving(), times, 4, **kept)
    assert [bits(next(begun)), bits(next(begun))] == due[:2]
    begun.close()
    traced = calls_of("wavefront.drive.tracing._trace_wave")
    assert [bits(each) for each in wf.render_frames(moving(), times, 4, **kept)] == due
    assert len(traced) == 1
    assert sorted(each.name for each in tmp_path.iterdir()) == ["f_00.wfck", "f_01.wfck", "f_02.wfck"]


def test_the_time_is_part_of_a_checkpoints_identity(tmp_path: Path) -> None:
    hidden = wf.Scene([ball(), wf.Box((0, 0, 0), 0.1).transformed(wf.Keyframes([0, 1], [moved(0)] * 2))])
    kept = {**SMALL, "checkpoint": str(tmp_path / "a.wfck")}
    wf.render(hidden.at(0.25), 2, **kept)
    wf.render(hidden.at(0.25), 4, **kept)
    with pytest.raises(wf.SceneError, match=r"time was 0\.25 and is 0\.5"):
        wf.render(hidden.at(0.5), 4, **kept)


KILLED = """
import sys, numpy as np, wavefront as wf
places = np.tile(np.eye(4), (2, 1, 1)); places[1, 0, 3] = 1
shapes = [wf.Sphere((0, 0, 0), 1).transformed(wf.Keyframes([0, 1], places)), wf.Box((0, -2, 0), 1)]
scene = wf.Scene(shapes, [wf.Environment(1)])
kept = {"checkpoint": sys.argv[1], "checkpoint_interval": 0.01} if len(sys.argv) > 1 else {}
for image in wf.render_frames(scene, fps=3, spp=256, size=(96, 96), progress=False, workers=1, **kept):
    print(image.rgb.tobytes().hex()[:4000], flush=True)
"""


@pytest.mark.slow
def test_killed_frames_go_on_with_the_same_bits(tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen([sys.executable, "-c", KILLED, *arguments], stdout=subprocess.PIPE, text=True)

    whole = run().communicate()[0]
    pattern = str(tmp_path / "f{}.wfck")
    for delay in (0.4, 0.8, 0.6):
        process = run(pattern)
        assert process.stdout is not None
        process.stdout.readline()  # a frame is done
        time.sleep(delay)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
    assert run(pattern).communicate()[0] == whole


# --- Frames as jobs -------------------------------------------------------------------------------------


def executors() -> Iterator[Any]:
    yield lambda: ThreadPoolExecutor(2)
    spawn = multiprocessing.get_context("spawn")
    yield pytest.param(lambda: ProcessPoolExecutor(2, spawn), marks=pytest.mark.slow)
    yield pytest.param(_dask, marks=pytest.mark.slow)


def _dask() -> Any:
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0")
    return distributed.Client(cluster)


@pytest.mark.parametrize("make", list(executors()))
def test_workers_of_an_executor_render_frames(make: Any) -> None:
    times = [0, 0.5, 1, 1.5, 2]
    given = {name: value for name, value in SMALL.items() if name != "workers"}
    due = [bits(each) for each in wf.render_frames(moving(), times, 4, **SMALL)]
    with make() as executor:
        frames = [bits(each) for each in wf.render_frames(moving(), times, 4, executor=executor, **given)]
        assert frames == due
        kept = {**given, "executor": executor}
        of_function = wf.render_frames(lambda time: moving().at(time), times[:2], 4, **kept)
        assert [bits(each) for each in of_function] == due[:2]
    assert [
        bits(each) for each in wf.render_frames(moving(), times, 4, executor=ThreadPoolExecutor, **given)
    ] == due


def test_the_scene_is_sent_once(calls_of: Any) -> None:
    sent = calls_of("wavefront.workers.remote.pack")
    with ProcessPoolExecutor(1) as executor:
        list(wf.render_frames(moving(), [0, 1, 2], 1, executor=executor, size=(4, 4), progress=False))
    assert len(sent) == 1


def test_errors_of_workers_reach_the_caller() -> None:
    def broken(time: float) -> Any:
        raise wf.SceneError(f"nothing at {time:g}")

    for executor in (None, ThreadPoolExecutor):
        with pytest.raises(wf.SceneError, match="nothing at 3"):
            list(wf.render_frames(broken, [3], 1, executor=executor, progress=False))


# --- Progress, errors and the command line --------------------------------------------------------------


def test_progress_counts_frames() -> None:
    told: list[tuple[float, float]] = []
    list(
        wf.render_frames(
            moving(), [0, 1, 2], 1, size=4, progress=lambda done, total: told.append((done, total))
        )
    )
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_the_bar_says_how_much_time_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("wavefront.core.progress.DELAY", 0)
    list(wf.render_frames(moving(), [0, 1, 2], 1, size=4, progress=True, workers=1))
    shown = capsys.readouterr().err
    assert "3/3" in shown
    assert "frame" in shown


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.render_frames(moving(), []), "times is empty"),
        (lambda: wf.render_frames(moving(), [0, np.inf]), r"times\[1\] is inf"),
        (lambda: wf.render_frames(moving(), 3), r"times must have shape \(n,\)"),
        (lambda: wf.render_frames(moving(), fps=0), "fps is 0; it must be above 0"),
        (lambda: wf.render_frames(moving(), [0], shutter=0), "shutter is 0; it must be above 0"),
        (lambda: wf.render_frames(moving(), [0], shutter=(0, 1)), "shutter must be a number"),
        (lambda: wf.render_frames(moving(), fps=1e9), "makes 2000000000 frames; there may be 1000000"),
        (
            lambda: wf.render_frames(lambda time: moving(), spp=1),
            "source is a function of time; give its times",
        ),
        (lambda: wf.render_frames(lambda time: moving(), [0], animation=1), "animation is for files"),
        (lambda: wf.render_frames(moving(), [0], 0), "spp is 0"),
        (lambda: wf.render_frames(moving(), [0], checkpoint="a.wfck"), "has no place for a number"),
        (lambda: wf.render_frames(moving(), [0], executor="thread"), "executor is 'thread'"),
        (lambda: wf.render_frames(moving(), [0], executor=3), "executor"),
        (lambda: wf.render_frames(lambda time: 3, [0], 1), "cannot render int"),
        (lambda: wf.render_frames("a.obj", [0]), "a.obj"),
    ],
)
def test_errors(make: Any, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(wf.SceneError, match=message):
        next(make())


OPTIONS = ["--spp", "1", "--size", "16x12", "--lighting", "even", "--quiet"]


def test_the_command_writes_what_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = str(animated(tmp_path / "a.gltf")), tmp_path / "a.gif"
    assert main(["animate", path, "-o", str(out), "--fps", "4", "--animation", "Go", *OPTIONS]) == 0
    assert iio.imread(out).shape == (4, 12, 16, 3)
    assert capsys.readouterr().out == f"{out}: 4 pictures\n"
    numbered = str(tmp_path / "f_{}.png")
    assert (
        main(["animate", path, "-o", numbered, "--fps", "2", "--end", "2", "--start", "0.5", *OPTIONS]) == 0
    )
    assert sorted(each.name for each in tmp_path.glob("f_*")) == ["f_0.png", "f_1.png", "f_2.png"]


def test_the_command_turns_the_view_meanwhile(tmp_path: Path) -> None:
    path, places = str(animated(tmp_path / "a.gltf")), []
    for turn in ("0", "180", "360"):
        pattern = str(tmp_path / f"t{turn}_{{}}.npz")
        assert main(["animate", path, "-o", pattern, "--fps", "2", "--turntable", turn, *OPTIONS]) == 0
        places.append([wf.Image.load(pattern.format(k)).rgb for k in (0, 1)])
    assert (places[0][1] != places[1][1]).any()
    out = str(tmp_path / "blurred_{}.npz")
    assert main(["animate", path, "-o", out, "--fps", "2", "--shutter", "1", *OPTIONS]) == 0
    assert (wf.Image.load(out.format(0)).rgb != places[0][0]).any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--end", "-1"], "--end is -1, before the start at 0 s"),
        (["--time", "1"], "--time is one moment; give --start and --end"),
        (["--animation", "Gone"], "it must be one of 0, Go"),
        (["--animation", "7"], "animation is 7; it must be at least 0 and below 2"),
        (["--end", "0"], "nothing moves for longer than a picture; give --turntable or --end"),
        (["--fps", "0"], "fps is 0"),
        (["--shutter", "0"], "shutter is 0.0; it must be above 0"),
        (["-o", "a.webm"], "extension is '.webm'"),
    ],
)
def test_errors_of_the_command(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(animated(tmp_path / "a.gltf"))
    assert main(["animate", path, *OPTIONS, *arguments]) == 2
    assert message in capsys.readouterr().err


def test_commands_render_a_moment(tmp_path: Path) -> None:
    path, out = animated(tmp_path / "a.gltf"), str(tmp_path / "a.npz")
    assert main(["render", str(path), "-o", out, "--time", "0.5", "--animation", "1", *OPTIONS]) == 0
    found = wf.Image.load(out).rgb
    due = wf.render(wf.load(path, time=0.5), 1, size=(16, 12), lighting="even", **QUIET)
    np.testing.assert_array_equal(found, due.rgb)


def test_info_says_what_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(animated(tmp_path / "a.gltf"))]) == 0
    assert "\nmoves: from 0 to 1 s; animations '0', 'Go'\n" in capsys.readouterr().out

"""What moves has the same bits whoever renders it: workers, waves, checkpoints, kill -9, parts that merge."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavefront as wf

SHUTTER = (0.1, 0.9)
OPTIONS: dict[str, Any] = {
    **{"progress": False, "accel": "numpy", "branches": 1, "reuse": False, "shutter": SHUTTER},
    "aovs": ("alpha", "depth", "direct"),
}


def way(*shift: float, degrees: float = 0) -> wf.Keyframes:
    """A motion that turns about y and goes along a line, in a second."""
    turn, there = np.radians(degrees), np.eye(4)
    there[0, 0] = there[2, 2] = np.cos(turn)
    there[0, 2], there[2, 0] = np.sin(turn), -np.sin(turn)
    there[:3, 3] = shift
    return wf.Keyframes([0, 1], [np.eye(4), there])


BOX = wf.Box((0, 0, 0), 0.8, material=wf.Diffuse((0.3, 0.7, 0.2)))
MELTS = wf.Mesh(
    np.stack([BOX.vertices, BOX.vertices * (1, 0.4, 1) + (0.6, 0, 0)]), BOX.faces, times=[0, 1], smooth=True
)
FLOOR = wf.Rectangle((-3, -0.6, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))
VIEW = wf.Camera.look_at((0, 2, 6), (0, 0, 0), fov=40, size=(16, 12))
MOVING_VIEW = VIEW.transformed(way(0.3, -0.1, -0.2, degrees=3))
LAMP = wf.PointLight((-1.5, 2, 1.5), 20)
PANEL = wf.Rectangle((-0.4, 1.2, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=8)
DOME = wf.Environment(np.random.default_rng(1).random((4, 8, 3)) ** 3, backdrop=(0.1, 0.2, 0.3))
CLEAR = wf.Sky.cie(12, (1, 1, 0.5), horizontal=1, direct_normal=0.5)
GOES = way(1, 0.2, 0.5, degrees=70)


def scenes() -> dict[str, wf.Scene]:
    """Scenes in which something moves, by its name; built anew, as another process would."""
    return {
        "camera": wf.Scene([FLOOR, BOX], [LAMP], MOVING_VIEW),
        "instance": wf.Scene([FLOOR, BOX.transformed(GOES)], [LAMP], VIEW),
        "deforming": wf.Scene([FLOOR, MELTS], [LAMP], VIEW),
        "spheres": wf.Scene([FLOOR, wf.Spheres([[(0, 0, 0)], [(1, 0, 0)]], 0.5, times=[0, 1])], [LAMP], VIEW),
        "light": wf.Scene([FLOOR, BOX], [LAMP.transformed(GOES)], VIEW),
        "panel": wf.Scene([FLOOR, BOX, PANEL.transformed(GOES)], [], VIEW),
        "rows": wf.Scene([FLOOR, BOX.transformed(GOES)], [LAMP], VIEW.replace(rolling_shutter=0.3)),
        "sky": wf.Scene([FLOOR, BOX], [DOME.transformed(GOES), CLEAR.transformed(GOES)], VIEW),
        "all": wf.Scene(
            [FLOOR, BOX.transformed(GOES), MELTS.translated((-1, 0, 0)), PANEL.transformed(GOES)],
            [LAMP.transformed(way(0, 1, 0)), DOME.transformed(GOES)],
            MOVING_VIEW.replace(rolling_shutter=0.1),
        ),
    }


def digest(image: wf.Image) -> str:
    """SHA-256 of all that an image holds."""
    parts = [image.rgb, image.variance, image.counts, *(image.layers[name] for name in sorted(image.layers))]
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


def drawn(name: str, spp: int | None = 5, **options: Any) -> wf.Image:
    """Render a scene."""
    return wf.render(scenes()[name], spp, **{**OPTIONS, "workers": 1, **options})


@pytest.fixture(scope="module")
def alone() -> Any:
    """Return the bits of one worker, by the name of the scene and the accelerator."""
    found: dict[tuple[str, str], str] = {}

    def bits(name: str, accel: str = "numpy") -> str:
        if (name, accel) not in found:
            found[name, accel] = digest(drawn(name, accel=accel, executor="threads"))
        return found[name, accel]

    return bits


# --- Workers ------------------------------------------------------------------------------------------


WORKERS: list[dict[str, Any]] = [
    {"wave_size": 61},
    {"workers": 3, "executor": "threads", "wave_size": 100},
    {"workers": 2, "executor": "processes", "wave_size": 200},
]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers that are forked")
@pytest.mark.parametrize("how", WORKERS)
@pytest.mark.first(1)
def test_any_workers_and_waves_give_the_same_bits(how: dict[str, Any], alone: Any) -> None:
    assert digest(drawn("all", **how)) == alone("all")


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["numpy", "embree"])
@pytest.mark.parametrize("name", scenes())
@pytest.mark.parametrize("how", [*WORKERS, {"workers": 8, "executor": "processes", "wave_size": 37}])
def test_each_kind_of_motion_has_the_same_bits(how: Any, name: str, accel: str, alone: Any) -> None:
    assert digest(drawn(name, accel=accel, **how)) == alone(name, accel)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["spawn", "forkserver", "loky", "dask"])
def test_executors_are_sent_what_moves(kind: str, alone: Any) -> None:
    plain: dict[str, Any] = {"wave_size": 200}
    if kind == "dask":
        distributed = pytest.importorskip("distributed")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0")
        with cluster, distributed.Client(cluster) as client:
            for name in scenes():
                assert digest(drawn(name, executor=client, workers=None, **plain)) == alone(name)
        return
    executor: Any = pytest.importorskip("loky").ProcessPoolExecutor if kind == "loky" else kind
    assert digest(drawn("all", executor=executor, workers=2, **plain)) == alone("all")


# --- Parts and checkpoints ----------------------------------------------------------------------------


def test_parts_merge_to_the_bits_of_one_render() -> None:
    whole = drawn("all", 9)
    parts = [drawn("all", None, samples=range(*cut), wave_size=150) for cut in pairwise((0, 2, 5, 9))]
    merged = parts[2].merge(parts[0]).merge(parts[1])
    assert merged.rgb.tobytes() == whole.rgb.tobytes()
    for name, layer in whole.layers.items():
        assert merged.layers[name].tobytes() == layer.tobytes()
    other = drawn("all", None, samples=range(9, 12), shutter=(0.1, 0.8))
    with pytest.raises(wf.SceneError, match=r"different renders .*: shutter was"):
        merged.merge(other)


def stopped_after(samples: int, path: Path, name: str, **options: Any) -> None:
    """Render a scene until so many samples are done, then as at Ctrl-C."""

    def progress(done: float, total: float) -> None:
        if done >= samples:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted):
        drawn(name, checkpoint=path, **{**options, "progress": progress})


@pytest.mark.parametrize("name", ["all", *(pytest.param(n, marks=pytest.mark.slow) for n in scenes())])
def test_a_render_that_is_stopped_goes_on_with_the_same_bits(tmp_path: Path, name: str, alone: Any) -> None:
    stopped_after(350, tmp_path / "a", name, wave_size=100)
    part = wf.Image.load(tmp_path / "a").metadata["samples"]
    assert 0 < part < 5 * 16 * 12
    again = drawn(name, checkpoint=tmp_path / "a", wave_size=300, workers=2, executor="threads")
    assert digest(again) == alone(name)


def closes_slowly(u: Any, power: float = 0.5) -> Any:
    """A curve of one's own."""
    return 1 - (1 - u) ** power


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shutter": (0.1, 0.8)}, r"shutter was \[0.1, 0.9\] and is \[0.1, 0.8\]"),
        ({"shutter": None}, r"shutter was \[0.1, 0.9\] and is None"),
        ({"shutter_curve": "triangle"}, "shutter_curve was 'box' and is 'triangle'"),
        ({"shutter_curve": partial(closes_slowly, power=0.4)}, "shutter_curve"),
        ({"camera": VIEW.transformed(way(0.3, -0.1, -0.2))}, "the camera differs"),
        ({"camera": MOVING_VIEW.replace(rolling_shutter=0.01)}, "the camera differs"),
    ],
)
def test_other_times_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    drawn("camera", 1, checkpoint=tmp_path / "a")
    with pytest.raises(wf.SceneError, match=message):
        drawn("camera", 2, checkpoint=tmp_path / "a", **changes)


def test_another_curve_of_ones_own_is_refused(tmp_path: Path) -> None:
    drawn("camera", 1, checkpoint=tmp_path / "a", shutter_curve=partial(closes_slowly, power=0.4))
    drawn("camera", 2, checkpoint=tmp_path / "a", shutter_curve=partial(closes_slowly, power=0.4))
    with pytest.raises(wf.SceneError, match="the code of the shutter_curve differs"):
        drawn("camera", 3, checkpoint=tmp_path / "a", shutter_curve=partial(closes_slowly, power=0.3))


def test_another_motion_is_refused(tmp_path: Path) -> None:
    """Of anything that moves, also where the scene of its start is the same."""
    late = np.stack([BOX.vertices, BOX.vertices * (1, 0.4, 1) + (0.601, 0, 0)])
    others = {
        "instance": wf.Scene([FLOOR, BOX.transformed(way(1, 0.2, 0.5, degrees=71))], [LAMP], VIEW),
        "deforming": wf.Scene([FLOOR, wf.Mesh(late, BOX.faces, times=[0, 1], smooth=True)], [LAMP], VIEW),
        "light": wf.Scene([FLOOR, BOX], [LAMP.transformed(way(1, 0.2, 0.5, degrees=71))], VIEW),
        "sky": wf.Scene(
            [FLOOR, BOX], [DOME.transformed(GOES), CLEAR.transformed(way(1, 0.2, 0.5, degrees=71))], VIEW
        ),
    }
    for name, other in others.items():
        drawn(name, 1, checkpoint=tmp_path / name)
        drawn(name, 2, checkpoint=tmp_path / name)
        with pytest.raises(wf.SceneError, match="another render: the scene differs"):
            wf.render(other, 2, **OPTIONS, workers=1, checkpoint=tmp_path / name)


# --- kill -9 ------------------------------------------------------------------------------------------


KILLED = """
import sys
sys.path[:0] = sys.argv[1:3]
import test_same_bits_with_time as here
more = {"checkpoint": sys.argv[4], "checkpoint_interval": 0.02} if len(sys.argv) > 4 else {}
for name in sys.argv[3].split(","):
    print(here.digest(here.drawn(name, 400, wave_size=2000, **more)), flush=True)
"""


def started(name: str, *checkpoint: str) -> subprocess.Popen[str]:
    """Render a scene in another process, which prints the digest at the end."""
    here = Path(__file__).parent
    command = [sys.executable, "-c", KILLED, str(here), str(here.parents[1]), name, *checkpoint]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("name", scenes())
def test_kill_9_costs_no_bit(name: str, tmp_path: Path) -> None:
    """At three moments, each some time after a checkpoint was written."""
    whole, path, kills = started(name).communicate()[0], tmp_path / "a.wfck", 0
    while kills < 3:
        before = path.stat().st_mtime_ns if path.exists() else None
        process = started(name, str(path))
        while process.poll() is None and before == (path.stat().st_mtime_ns if path.exists() else None):
            time.sleep(0.005)
        time.sleep(0.07 * kills)
        if process.poll() is not None:
            break  # done
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
        kills += 1
    assert kills
    assert 0 < wf.Image.load(path).metadata["samples"] <= 400 * 16 * 12
    assert started(name, str(path)).communicate()[0] == whole

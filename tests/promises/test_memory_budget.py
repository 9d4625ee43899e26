"""`max_memory`: what it accepts, how it sizes waves and workers, and no bit of a picture depends on it."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import (
    LANE_BYTES,
    LARGE_WAVE,
    LEAST_WAVE,
    PROCESS_BYTES,
    SMALL_WAVE,
    THREAD_BYTES,
    Settings,
    li_full,
    make_budget,
    memory_size,
    picture_memory,
    plan,
    resident_memory,
)
from inside import drive_Budget as Budget

import wavefront as wf

MEGABYTE = 10**6
PEAKS = Path(__file__).parents[2] / "benchmarks" / "memory.py"


def budget(
    max_memory: int | None,
    size: tuple[int, int],
    workers: int,
    wave_size: int | None,
    layers: tuple[str, ...] = (),
    executor: str = "processes",
) -> Budget:
    settings = Settings(max_memory=max_memory, workers=workers, wave_size=wave_size)
    return make_budget(settings, size, executor, layers)


@pytest.mark.parametrize(
    ("value", "size"),
    [
        (1, 1),
        (2e9, 2_000_000_000),
        (np.int64(7), 7),
        ("12345", 12345),
        ("2GB", 2_000_000_000),
        ("2 gb", 2_000_000_000),
        ("1.5GiB", 3 << 29),
        (".5 TB", 500_000_000_000),
        ("800MB", 800_000_000),
        ("800MiB", 800 << 20),
        ("64 KB", 64_000),
        ("64kib", 65_536),
        ("9B", 9),
    ],
)
def test_sizes(value: Any, size: int) -> None:
    assert memory_size("max_memory", value) == size


@pytest.mark.parametrize(
    "value", [0, -1, "", "GB", "2 XB", "-1GB", "1e3MB", float("nan"), float("inf"), True, [2]]
)
def test_other_sizes_are_refused_before_work(value: Any) -> None:
    with pytest.raises(wf.SceneError, match=r'max_memory is .*; it must be a number of bytes, or .* "2GB"'):
        wf.render("no such file", max_memory=value)


@pytest.fixture
def in_use(monkeypatch: pytest.MonkeyPatch) -> int:
    """Return the bytes that this process has in use."""
    monkeypatch.setattr(plan, "resident_memory", lambda: 100 * MEGABYTE)
    return 100 * MEGABYTE


def test_memory_sizes_waves_first_and_then_workers(in_use: int) -> None:
    """With much memory waves are as large as pays; with little there are fewer workers, then small waves."""
    free = budget(None, (640, 480), 4, None)
    assert (free.workers, free.wave_size) == (4, LARGE_WAVE)
    ample = budget(10**12, (640, 480), 4, None)
    assert (ample.workers, ample.wave_size) == (4, SMALL_WAVE)
    assert budget(10**12, (640, 480), 4, 500).wave_size == 500
    before = free
    for megabytes in range(2000, 300, -20):
        found = budget(megabytes * MEGABYTE, (640, 480), 4, None)
        used = found.workers * (PROCESS_BYTES + found.wave_size * LANE_BYTES)
        assert in_use + picture_memory((640, 480)) + used <= megabytes * MEGABYTE
        assert found.workers <= before.workers
        assert found.workers < before.workers or found.wave_size <= before.wave_size
        before = found
    assert before.workers == 1
    assert LEAST_WAVE <= before.wave_size < LARGE_WAVE


def test_what_cannot_fit_is_refused_with_the_figures() -> None:
    """Before any work: the scene is not even compiled."""
    shape: Any = wf.Sphere((0, 0, 0), 1)
    shape.material = None  # compiling it would fail
    scene = wf.Scene(shape, [wf.Environment(1.0)])
    scene.camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(4096, 2048))
    message = (
        r"max_memory is 1,000 MB; [\d,]+ MB are needed: [\d,]+ MB are in use already, "
        r"2,399 MB are for a picture of 4096x2048 pixels, and \d+ MB for one worker"
    )
    with pytest.raises(wf.SceneError, match=message):
        wf.render(scene, 1, max_memory="1GB")


def test_layers_count(in_use: int) -> None:
    limit = in_use + picture_memory((640, 480)) + PROCESS_BYTES + 40 * MEGABYTE
    plain, layered = (budget(limit, (640, 480), 1, None, layers) for layers in ((), ("direct", "indirect")))
    assert layered.wave_size < plain.wave_size
    with pytest.raises(wf.SceneError, match="are needed"):
        wf.render(scenes.everything(), 1, size=(2000, 1500), max_memory="1.1GB", aovs="all", progress=False)


def test_the_least_memory_that_is_named_is_enough(in_use: int) -> None:
    least = in_use + picture_memory((64, 64)) + THREAD_BYTES + LEAST_WAVE * LANE_BYTES
    found = budget(least, (64, 64), 8, None, executor="threads")
    assert (found.workers, found.wave_size) == (1, LEAST_WAVE)
    with pytest.raises(wf.SceneError, match="are needed"):
        budget(least - 1, (64, 64), 8, None, executor="threads")


@pytest.mark.parametrize("executor", ["threads", pytest.param("processes", marks=pytest.mark.slow)])
def test_no_bit_depends_on_the_budget(executor: str) -> None:
    options: dict[str, Any] = {"spp": 16, "executor": executor, "progress": False, "size": (64, 48)}
    scene, found = scenes.everything(), set()
    free = wf.render(scene, workers=1, **options)
    fixed = PROCESS_BYTES if executor == "processes" else THREAD_BYTES
    for room in (1, 3.5):
        spare = resident_memory() + picture_memory((64, 48)) + 5 * MEGABYTE
        image = wf.render(scene, workers=3, max_memory=int(spare + room * fixed + 30 * MEGABYTE), **options)
        found.add(image.metadata["workers"])
        assert image.rgb.tobytes() == free.rgb.tobytes()
    assert len(found) > 1, "all budgets gave the same number of workers"


class LimitedMemory:
    """The full integrator, for which there is memory for so many paths only."""

    def __init__(self, most: int, fails_at: int = 0) -> None:
        self.most, self.fails_at, self.calls = most, fails_at, 0
        self.lock = threading.Lock()

    def __call__(self, scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
        with self.lock:
            self.calls += 1
        if len(paths) > self.most and self.calls > self.fails_at:
            raise MemoryError("no room")
        return li_full(scene, paths, sampler, max_bounces)


@pytest.mark.parametrize(
    ("executor", "workers", "fails_at"),
    [("threads", 2, 3), ("processes", 2, 0), ("threads", 1, 0), ("processes", 1, 3)],
)
@pytest.mark.first(2)
def test_out_of_memory_halves_the_wave_and_goes_on(executor: str, workers: int, fails_at: int) -> None:
    """With the same bits, also when memory runs out in the middle of a render."""
    scene, options = scenes.everything(), {"spp": 6, "progress": False, "size": (24, 18)}
    expected = wf.render(scene, workers=1, integrator=LimitedMemory(10**9), **options)
    image = wf.render(
        scene,
        integrator=LimitedMemory(300, fails_at),
        executor=executor,
        workers=workers,
        wave_size=2000,
        **options,
    )
    assert image.metadata["samples"] == 6 * 24 * 18
    assert image.rgb.tobytes() == expected.rgb.tobytes()
    assert np.array_equal(image.standard_error, expected.standard_error)


def test_waves_stay_small_after_memory_ran_out() -> None:
    """So that not every wave is tried in vain."""
    integrator = LimitedMemory(300)
    options: dict[str, Any] = {"workers": 1, "executor": "threads", "size": (24, 18), "progress": False}
    wf.render(scenes.everything(), 6, integrator=integrator, wave_size=2000, **options)
    smallest = 125  # paths of a wave of 2000, halved while it is above 300, or of what was left of one
    assert integrator.calls < 6 * 24 * 18 / smallest + 10


def test_without_memory_for_a_few_paths_there_is_an_error() -> None:
    options: dict[str, Any] = {"workers": 1, "wave_size": 3000, "size": (40, 30), "progress": False}
    with pytest.raises(wf.RenderError, match="out of memory: no room") as caught:
        wf.render(scenes.everything(), 24, integrator=LimitedMemory(0), **options)
    assert caught.value.image is None
    with pytest.raises(wf.RenderError, match="out of memory: no room") as caught:
        wf.render(
            scenes.everything(), 24, integrator=LimitedMemory(0, fails_at=2), executor="threads", **options
        )
    assert caught.value.image.metadata["samples"] > 0


def test_a_session_sizes_each_picture() -> None:
    """A larger picture leaves less memory for waves; what cannot fit is refused, and the other goes on."""
    limit = resident_memory() + picture_memory((64, 64)) + 2 * PROCESS_BYTES + 60 * MEGABYTE
    with wf.Session(
        scenes.everything(), 2, size=(64, 64), workers=2, max_memory=limit, progress=False
    ) as session:
        with pytest.raises(wf.SceneError, match="for a picture of 2000x2000 pixels"):
            session.set_camera(None, size=(2000, 2000))
        image = session.run()
    assert image.metadata["samples"] == 2 * 64 * 64


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_the_peak_of_a_large_picture_does_not_grow_with_its_samples() -> None:
    """1920x1080 at 4 and 4096 samples, to the end: within 5 %, under 1 GB. Ten minutes on two quiet cores."""
    options = ["--scene", "sky", "--spp", "4", "4096", "--seconds", "7200"]
    limits = ["--max-memory", "1GB", "--workers", "2"]
    done = subprocess.run([sys.executable, PEAKS, *options, *limits], capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert "4096 of 4096 samples" in done.stdout
    few, many = [float(peak) for peak in re.findall(r"spp: peak ([\d,]+) MB", done.stdout)]
    assert max(few, many) < 1000
    assert max(few, many) / min(few, many) < 1.05

"""Executors of every kind: the same bits, the scene sent once, losses and differences noticed."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import Payload, WorkerPool, executors, jobs, machine, remote, worker_count

import wavefront as wf

needs_fork = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs fork")
QUIET = {"progress": False, "wave_size": 500}


@contextmanager
def forked(workers: int = 2) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes such as a user makes."""
    with ProcessPoolExecutor(workers, multiprocessing.get_context("fork")) as pool:
        pool.submit(int).result()
        yield pool


def pools_of(method: str) -> Callable[[int], Executor]:
    """Return a function that makes pools of processes."""
    return partial(ProcessPoolExecutor, mp_context=multiprocessing.get_context(method))


@pytest.fixture(scope="module")
def expected() -> bytes:
    """The bits of one worker."""
    image = wf.render(scenes.everything(), 8, workers=1, executor="threads", **QUIET)
    return image.rgb.tobytes()


@pytest.fixture
def folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Return where folders are made that are shared with workers."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


# --- The same bits --------------------------------------------------------------------------------


def test_workers_that_are_spawned(expected: bytes, folders: Path) -> None:
    image = wf.render(scenes.everything(), 8, workers=2, executor="spawn", **QUIET)
    assert image.rgb.tobytes() == expected
    assert (image.metadata["executor"], image.metadata["workers"]) == ("spawn", 2)
    assert not list(folders.iterdir())
    assert not multiprocessing.active_children()


@needs_fork
def test_an_executor_of_the_user_goes_on_after_the_render(expected: bytes, folders: Path) -> None:
    """All its workers are used, and it is neither shut down nor slowed."""
    with forked(3) as pool:
        before = threading.active_count()
        for _ in range(2):
            image = wf.render(scenes.everything(), 8, executor=pool, **QUIET)
            assert image.rgb.tobytes() == expected
        assert (image.metadata["executor"], image.metadata["workers"]) == ("ProcessPoolExecutor", 3)
        assert pool.submit(abs, -1).result() == 1
        assert threading.active_count() == before
        assert not list(folders.iterdir())
    with ThreadPoolExecutor(2) as threads:
        assert wf.render(scenes.everything(), 8, executor=threads, **QUIET).rgb.tobytes() == expected
        assert threads.submit(abs, -1).result() == 1


@needs_fork
def test_a_function_that_makes_pools_of_processes(expected: bytes) -> None:
    image = wf.render(scenes.everything(), 8, workers=2, executor=pools_of("fork"), **QUIET)
    assert image.rgb.tobytes() == expected
    assert not multiprocessing.active_children()


class InThisThread(Executor):
    """Does everything at once, so that it shares the memory of this process."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(function(*args, **options))
        return future


def test_an_executor_of_another_kind_is_asked_where_its_workers_are(expected: bytes) -> None:
    """Those in this process are sent nothing, so the filter need not be pickled."""
    lock = threading.Lock()

    def box(u: np.ndarray) -> np.ndarray:
        with lock:
            return u

    image = wf.render(scenes.everything(), 8, executor=InThisThread(), filter=box, **QUIET)
    assert image.rgb.tobytes() == expected


EVERY_EXECUTOR = ["threads", "processes", "spawn", "forkserver", "made spawn", "made forkserver", "loky"]


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["numpy", "auto"])
@pytest.mark.parametrize("workers", [1, 2, 3, 8])
@pytest.mark.parametrize("kind", EVERY_EXECUTOR)
def test_every_executor_gives_the_same_bits(kind: str, workers: int, accel: str) -> None:
    """For any number of workers, also where they build Embree's tree anew."""
    executor: Any = kind
    if kind.startswith("made "):
        executor = pools_of(kind.removeprefix("made "))
    if kind == "loky":
        executor = pytest.importorskip("loky").ProcessPoolExecutor
    scene, options = scenes.everything(), {"accel": accel, **QUIET}
    image = wf.render(scene, 8, workers=workers, executor=executor, **options)
    alone = wf.render(scene, 8, workers=1, executor="threads", **options)
    assert image.rgb.tobytes() == alone.rgb.tobytes()


@pytest.mark.slow
def test_pictures_come_while_it_renders() -> None:
    """Each is that of a shorter render; another view goes to the same workers."""
    with wf.Session(scenes.everything(), 8, workers=2, executor="spawn", **QUIET) as session:
        images = list(session)
        processes = {process.pid for process in multiprocessing.active_children()}
        session.set_camera(None, (10, 10))
        small = session.run()
        assert {process.pid for process in multiprocessing.active_children()} == processes
    assert len(processes) == 2
    assert [image.spp for image in images if image.spp in (1, 2, 4, 8)] == [1, 2, 4, 8]
    for image in images:
        alone = wf.render(scenes.everything(), image.spp, workers=1, **QUIET)
        assert image.rgb.tobytes() == alone.rgb.tobytes()
    alone = wf.render(scenes.everything(), 8, size=(10, 10), workers=1, **QUIET)
    assert small.rgb.tobytes() == alone.rgb.tobytes()


# --- The scene is sent once -----------------------------------------------------------------------


@needs_fork
def test_workers_that_cannot_read_the_file_are_sent_the_scene(expected, monkeypatch):
    def first(self: remote.FileDelivery, payload: Payload) -> Payload:
        return Payload(payload.token, payload.machine, "/no/such/file", None)

    monkeypatch.setattr(remote.FileDelivery, "first", first)
    with forked() as pool:
        image = wf.render(scenes.everything(), 8, executor=pool, **QUIET)
    assert image.rgb.tobytes() == expected


def test_the_deadline_is_that_of_the_clock_of_the_machine(calls_of: Any, set_clock: Any) -> None:
    view = jobs.CameraJob(None, time.perf_counter() + 100)  # type: ignore[arg-type]
    pickled = pickle.dumps(view)
    assert pickle.loads(pickled).deadline == view.deadline
    calls_of("platform.node", lambda: "another")
    clock = time.perf_counter
    set_clock(lambda: clock() - 1e6)
    assert 90 < pickle.loads(pickled).deadline - time.perf_counter() <= 100


class Unpicklable:
    """A filter that works here alone."""

    def __init__(self) -> None:
        self.lock = threading.Lock()

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return u


def test_a_scene_that_cannot_be_pickled_is_named(folders: Path) -> None:
    with pytest.raises(wf.SceneError, match=r"cannot be sent to workers.*lock.*use executor='threads'"):
        wf.render(scenes.everything(), 1, executor="spawn", filter=Unpicklable(), **QUIET)
    assert not list(folders.iterdir())


def test_where_processes_are_spawned_such_a_scene_has_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "_forks", lambda: False)
    monkeypatch.setattr(executors, "MIN_PATHS_TO_SPAWN", 1)
    options = {"workers": 2, **QUIET}
    image = wf.render(scenes.everything(), 1, filter=Unpicklable(), **options)
    assert image.metadata["executor"] == "threads"
    assert wf.render(scenes.everything(), 1, **options).metadata["executor"] == "processes"


SCRIPT = """
import numpy as np
import wavefront as wf
print("begin", flush=True)
class Mine(wf.Bsdf):
    def f(self, wo, wi):
        return (wi[2] > 0) * np.full_like(wi, 0.1)
ball = wf.Sphere((0, 0, 0), 1, material=Mine())
image = wf.render([ball, wf.Environment(1)], 2, size=(8, 8), workers=2, executor={executor!r}, progress=False)
print(image.rgb.sum(), flush=True)
"""


def run_script(tmp_path: Path, executor: str, prelude: str = "") -> subprocess.CompletedProcess[str]:
    path = tmp_path / "script.py"
    path.write_text(prelude + SCRIPT.format(executor=executor))
    command = [sys.executable, "-W", "error", str(path)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_a_script_is_not_run_again(tmp_path: Path) -> None:
    """Though it has no guard, and classes of its own, which are sent with their code."""
    pytest.importorskip("cloudpickle")
    spawned, threads = (run_script(tmp_path, executor) for executor in ("spawn", "threads"))
    assert spawned.stdout == threads.stdout, spawned.stderr
    assert spawned.stdout.count("begin") == 1
    assert spawned.stderr == ""


def test_without_cloudpickle_classes_of_a_script_are_named(tmp_path: Path) -> None:
    done = run_script(tmp_path, "spawn", "import sys\nsys.modules['cloudpickle'] = None\n")
    assert "Mine is defined in the script itself: pip install cloudpickle" in done.stderr


# --- Losses ---------------------------------------------------------------------------------------


class Gray(wf.Bsdf):
    """Half of the light is scattered evenly."""

    def f(self, wo: Any, wi: Any) -> Any:
        return np.float32(0.5 / np.pi) * np.broadcast_to(wi[2] > 0, wi.shape)


class Deadly(Gray):
    """Kills its process where a file is not there yet."""

    def __init__(self, path: Path) -> None:
        self.path, self.parent = str(path), os.getpid()

    def f(self, wo: Any, wi: Any) -> Any:
        if os.getpid() != self.parent and not os.path.exists(self.path):
            Path(self.path).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().f(wo, wi)


def ball(material: wf.Bsdf) -> list[Any]:
    return [wf.Sphere((0, 0, 0), 1, material=material), wf.Environment(1)]


@needs_fork
@pytest.mark.parametrize(
    "executor",
    [
        "processes",
        pytest.param("spawn", marks=pytest.mark.slow),
        pytest.param("forkserver", marks=pytest.mark.slow),
        pytest.param(pools_of("fork"), id="made"),
    ],
)
@pytest.mark.first(1)
def test_a_lost_worker_costs_its_jobs_alone(executor: Any, tmp_path: Path) -> None:
    options = {"size": (32, 32), "workers": 2, **QUIET}
    image = wf.render(ball(Deadly(tmp_path / "dead")), 4, executor=executor, **options)
    assert (tmp_path / "dead").exists()
    alone = wf.render(ball(Gray()), 4, executor="threads", **options)
    assert image.rgb.tobytes() == alone.rgb.tobytes()


@needs_fork
def test_a_pool_of_the_user_that_breaks_is_an_error_with_the_picture(tmp_path: Path) -> None:
    """It cannot be replaced: it is not ours."""

    def lose(done: int, total: int) -> None:
        if done >= 64 * 64:
            (tmp_path / "dead").unlink(missing_ok=True)

    (tmp_path / "dead").touch()
    options = {"size": (64, 64), "progress": lose, "wave_size": 1024}
    message = r"lost a worker with samples .*belongs to the caller"
    with pytest.raises(wf.RenderError, match=message) as caught, forked() as pool:
        wf.render(ball(Deadly(tmp_path / "dead")), 100, executor=pool, **options)
    image = caught.value.image
    assert image.metadata["samples"] >= 64 * 64


class Failing(Gray):
    """Has no result."""

    def f(self, wo: Any, wi: Any) -> Any:
        raise ZeroDivisionError("no such thing")


@needs_fork
def test_a_job_that_fails_everywhere_is_named() -> None:
    message = r"samples 0 to 0 of \d+ pixels from 0 on failed 3 times, at last by: ZeroDivisionError: no such"
    with pytest.raises(wf.RenderError, match=message) as caught, forked() as pool:
        wf.render(ball(Failing()), 1, size=(8, 8), executor=pool, **QUIET)
    assert "in f\n" in "".join(caught.value.__cause__.__cause__.__notes__)  # type: ignore[union-attr]


def fail_once(path: str, job: int) -> int:
    if job == 3 and not os.path.exists(path):
        Path(path).touch()
        raise OSError("this machine is not well")
    return job


@needs_fork
def test_a_job_that_fails_once_is_done_again(tmp_path: Path) -> None:
    work = partial(fail_once, str(tmp_path / "failed"))
    with forked() as pool, WorkerPool(work, 2, pool) as workers:
        assert list(workers.run(range(10))) == [(job, job) for job in range(10)]
    assert (tmp_path / "failed").exists()


# --- Other machines -------------------------------------------------------------------------------


@needs_fork
def test_workers_of_other_versions_are_noticed(monkeypatch: pytest.MonkeyPatch, expected: bytes) -> None:
    elsewhere = {**machine.describe_machine(), "NumPy": "1.0", "CPU features": "AVX9"}
    monkeypatch.setattr(remote, "describe_machine", lambda: elsewhere)
    differs = rf"a worker differs from this machine: NumPy {np.__version__} in place of 1\.0, a CPU .*AVX9"
    with forked() as pool:
        with pytest.warns(UserWarning, match=differs) as warned:
            image = wf.render(scenes.everything(), 8, executor=pool, **QUIET)
        assert len(warned) == 1
        assert image.rgb.tobytes() == expected
        with pytest.raises(wf.RenderError, match=rf"{differs}.*with strict=True"):
            wf.render(scenes.everything(), 8, executor=pool, strict=True, **QUIET)


@pytest.mark.slow
def test_workers_on_another_processor_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    features = machine.describe_machine()["CPU features"].split()
    if features == [machine.NONE]:
        pytest.skip("NumPy uses no instructions here that can be turned off")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", features[-1])
    with pytest.warns(UserWarning, match=f"a CPU without {features[-1]}"):
        wf.render(scenes.everything(), 1, workers=1, executor="spawn", **QUIET)


# --- How many workers -----------------------------------------------------------------------------


def test_an_executor_says_how_many_workers_it_has() -> None:
    with ThreadPoolExecutor(5) as pool:
        assert worker_count(None, pool) == 5
        assert worker_count(2, pool) == 2
    assert worker_count(None, InThisThread()) == worker_count(None)


def test_what_is_no_executor_is_named() -> None:
    with pytest.raises(wf.SceneError, match="executor is 3; it must be one of processes, threads"):
        wf.render(scenes.everything(), 1, executor=3)  # type: ignore[arg-type]

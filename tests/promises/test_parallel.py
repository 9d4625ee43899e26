"""Workers: results in order, few under way, errors, deaths and early stops clean."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import (
    MIN_PATHS,
    MIN_PATHS_TO_SPAWN,
    STOP,
    ProcessPool,
    Sensors,
    SharedInt,
    Stopped,
    WorkerPool,
    choose_executor,
    executors,
    worker_count,
)
from scripts import eventually, runs
from threadpoolctl import threadpool_limits

import wavefront as wf

LINUX = sys.platform.startswith("linux")
EXECUTORS = ["threads", pytest.param("processes", marks=pytest.mark.skipif(not LINUX, reason="needs fork"))]
processes = pytest.mark.skipif(not LINUX, reason="needs fork")


def run(work: Callable[[int], int], jobs: range, workers: int, executor: str) -> list[tuple[int, int]]:
    with WorkerPool(work, workers, executor) as pool:
        return list(pool.run(jobs))


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_results_come_in_order(workers: int, executor: str) -> None:

    def work(job: int) -> int:
        time.sleep(0.003 * (job % 3))
        return job * job

    assert run(work, range(20), workers, executor) == [(k, k * k) for k in range(20)]


@pytest.mark.parametrize("executor", EXECUTORS)
def test_several_runs_share_the_workers(executor: str) -> None:
    with WorkerPool(lambda k: (k, os.getpid(), threading.get_ident()), 2, executor) as pool:
        seen = [{result[1:] for _, result in pool.run(range(20))} for _ in range(2)]
    assert len(seen[0] | seen[1]) <= 2


@pytest.mark.parametrize("executor", EXECUTORS)
def test_few_pieces_are_taken_ahead(executor: str) -> None:
    """A generator of a million pieces is not drained before the first result is used."""
    taken = []

    def jobs() -> Iterator[int]:
        for k in range(1_000_000):
            taken.append(k)
            yield k

    with WorkerPool(abs, 2, executor) as pool:
        assert next(pool.run(jobs())) == (0, 0)
        assert len(taken) <= 6


@pytest.mark.parametrize("executor", EXECUTORS)
def test_an_error_in_a_piece_reaches_the_caller(executor: str) -> None:

    def work(job: int) -> int:
        if job == 3:
            raise ValueError("piece 3 failed")
        return job

    with pytest.raises(ValueError, match="piece 3 failed"):
        run(work, range(10), 2, executor)


@pytest.mark.parametrize("executor", EXECUTORS)
def test_no_worker_is_left(executor: str) -> None:
    before = threading.active_count()
    run(abs, range(10), 3, executor)
    with WorkerPool(abs, 3, executor) as pool:
        next(pool.run(range(10)))
    assert threading.active_count() == before
    assert not multiprocessing.active_children()


@processes
def test_pieces_of_a_process_that_dies_are_done_again(tmp_path: Path) -> None:

    def work(job: int) -> int:
        if job in (4, 11):
            try:
                (tmp_path / str(job)).touch(exist_ok=False)
            except FileExistsError:
                return job
            os.kill(os.getpid(), signal.SIGKILL)
        return job

    assert run(work, range(20), 2, "processes") == [(k, k) for k in range(20)]


@processes
def test_processes_that_die_again_and_again_are_an_error() -> None:

    def work(job: int) -> int:
        if job == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        return job

    with pytest.raises(wf.RenderError, match=r"worker processes died 3 times, at last with \d .*memory"):
        run(work, range(8), 2, "processes")
    assert not multiprocessing.active_children()


@processes
def test_a_job_handed_to_processes_that_have_died_fails_by_its_future() -> None:
    pool = ProcessPool("fork", 1, SharedInt())
    died = [pool.submit(os._exit, 1).exception(30), pool.submit(int).exception(30)]
    pool.shutdown([])
    assert all(isinstance(error, BrokenExecutor) for error in died)


@processes
def test_ctrl_c_reaches_the_parent_alone() -> None:

    def work(job: int) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        return job

    assert run(work, range(6), 2, "processes") == [(k, k) for k in range(6)]


@processes
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    script = (
        "import os, sys, time\n"
        "from wavefront.workers.pool import WorkerPool\n"
        "with WorkerPool(lambda k: time.sleep(0.2) or os.getpid(), 2, 'processes') as pool:\n"
        "    for _, pid in pool.run(range(1000)):\n"
        "        print(pid, flush=True)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pids = {int(parent.stdout.readline()) for _ in range(4)}
    parent.kill()
    parent.wait()
    parent.stdout.close()
    assert eventually(lambda: not any(map(runs, pids)))


def test_default_is_one_worker_per_core() -> None:
    assert 1 <= worker_count(None) <= (os.cpu_count() or 1)
    assert worker_count(5) == 5


@processes
def test_a_process_that_is_killed_while_it_writes_is_no_obstacle() -> None:

    def work(job: int) -> int:
        def send_half(connection: Connection, message: bytes) -> None:
            os.write(connection.fileno(), message[: len(message) // 2])
            os.kill(os.getpid(), signal.SIGSTOP)

        if job:
            Connection._send = send_half  # type: ignore[attr-defined]
        return job

    with WorkerPool(work, 1, "processes") as pool:
        assert next(pool.run(range(3))) == (0, 0)
        (child,) = multiprocessing.active_children()
        while Path(f"/proc/{child.pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
            time.sleep(0.01)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("executor", EXECUTORS)
def test_a_stop_ends_a_run(executor: str) -> None:
    """Pieces that have not begun are not done; those under way may look, and stop too."""
    stop = SharedInt()
    found = []

    def work(job: int) -> int:
        while job > 0 and not stop.value:
            time.sleep(0.01)
        return job

    with WorkerPool(work, 2, executor, stop) as pool:
        results = pool.run(range(100), lambda: found and stop.rise_to(STOP))
        found.append(next(results))
        with pytest.raises(Stopped):
            list(results)
    assert found == [(0, 0)]


# --- which executor -------------------------------------------------------------------------------


@pytest.fixture
def no_busy_threads(calls_of: Any) -> None:
    """No other thread of this process computes, whatever the machine says."""
    calls_of("wavefront.workers.executors._other_threads_compute", lambda: False)


@processes
def test_much_work_goes_to_processes(no_busy_threads: None) -> None:
    """Little, or that of one worker, to threads."""
    assert choose_executor(None, 2, MIN_PATHS) == "processes"
    assert choose_executor(None, 2, MIN_PATHS - 1) == "threads"
    assert choose_executor(None, 1, MIN_PATHS) == "threads"
    assert choose_executor("threads", 2, MIN_PATHS) == "threads"
    assert choose_executor("processes", 1, 1) == "processes"


@processes
@pytest.mark.parametrize("computes", [False, True])
def test_a_thread_that_computes_keeps_processes_away(computes: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that waits does not, nor those of BLAS, which spin when it has them back after a fork."""
    end, nap, loops = threading.Event(), time.sleep, [0]

    def other() -> None:
        while computes and not end.is_set():
            sum(range(1000))
            loops[0] += 1
        end.wait()

    def long_nap(seconds: float) -> None:
        """Sleep until the thread has had a core for some milliseconds."""
        least = loops[0] + 1000 * computes
        nap(seconds)
        while loops[0] < least:
            nap(seconds)

    thread = threading.Thread(target=other)
    thread.start()
    try:
        with threadpool_limits(2, "blas"), WorkerPool(abs, 1, "processes") as pool:
            assert list(pool.run([-1])) == [(-1, 1)]
        monkeypatch.setattr(executors.time, "sleep", long_nap)
        expected = "threads" if computes else "processes"
        assert choose_executor(None, 2, MIN_PATHS) == expected
    finally:
        end.set()
        thread.join()


def test_without_a_global_lock_threads_are_as_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "_is_gil_enabled", lambda: False, raising=False)
    assert choose_executor(None, 2, MIN_PATHS) == "threads"


def test_where_processes_are_not_forked_they_need_more_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert choose_executor(None, 2, MIN_PATHS) == "threads"
    assert choose_executor(None, 2, MIN_PATHS_TO_SPAWN) == "processes"
    assert choose_executor("processes", 2, 1) == "processes"


@processes
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are forked on Linux alone")
@pytest.mark.parametrize(
    "error",
    [
        OSError(38, "Function not implemented"),  # as serverless platforms have it
        FileNotFoundError(2, "No such file or directory"),  # without /dev/shm
        ImportError("This platform lacks a functioning sem_open implementation"),
    ],
)
def test_without_semaphores_there_are_threads(
    error: Exception, fails: Any, no_busy_threads: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a line that says so, where processes would be faster, and an error where they are asked for."""
    fails("multiprocessing.synchronize.SemLock.__init__", error)
    monkeypatch.setattr(executors, "MIN_PATHS", 1)
    picture: dict[str, Any] = {"spp": 1, "size": (16, 16), "workers": 2}
    with pytest.warns(UserWarning, match=r"workers are threads.*no semaphores.*/dev/shm"):
        image = wf.render(scenes.everything(), **picture)
    assert image.metadata["executor"] == "threads"
    for name in ("processes", "spawn", "forkserver"):
        with pytest.raises(wf.SceneError, match=rf"'{name}'.*no semaphores.*use 'threads'"):
            wf.render(scenes.everything(), executor=name, **picture)
    wf.render(scenes.everything(), executor="threads", **picture)


@pytest.mark.skipif(sys.platform == "win32", reason="folders in use cannot be removed")
def test_a_working_folder_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes that are not forked begin in it; others do not need it."""
    folder = tmp_path / "folder"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    for name in ("spawn", "forkserver"):
        with pytest.raises(wf.SceneError, match=rf"'{name}', but the working folder.*not exist.*'threads'"):
            wf.render(scenes.everything(), 1, executor=name)
    for name in ("processes", "threads"):
        assert wf.render(scenes.everything(), 1, executor=name, workers=2).spp == 1


def test_a_daemon_has_threads() -> None:
    daemon = multiprocessing.current_process()
    daemon._config["daemon"] = True  # type: ignore[attr-defined]
    try:
        assert choose_executor(None, 2, MIN_PATHS) == "threads"
        for name in ("processes", "spawn", "forkserver"):
            with pytest.raises(wf.SceneError, match=rf"'{name}'.*daemon of multiprocessing.*use 'threads'"):
                choose_executor(name, 2, MIN_PATHS)
    finally:
        del daemon._config["daemon"]  # type: ignore[attr-defined]


# --- pictures -------------------------------------------------------------------------------------


def settings_of(kind: str, accel: str) -> dict[str, Any]:
    """Return the settings of a picture, or of points at which light is measured."""
    options: dict[str, Any] = {"accel": accel, "progress": False, "wave_size": 500}
    if kind != "picture":
        points = np.random.default_rng(0).uniform(-1, 1, (63, 3))
        options["camera"] = Sensors(points, (0, 1, 0) if kind == "irradiance" else None, kind)
    return options


@cache
def by_one_worker(kind: str, accel: str) -> wf.Image:
    """Return what one thread finds."""
    return wf.render(scenes.everything(), 8, workers=1, executor="threads", **settings_of(kind, accel))


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize(
    ("kind", "accel"),
    [
        *(("picture", "auto"), ("irradiance", "numpy"), ("fluence", "auto")),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (("picture", "numpy"), ("irradiance", "auto"), ("fluence", "numpy"))
        ),
    ],
)
@pytest.mark.first(4)
def test_the_executor_changes_no_bit(executor: str, accel: str, kind: str) -> None:
    options = settings_of(kind, accel)
    image = wf.render(scenes.everything(), 8, workers=2, executor=executor, **options)
    alone = by_one_worker(kind, accel)
    assert image.rgb.tobytes() == alone.rgb.tobytes()
    assert image.metadata["executor"] == executor
    assert image.metadata["rays"] == alone.metadata["rays"]

"""Workers: results in order, few under way, errors, deaths and early stops clean."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import scenes

import wavefront as wf
from wavefront.parallel import MIN_PATHS, Workers, choose_executor, worker_count

LINUX = sys.platform.startswith("linux")
EXECUTORS = ["threads", pytest.param("processes", marks=pytest.mark.skipif(not LINUX, reason="needs fork"))]
processes = pytest.mark.skipif(not LINUX, reason="needs fork")


def children() -> set[int]:
    """Processes that this one has forked, those that ended but were not waited for among them."""
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[1]) == os.getpid():
                found.add(int(stat.parent.name))
    return found


def open_files() -> int:
    """Number of open file descriptors."""
    return len(list(Path("/proc/self/fd").glob("*")))


def run(work: Callable[[int], int], pieces: range, workers: int, executor: str) -> list[tuple[int, int]]:
    with Workers(work, workers, executor) as crew:
        return list(crew.run(pieces))


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_results_come_in_order(workers: int, executor: str) -> None:
    """However long each piece takes."""

    def work(piece: int) -> int:
        time.sleep(0.003 * (piece % 3))
        return piece * piece

    assert run(work, range(20), workers, executor) == [(k, k * k) for k in range(20)]


@pytest.mark.parametrize("executor", EXECUTORS)
def test_several_runs_share_the_workers(executor: str) -> None:
    """The second starts none anew."""
    with Workers(lambda k: (k, os.getpid(), threading.get_ident()), 2, executor) as crew:
        seen = [{result[1:] for _, result in crew.run(range(20))} for _ in range(2)]
    assert len(seen[0] | seen[1]) <= 2


@pytest.mark.parametrize("executor", EXECUTORS)
def test_few_pieces_are_taken_ahead(executor: str) -> None:
    """A generator of a million pieces is not drained before the first result is used."""
    taken = []

    def pieces() -> Iterator[int]:
        for k in range(1_000_000):
            taken.append(k)
            yield k

    with Workers(abs, 2, executor) as crew:
        assert next(crew.run(pieces())) == (0, 0)
        assert len(taken) <= 6


@pytest.mark.parametrize("executor", EXECUTORS)
def test_an_error_in_a_piece_reaches_the_caller(executor: str) -> None:
    """As it was raised."""

    def work(piece: int) -> int:
        if piece == 3:
            raise ValueError("piece 3 failed")
        return piece

    with pytest.raises(ValueError, match="piece 3 failed"):
        run(work, range(10), 2, executor)


@pytest.mark.parametrize("executor", EXECUTORS)
def test_no_worker_is_left(executor: str) -> None:
    """Neither after the end nor after an early stop."""
    before = threading.active_count(), children(), open_files()
    run(abs, range(10), 3, executor)
    with Workers(abs, 3, executor) as crew:
        next(crew.run(range(10)))
    assert (threading.active_count(), children(), open_files()) == before


@processes
def test_processes_are_processes() -> None:
    """As many as asked for, and none of them this one."""
    with Workers(lambda k: time.sleep(0.05) or os.getpid(), 3, "processes") as crew:
        pids = {pid for _, pid in crew.run(range(30))}
    assert len(pids) == 3
    assert os.getpid() not in pids


@processes
def test_pieces_of_a_process_that_dies_are_done_again(tmp_path: Path) -> None:
    """By new ones; nothing is missing."""

    def work(piece: int) -> int:
        if piece in (4, 11):
            try:
                (tmp_path / str(piece)).touch(exist_ok=False)
            except FileExistsError:
                return piece
            os.kill(os.getpid(), signal.SIGKILL)
        return piece

    assert run(work, range(20), 2, "processes") == [(k, k) for k in range(20)]


@processes
def test_processes_that_die_again_and_again_are_an_error() -> None:
    """It names the piece."""

    def work(piece: int) -> int:
        if piece == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        return piece

    with pytest.raises(wf.SceneError, match=r"worker processes died 3 times, at last with \d .*memory"):
        run(work, range(8), 2, "processes")
    assert not children()


@processes
def test_ctrl_c_reaches_the_parent_alone() -> None:
    """A terminal sends it to all; workers finish what they do."""

    def work(piece: int) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        return piece

    assert run(work, range(6), 2, "processes") == [(k, k) for k in range(6)]


@processes
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    """Even if it is killed."""
    script = (
        "import os, sys, time\n"
        "from wavefront.parallel import Workers\n"
        "with Workers(lambda k: time.sleep(0.2 if k < 8 else 600) or os.getpid(), 2, 'processes') as crew:\n"
        "    for _, pid in crew.run(range(1000)):\n"
        "        print(pid, flush=True)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pids = {int(parent.stdout.readline()) for _ in range(8)}
    time.sleep(0.3)  # all are in the midst of a long piece
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 10
    while pids and time.monotonic() < deadline:
        time.sleep(0.05)
        pids = {pid for pid in pids if _runs(pid)}
    assert not pids


@processes
def test_an_early_stop_does_not_wait() -> None:
    """What is under way is of no use to anybody."""
    begin = time.monotonic()
    with Workers(lambda k: time.sleep(0 if k == 0 else 600) or k, 2, "processes") as crew:
        assert next(crew.run(range(10))) == (0, 0)
    assert time.monotonic() - begin < 60
    assert not children()


@processes
def test_ctrl_c_while_waiting_ends_all() -> None:
    """However long the pieces still take; the next run has new workers."""

    def work(piece: int) -> int:
        if piece == 3:
            os.kill(os.getppid(), signal.SIGINT)
            time.sleep(600)
        return piece

    with Workers(work, 2, "processes") as crew:
        with pytest.raises(KeyboardInterrupt):
            list(crew.run(range(10)))
        assert not children()
        assert list(crew.run(range(3))) == [(0, 0), (1, 1), (2, 2)]


@processes
def test_runs_that_were_given_up_do_not_disturb_others() -> None:
    """Their results come to nobody else."""
    with Workers(lambda k: time.sleep(0.01) or k * k, 2, "processes") as crew:
        first = crew.run(range(100, 110))
        assert next(first) == (100, 100 * 100)
        assert list(crew.run(range(8))) == [(k, k * k) for k in range(8)]
        assert next(first) == (101, 101 * 101)


@processes
def test_a_worker_that_dies_idle_is_replaced() -> None:
    """Nobody loses anything by it."""
    with Workers(lambda k: (k, os.getpid()), 1, "processes") as crew:
        ((_, (_, pid)),) = crew.run([0])
        os.kill(pid, signal.SIGKILL)
        while _runs(pid):
            time.sleep(0.01)
        results = [result for _, result in crew.run(range(5))]
    assert [k for k, _ in results] == list(range(5))
    assert pid not in {each for _, each in results}


@processes
def test_pieces_and_results_may_be_large() -> None:
    """Larger than what a pipe holds."""
    pieces = [np.full(1 << 20, k, np.float32) for k in range(5)]
    with Workers(lambda piece: np.tile(piece, 3) + 1, 2, "processes") as crew:
        for k, (piece, result) in enumerate(crew.run(pieces)):
            assert piece is pieces[k]
            assert result.shape == (3 << 20,)
            assert (result == k + 1).all()


class Odd(Exception):
    """Takes two arguments, but hands one on, so pickle cannot put it together again."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} {where}")


@processes
def test_errors_of_workers_say_where_they_come_from() -> None:
    """Also those that pickle cannot take apart, and results that it cannot."""

    def work(piece: int) -> object:
        if piece == 1:
            raise Odd("strange", "place")
        return lambda: piece

    def broken(piece: int) -> int:
        return 1 // piece

    with pytest.raises(ZeroDivisionError) as caught:
        run(broken, range(3), 2, "processes")
    assert "In a worker process" in caught.value.__notes__[0]
    assert "return 1 // piece" in caught.value.__notes__[0]
    with pytest.raises(RuntimeError, match="Odd: strange place"):
        run(work, range(1, 3), 2, "processes")
    with pytest.raises(Exception, match="pickle"):
        run(work, range(2, 4), 2, "processes")


@processes
def test_what_workers_print_appears_once() -> None:
    """And what the parent had printed before, too, though its buffer is copied."""
    script = (
        "from wavefront.parallel import Workers\n"
        "print('before')\n"
        "with Workers(lambda k: print(f'piece {k}'), 2, 'processes') as crew:\n"
        "    list(crew.run(range(3)))\n"
    )
    buffered = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=buffered
    )
    assert sorted(done.stdout.splitlines()) == ["before", "piece 0", "piece 1", "piece 2"]


@processes
def test_a_daemon_of_multiprocessing_may_have_workers() -> None:
    """It allows no children, but of its own."""
    ours, theirs = multiprocessing.Pipe()
    fork = multiprocessing.get_context("fork")
    daemon = fork.Process(target=lambda: theirs.send(run(abs, range(4), 2, "processes")), daemon=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forking beside threads
        daemon.start()
    assert ours.poll(60)
    assert ours.recv() == [(k, k) for k in range(4)]
    daemon.join()


@processes
def test_several_threads_may_have_workers() -> None:
    """Each waits for its own only."""
    results: dict[int, list] = {}

    def one(number: int) -> None:
        results[number] = run(lambda k: time.sleep(0.005 * number) or k, range(12), 2, "processes")

    threads = [threading.Thread(target=one, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {number: [(k, k) for k in range(12)] for number in range(4)}
    assert not children()


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_default_is_one_worker_per_core() -> None:
    """Of those that this process may use."""
    assert 1 <= worker_count(None) <= (os.cpu_count() or 1)
    assert worker_count(5) == 5


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2"])
def test_bad_worker_counts_are_named(workers: object) -> None:
    """With the value and the limit."""
    with pytest.raises(wf.SceneError, match=f"workers is {workers!r}.*at least 1"):
        worker_count(workers)


# --- which executor -------------------------------------------------------------------------------


@processes
def test_much_work_goes_to_processes() -> None:
    """Little, or that of one worker, to threads."""
    assert choose_executor(None, 2, MIN_PATHS) == "processes"
    assert choose_executor(None, 2, MIN_PATHS - 1) == "threads"
    assert choose_executor(None, 1, MIN_PATHS) == "threads"
    assert choose_executor("threads", 2, MIN_PATHS) == "threads"
    assert choose_executor("processes", 1, 1) == "processes"


def test_without_a_global_lock_threads_are_as_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the free-threaded builds of Python."""
    monkeypatch.setattr(sys, "_is_gil_enabled", lambda: False, raising=False)
    assert choose_executor(None, 2, MIN_PATHS) == "threads"


def test_where_nothing_can_be_forked_workers_are_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """And asking for processes is an error that says why."""
    monkeypatch.setattr(sys, "platform", "darwin")
    assert choose_executor(None, 2, MIN_PATHS) == "threads"
    with pytest.raises(
        wf.SceneError, match=r"executor is 'processes', but .* not safe on darwin; use 'threads'"
    ):
        choose_executor("processes", 2, MIN_PATHS)


def test_unknown_executors_are_named() -> None:
    """With what there is."""
    with pytest.raises(wf.SceneError, match="executor is 'dask'; it must be one of processes, threads"):
        wf.render(scenes.everything(), 1, executor="dask")


# --- pictures -------------------------------------------------------------------------------------


@pytest.mark.parametrize("accel", ["numpy", "auto"])
@pytest.mark.parametrize("executor", EXECUTORS)
def test_the_executor_changes_no_bit(executor: str, accel: str) -> None:
    """And is named in the picture."""
    options = {"accel": accel, "progress": False, "wave_size": 500}
    image = wf.render(scenes.everything(), 8, workers=2, executor=executor, **options)
    alone = wf.render(scenes.everything(), 8, workers=1, executor="threads", **options)
    assert image.rgb.tobytes() == alone.rgb.tobytes()
    assert image.metadata["executor"] == executor
    assert image.metadata["rays"] == alone.metadata["rays"]


@processes
def test_ctrl_c_stops_processes() -> None:
    """The picture so far is the same as with threads, and no process is left."""

    def stop(done: int, total: int) -> None:
        if done >= 4 * 300:
            raise KeyboardInterrupt

    pictures = []
    for executor in ("processes", "threads"):
        with pytest.warns(UserWarning, match="interrupted"):
            image = wf.render(
                scenes.everything(), 64, wave_size=300, workers=2, executor=executor, progress=stop
            )
        pictures.append(np.asarray(image).tobytes())
    assert pictures[0] == pictures[1]
    assert not children()

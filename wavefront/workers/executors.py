"""How many workers there are, and what they are: the table of executors.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win: two threads trace 1.4 times as fast as one,
two processes 1.9 times (docs/performance.md). So where the system can fork, workers are processes.
They share the scene's memory, which nobody writes, and cost some milliseconds to start. Elsewhere processes
are spawned, and take about a second until they have imported NumPy and this package and read the scene.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from ..core.errors import SceneError, warn_caller
from ..core.registry import Registry
from .contract import (
    ExecutorMaker,
    ExecutorTasks,
    LocalWorkers,
    StoppableWork,
    TaskPool,
    Workers,
    WorkersMaker,
    shares_memory,
)
from .dask import DaskClient, dask_workers, threads_in
from .machine import reserve_buffers
from .remote import RemoteWorkers

MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are forked
MIN_PATHS_TO_SPAWN = 1 << 22  # fewer are traced sooner than processes are spawned

NAP = 0.05  # seconds for which other threads are watched
BUSY = 0.01  # part of a core; busy threads may get little of one on a busy machine
THREAD_CLOCK = 6  # last bits of the id of the clock of a thread's CPU time, after those of ~thread
# (Linux, include/linux/posix-timers_types.h; `time.pthread_getcpuclockid` may crash when a thread has ended)

WAVES_PER_TASK = 4  # of a cluster, where a task costs 8 ms beside its work, and a wave takes 100 ms

PROCESSES = ("processes", "spawn", "forkserver")  # names of executors whose workers are our own processes

ExecutorLike: TypeAlias = Executor | ExecutorMaker | DaskClient


def _forks() -> bool:
    """Return whether processes are forked here; elsewhere that is not safe, or not possible."""
    return sys.platform.startswith("linux")


def _processes(work: StoppableWork, count: int, strict: bool) -> Workers:
    from .processes import forked_workers  # here, as not every render needs it

    return forked_workers(work, count, strict) if _forks() else _spawn("spawn", work, count, strict)


def _spawn(method: str, work: StoppableWork, count: int, strict: bool) -> Workers:
    from .processes import spawned_workers

    return spawned_workers(method, work, count, strict)


def _threads(work: StoppableWork, count: int, strict: bool) -> Workers:
    reserve_buffers(count)
    executor = ThreadPoolExecutor(count, thread_name_prefix="wavefront")
    return LocalWorkers(ExecutorTasks(executor, work.stop, replaceable=True), work)


def _made(make: ExecutorMaker, work: StoppableWork, count: int, strict: bool) -> Workers:
    """Start the workers of an executor that is made for them."""
    executor = make(count)
    pool = ExecutorTasks(executor, work.stop, replaceable=True)
    try:
        return _workers_of(executor, pool, work, strict)
    except BaseException:
        pool.shutdown([])
        raise


def _users(executor: Executor, work: StoppableWork, count: int, strict: bool) -> Workers:
    """Use the workers of an executor that belongs to the caller."""
    return _workers_of(executor, ExecutorTasks(executor, work.stop, replaceable=False), work, strict)


def _workers_of(executor: Executor, pool: TaskPool, work: StoppableWork, strict: bool) -> Workers:
    if shares_memory(executor, work.stop):
        return LocalWorkers(pool, work)
    return RemoteWorkers(pool, work, strict)


def _workers_maker(executor: ExecutorLike) -> WorkersMaker:
    """Return what starts the workers of an executor that a user gives."""
    if isinstance(executor, DaskClient):
        return partial(dask_workers, executor)
    if isinstance(executor, Executor):
        return partial(_users, executor)
    return partial(_made, executor)


def _is_executor(thing: Any) -> bool:
    return isinstance(thing, Executor | DaskClient) or callable(thing)


EXECUTORS: Registry[WorkersMaker] = Registry(
    "executor",
    "a concurrent.futures.Executor, a function that returns one, or a dask.distributed.Client",
    {
        "processes": _processes,
        "threads": _threads,
        "spawn": partial(_spawn, "spawn"),
        "forkserver": partial(_spawn, "forkserver"),
    },
    accepts=_is_executor,
    adapt=_workers_maker,
)


def worker_count(workers: int | None, executor: str | ExecutorLike | None = None) -> int:
    """Return the number of workers to use.

    None means all workers of an executor that the user has made, and otherwise one per core that this process
    may use.

    Raises
    ------
    SceneError
        If it is not a whole number of at least 1.
    """
    if workers is None:
        return _workers_in(executor) or _cores()
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SceneError(f"workers is {workers!r}; it must be a whole number of at least 1")
    return workers


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _workers_in(executor: str | ExecutorLike | None) -> int | None:
    """Return how many workers an executor has; None if it does not say."""
    if isinstance(executor, DaskClient):
        return threads_in(executor)
    if not isinstance(executor, Executor):
        return None
    sizes = getattr(executor, "_max_workers", None), getattr(executor, "num_workers", None)  # the latter: MPI
    return next((size for size in sizes if isinstance(size, int) and size > 0), None)


def choose_executor(executor: str | ExecutorLike | None, workers: int, paths: int) -> str | ExecutorLike:
    """Return what was asked for, else "threads" or "processes", whichever is faster for these paths.

    Warns where it were processes, but the system has no semaphores for them.

    Raises
    ------
    SceneError
        If the name is unknown, or processes are asked for where they cannot be had.
    """
    if executor is not None:
        EXECUTORS.find(executor)
    obstacle = _daemon() or _obstacle_to_starting(str(executor)) if executor in PROCESSES else None
    if obstacle:
        raise SceneError(f"executor is {executor!r}, but {obstacle}; use 'threads'")
    if executor == "forkserver" and executor not in multiprocessing.get_all_start_methods():
        raise SceneError(f"executor is 'forkserver', which {sys.platform} does not have; use 'spawn'")
    if executor is not None:
        return executor
    without_lock = not getattr(sys, "_is_gil_enabled", lambda: True)()
    few = workers == 1 or paths < (MIN_PATHS if _forks() else MIN_PATHS_TO_SPAWN)
    if few or without_lock or _daemon() or (_forks() and _other_threads_compute()):
        return "threads"
    obstacle = _obstacle_to_starting("processes")
    if obstacle:
        warn_caller(f"workers are threads, which are slower than processes: {obstacle}")
    return "threads" if obstacle else "processes"


def _other_threads_compute() -> bool:
    """Return whether other threads of Python are busy in this process.

    Before a fork OpenBLAS waits for its own threads, forever if another thread uses them: `os.fork` hangs.
    Its own threads do no harm where nobody uses them, as in the 0.1 s for which they spin after a render.
    A thread is busy if it used a core meanwhile, or waits for one that other programs keep from it.
    """
    others = {each.native_id for each in threading.enumerate() if each.native_id is not None}
    others.discard(threading.get_native_id())
    if not others:
        return False
    clocks = [~other << 3 | THREAD_CLOCK for other in others]
    begin = _seconds(clocks)
    time.sleep(NAP)
    used = any(end - begin[clock] > BUSY * NAP for clock, end in _seconds(clocks).items() if clock in begin)
    return used or any(map(_runnable, others))


def _runnable(thread: int) -> bool:
    """Return whether a thread of this process has a core or waits for one (Linux, proc(5))."""
    try:
        return Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()[0] == "R"
    except OSError:  # it has ended, or nothing tells
        return False


def _seconds(clocks: Iterable[int]) -> dict[int, float]:
    """Return the seconds of clocks by their ids, but for those of threads that have ended."""
    found = {}
    for clock in clocks:
        with suppress(OSError):
            found[clock] = time.clock_gettime(clock)
    return found


def waves_per_job(executor: str | ExecutorLike) -> int:
    """Return how many waves a job may have."""
    return WAVES_PER_TASK if isinstance(executor, DaskClient) else 1


def needs_pickling(executor: str | ExecutorLike) -> bool:
    """Return whether workers of a name can be started only with a scene that can be pickled."""
    return executor in ("spawn", "forkserver") or (executor == "processes" and not _forks())


def _daemon() -> str | None:
    """Return why workers cannot be processes, as this one is a daemon; None if it is none."""
    if multiprocessing.current_process().daemon:
        return "this process is a daemon of multiprocessing, which may have no children"
    return None


def _obstacle_to_starting(executor: str) -> str | None:
    """Return why no processes can be started here; None if they can."""
    return _missing_semaphores() or (_missing_folder() if needs_pickling(executor) else None)


def _missing_folder() -> str | None:
    """Return why processes that are not forked cannot be started; None if there is a folder to start in."""
    try:
        os.getcwd()
    except OSError:
        return "the working folder of this process does not exist any more"
    return None


def _missing_semaphores() -> str | None:
    """Return why workers cannot be processes, as sandboxes have no semaphores for them; None if there are."""
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else None  # leaves nothing behind
    try:
        multiprocessing.get_context(method).Lock()
    except (ImportError, OSError) as error:
        return f"this system has no semaphores for processes ({error}), perhaps as it has no /dev/shm"
    return None

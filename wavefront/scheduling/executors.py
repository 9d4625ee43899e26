"""How many workers there are, and what they are: the table of executors.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win: two threads trace 1.4 times as fast as one,
two processes 1.9 times (docs/performance.md). So where the system can fork, workers are processes.
They share the scene's memory, which nobody writes, and cost some milliseconds to start.
"""

from __future__ import annotations

import multiprocessing
import os
import sys

from ..errors import SceneError
from ..registry import Registry
from .blas import reserve_buffers
from .shared import SharedInt
from .workers import ExecutorMaker, StoppableWork, Workers, WorkersMaker, start_threads, workers_of

MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are started


def _processes(work: StoppableWork, count: int, stop: SharedInt) -> Workers:
    from .processes import ForkedWorkers  # here, because not every system can fork

    return ForkedWorkers(work, count, stop)


def _threads(work: StoppableWork, count: int, stop: SharedInt) -> Workers:
    reserve_buffers(count)
    return start_threads(work, count, stop)


EXECUTORS: Registry[WorkersMaker] = Registry(
    "executor",
    "a function that returns a concurrent.futures.Executor",
    {"processes": _processes, "threads": _threads},
    adapt=workers_of,
)


def worker_count(workers: int | None) -> int:
    """Return the number of workers to use; None means one per core that this process may use.

    Raises
    ------
    SceneError
        If it is not a whole number of at least 1.
    """
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SceneError(f"workers is {workers!r}; it must be a whole number of at least 1")
    return workers


def choose_executor(executor: str | ExecutorMaker | None, workers: int, paths: int) -> str | ExecutorMaker:
    """Return what was asked for, else "threads" or "processes", whichever is faster for so many paths.

    Raises
    ------
    SceneError
        If the name is unknown, or processes are asked for where they cannot be had.
    """
    if executor is not None:
        EXECUTORS.find(executor)
    obstacle = _obstacle_to_processes()
    if executor == "processes" and obstacle:
        raise SceneError(f"executor is 'processes', but {obstacle}; use 'threads'")
    if executor is not None:
        return executor
    without_lock = not getattr(sys, "_is_gil_enabled", lambda: True)()
    few = workers == 1 or paths < MIN_PATHS
    return "threads" if few or without_lock or obstacle else "processes"


def _obstacle_to_processes() -> str | None:
    """Return why workers cannot be processes; None if they can."""
    if not sys.platform.startswith("linux"):
        return f"they are forked, which is not safe on {sys.platform}"
    if multiprocessing.current_process().daemon:
        return "this process is a daemon of multiprocessing, which may have no children"
    return None

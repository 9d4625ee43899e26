"""Pieces of work on all cores, handed back in order.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win: two threads trace 1.4 times as fast as one,
two processes 1.9 times (docs/performance.md). So where the system can fork, workers are processes.
They share the scene's memory, which nobody writes, and cost some milliseconds to start.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from concurrent.futures import wait as wait_for_futures
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Generic, Self, TypeVar

from ..errors import RenderError, SceneError
from ..registry import Registry
from .blas import reserve_buffers, single_threaded_blas
from .crew import Crew, CrewMaker, PoolMaker, Stoppable, Threads, pooled
from .shared import STOP, SharedNumber, Stopped

Job = TypeVar("Job")
Result = TypeVar("Result")

MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are started
RETRIES = 2  # times that lost processes are replaced
POLL = 0.1  # seconds between two looks at whether work is to stop


def _processes(work: Stoppable, count: int, stop: SharedNumber) -> Crew:
    from .processes import Processes  # here, because not every system can fork

    return Processes(work, count, stop)


def _threads(work: Stoppable, count: int, stop: SharedNumber) -> Crew:
    reserve_buffers(count)
    return Threads(work, count, stop)


EXECUTORS: Registry[CrewMaker] = Registry(
    "executor",
    "a function that returns a concurrent.futures.Executor",
    {"processes": _processes, "threads": _threads},
    adapt=pooled,
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


def choose_executor(executor: str | PoolMaker | None, workers: int, paths: int) -> str | PoolMaker:
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
    """Say why workers cannot be processes, if they cannot."""
    if not sys.platform.startswith("linux"):
        return f"they are forked, which is not safe on {sys.platform}"
    if multiprocessing.current_process().daemon:
        return "this process is a daemon of multiprocessing, which may have no children"
    return None


class Workers(Generic[Job, Result]):
    """Workers that do one kind of work, as a context manager.

    BLAS is held to one thread per worker.

    Parameters
    ----------
    work
        Turns a piece into its result. Processes have a copy of all that it refers to, as it was at
        the first piece; pieces and results travel.
    count
        Number of workers.
    executor
        A name in `EXECUTORS`, or a function that returns a pool for a number of workers.
    stop
        At STOP no piece is begun any more, and work that looks at it may raise `Stopped`; at AT_ONCE
        nobody waits for pieces under way. Leaving the context sets it to STOP.
    """

    def __init__(
        self,
        work: Callable[[Job], Result],
        count: int,
        executor: str | PoolMaker,
        stop: SharedNumber | None = None,
    ) -> None:
        self._stop = SharedNumber() if stop is None else stop
        self._work, self._count = Stoppable(work, self._stop), count
        self._make = EXECUTORS.find(executor)
        self._crew: Crew | None = None
        self._running: deque[tuple[Job, Future[Result]]] = deque()
        self._retries = RETRIES

    def __enter__(self) -> Self:
        """Hold BLAS to one thread; workers start with the first piece."""
        single_threaded_blas.acquire()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop what is under way and end all workers.

        Threads end at their next look at `stop`. Processes that have not ended after a second are killed.
        """
        self._stop.rise_to(STOP)
        try:
            if self._crew is not None:
                self._crew.end([future for _, future in self._running])
        finally:
            single_threaded_blas.release()

    def run(
        self, jobs: Iterable[Job], waiting: Callable[[], object] = lambda: None
    ) -> Iterator[tuple[Job, Result]]:
        """Yield each piece with its result, in the order of the pieces.

        Few pieces are under way at once, so memory does not grow with their number. While no result
        comes, `waiting` is called every `POLL` seconds.

        Raises
        ------
        Stopped
            If `stop` is set, or a piece raised it.
        RenderError
            If worker processes die again and again.
        """
        running = self._running
        for job in jobs:
            running.append((job, self._submit(job)))
            if len(running) > 2 * self._count:
                yield self._first(waiting)
        while running:
            yield self._first(waiting)

    def _first(self, waiting: Callable[[], object]) -> tuple[Job, Result]:
        """Wait for the first of the pieces under way; should workers have died, give all to new ones."""
        while True:
            job, future = self._running[0]
            while not wait_for_futures([future], POLL).done:
                waiting()
                if self._stop.value:
                    raise Stopped
            try:
                result = future.result()
            except BrokenProcessPool:
                self._replace(job)
                continue
            self._running.popleft()
            return job, result

    def _replace(self, job: Job) -> None:
        """Give all pieces under way to new processes."""
        if not self._retries:
            raise RenderError(
                f"worker processes died {RETRIES + 1} times, at last with {job} under way; were they "
                "killed for lack of memory? Use fewer workers or a smaller wave_size"
            ) from None
        self._retries -= 1
        assert self._crew is not None
        self._crew.end([future for _, future in self._running])
        self._crew = None
        again = [each for each, _ in self._running]
        self._running.clear()
        self._running.extend((each, self._submit(each)) for each in again)

    def _submit(self, job: Job) -> Future[Result]:
        try:
            if self._crew is None:
                self._crew = self._make(self._work, self._count, self._stop)
            return self._crew.submit(job)
        except (RuntimeError, OSError) as error:  # a limit of threads, processes or memory
            raise RenderError(f"a worker cannot be started: {error}; use fewer workers") from error

"""Pieces of work on all cores, handed back in order.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win: two threads trace 1.4 times as fast as one,
two processes 1.9 times (docs/performance.md). So where the system can fork, workers are processes.
They share the scene's memory, which nobody writes, and cost some milliseconds to start.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from threadpoolctl import threadpool_limits

from .errors import SceneError
from .forked import Processes

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

Piece = TypeVar("Piece")
Result = TypeVar("Result")

EXECUTORS = ("processes", "threads")
MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are started


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


def choose_executor(executor: str | None, workers: int, paths: int) -> str:
    """Return "threads" or "processes": what was asked for, or what is faster for so many paths.

    Raises
    ------
    SceneError
        If the name is unknown, or processes are asked for where they cannot be had.
    """
    if executor not in (None, *EXECUTORS):
        raise SceneError(f"executor is {executor!r}; it must be one of {', '.join(EXECUTORS)}")
    can_fork = sys.platform.startswith("linux")
    if executor == "processes" and not can_fork:
        raise SceneError(
            f"executor is 'processes', but they are forked, which is not safe on {sys.platform}; "
            "use 'threads'"
        )
    if executor is not None:
        return executor
    without_lock = not getattr(sys, "_is_gil_enabled", lambda: True)()
    few = workers == 1 or paths < MIN_PATHS
    return "threads" if few or without_lock or not can_fork else "processes"


class Workers(Generic[Piece, Result]):
    """Workers that do one kind of work, as a context manager.

    BLAS is held to one thread per worker.

    Parameters
    ----------
    work
        Turns a piece into its result.
    count
        Number of workers.
    executor
        "threads" or "processes".
    """

    def __init__(self, work: Callable[[Piece], Result], count: int, executor: str) -> None:
        self._crew = (Threads if executor == "threads" else Processes)(work, count)
        self._limits: Any = None

    def __enter__(self) -> Self:
        """Hold BLAS to one thread; workers start with the first pieces."""
        self._limits = threadpool_limits(1, "blas")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Drop what is not done; no worker is left."""
        self._limits.restore_original_limits()
        self._crew.close()

    def run(self, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Result]]:
        """Yield each piece with its result, in the order of the pieces.

        Few pieces are under way at once, so memory does not grow with their number.

        Raises
        ------
        SceneError
            If worker processes die again and again.
        """
        return self._crew.run(pieces)


class Threads(Generic[Piece, Result]):
    """Worker threads; parameters as for `Workers`."""

    def __init__(self, work: Callable[[Piece], Result], count: int) -> None:
        self._work, self._count = work, count
        self._pool: ThreadPoolExecutor | None = None

    def run(self, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Result]]:
        """Yield each piece with its result, in the order of the pieces."""
        from concurrent.futures import ThreadPoolExecutor  # here, so that processes do not pay for it

        self._pool = self._pool or ThreadPoolExecutor(self._count, "wavefront")
        running: deque[tuple[Piece, Future[Result]]] = deque()
        for piece in pieces:
            running.append((piece, self._pool.submit(self._work, piece)))
            if len(running) > 2 * self._count:
                first, future = running.popleft()
                yield first, future.result()
        for first, future in running:
            yield first, future.result()

    def close(self) -> None:
        """Drop what has not begun, and wait for what has."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

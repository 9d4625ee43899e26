"""Pieces of work on all cores, handed back in order.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win: two threads trace 1.4 times as fast as one,
two processes 1.9 times (docs/performance.md). So where the system can fork, workers are processes.
They share the scene's memory, which nobody writes, and cost some milliseconds to start.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from .errors import SceneError

Piece = TypeVar("Piece")
Result = TypeVar("Result")

EXECUTORS = ("processes", "threads")
MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are started
RETRIES = 2  # times that lost processes are replaced
LARGEST_BLOCK = 31 << 20  # bytes; larger ones do not move glibc's limits


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


class Workers(Generic[Piece, Result]):
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
        "threads" or "processes".
    """

    def __init__(self, work: Callable[[Piece], Result], count: int, executor: str) -> None:
        self._work, self._count, self._executor = work, count, executor
        self._limits: Any = None
        self._pool: Executor | None = None
        self._retries = RETRIES

    def __enter__(self) -> Self:
        """Hold BLAS to one thread; workers start with the first piece."""
        self._limits = threadpool_limits(1, "blas")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Drop what has not begun, and wait for what has."""
        self._limits.restore_original_limits()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def run(self, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Result]]:
        """Yield each piece with its result, in the order of the pieces.

        Few pieces are under way at once, so memory does not grow with their number.

        Raises
        ------
        SceneError
            If worker processes die again and again.
        """
        running: deque[tuple[Piece, Future[Result]]] = deque()
        for piece in pieces:
            running.append((piece, self._submit(piece)))
            if len(running) > 2 * self._count:
                yield self._first(running)
        while running:
            yield self._first(running)

    def _first(self, running: deque[tuple[Piece, Future[Result]]]) -> tuple[Piece, Result]:
        """Wait for the first of the pieces under way; should workers have died, give all to new ones."""
        while True:
            piece, future = running[0]
            try:
                result = future.result()
            except BrokenProcessPool:
                self._replace(piece)
                again = [each for each, _ in running]
                running.clear()
                running.extend((each, self._submit(each)) for each in again)
                continue
            running.popleft()
            return piece, result

    def _replace(self, piece: Piece) -> None:
        """Make room for a new pool."""
        if not self._retries:
            raise SceneError(
                f"worker processes died {RETRIES + 1} times, at last with {piece} under way; were they "
                "killed for lack of memory? Use fewer workers or a smaller wave_size"
            ) from None
        self._retries -= 1
        assert self._pool is not None
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = None

    def _submit(self, piece: Piece) -> Future[Result]:
        if self._pool is None:
            self._pool = self._start()
        try:
            return self._pool.submit(self._work if self._executor == "threads" else _do, piece)
        except BrokenProcessPool as error:
            failed: Future[Result] = Future()
            failed.set_exception(error)
            return failed

    def _start(self) -> Executor:
        if self._executor == "threads":
            return ThreadPoolExecutor(self._count, "wavefront")
        fork = multiprocessing.get_context("fork")
        pool = ProcessPoolExecutor(self._count, fork, _adopt, (self._work,))
        with _forking():
            pool.submit(int)  # the first task starts all processes
        return pool


@contextmanager
def _forking() -> Iterator[None]:
    """Let children be deaf to Ctrl-C, which the parent answers.

    Forking beside other threads is what Python warns of: a lock that one of them holds stays held in
    the child. Ours take none but their own and those that Python and the C library renew.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*fork.*", DeprecationWarning)
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_adopted: Callable[[Any], Any]  # in a worker process: its work


def _adopt(work: Callable[[Any], Any]) -> None:
    """Begin life as a worker process, which ends with its parent."""
    global _adopted
    _adopted = work
    _prepare_heap()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _prepare_heap() -> None:
    """Have glibc keep what is freed, in large pages; with another C library, do nothing of use.

    All memory of a young process is new, and the system hands it out page by page: 11 600 page faults
    in the first wave. After glibc has freed a block, it takes smaller ones from its heap, and keeps
    twice as much there before it gives any back; and NumPy asks for large pages under large arrays.
    """
    np.empty(LARGEST_BLOCK, np.uint8)
    nearly_twice = [np.empty(9 * LARGEST_BLOCK // 10, np.uint8) for _ in range(2)]
    del nearly_twice


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _do(piece: Any) -> Any:
    return _adopted(piece)

"""Pieces of work on a pool of threads, handed back in order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

from .errors import SceneError

Piece = TypeVar("Piece")
Result = TypeVar("Result")


def worker_count(workers: int | None) -> int:
    """Return the number of threads to use; None means one per core that this process may use.

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


def run_ordered(
    work: Callable[[Piece], Result], pieces: Iterable[Piece], workers: int
) -> Iterator[tuple[Piece, Result]]:
    """Run `work` on every piece and yield each with its result, in the order of the pieces.

    Few pieces are under way at once, so memory does not grow with their number. BLAS is held to
    one thread per worker. When the consumer stops early, pieces that have not begun are dropped.
    """
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(workers, "wavefront") as pool:
        running: deque[tuple[Piece, Future[Result]]] = deque()
        try:
            for piece in pieces:
                running.append((piece, pool.submit(work, piece)))
                if len(running) > 2 * workers:
                    first, future = running.popleft()
                    yield first, future.result()
            while running:
                first, future = running.popleft()
                yield first, future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

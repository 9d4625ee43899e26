"""The contract of a group of workers, and the groups that a pool of `concurrent.futures` makes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from functools import partial
from typing import Any, Protocol, TypeAlias

from .shared import AT_ONCE, SharedNumber, Stopped

LOOK = 0.02  # seconds between two looks at whether workers have ended


class Crew(Protocol):
    """Workers that have been started."""

    def submit(self, job: Any) -> Future[Any]:
        """Give a piece to the first worker that is free."""

    def end(self, running: Collection[Future[Any]]) -> None:
        """End all workers, told what has been submitted; they have been asked to stop."""


class Stoppable:
    """Work that begins only as long as nobody has asked for a stop."""

    def __init__(self, work: Callable[[Any], Any], stop: SharedNumber) -> None:
        self._work, self._stop = work, stop

    def __call__(self, job: Any) -> Any:
        if self._stop.value:
            raise Stopped
        return self._work(job)


CrewMaker: TypeAlias = Callable[[Stoppable, int, SharedNumber], Crew]  # of work, for so many workers
PoolMaker: TypeAlias = Callable[[int], Executor]  # called with the number of workers


class Pool:
    """The workers of a pool that `make` returns, such as `ThreadPoolExecutor`."""

    def __init__(self, make: PoolMaker, work: Stoppable, count: int, stop: SharedNumber) -> None:
        self._work, self._stop = work, stop
        self._pool = make(count)

    def submit(self, job: Any) -> Future[Any]:
        """Give a piece to the first worker that is free."""
        return self._pool.submit(self._work, job)

    def end(self, running: Collection[Future[Any]]) -> None:
        """Wait for the workers, which stop at their next check; after a second Ctrl-C do not wait."""
        self._pool.shutdown(wait=False)
        if all_done(running, math.inf, self._stop):
            self._pool.shutdown(wait=True)


def pooled(make: PoolMaker) -> CrewMaker:
    """Return what starts workers in pools that `make` returns."""
    return partial(Pool, make)


Threads = pooled(partial(ThreadPoolExecutor, thread_name_prefix="wavefront"))


def all_done(futures: Collection[Future[Any]], patience: float, stop: SharedNumber) -> bool:
    """Wait until all futures are done, at most so many seconds and not past a second Ctrl-C."""
    end = time.monotonic() + patience
    while wait_for_futures(futures, LOOK).not_done:
        if stop.value >= AT_ONCE or time.monotonic() > end:
            return False
    return True

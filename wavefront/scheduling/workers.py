"""The contract of workers that have been started, and the workers of an executor of `concurrent.futures`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from functools import partial
from typing import Any, Protocol, TypeAlias

from .shared import AT_ONCE, SharedInt, Stopped

POLL_INTERVAL = 0.02  # seconds between two checks whether workers have ended


class Workers(Protocol):
    """Workers that have been started."""

    def submit(self, job: Any) -> Future[Any]:
        """Give a job to the first worker that is free."""

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """End all workers; `running` are the futures that may not be done. Their stop flag is set, if any."""


class StoppableWork:
    """A function of a job that is called only while the stop flag is not set."""

    def __init__(self, work: Callable[[Any], Any], stop: SharedInt) -> None:
        self._work, self._stop = work, stop

    def __call__(self, job: Any) -> Any:
        if self._stop.value:
            raise Stopped
        return self._work(job)


WorkersMaker: TypeAlias = Callable[[StoppableWork, int, SharedInt], Workers]  # called with their number
ExecutorMaker: TypeAlias = Callable[[int], Executor]  # called with the number of workers


class ExecutorWorkers:
    """The workers of an executor that `make` returns, such as a `ThreadPoolExecutor`."""

    def __init__(self, make: ExecutorMaker, work: StoppableWork, count: int, stop: SharedInt) -> None:
        self._work, self._stop = work, stop
        self._executor = make(count)

    def submit(self, job: Any) -> Future[Any]:
        """Give a job to the first worker that is free."""
        return self._executor.submit(self._work, job)

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """Wait for the workers, which check the stop flag; after a second Ctrl-C do not wait."""
        self._executor.shutdown(wait=False)
        if all_done(running, math.inf, self._stop):
            self._executor.shutdown(wait=True)


def workers_of(make: ExecutorMaker) -> WorkersMaker:
    """Return what starts the workers of executors that `make` returns."""
    return partial(ExecutorWorkers, make)


start_threads = workers_of(partial(ThreadPoolExecutor, thread_name_prefix="wavefront"))


def all_done(futures: Collection[Future[Any]], timeout: float, stop: SharedInt) -> bool:
    """Wait until all futures are done, at most `timeout` seconds and not past a second Ctrl-C.

    Returns
    -------
    bool
        True if all are done.
    """
    end = time.monotonic() + timeout
    while wait_for_futures(futures, POLL_INTERVAL).not_done:
        if stop.value >= AT_ONCE or time.monotonic() > end:
            return False
    return True

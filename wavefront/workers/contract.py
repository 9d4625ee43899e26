"""The contract of workers that have been started, and those of executors of `concurrent.futures`."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from typing import Any, Protocol, TypeAlias

from ..core.errors import collect_warnings, warn_caller
from ..core.shared import AT_ONCE, SharedInt, Stopped

POLL_INTERVAL = 0.02  # seconds between two checks whether workers have ended
END_TIMEOUT = 1.0  # seconds that jobs in the user's own executor have to end


class JobFailed(Exception):
    """A worker has no result for a job; another one may have."""


class Workers(Protocol):
    """Workers that have been started for one kind of work.

    Attributes
    ----------
    replaceable
        Whether other workers can be started when these are lost.
    """

    replaceable: bool

    def submit(self, job: Any, attempt: int = 0) -> Future[Any]:
        """Give a job to the first worker that is free; `attempt` says how often it has failed."""

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a job that is done, or raise JobFailed."""

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """End all workers; `running` are the futures that may not be done. Their stop flag is set, if any."""


class TaskPool(Protocol):
    """Runs functions in workers.

    Attributes
    ----------
    replaceable
        Whether another pool can be made when its workers are lost.
    """

    replaceable: bool

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Have the first worker that is free call a function; if all are lost, the future says so."""

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """End all workers that are ours."""


class StoppableWork:
    """A function of a job that is called only while the stop flag is not set."""

    def __init__(self, work: Callable[[Any], Any], stop: SharedInt) -> None:
        self._work, self.stop = work, stop

    def __call__(self, job: Any) -> Any:
        """Do a job, or raise `Stopped`."""
        if self.stop.value:
            raise Stopped
        return self._work(job)


WorkersMaker: TypeAlias = Callable[[StoppableWork, int, bool], Workers]  # with their number, and `strict`
ExecutorMaker: TypeAlias = Callable[[int], Executor]  # called with the number of workers


class WarningsOfJobs:
    """Repeats the warnings of jobs in the caller, each once."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def repeat(self, messages: Iterable[str]) -> None:
        """Warn of what has not been said yet."""
        for message in messages:
            if message not in self._said:
                self._said.add(message)
                warn_caller(message)


def with_warnings(work: Callable[[Any], Any], job: Any) -> tuple[Any, tuple[str, ...]]:
    """Do a job; return its result and its warnings."""
    with collect_warnings() as messages:
        return work(job), tuple(messages)


class LocalWorkers:
    """Workers that share the memory of this process, so that they need not be sent anything but jobs."""

    def __init__(self, pool: TaskPool, work: Callable[[Any], Any]) -> None:
        self.replaceable = pool.replaceable
        self._pool, self._work, self._warnings = pool, work, WarningsOfJobs()

    def submit(self, job: Any, attempt: int = 0) -> Future[Any]:
        """Give a job to the first worker that is free."""
        return self._pool.submit(with_warnings, self._work, job)

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a job that is done; an error is raised as it is."""
        result, messages = future.result()
        self._warnings.repeat(messages)
        return result

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """End the workers if they are ours."""
        self._pool.shutdown(running)


class ExecutorTasks:
    """Runs functions in the workers of an executor, which ends with the render if it was made for it.

    One that belongs to the caller goes on.
    """

    def __init__(self, executor: Executor, stop: SharedInt, replaceable: bool) -> None:
        self._executor, self._stop, self.replaceable = executor, stop, replaceable

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Have the first worker that is free call a function; if all are lost, the future says so."""
        return submitted(self._executor, function, *args)

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """Withdraw jobs that have not begun, and wait for the others; for those of a caller a moment.

        After a second Ctrl-C nobody waits.
        """
        if self.replaceable:
            self._executor.shutdown(wait=all_done(running, math.inf, self._stop))
        else:
            all_done(running, END_TIMEOUT, self._stop)


def submitted(executor: Executor, function: Callable[..., Any], /, *args: Any) -> Future[Any]:
    """Hand a function to an executor; if all its workers are lost, the future says so."""
    try:
        return executor.submit(function, *args)
    except BrokenExecutor as error:
        failed: Future[Any] = Future()
        failed.set_exception(error)
        return failed


def shares_memory(executor: Executor, stop: SharedInt) -> bool:
    """Return whether the workers of an executor are in this process, as those that it has say themselves.

    Raises
    ------
    Stopped
        If the stop flag is set while an answer is waited for.
    """
    if isinstance(executor, ThreadPoolExecutor | ProcessPoolExecutor):
        return isinstance(executor, ThreadPoolExecutor)
    answer = executor.submit(_process)
    while wait_for_futures([answer], POLL_INTERVAL).not_done:
        if stop.value:
            answer.cancel()
            raise Stopped
    return bool(answer.result() == _process())


def _process() -> tuple[str, int]:
    return platform.node(), os.getpid()


def all_done(futures: Collection[Future[Any]], timeout: float, stop: SharedInt) -> bool:
    """Cancel the futures that have not begun, and wait for the others.

    Waits at most `timeout` seconds and not past a second Ctrl-C.

    Returns
    -------
    bool
        True if all are done.
    """
    running = [future for future in futures if not future.cancel()]
    end = time.monotonic() + timeout
    while wait_for_futures(running, POLL_INTERVAL).not_done:
        if stop.value >= AT_ONCE or time.monotonic() > end:
            return False
    return True

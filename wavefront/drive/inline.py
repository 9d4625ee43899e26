"""The worker of a picture that is one wave: the caller itself, without a thread or a process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextvars import Context, copy_context
from typing import Any, Self, TypeAlias

from ..core.shared import STOP, Stopped
from ..workers.executors import WarningsOfJobs, with_warnings
from ..workers.pool import POLL_INTERVAL, WorkerPool
from .tracing import WaveMonitor


class InlineWorker:
    """Does jobs where it is called, one after the other; the interface is that of `WorkerPool`.

    Parameters
    ----------
    work
        Turns a monitor and a job into a result.
    monitor
        The monitor by which the session watches and stops jobs.
    """

    def __init__(self, work: Callable[[WaveMonitor, Any], Any], monitor: WaveMonitor) -> None:
        self._work, self._monitor, self._warnings = work, monitor, WarningsOfJobs()
        self.closed = False

    def __enter__(self) -> Self:
        """Keep nothing: there are no workers."""
        return self

    def start(self) -> None:
        """Start nothing."""

    def run(
        self, jobs: Iterable[Any], waiting: Callable[[], object] = lambda: None
    ) -> Iterator[tuple[Any, Any]]:
        """Yield each job with its result; every `POLL_INTERVAL` seconds, between two bounces, call `waiting`.

        A job has a context of its own, as in a thread: the caller's `np.errstate` is not that of its wave.

        Raises
        ------
        Stopped
            If the stop flag is set, or a job raised it.
        """
        outside = copy_context()
        monitor = _WatchedMonitor(self._monitor, lambda: outside.run(waiting))
        for job in jobs:
            if self._monitor.stop.value:
                raise Stopped
            result, messages = Context().run(with_warnings, lambda job: self._work(monitor, job), job)
            self._warnings.repeat(messages)
            yield job, result

    def cancel(self) -> None:
        """Reset the stop flag, unless nobody is to wait for anything: no job is under way."""
        if self._monitor.stop.value <= STOP:
            self._monitor.stop.reset()

    def discard(self) -> None:
        """Discard nothing: no job is under way."""

    def close(self) -> None:
        """Set the stop flag: no job begins any more."""
        self._monitor.stop.rise_to(STOP)
        self.closed = True

    begin_closing = close


class _WatchedMonitor(WaveMonitor):
    """A monitor that also gives the caller a turn between two bounces, as while other workers trace."""

    def __init__(self, monitor: WaveMonitor, waiting: Callable[[], object]) -> None:
        self.stop, self.surfaces = monitor.stop, monitor.surfaces
        self._waiting, self._last = waiting, time.perf_counter()

    def check(self, surfaces: int, deadline: float) -> None:
        """Record that a wave has come to another surface of its paths; see `WaveMonitor`."""
        super().check(surfaces, deadline)
        if time.perf_counter() - self._last > POLL_INTERVAL:
            self._waiting()
            self._last = time.perf_counter()


AnyPool: TypeAlias = WorkerPool[Any, Any] | InlineWorker

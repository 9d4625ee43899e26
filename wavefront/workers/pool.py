"""A pool of workers that does jobs and returns the results in the order of the jobs."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future
from concurrent.futures import wait as wait_for_futures
from contextlib import contextmanager
from typing import Any, Generic, Self, TypeVar

from ..arrays.soa import soa
from ..core.errors import RenderError
from ..core.interrupt import deferred_signals
from ..core.shared import AT_ONCE, STOP, SharedInt, Stopped
from .executors import EXECUTORS, ExecutorLike, JobFailed, StoppableWork, Workers, all_done
from .machine import single_threaded_blas

Job = TypeVar("Job")
Result = TypeVar("Result")

RETRIES = 2  # times that lost processes are replaced, or that a job is given to another worker
POLL_INTERVAL = 0.1  # seconds between two checks whether work is to stop
CANCEL_TIMEOUT = 1.0  # seconds that jobs have to end when they are canceled
IDLE_TIMEOUT = 10.0  # seconds after which idle workers end, outside of a context


@soa
class _Submitted(Generic[Job, Result]):
    """A job that was given to workers."""

    job: Job
    future: Future[Any]
    workers: Workers
    attempt: int  # how often it had failed before


class WorkerPool(Generic[Job, Result]):
    """Workers that do one kind of work, as a context manager.

    Workers start with the first job, and BLAS is held to one thread per worker while there are any. Within
    the context they stay until its end. Without a context they end when they were idle for
    `IDLE_TIMEOUT` seconds, and start again with the next job.

    Parameters
    ----------
    work
        Turns a job into its result. Processes have a copy of all that it refers to, as it was when
        they started; jobs and results are pickled. If the processes are not forked, it is pickled, too.
    count
        Number of workers.
    executor
        A name in `EXECUTORS`, or an object that this table takes in place of one.
    stop
        The stop flag. At STOP no job is begun any more, and work that checks the flag may raise `Stopped`;
        at AT_ONCE nobody waits for jobs under way. `close` sets it to STOP.
    strict
        Whether workers that may compute other bits than this machine are an error, not a warning.
    """

    def __init__(
        self,
        work: Callable[[Job], Result],
        count: int,
        executor: str | ExecutorLike,
        stop: SharedInt | None = None,
        strict: bool = False,
    ) -> None:
        self._stop = SharedInt() if stop is None else stop
        self._work, self._count = StoppableWork(work, self._stop), count
        self._make = EXECUTORS.find(executor)
        self._workers: Workers | None = None
        self._strict = strict
        self._running: deque[_Submitted[Job, Result]] = deque()
        self._retries = RETRIES
        self._kept = False  # by a context
        self._last_use = 0.0
        self._lock = threading.RLock()  # of the workers and the deque; the idle timer takes it, too
        self._idle_timer: threading.Thread | None = None  # the last one; it may be over
        self._timed = False  # it is not over
        self._closed = threading.Event()
        self._closing: threading.Thread | None = None

    def __enter__(self) -> Self:
        """Keep workers that are idle."""
        self._kept = True
        return self

    def __exit__(self, *raised: object) -> None:
        """Close the pool."""
        self.close()

    def close(self) -> None:
        """Stop the jobs under way and end all workers; the pool cannot be used again.

        Threads end at their next check of the stop flag. Processes that have not ended after a second are
        killed.
        """
        self._stop.rise_to(STOP)
        self._closed.set()
        try:
            self._end_workers()
        finally:
            for thread in (self._idle_timer, self._closing):
                if thread is not None and thread is not threading.current_thread():
                    thread.join()

    def begin_closing(self) -> None:
        """Begin to close the pool, in a thread of its own: ending processes takes some milliseconds."""
        self._closing = threading.Thread(target=self.close, daemon=True)
        self._closing.start()

    def start(self) -> None:
        """Start the workers now; otherwise the first job does.

        Raises
        ------
        RenderError
            If one cannot be started.
        """
        with self._lock, _start_errors(), deferred_signals():
            if self._workers is None:
                self._start_workers()

    def run(
        self, jobs: Iterable[Job], waiting: Callable[[], object] = lambda: None
    ) -> Iterator[tuple[Job, Result]]:
        """Yield each job with its result, in the order of the jobs.

        Few jobs are under way at once, so memory does not grow with their number. While no result
        comes, `waiting` is called every `POLL_INTERVAL` seconds.

        Raises
        ------
        Stopped
            If the stop flag is set, or a job raised it.
        RenderError
            If worker processes die again and again, or a job fails wherever it is done.
        """
        for job in jobs:
            self._submit(job)
            if len(self._running) > 2 * self._count:
                yield self._first(waiting)
        while self._running:
            yield self._first(waiting)

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed.is_set()

    def cancel(self) -> None:
        """Stop the jobs under way and discard their results; the workers stay for other jobs.

        The stop flag is 0 afterwards, unless it is AT_ONCE.
        """
        with self._lock:
            futures = [submitted.future for submitted in self._running]
            self._running.clear()
        self._stop.rise_to(STOP)
        if not all_done(futures, CANCEL_TIMEOUT, self._stop):
            self._end_workers(futures)
        if self._stop.value < AT_ONCE:
            self._stop.reset()

    def discard(self) -> None:
        """Wait for the jobs under way, but for those that have not begun, and discard their results."""
        with self._lock:
            futures = [submitted.future for submitted in self._running]
            self._running.clear()
        all_done(futures, math.inf, self._stop)

    def _first(self, waiting: Callable[[], object]) -> tuple[Job, Result]:
        """Wait for the first of the jobs under way; those of lost workers are given to others."""
        while True:
            first = self._running[0]
            while not wait_for_futures([first.future], POLL_INTERVAL).done:
                waiting()
                if self._stop.value:
                    raise Stopped
            try:
                result = first.workers.result(first.future)
            except BrokenExecutor as error:
                self._replace(first, error)
                continue
            except JobFailed as failure:
                self._repeat(first, failure)
                continue
            with self._lock:
                self._running.popleft()
                self._last_use = time.monotonic()
            return first.job, result

    def _replace(self, first: _Submitted[Job, Result], error: BrokenExecutor) -> None:
        """Give all jobs under way to new workers."""
        if self._stop.value:
            raise Stopped
        if not first.workers.replaceable:
            raise RenderError(
                f"the executor lost a worker with {first.job} under way, and is broken: {error} It belongs "
                "to the caller and is not replaced; a function that makes executors would be called again"
            ) from error
        if not self._retries:
            raise RenderError(
                f"worker processes died {RETRIES + 1} times, at last with {first.job} under way; were they "
                "killed for lack of memory? Use fewer workers or a smaller wave_size"
            ) from None
        self._retries -= 1
        with self._lock:
            again = list(self._running)
            self._end_workers()
            for submitted in again:
                self._submit(submitted.job, submitted.attempt)

    def _repeat(self, first: _Submitted[Job, Result], failure: JobFailed) -> None:
        """Give the first job to another worker; it stays the first."""
        if self._stop.value:
            raise Stopped
        if first.attempt == RETRIES:
            raise RenderError(f"{first.job} failed {RETRIES + 1} times, at last by: {failure}") from failure
        with self._lock:
            self._submit(first.job, first.attempt + 1)
            self._running[0] = self._running.pop()

    def _submit(self, job: Job, attempt: int = 0) -> None:
        with self._lock, _start_errors(), deferred_signals():
            if self._workers is None:
                self._start_workers()
            assert self._workers is not None
            future = self._workers.submit(job, attempt)
            self._running.append(_Submitted(job, future, self._workers, attempt))
            self._last_use = time.monotonic()

    def _start_workers(self) -> None:
        single_threaded_blas.acquire()
        try:
            self._workers = self._make(self._work, self._count, self._strict)
        except BaseException:
            single_threaded_blas.release()
            raise
        if not self._kept and not self._timed:
            timer = threading.Thread(target=self._end_idle_workers, daemon=True)
            timer.start()
            self._idle_timer, self._timed = timer, True

    def _end_workers(self, running: list[Future[Any]] | None = None) -> None:
        """End all workers; `running` are the futures that may not be done, by default those under way."""
        with self._lock:
            workers, self._workers = self._workers, None
            futures = [submitted.future for submitted in self._running] if running is None else running
            self._running.clear()
        if workers is None:
            return
        try:
            workers.shutdown(futures)
        finally:
            single_threaded_blas.release()

    def _end_idle_workers(self) -> None:
        """End the workers when they were idle for `IDLE_TIMEOUT` seconds. Runs in a thread of its own.

        Results that nobody has fetched yet are kept.
        """
        left = IDLE_TIMEOUT
        while not self._closed.wait(left):
            with self._lock:
                if self._kept or not all(submitted.future.done() for submitted in self._running):
                    self._last_use = time.monotonic()
                left = self._last_use + IDLE_TIMEOUT - time.monotonic()
                if left > 0 and self._workers is not None:
                    continue
                workers, self._workers, self._timed = self._workers, None, False
                if workers is not None:
                    workers.shutdown([])
                    single_threaded_blas.release()
                return


@contextmanager
def _start_errors() -> Iterator[None]:
    """Turn a limit of threads, processes or memory into the error of a render."""
    try:
        yield
    except RenderError:
        raise
    except (RuntimeError, OSError) as error:
        raise RenderError(f"a worker cannot be started: {error}; use fewer workers") from error

"""Workers that are forked processes.

They share the memory of the process that forked them, which nobody writes. Ending them is the difficult
part: nobody may wait for a process that is suspended or busy, and a process that is killed while it reads or
writes leaves a pipe behind on which `concurrent.futures` would wait forever.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from multiprocessing.context import ForkContext, ForkProcess
from multiprocessing.process import BaseProcess
from multiprocessing.queues import SimpleQueue
from typing import Any

import numpy as np

from .shared import AT_ONCE, SharedInt
from .workers import POLL_INTERVAL, StoppableWork, all_done

END_TIMEOUT = 1.0  # seconds that processes have to end by themselves
TERM_TIMEOUT = 0.2  # seconds from SIGTERM to SIGKILL
LARGEST_BLOCK = 31 << 20  # bytes; larger ones do not move glibc's limits


class ForkedWorkers:
    """A pool of forked processes."""

    def __init__(self, work: StoppableWork, count: int, stop: SharedInt) -> None:
        self._stop = stop
        self._context = _Fork()
        self._pool = ProcessPoolExecutor(count, self._context, _initialize_worker, (work,))
        with _forking():
            self._pool.submit(int)  # the first task starts all processes

    def submit(self, job: Any) -> Future[Any]:
        """Give a job to the first process that is free; if one has died, the future says so."""
        try:
            return self._pool.submit(_run, job)
        except BrokenProcessPool as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """Let the processes end when their jobs are done or stopped, or else kill them.

        Processes with jobs that are not done are killed before the pool is shut down: a pool that
        is shut down waits until its queue is read, and does not notice that no reader is left.
        """
        watchdog = threading.Thread(target=self._context.end_processes, args=(self._stop,), daemon=True)
        try:
            if not all_done(running, END_TIMEOUT, self._stop):
                self._context.kill()
            watchdog.start()
            self._pool.shutdown(wait=True)
            watchdog.join()
        except BaseException:
            self._context.kill()
            raise


class _ResultQueue(SimpleQueue):
    """A queue that two threads may close at once: a connection that is closed twice closes another file."""

    def __init__(self, *, ctx: Any) -> None:
        super().__init__(ctx=ctx)
        self._closing = threading.Lock()

    def close(self) -> None:
        """Close both ends."""
        with self._closing:
            super().close()

    def close_writer(self) -> None:
        """Close the end that is written to, so that nobody waits for more."""
        with self._closing:
            self._writer.close()  # type: ignore[attr-defined]


class _Fork(ForkContext):
    """A context that records the processes and queues of a pool, so that they can be ended from outside."""

    def __init__(self) -> None:
        super().__init__()
        self._processes: list[BaseProcess] = []
        self._results: list[Any] = []

    def Process(self, *args: Any, **options: Any) -> ForkProcess:  # type: ignore[override]
        """Make a process."""
        process = ForkProcess(*args, **options)
        self._processes.append(process)
        return process

    def SimpleQueue(self) -> Any:
        """Make the queue of results."""
        queue = _ResultQueue(ctx=self.get_context())
        self._results.append(queue)
        return queue

    def end_processes(self, stop: SharedInt) -> None:
        """Wait for all processes to end, and kill those that do not within `END_TIMEOUT`."""
        end = time.monotonic() + END_TIMEOUT
        while self._alive(POLL_INTERVAL):
            if stop.value >= AT_ONCE or time.monotonic() > end:
                self.kill()
                return

    def kill(self) -> None:
        """End all processes by SIGTERM, and those that are suspended, and so do not react to it, by SIGKILL.

        A process that was ended while it wrote a result leaves a reader that waits for the rest, unless
        all writers are closed.
        """
        for process in self._alive(0):
            process.terminate()
        end = time.monotonic() + TERM_TIMEOUT
        while self._alive(POLL_INTERVAL) and time.monotonic() < end:
            pass
        for process in self._alive(0):
            process.kill()
        for queue in self._results:
            queue.close_writer()

    def _alive(self, timeout: float) -> list[BaseProcess]:
        """Return the processes that have not ended; if there are any, wait so long for one to end."""
        alive = [process for process in self._processes if process.pid is not None]
        for patience in (0, timeout):
            ended = wait([process.sentinel for process in alive], patience) if alive else ()
            alive = [process for process in alive if process.sentinel not in ended]
        return alive


@contextmanager
def _forking() -> Iterator[None]:
    """Fork children that ignore Ctrl-C, which the parent handles.

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


_work: Callable[[Any], Any]  # in a worker process


def _initialize_worker(work: Callable[[Any], Any]) -> None:
    """Prepare a worker process, which ends with its parent."""
    global _work
    _work = work
    _prepare_heap()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _prepare_heap() -> None:
    """Have glibc keep what is freed, in large pages; with another C library, do nothing of use.

    All memory of a young process is new, and the system hands it out page by page: 11 600 page faults
    in the first wave. After glibc has freed a block, it takes smaller ones from its heap, and keeps
    twice as much there before it gives any back; and NumPy asks for large pages under large arrays.
    """
    with suppress(MemoryError):
        np.empty(LARGEST_BLOCK, np.uint8)
        nearly_twice = [np.empty(9 * LARGEST_BLOCK // 10, np.uint8) for _ in range(2)]
        del nearly_twice


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _run(job: Any) -> Any:
    return _work(job)

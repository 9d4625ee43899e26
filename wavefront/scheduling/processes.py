"""A crew of forked processes.

They share the memory of the process that forked them, which nobody writes. Their end is the difficult part:
one that is stopped or busy must not be waited for, and one that is killed while it reads or writes leaves a
pipe behind on which `concurrent.futures` would wait for ever.
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

from .crew import LOOK, Stoppable, all_done
from .shared import AT_ONCE, SharedNumber

PATIENCE = 1.0  # seconds that processes have to end by themselves
LAST_WORDS = 0.2  # seconds from SIGTERM to SIGKILL
LARGEST_BLOCK = 31 << 20  # bytes; larger ones do not move glibc's limits


class Processes:
    """A pool of forked processes."""

    def __init__(self, work: Stoppable, count: int, stop: SharedNumber) -> None:
        self._stop = stop
        self._context = _Fork()
        self._pool = ProcessPoolExecutor(count, self._context, _adopt, (work,))
        with _forking():
            self._pool.submit(int)  # the first task starts all processes

    def submit(self, job: Any) -> Future[Any]:
        """Give a piece to the first process that is free; if one has died, the future says so."""
        try:
            return self._pool.submit(_do, job)
        except BrokenProcessPool as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def end(self, running: Collection[Future[Any]]) -> None:
        """Let the processes end when their pieces are done or stopped, or else kill them.

        Processes with pieces that are not done are killed before the pool is shut down: a pool that
        is shut down waits for its queue to be read, and finds out no longer that nobody is left to.
        """
        watchdog = threading.Thread(target=self._context.end_processes, args=(self._stop,), daemon=True)
        try:
            if not all_done(running, PATIENCE, self._stop):
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
    """Makes what a pool of processes consists of, and remembers it, so that it can be ended from outside."""

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

    def end_processes(self, stop: SharedNumber) -> None:
        """Wait for all processes to end, and kill those that do not within `PATIENCE`."""
        end = time.monotonic() + PATIENCE
        while self._alive(LOOK):
            if stop.value >= AT_ONCE or time.monotonic() > end:
                self.kill()
                return

    def kill(self) -> None:
        """End all processes by SIGTERM, and those that are stopped, and so do not hear it, by SIGKILL.

        One that was ended while it wrote a result leaves a reader that waits for the rest, unless all
        writers are closed.
        """
        for process in self._alive(0):
            process.terminate()
        end = time.monotonic() + LAST_WORDS
        while self._alive(LOOK) and time.monotonic() < end:
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
    with suppress(MemoryError):
        np.empty(LARGEST_BLOCK, np.uint8)
        nearly_twice = [np.empty(9 * LARGEST_BLOCK // 10, np.uint8) for _ in range(2)]
        del nearly_twice


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _do(job: Any) -> Any:
    return _adopted(job)

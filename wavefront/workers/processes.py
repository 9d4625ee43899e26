"""Workers that are processes of this machine: forked, spawned, or forked by a server process.

Forked ones share the memory of the process that forked them, which nobody writes; the others are sent the
scene. Ending them is the difficult part: nobody may wait for a process that is suspended or busy, and a
process that is killed while it reads or writes leaves a pipe behind on which `concurrent.futures` would wait
forever.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from multiprocessing.queues import SimpleQueue
from types import ModuleType
from typing import Any

from ..core.interrupt import SIGNALS
from ..core.shared import AT_ONCE, SharedInt
from .executors import POLL_INTERVAL, LocalWorkers, StoppableWork, all_done, submitted
from .machine import prepare_heap
from .remote import RemoteWorkers

END_TIMEOUT = 1.0  # seconds that processes have to end by themselves
TERM_TIMEOUT = 0.2  # seconds from SIGTERM to SIGKILL
MOST_ON_WINDOWS = 61  # processes of a pool, which waits for all of them at once


def forked_workers(work: StoppableWork, count: int, strict: bool) -> LocalWorkers:
    """Start workers that share the memory of this process."""
    pool = ProcessPool("fork", count, work.stop, work)
    pool.submit(int)  # the first task starts all processes, before there is more to copy
    return LocalWorkers(pool, _call_work)


def spawned_workers(method: str, work: StoppableWork, count: int, strict: bool) -> RemoteWorkers:
    """Start workers that know nothing of this process, by "spawn" or "forkserver"."""
    return RemoteWorkers(ProcessPool(method, count, work.stop), work, strict)


class ProcessPool:
    """A pool of processes.

    Parameters
    ----------
    method
        How they are started: "fork", "spawn" or "forkserver".
    count
        How many.
    stop
        The stop flag.
    work
        The work that forked processes have from the beginning.
    """

    replaceable = True

    def __init__(
        self, method: str, count: int, stop: SharedInt, work: Callable[[Any], Any] | None = None
    ) -> None:
        self._stop, self._forks = stop, method == "fork"
        self._context = _Context(method)
        self._count = min(count, MOST_ON_WINDOWS) if sys.platform == "win32" else count
        context: Any = self._context
        self._pool = ProcessPoolExecutor(self._count, context, _initialize_worker, (work,))

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Have the first process that is free call a function; if all are lost, the future says so.

        Processes start with the first tasks.

        The future cannot be canceled: set the stop flag to end jobs early.
        """
        answer = _Answer()
        with ExitStack() as stack:
            if len(self._context.processes) < self._count:  # this task starts some
                stack.enter_context(self._context.starting())
                stack.enter_context(_blocking_signals())
                stack.enter_context(_forking() if self._forks else _without_main())
            submitted(self._pool, function, *args).add_done_callback(answer.follow)
        return answer

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """Let the processes end when their jobs are done or stopped, or else kill them.

        Processes with jobs that are not done are killed before the pool is shut down: a pool that
        is shut down waits until its queue is read, and does not notice that no reader is left.
        """
        watchdog = threading.Thread(target=self._context.end_processes, args=(self._stop,), daemon=True)
        try:
            if not all_done(running, END_TIMEOUT, self._stop):
                self._context.kill()
            try:
                watchdog.start()
            except RuntimeError:  # there is no memory for a thread
                self._context.kill()
            self._pool.shutdown(wait=True)
            if watchdog.ident is not None:
                watchdog.join()
        except BaseException:
            self._context.kill()
            raise


class _Answer(Future[Any]):
    """A future that cannot be canceled.

    When processes were killed, the thread of `ProcessPoolExecutor` in Python 3.11 fails at the first future
    that was canceled before it had begun, and so leaves the other futures open and the processes unreaped.
    """

    def cancel(self) -> bool:
        """Return False: the job goes on."""
        return False

    def follow(self, done: Future[Any]) -> None:
        """Take the outcome of a future that is done."""
        error = done.exception()
        if error is None:
            self.set_result(done.result())
        else:
            self.set_exception(error)


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


class _Context:
    """A context of multiprocessing that records processes and queues, so that they can be ended from outside.

    Attributes
    ----------
    processes
        Those that were made.
    """

    def __init__(self, method: str) -> None:
        self.processes: list[BaseProcess] = []
        self._context: Any = multiprocessing.get_context(method)
        self._results: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        """Return everything else of the context of multiprocessing."""
        return getattr(self._context, name)

    def Process(self, *args: Any, **options: Any) -> BaseProcess:
        """Make a process."""
        process: BaseProcess = self._context.Process(*args, **options)
        self.processes.append(process)
        return process

    def SimpleQueue(self) -> Any:
        """Make the queue of results."""
        queue = _ResultQueue(ctx=self._context)
        self._results.append(queue)
        return queue

    @contextmanager
    def starting(self) -> Iterator[None]:
        """End the started processes if another one cannot start: Python would wait for them at its end."""
        try:
            yield
        except BaseException:
            self.kill()
            for process in self.processes:
                if process.pid is not None:
                    process.join(TERM_TIMEOUT)
            raise

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
        alive = [process for process in self.processes if process.pid is not None]
        for patience in (0, timeout):
            ended = wait([process.sentinel for process in alive], patience) if alive else ()
            alive = [process for process in alive if process.sentinel not in ended]
        return alive


@contextmanager
def _forking() -> Iterator[None]:
    """Leave out Python's warning of forking beside other threads.

    A lock that one of them holds stays held in the child. Ours take none but their own and those that Python
    and the C library renew.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*fork.*", DeprecationWarning)
        yield


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the user's script, which multiprocessing would run again in every process that is not forked.

    It would render again there if it does not guard itself by `if __name__ == "__main__"`. What it defines
    is pickled with its code.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _blocking_signals() -> Iterator[None]:
    """Start children that do not hear of Ctrl-C and of the end of a terminal, which the parent handles."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_work: Callable[[Any], Any] | None  # in a forked process


def _initialize_worker(work: Callable[[Any], Any] | None) -> None:
    """Prepare a worker process, which ends with its parent."""
    global _work
    _work = work
    prepare_heap()
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _call_work(job: Any) -> Any:
    assert _work is not None
    return _work(job)

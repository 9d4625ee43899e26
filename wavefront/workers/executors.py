"""Executors: the contract of workers, the table of executors, and the choice of one for a render.

NumPy lets go of Python's global lock inside its loops, but between two of them every thread must take
it again, and waiting for it costs more than the loops win (docs/performance.md has figures). So where the
system can fork, workers are processes. They share the scene's memory, which nobody writes, and cost some
milliseconds to start. Elsewhere processes are spawned, and take about a second until they have imported
NumPy and this package and read the scene.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import platform
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeAlias, runtime_checkable

from ..core.cores import core_count
from ..core.errors import SceneError, collect_warnings, warn_caller
from ..core.registry import Registry
from ..core.shared import AT_ONCE, SharedInt, Stopped
from .machine import reserve_buffers

POLL_INTERVAL = 0.02  # seconds between two checks whether workers have ended
END_TIMEOUT = 1.0  # seconds that jobs in the user's own executor have to end
MIN_PATHS = 1 << 18  # fewer are traced sooner than processes are forked
MIN_PATHS_TO_SPAWN = 1 << 22  # fewer are traced sooner than processes are spawned

NAP = 0.05  # seconds for which other threads are watched
BUSY = 0.01  # part of a core; busy threads may get little of one on a busy machine
THREAD_CLOCK = 6  # last bits of the id of the clock of a thread's CPU time, after those of ~thread
# (Linux, include/linux/posix-timers_types.h; `time.pthread_getcpuclockid` may crash when a thread has ended)

WAVES_PER_TASK = 4  # of a cluster, where a task costs 8 ms beside its work, and a wave takes 100 ms

PROCESSES = ("processes", "spawn", "forkserver")  # names of executors whose workers are our own processes


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


@runtime_checkable
class DaskClient(Protocol):
    """The part of `dask.distributed.Client` that is used."""

    loop: Any  # of its network thread

    def submit(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Have a worker call a function."""

    def gather(self, futures: Any, **options: Any) -> Any:
        """Return the results of tasks."""

    def scatter(self, data: Any, **options: Any) -> Any:
        """Send data to the memory of workers."""

    def nthreads(self) -> Mapping[str, int]:
        """Return the number of threads of each worker."""


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
ExecutorLike: TypeAlias = Executor | ExecutorMaker | DaskClient


class WarningsOfJobs:
    """Repeats the warnings of jobs in the caller, each once."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def repeat(self, messages: Iterable[str]) -> None:
        """Warn with each message that is new."""
        for message in messages:
            if message not in self._said:
                self._said.add(message)
                warn_caller(message)


def with_warnings(work: Callable[[Any], Any], job: Any) -> tuple[Any, tuple[str, ...]]:
    """Do a job; return its result and its warnings."""
    with collect_warnings() as messages:
        return work(job), tuple(messages)


class LocalWorkers:
    """Workers that share the memory of this process, so that only jobs are sent to them."""

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
    """Return whether the workers of an executor are in this process; they are asked.

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


def _forks() -> bool:
    """Return whether processes are forked here; elsewhere that is not safe, or not possible."""
    return sys.platform.startswith("linux")


def _processes(work: StoppableWork, count: int, strict: bool) -> Workers:
    from .processes import forked_workers  # here, as not every render needs it

    return forked_workers(work, count, strict) if _forks() else _spawn("spawn", work, count, strict)


def _spawn(method: str, work: StoppableWork, count: int, strict: bool) -> Workers:
    from .processes import spawned_workers

    return spawned_workers(method, work, count, strict)


def _threads(work: StoppableWork, count: int, strict: bool) -> Workers:
    reserve_buffers(count)
    executor = ThreadPoolExecutor(count, thread_name_prefix="wavefront")
    return LocalWorkers(ExecutorTasks(executor, work.stop, replaceable=True), work)


def _made(make: ExecutorMaker, work: StoppableWork, count: int, strict: bool) -> Workers:
    """Start the workers of an executor that is made for them."""
    executor = make(count)
    pool = ExecutorTasks(executor, work.stop, replaceable=True)
    try:
        return _workers_of(executor, pool, work, strict)
    except BaseException:
        pool.shutdown([])
        raise


def _users(executor: Executor, work: StoppableWork, count: int, strict: bool) -> Workers:
    """Use the workers of an executor that belongs to the caller."""
    return _workers_of(executor, ExecutorTasks(executor, work.stop, replaceable=False), work, strict)


def _workers_of(executor: Executor, pool: TaskPool, work: StoppableWork, strict: bool) -> Workers:
    if shares_memory(executor, work.stop):
        return LocalWorkers(pool, work)
    from .remote import RemoteWorkers

    return RemoteWorkers(pool, work, strict)


def _dask(client: DaskClient, work: StoppableWork, count: int, strict: bool) -> Workers:
    from .remote import dask_workers

    return dask_workers(client, work, count, strict)


def _workers_maker(executor: ExecutorLike) -> WorkersMaker:
    """Return the function that starts the workers of an executor that a user gives."""
    if isinstance(executor, DaskClient):
        return partial(_dask, executor)
    if isinstance(executor, Executor):
        return partial(_users, executor)
    return partial(_made, executor)


def _is_executor(thing: Any) -> bool:
    return isinstance(thing, Executor | DaskClient) or callable(thing)


EXECUTORS: Registry[WorkersMaker] = Registry(
    "executor",
    "a concurrent.futures.Executor, a function that returns one, or a dask.distributed.Client",
    {
        "processes": _processes,
        "threads": _threads,
        "spawn": partial(_spawn, "spawn"),
        "forkserver": partial(_spawn, "forkserver"),
    },
    accepts=_is_executor,
    adapt=_workers_maker,
)


def worker_count(workers: int | None, executor: str | ExecutorLike | None = None) -> int:
    """Return the number of workers to use.

    None means all workers of an executor that the user has made, and otherwise one per core that this process
    may use.

    Raises
    ------
    SceneError
        If it is not a whole number of at least 1.
    """
    if workers is None:
        return _workers_in(executor) or core_count()
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SceneError(f"workers is {workers!r}; it must be a whole number of at least 1")
    return workers


def _workers_in(executor: str | ExecutorLike | None) -> int | None:
    """Return the number of workers of an executor; None if it does not say."""
    if isinstance(executor, DaskClient):
        return threads_in(executor)
    if not isinstance(executor, Executor):
        return None
    sizes = getattr(executor, "_max_workers", None), getattr(executor, "num_workers", None)  # the latter: MPI
    return next((size for size in sizes if isinstance(size, int) and size > 0), None)


def threads_in(client: DaskClient) -> int:
    """Return the number of threads of all workers of a cluster.

    Raises
    ------
    SceneError
        If the client does not tell, as it is closed.
    """
    try:
        return sum(client.nthreads().values())
    except Exception as error:  # of whatever kind: a closed client has lost its parts
        raise SceneError(
            f"executor is a client of Dask that does not answer: {error}; is it closed?"
        ) from error


def choose_executor(executor: str | ExecutorLike | None, workers: int, paths: int) -> str | ExecutorLike:
    """Return the executor that was asked for, else "threads" or "processes", the faster one for these paths.

    Warns where it were processes, but the system has no semaphores for them.

    Raises
    ------
    SceneError
        If the name is unknown, or processes are asked for where they cannot be had.
    """
    if executor is not None:
        EXECUTORS.find(executor)
    obstacle = _daemon() or _obstacle_to_starting(str(executor)) if executor in PROCESSES else None
    if obstacle:
        raise SceneError(f"executor is {executor!r}, but {obstacle}; use 'threads'")
    if executor == "forkserver" and executor not in multiprocessing.get_all_start_methods():
        raise SceneError(f"executor is 'forkserver', which {sys.platform} does not have; use 'spawn'")
    if executor is not None:
        return executor
    without_lock = not getattr(sys, "_is_gil_enabled", lambda: True)()
    few = workers == 1 or paths < (MIN_PATHS if _forks() else MIN_PATHS_TO_SPAWN)
    if few or without_lock or _daemon() or (_forks() and _other_threads_compute()):
        return "threads"
    obstacle = _obstacle_to_starting("processes")
    if obstacle:
        warn_caller(f"workers are threads, which are slower than processes: {obstacle}")
    return "threads" if obstacle else "processes"


def _other_threads_compute() -> bool:
    """Return whether other threads of Python are busy in this process.

    Before a fork OpenBLAS waits for its own threads, forever if another thread uses them: `os.fork` hangs.
    Its own threads do no harm where nobody uses them, as in the 0.1 s for which they spin after a render.
    A thread is busy if it used a core meanwhile, or waits for one that other programs keep from it.
    """
    others = {thread.native_id for thread in threading.enumerate() if thread.native_id is not None}
    others.discard(threading.get_native_id())
    if not others:
        return False
    clocks = [~other << 3 | THREAD_CLOCK for other in others]
    begin = _seconds(clocks)
    time.sleep(NAP)
    used = any(end - begin[clock] > BUSY * NAP for clock, end in _seconds(clocks).items() if clock in begin)
    return used or any(map(_runnable, others))


def _runnable(thread: int) -> bool:
    """Return whether a thread of this process has a core or waits for one (Linux, proc(5))."""
    try:
        return Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()[0] == "R"
    except OSError:  # it has ended, or nothing tells
        return False


def _seconds(clocks: Iterable[int]) -> dict[int, float]:
    """Return the seconds of clocks by their ids, but for those of threads that have ended."""
    seconds = {}
    for clock in clocks:
        with suppress(OSError):
            seconds[clock] = time.clock_gettime(clock)
    return seconds


def waves_per_job(executor: str | ExecutorLike) -> int:
    """Return the number of waves that a job may have."""
    return WAVES_PER_TASK if isinstance(executor, DaskClient) else 1


def needs_pickling(executor: str | ExecutorLike) -> bool:
    """Return whether workers of a name can be started only with a scene that can be pickled."""
    return executor in ("spawn", "forkserver") or (executor == "processes" and not _forks())


def _daemon() -> str | None:
    """Return why workers cannot be processes, as this one is a daemon; None if it is none."""
    if multiprocessing.current_process().daemon:
        return "this process is a daemon of multiprocessing, which may have no children"
    return None


def _obstacle_to_starting(executor: str) -> str | None:
    """Return why no processes can be started here; None if they can."""
    return _missing_semaphores() or (_missing_folder() if needs_pickling(executor) else None)


def _missing_folder() -> str | None:
    """Return why processes that are not forked cannot be started; None if there is a folder to start in."""
    try:
        os.getcwd()
    except OSError:
        return "the working folder of this process does not exist any more"
    return None


def _missing_semaphores() -> str | None:
    """Return why workers cannot be processes, as sandboxes have no semaphores for them; None if there are."""
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else None  # leaves nothing behind
    try:
        multiprocessing.get_context(method).Lock()
    except (ImportError, OSError) as error:
        return f"this system has no semaphores for processes ({error}), perhaps as it has no /dev/shm"
    return None

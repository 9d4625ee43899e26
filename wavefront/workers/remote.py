"""Workers that share no memory with this process: the work is sent once to each of them, then jobs alone.

A job comes with a `Payload`, which names the work and says where to read it. The first job of a process loads
it, and later ones find it in `_kept`.
"""

from __future__ import annotations

import copyreg
import io
import os
import pickle
import shutil
import tempfile
import threading
import time
import traceback
import uuid
from collections import ChainMap
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import BrokenExecutor, Future, InvalidStateError
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import count
from typing import Any, Protocol

from ..arrays.soa import soa
from ..core.errors import RenderError, SceneError, warn_caller
from ..core.shared import SharedInt, Stopped
from .executors import (
    END_TIMEOUT,
    DaskClient,
    JobFailed,
    StoppableWork,
    TaskPool,
    WarningsOfJobs,
    all_done,
    with_warnings,
)
from .machine import describe_machine, machine_differences, prepare_heap, single_threaded_blas


class Delivery(Protocol):
    """How the payload reaches workers."""

    def first(self, payload: Payload) -> Any:
        """Return the object that jobs bring along in place of the payload."""

    def again(self, payload: Payload) -> Any:
        """Return that of a job that has failed, perhaps because its worker had no payload."""


class FileDelivery:
    """Workers read the payload from a file; jobs for those that cannot, on other machines, bring it along."""

    def __init__(self, folder: str) -> None:
        self._path = os.path.join(folder, "work")

    def first(self, payload: Payload) -> Payload:
        """Write the file."""
        assert payload.data is not None
        with open(self._path, "xb") as file:
            file.write(payload.data)
        return replace(payload, path=self._path, data=None)

    def again(self, payload: Payload) -> Payload:
        """Return all of it."""
        return payload


class RemoteWorkers:
    """Workers of a pool that share no memory with this process.

    Parameters
    ----------
    pool
        Runs functions in the workers.
    work
        Is pickled.
    strict
        Whether workers that may compute other bits are an error.
    delivery
        How the work reaches workers; by default in a file, as most pools are on this machine.

    Raises
    ------
    SceneError
        If the work cannot be pickled.
    """

    def __init__(
        self, pool: TaskPool, work: StoppableWork, strict: bool, delivery: Delivery | None = None
    ) -> None:
        self.replaceable = pool.replaceable
        self._pool, self._strict, self._stop = pool, strict, work.stop
        self._warned: set[tuple[str, ...]] = set()
        self._warnings = WarningsOfJobs()
        self._folder = tempfile.mkdtemp(prefix="wavefront-")
        try:
            data = pack(work, self._folder)
            self._payload = Payload(uuid.uuid4().hex, describe_machine(), "", data)
            self._delivery = delivery or FileDelivery(self._folder)
            self._reference = self._delivery.first(self._payload)
        except BaseException:
            self._remove_folder()
            raise

    def submit(self, job: Any, attempt: int = 0) -> Future[Any]:
        """Give a job to the first worker that is free."""
        reference = self._delivery.again(self._payload) if attempt else self._reference
        return self._pool.submit(do_job, reference, job)

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a job that is done.

        Raises
        ------
        JobFailed
            If there is none, but another worker may have one.
        RenderError
            If the worker may compute other bits than this machine, and that is an error.
        """
        try:
            reply: Reply = future.result()
        except BrokenExecutor:
            raise
        except Exception as error:
            raise JobFailed(f"{type(error).__name__}: {error}") from error
        self._report(reply.differences)
        if reply.error is not None:
            raise reply.error
        if reply.missing:
            raise JobFailed("a worker has no copy of the scene")
        if reply.failure:
            failure = JobFailed(reply.failure.strip().rpartition("\n")[2])
            failure.add_note(reply.failure)
            raise failure
        self._warnings.repeat(reply.warnings)
        return reply.result

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """End the workers if they are ours, and remove the files shared with them."""
        try:
            self._pool.shutdown(running)
        finally:
            self._stop.leave_stopped()
            self._remove_folder()

    def _report(self, differences: tuple[str, ...]) -> None:
        """Warn once of each kind of worker."""
        if not differences or differences in self._warned:
            return
        self._warned.add(differences)
        message = f"a worker differs from this machine: {', '.join(differences)}"
        if self._strict:
            raise RenderError(f"{message}; with strict=True that is an error")
        warn_caller(f"{message}; the picture may differ in its last bits")

    def _remove_folder(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)


KEEP = 10.0  # seconds from the last job until a process forgets the work


@soa
class Payload:
    """Work, or where to read it."""

    token: str  # names the work
    machine: dict[str, str]  # describes where the render runs
    path: str  # of a file with the work; empty if there is none
    data: bytes | None  # the work, pickled; None where the file has it


@soa
class Reply:
    """The answer of a worker to a job."""

    result: Any = None
    warnings: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()  # between the worker's machine and that of the render
    missing: bool = False  # the worker cannot read the work
    error: Exception | None = None  # Stopped or MemoryError, to be raised again
    failure: str = ""  # any other error, with its traceback


def do_job(payload: Payload, job: Any) -> Reply:
    """Do a job in a worker. No error is raised: not every error can be pickled."""
    try:
        with _kept.use(payload) as (work, differing):
            return _reply(work, job, differing)
    except FileNotFoundError:
        return Reply(missing=True)
    except Exception:  # of a class that this worker does not have, or in another version
        return Reply(failure=traceback.format_exc(), differences=machine_differences(payload.machine))


def _reply(work: Callable[[Any], Any], job: Any, differing: tuple[str, ...]) -> Reply:
    single_threaded_blas.acquire()
    try:
        return Reply(*with_warnings(work, job), differing)
    except (Stopped, MemoryError) as error:
        return Reply(error=error)
    except KeyboardInterrupt:  # a terminal sends Ctrl-C to all processes; the render's own handles it
        return Reply(error=Stopped())
    except Exception:
        return Reply(failure=traceback.format_exc(), differences=differing)
    finally:
        single_threaded_blas.release()


@soa
class _Entry:
    work: Callable[[Any], Any]
    differences: tuple[str, ...]
    users: int = 0
    last_use: float = 0.0


class _KeptWork:
    """The work that was sent to this process; it is kept for `KEEP` seconds after its last job."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._entries: dict[str, _Entry] = {}
        self._sweeper: threading.Thread | None = None

    @contextmanager
    def use(self, payload: Payload) -> Iterator[tuple[Callable[[Any], Any], tuple[str, ...]]]:
        """Find the work, or load it; other threads wait.

        Raises
        ------
        FileNotFoundError
            If it cannot be read here.
        """
        with self._lock:
            entry = self._entries.get(payload.token)
            if entry is None:
                entry = self._entries[payload.token] = _load(payload)
            entry.users += 1
            if self._sweeper is None:
                self._sweeper = threading.Thread(target=self._sweep, name="wavefront-sweeper", daemon=True)
                self._sweeper.start()
        try:
            yield entry.work, entry.differences
        finally:
            with self._lock:
                entry.users -= 1
                entry.last_use = time.monotonic()

    def _sweep(self) -> None:
        """Forget work that has no jobs any more. Runs in a thread of its own, which ends with the last."""
        while True:
            time.sleep(KEEP / 10)
            with self._lock:
                over = time.monotonic() - KEEP
                for token, entry in list(self._entries.items()):
                    if not entry.users and entry.last_use < over:
                        del self._entries[token]
                if not self._entries:
                    self._sweeper = None
                    return


_kept = _KeptWork()


def _load(payload: Payload) -> _Entry:
    prepare_heap()
    data = payload.data
    if data is None:
        with open(payload.path, "rb") as file:
            data = file.read()
    return _Entry(pickle.loads(data), machine_differences(payload.machine))


def pack(work: Any, folder: str) -> bytes:
    """Pickle work, and publish its shared integers as files in a folder.

    Objects that the user's script defines are pickled with their code, where cloudpickle is installed.

    Raises
    ------
    SceneError
        If the work cannot be pickled.
    """
    names = count()

    def publish(shared: SharedInt) -> tuple[Any, ...]:
        path = os.path.join(folder, f"shared{next(names)}")
        shared.publish(path)
        return SharedInt.attach, (path,)

    base = _pickler_class()
    table = ChainMap({SharedInt: publish}, base.dispatch_table)
    pickler_class = type("Publisher", (base,), {"dispatch_table": table})
    buffer = io.BytesIO()
    try:
        pickler_class(buffer, protocol=5).dump(work)
    except Exception as error:  # whatever the classes of the user raise
        raise SceneError(
            f"the scene cannot be sent to workers that share no memory with this process: {error}; "
            "use executor='threads'"
        ) from error
    return buffer.getvalue()


def can_be_sent(thing: Any) -> bool:
    """Return whether workers that share no memory with this process can be sent something."""
    try:
        with tempfile.TemporaryDirectory(prefix="wavefront-") as folder:
            pack(thing, folder)
    except SceneError:
        return False
    return True


def _pickler_class() -> Any:
    try:
        from cloudpickle import Pickler
    except ImportError:
        return _PicklerByName
    return Pickler


class _PicklerByName(pickle.Pickler):
    """Refuses objects of the user's script, which other processes do not find by their name."""

    dispatch_table = copyreg.dispatch_table

    def reducer_override(self, thing: Any) -> Any:
        """Leave all other things to pickle."""
        if isinstance(thing, type) or callable(thing):
            name = getattr(thing, "__qualname__", None)
            if name and getattr(thing, "__module__", None) == "__main__":
                raise pickle.PicklingError(f"{name} is defined in the script itself: pip install cloudpickle")
        return NotImplemented


class ClusterTasks:
    """Runs functions in the workers of a cluster, which belongs to the caller.

    The executor that Dask makes of a client leaves a future open forever if the result of a task is lost
    before it is fetched, with all that it was computed from. Here such a future has an error.
    """

    replaceable = False

    def __init__(self, client: DaskClient, stop: SharedInt) -> None:
        self._client, self._stop = client, stop

    def submit(self, function: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Have the first worker that is free call a function."""
        with _reached():
            task = self._client.submit(function, *args, pure=False)
        answer = Future[Any]()
        answer.add_done_callback(lambda done: task.cancel() if done.cancelled() else None)
        self._client.loop.add_callback(self._fetch, task, answer)
        return answer

    async def _fetch(self, task: Any, answer: Future[Any]) -> None:
        """Wait for a task and pass on its result, or why there is none."""
        with suppress(InvalidStateError):  # it was canceled meanwhile
            try:
                answer.set_result(await self._client.gather(task, asynchronous=True))
            except Exception as error:
                answer.set_exception(error)
            except BaseException as error:  # asyncio's own of tasks that are lost with their scheduler
                answer.set_exception(ConnectionError(f"{type(error).__name__}: {error}"))

    def shutdown(self, running: Collection[Future[Any]]) -> None:
        """Withdraw jobs that have not begun; nobody waits for the others."""
        all_done(running, END_TIMEOUT, self._stop)


class ScatterDelivery:
    """The payload is sent from worker to worker, to the memory of all of them.

    A worker that joins later gets it from another one with its first job. Dask sends a lost worker's jobs to
    others.
    """

    def __init__(self, client: DaskClient) -> None:
        self._client = client

    def first(self, payload: Payload) -> Any:
        """Return the future of the payload, which Dask replaces with the payload."""
        with _reached():
            self._scattered = self._client.scatter(payload, broadcast=True, hash=False)
        return self._scattered

    def again(self, payload: Payload) -> Any:
        """Return the same future, or another one if all workers that had the payload are lost."""
        return self._scattered if self._scattered.status == "finished" else self.first(payload)


@contextmanager
def _reached() -> Iterator[None]:
    """Turn whatever says that a cluster cannot be reached into the error of a render."""
    try:
        yield
    except (MemoryError, SceneError):
        raise
    except Exception as error:
        message = f"{type(error).__name__}: {error}"
        raise RenderError(f"the cluster of Dask cannot be given work: {message}") from error


def dask_workers(client: DaskClient, work: StoppableWork, count: int, strict: bool) -> RemoteWorkers:
    """Return the workers of a cluster, which belongs to the caller."""
    return RemoteWorkers(ClusterTasks(client, work.stop), work, strict, ScatterDelivery(client))

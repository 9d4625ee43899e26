"""The workers of a cluster of dask.distributed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import contextmanager, suppress
from typing import Any, Protocol, runtime_checkable

from ..core.errors import RenderError, SceneError
from ..core.shared import SharedInt
from .contract import END_TIMEOUT, StoppableWork, all_done
from .remote import Payload, RemoteWorkers


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

"""The workers of a cluster of dask.distributed."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from typing import Any, Protocol, runtime_checkable

from .delivery import Payload
from .remote import RemoteWorkers
from .workers import StoppableWork, UsersExecutor


@runtime_checkable
class DaskClient(Protocol):
    """The part of `dask.distributed.Client` that is used."""

    def get_executor(self, **options: Any) -> Executor:
        """Return an executor of the cluster."""

    def scatter(self, data: Any, **options: Any) -> Any:
        """Send data to the memory of workers."""

    def nthreads(self) -> Mapping[str, int]:
        """Return the number of threads of each worker."""


class ScatterDelivery:
    """The payload is sent from worker to worker, to the memory of all of them.

    A worker that joins later gets it from another one with its first job. Dask sends a lost worker's jobs to
    others.
    """

    def __init__(self, client: DaskClient) -> None:
        self._client = client

    def first(self, payload: Payload) -> Any:
        """Return the future of the payload, which Dask replaces with the payload."""
        self._scattered = self._client.scatter(payload, broadcast=True, hash=False)
        return self._scattered

    def again(self, payload: Payload) -> Any:
        """Return the same future, or another one if all workers that had the payload are lost."""
        return self._scattered if self._scattered.status == "finished" else self.first(payload)


def dask_workers(client: DaskClient, work: StoppableWork, count: int, strict: bool) -> RemoteWorkers:
    """Return the workers of a cluster, which belongs to the caller."""
    executor = client.get_executor(pure=False)
    return RemoteWorkers(UsersExecutor(executor, work.stop), work, strict, ScatterDelivery(client))

"""Workers that share no memory with this process: the work is sent once to each of them, then jobs alone."""

from __future__ import annotations

import os
import shutil
import tempfile
import uuid
from collections.abc import Collection
from concurrent.futures import BrokenExecutor, Future
from dataclasses import replace
from typing import Any, Protocol

from ..core.errors import RenderError, warn_caller
from .machine import describe_machine
from .payload import Payload, Reply, do_job, pack
from .workers import JobFailed, StoppableWork, TaskPool, WarningsOfJobs


class Delivery(Protocol):
    """How the payload reaches workers."""

    def first(self, payload: Payload) -> Any:
        """Return what jobs bring along in place of the payload."""

    def again(self, payload: Payload) -> Any:
        """Return what a job brings along that has failed, perhaps because its worker had no payload."""


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
        """End the workers if they are ours, and remove what was shared with them."""
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

"""Work that is sent to workers that share no memory with this process: once to each, where it is kept.

This is the worker's side, with the messages of both. A job comes with a `Payload`, which names the work
and says where to read it. The first job of a process loads it, and later ones find it in `_kept`.
"""

from __future__ import annotations

import copyreg
import io
import os
import pickle
import tempfile
import threading
import time
import traceback
from collections import ChainMap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any

from ..arrays.soa import soa
from ..core.errors import SceneError
from ..core.shared import SharedInt, Stopped
from .blas import single_threaded_blas
from .heap import prepare_heap
from .machine import machine_differences
from .workers import with_warnings

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
    """What a worker answers to a job."""

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
    """The work that was sent to this process, until there was no job of it for `KEEP` seconds."""

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

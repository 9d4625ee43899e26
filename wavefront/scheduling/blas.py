"""BLAS: one thread for each worker, and memory for its calls."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from ..core.interrupt import deferred_signals
from ..core.memory import address_space_left, megabytes
from ..core.plural import plural

# Bytes of address space: OpenBLAS takes 32 MB for each call at a time, and a thread its stack.
BUFFER = 64 << 20
LARGE = 512  # rows of matrices whose product takes some milliseconds, so that two calls overlap


class _SingleThreadedBlas:
    """Holds BLAS to one thread for as long as anybody needs that.

    The number of BLAS's threads is one for the whole process. With a limit for each render, that of two
    overlapping ones that ends last would restore what it had found, which is the other's limit.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._libraries: Any = None
        self._limits: Any = None

    def acquire(self) -> None:
        """Hold BLAS to one thread."""
        with deferred_signals(), self._lock:
            if not self._users:
                self._libraries = ThreadpoolController()
                _let_any_thread_set(self._libraries)
                self._limits = self._libraries.limit(limits=1, user_api="blas")
            self._users += 1

    def release(self) -> None:
        """Let BLAS have as many threads as before, if nobody else needs it to have one."""
        with deferred_signals(), self._lock:
            self._users -= 1
            if not self._users:
                _let_any_thread_set(self._libraries)
                self._limits.restore_original_limits()
                _let_any_thread_set(self._libraries)

    def __enter__(self) -> None:
        """Hold BLAS to one thread."""
        self.acquire()

    def __exit__(self, *raised: object) -> None:
        """Let BLAS have as many threads as before."""
        self.release()


def _let_any_thread_set(libraries: Any) -> None:
    """Let any thread set the number of threads of OpenBLAS, as this one is about to.

    From 3.8 on threadpoolctl lets only that thread do so which did first, and nothing happens where others
    try. But renders are ended by threads of their own.
    """
    for each in libraries.lib_controllers:
        clear = getattr(each, "clear_controlling_thread", None)
        if clear is not None:
            clear(force=True)


single_threaded_blas = _SingleThreadedBlas()


def reserve_buffers(threads: int) -> None:
    """Have OpenBLAS take the memory now that a number of threads needs at a time.

    It ends the process when it finds none, so it should not look for it when waves have taken the rest.
    Nothing is done where the address space has no limit: there the memory is always found.

    Raises
    ------
    MemoryError
        If there is not enough.
    """
    left = address_space_left()
    if left == math.inf:
        return
    if left < threads * BUFFER:
        raise MemoryError(f"BLAS needs {megabytes(threads * BUFFER)} for {plural(threads, 'thread')}")
    together = threading.Barrier(threads)
    matrix = np.ones((LARGE, LARGE))

    def multiply() -> None:
        together.wait()
        matrix @ matrix

    workers = [threading.Thread(target=multiply) for _ in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()

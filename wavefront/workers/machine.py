"""The machine of workers: one thread of BLAS, a heap that is kept; and the libraries that bits depend on."""

from __future__ import annotations

import ctypes
import math
import platform
import sys
import threading
from contextlib import suppress
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from ..core.interrupt import deferred_signals
from ..core.memory import address_space_left, megabytes
from ..core.plural import plural
from ..version import VERSION

# Bytes of address space: OpenBLAS takes 32 MB for each call at a time, and a thread its stack.
BUFFER = 64 << 20
LARGE = 512  # rows of matrices whose product takes some milliseconds, so that two calls overlap


class _SingleThreadedBlas:
    """Holds BLAS to one thread for as long as anybody needs that.

    The number of BLAS's threads is one for the whole process. With a limit for each render, the one
    of two overlapping renders that ends last would restore the other's limit.
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
    for library in libraries.lib_controllers:
        clear = getattr(library, "clear_controlling_thread", None)
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


M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
LARGEST_BLOCK = 31 << 20  # bytes; glibc takes larger blocks from the system in any case
BLOCKS = 3  # of that size that are kept: a wave of shared paths takes nearly as much


def prepare_heap() -> None:
    """Have glibc keep freed memory, in large pages; with another C library, do nothing of use.

    All memory of a young process is new, and the system hands it out page by page: 11 600 page faults
    in the first wave. So the heap is grown to the size that glibc keeps before it gives any back, and NumPy
    asks for large pages under large arrays. The limits are set since environments may say otherwise: workers
    of Dask are started with MALLOC_TRIM_THRESHOLD_=65536, and every wave got all of its memory anew: it took
    twice the time.
    """
    with suppress(AttributeError, OSError, TypeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_TRIM_THRESHOLD, BLOCKS * LARGEST_BLOCK)
        mallopt(M_MMAP_THRESHOLD, LARGEST_BLOCK)
    with suppress(MemoryError):
        grown = [np.empty(9 * LARGEST_BLOCK // 10, np.uint8) for _ in range(BLOCKS)]
        del grown


def trim_heap() -> None:
    """Have glibc give free memory back to the system; with another C library, do nothing."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


NONE = "none"


def describe_machine() -> dict[str, str]:
    """Return the properties, by name, that the bits of results of this process depend on."""
    described = {
        "wavefront": VERSION,
        "NumPy": np.__version__,
        "architecture": platform.machine(),
        "CPU features": " ".join(_cpu_features()) or NONE,
    }
    if "embreex" in sys.modules:
        described["embreex"] = _embreex_version()
    return described


def machine_differences(here: dict[str, str]) -> tuple[str, ...]:
    """Return the differences of this process from the machine that was described, in words."""
    there = describe_machine()
    if "embreex" in here and "embreex" not in there:
        there["embreex"] = _embreex_version()
    return tuple(
        _difference(name, value, there[name]) for name, value in here.items() if there[name] != value
    )


def _difference(name: str, here: str, there: str) -> str:
    if name != "CPU features":
        return f"{name} {there} in place of {here}"
    ours, theirs = set(here.split()), set(there.split())
    added, missing = " ".join(sorted(theirs - ours)), " ".join(sorted(ours - theirs))
    parts = [f"{text} {names}" for text, names in (("with", added), ("without", missing)) if names]
    return f"a CPU {' and '.join(parts)}"


def _cpu_features() -> list[str]:
    """Return the extensions of the processor that NumPy uses; as `np.show_runtime` finds them."""
    from numpy._core import _multiarray_umath as umath  # type: ignore[attr-defined]

    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]]


def _embreex_version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("embreex")
    except PackageNotFoundError:
        return NONE

"""The heap of processes: what workers keep of it, and what is given back to the system."""

from __future__ import annotations

import ctypes
from contextlib import suppress

import numpy as np

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
LARGEST_BLOCK = 31 << 20  # bytes; glibc takes larger blocks from the system in any case
BLOCKS = 3  # of that size that are kept: a wave of shared paths takes nearly as much


def prepare_heap() -> None:
    """Have glibc keep what is freed, in large pages; with another C library, do nothing of use.

    All memory of a young process is new, and the system hands it out page by page: 11 600 page faults
    in the first wave. So the heap is grown to what glibc keeps before it gives any back, and NumPy asks for
    large pages under large arrays. The limits are set since environments may say otherwise: workers of
    Dask are started with MALLOC_TRIM_THRESHOLD_=65536, and every wave got all of its memory anew, which took
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
    """Have glibc give back to the system what is free; with another C library, do nothing."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)

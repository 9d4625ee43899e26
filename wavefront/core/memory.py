"""Memory: how much is in use and available, so that a picture that needs more is refused before any work."""

from __future__ import annotations

import gc
import math
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from .errors import SceneError

if sys.platform != "win32":
    import resource

UNITS = {
    "": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12,
    "KIB": 2**10, "MIB": 2**20, "GIB": 2**30, "TIB": 2**40,
}  # fmt: skip
UNKNOWN_RESIDENT = 150 * 10**6  # bytes that a process is taken to use where the system does not say


def address_space_left() -> float:
    """Return the number of bytes that this process may still map (`ulimit -v`); infinite without a limit."""
    if not sys.platform.startswith("linux"):
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return max(0, limit - pages * resource.getpagesize())


def available_memory() -> float:
    """Return the number of bytes that can still be allocated; infinite where it is unknown."""
    return min(address_space_left(), _bytes_in("/proc/meminfo", "MemAvailable:", math.inf))


def resident_memory() -> int:
    """Return the memory that this process uses now, bytes; a guess where the system does not say."""
    return int(_bytes_in("/proc/self/smaps_rollup", "Pss:", UNKNOWN_RESIDENT))


def _bytes_in(path: str, name: str, unknown: float) -> float:
    """Return the number of bytes that a file of Linux has, in kB, beside a name."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        return unknown
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(name)), unknown)


def memory_size(name: str, value: Any) -> int:
    """Return a size in bytes, from a number of bytes or a text such as "2GB", "1.5 GiB" or "800MB".

    KB, MB, GB and TB are powers of 1000, KiB, MiB, GiB and TiB powers of 1024.

    Raises
    ------
    SceneError
        If it is neither, or not above 0.
    """
    size = math.nan
    if isinstance(value, str):
        match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]*)\s*", value)
        if match and match[2].upper() in UNITS:
            size = float(match[1]) * UNITS[match[2].upper()]
    elif isinstance(value, int | float | np.number) and not isinstance(value, bool):
        size = float(value)
    if not 1 <= size < math.inf:
        raise SceneError(
            f'{name} is {value!r}; it must be a number of bytes, or a size such as "2GB", "800MB" or "1.5GiB"'
        )
    return int(size)


def check_memory(what: str, needed: int) -> None:
    """Check that `needed` bytes are available.

    Raises
    ------
    SceneError
        If they are not. The message says their use.
    """
    available = available_memory()
    if needed > available:
        raise SceneError(f"{what} needs {megabytes(needed)} of memory; {megabytes(available)} are available")


def megabytes(size: float) -> str:
    """Return a number of bytes as text for messages."""
    return f"{size / 1e6:,.0f} MB"


@contextmanager
def unwatched() -> Iterator[None]:
    """Make very many objects without the garbage collector looking through all of them again and again."""
    watched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if watched:
            gc.enable()

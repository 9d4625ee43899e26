"""How much memory there is, so that what cannot be had is refused before work."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from .errors import SceneError

if sys.platform != "win32":
    import resource


def address_space_left() -> float:
    """Bytes that this process may still map under its limit (`ulimit -v`); infinite without one."""
    if not sys.platform.startswith("linux"):
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return max(0, limit - pages * resource.getpagesize())


def available_memory() -> float:
    """Bytes that can still be allocated; infinite where nobody says."""
    return min(address_space_left(), _free_memory())


def _free_memory() -> float:
    """Bytes that the machine can give without swapping."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return math.inf
    found = (line.split() for line in lines if line.startswith("MemAvailable:"))
    return next((1024 * int(words[1]) for words in found), math.inf)


def check_memory(what: str, needed: int) -> None:
    """Check that there are so many bytes.

    Raises
    ------
    SceneError
        If there are not, naming what they are for.
    """
    available = available_memory()
    if needed > available:
        raise SceneError(
            f"{what} needs {_megabytes(needed)} of memory; {_megabytes(available)} are available"
        )


def _megabytes(size: float) -> str:
    return f"{size / 1e6:,.0f} MB"

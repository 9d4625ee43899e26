"""Available memory, so that a picture that needs more is refused before any work."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from .errors import SceneError

if sys.platform != "win32":
    import resource


def address_space_left() -> float:
    """Return how many bytes this process may still map (`ulimit -v`); infinite without a limit."""
    if not sys.platform.startswith("linux"):
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return max(0, limit - pages * resource.getpagesize())


def available_memory() -> float:
    """Return the number of bytes that can still be allocated; infinite where it is unknown."""
    return min(address_space_left(), _free_memory())


def _free_memory() -> float:
    """Return how many bytes the machine can provide without swapping."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return math.inf
    found = (line.split() for line in lines if line.startswith("MemAvailable:"))
    return next((1024 * int(words[1]) for words in found), math.inf)


def check_memory(what: str, needed: int) -> None:
    """Check that `needed` bytes are available.

    Raises
    ------
    SceneError
        If they are not. The message says what they are for.
    """
    available = available_memory()
    if needed > available:
        raise SceneError(
            f"{what} needs {_megabytes(needed)} of memory; {_megabytes(available)} are available"
        )


def _megabytes(size: float) -> str:
    return f"{size / 1e6:,.0f} MB"

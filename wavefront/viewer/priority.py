"""Workers that give way to the browser."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

NICENESS = 10  # of 19: such a process gets about a tenth of a core that another one wants


@contextmanager
def giving_way() -> Iterator[None]:
    """Give processes that are started meanwhile a low priority, where the system has such.

    All cores trace while a picture refines. The page that shows it and this process, which sends it, need one
    at once when the view moves.
    """
    before = {process.pid for process in multiprocessing.active_children()}
    yield
    if hasattr(os, "setpriority"):
        for process in multiprocessing.active_children():
            if process.pid is not None and process.pid not in before:
                with suppress(OSError):  # it may have ended
                    priority = os.getpriority(os.PRIO_PROCESS, process.pid)
                    os.setpriority(os.PRIO_PROCESS, process.pid, max(priority, NICENESS))

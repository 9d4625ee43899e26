"""Import of trimesh, and calls of its loaders, in which Ctrl-C is not lost.

trimesh catches BaseException about optional imports and within some loaders, so a KeyboardInterrupt that
is raised there would vanish, and leave a module half imported.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


def import_trimesh() -> Any:
    """Return the module trimesh. A Ctrl-C that comes while it is imported raises afterwards."""
    with ctrl_c_is_kept(wait=True):
        import trimesh
    return trimesh


@contextmanager
def ctrl_c_is_kept(wait: bool) -> Iterator[None]:
    """Raise KeyboardInterrupt at the end of the context if Ctrl-C came and nobody has heard of it.

    Signal handlers run in the main thread alone, so in another thread the context does nothing, and neither
    where the program has a handler of its own.

    Parameters
    ----------
    wait
        Whether it is not raised before the end.
    """
    default = signal.default_int_handler
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not default:
        yield
        return
    pressed = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        pressed.set()
        if not wait:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, default)
        if pressed.is_set():
            raise KeyboardInterrupt

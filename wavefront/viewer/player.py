"""The time of a scene that moves: it is set, or runs on as a clock does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

LEAST = 0.02  # seconds between two looks at the clock


class Player:
    """Lets the time of a scene run on, from its start again after its end.

    Parameters
    ----------
    span
        Its start and end, seconds.
    seek
        Shows the scene at a time, and returns when a picture of it has been seen.
    """

    def __init__(self, span: tuple[float, float], seek: Callable[[float], object]) -> None:
        self._span, self._seek = span, seek
        self.time = span[0]
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()

    @property
    def playing(self) -> bool:
        """Whether the time runs on."""
        return self._thread is not None and self._thread.is_alive()

    def play(self) -> None:
        """Let the time run on from where it is; it does nothing while it does so."""
        if not self.playing:
            self._stop.clear()
            self._thread = threading.Thread(target=self._run, name="wavefront-player", daemon=True)
            self._thread.start()

    def pause(self) -> None:
        """Hold the time, and wait until no picture is asked for any more."""
        self._stop.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        start, end = self._span
        last = time.perf_counter()
        while not self._stop.wait(LEAST):
            now = time.perf_counter()
            self.time = start + (self.time - start + now - last) % ((end - start) or 1.0)
            last = now
            self._seek(self.time)

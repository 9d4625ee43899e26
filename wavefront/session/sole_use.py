"""The use of a session: by one thread at a time, and not within itself."""

from __future__ import annotations

import threading

from ..core.errors import RenderError


class SoleUse:
    """A context that nobody can enter while it is entered: a second one gets an error, and does not wait."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._user = 0  # the thread that is within

    def __enter__(self) -> None:
        """Enter.

        Raises
        ------
        RenderError
            If the context is entered already.
        """
        if not self._lock.acquire(blocking=False):
            by = "another thread" if self.elsewhere else "the caller of this function"
            raise RenderError(f"the session is in use by {by}; meanwhile it can only be stopped or dropped")
        self._user = threading.get_ident()

    def __exit__(self, *raised: object) -> None:
        """Let others enter."""
        self._user = 0
        self._lock.release()

    @property
    def elsewhere(self) -> bool:
        """Whether another thread is within."""
        return self._lock.locked() and self._user != threading.get_ident()

    def wait(self) -> None:
        """Wait until nobody is within."""
        with self._lock:
            pass

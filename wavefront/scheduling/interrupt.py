"""Ctrl-C as a question that is answered between two waves, not as an error anywhere."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Self

from .shared import AT_ONCE, STOP, SharedNumber


class CtrlC:
    """Within this context Ctrl-C stops the work that looks at `stop`, and raises nothing.

    A KeyboardInterrupt could come while samples are added to the film, or while worker processes are
    being ended, and leave half of it undone. The first Ctrl-C therefore sets `stop` to STOP, the second
    to AT_ONCE, and only a third raises. Python calls handlers of signals in the main thread alone, so in
    another thread the context does nothing, and neither where the program has a handler of its own.

    Attributes
    ----------
    pressed
        Whether Ctrl-C was pressed.
    """

    def __init__(self, stop: SharedNumber) -> None:
        self.pressed = False
        self._stop = stop
        self._installed = False

    def __enter__(self) -> Self:
        """Answer Ctrl-C from now on."""
        in_main_thread = threading.current_thread() is threading.main_thread()
        if in_main_thread and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._answer)
            self._installed = True
        return self

    def __exit__(self, *error: object) -> None:
        """Let Ctrl-C raise KeyboardInterrupt again."""
        if self._installed:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _answer(self, number: int, frame: FrameType | None) -> None:
        if self.pressed and self._stop.value >= AT_ONCE:
            raise KeyboardInterrupt
        self._stop.rise_to(AT_ONCE if self.pressed else STOP)
        self.pressed = True

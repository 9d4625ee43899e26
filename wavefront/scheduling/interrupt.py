"""Ctrl-C sets a stop flag, which is checked between two waves, instead of raising an error anywhere."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Self

from .shared import AT_ONCE, STOP, SharedInt

NAMES = "SIGTERM", "SIGHUP", "SIGINT"  # Windows has no SIGHUP, which says that the terminal was closed
SIGNALS = [signal.Signals[name] for name in NAMES if name in signal.Signals.__members__]


class InterruptHandler:
    """A context in which Ctrl-C sets a stop flag and raises nothing.

    A KeyboardInterrupt could come while samples are added to the film, or while worker processes are
    being ended, and leave half of it undone. The first Ctrl-C therefore sets `stop` to STOP, the second
    to AT_ONCE, and only a third raises. Python calls signal handlers in the main thread alone, so in
    another thread the context does nothing, and neither where the program has a handler of its own.
    SIGTERM and SIGHUP count as Ctrl-C where the program handles them by `signal.default_int_handler`, too.
    The context can be entered again within itself. The outermost exit restores Python's handler, and raises
    KeyboardInterrupt if Ctrl-C was pressed and nothing else is raised.

    Attributes
    ----------
    pressed
        Whether Ctrl-C was pressed.
    """

    def __init__(self, stop: SharedInt) -> None:
        self.pressed = False
        self._stop = stop
        self._signals: list[signal.Signals] = []  # for which the handler is installed
        self._depth = 0  # of contexts since then
        self._answered = True  # with an exception, each first Ctrl-C

    def __enter__(self) -> Self:
        """Install the handler."""
        in_main_thread = threading.current_thread() is threading.main_thread()
        if self._depth and in_main_thread:
            self._depth += 1
        elif in_main_thread:
            default = signal.default_int_handler
            self._signals = [each for each in SIGNALS if signal.getsignal(each) is default]
            for each in self._signals:
                signal.signal(each, self._handle)
            self._depth = min(1, len(self._signals))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let Ctrl-C raise KeyboardInterrupt again."""
        if not self._depth or threading.current_thread() is not threading.main_thread():
            return
        self._depth -= 1
        if self._depth:
            return
        for each in self._signals:
            signal.signal(each, signal.default_int_handler)
        answered, self._answered = self._answered or kind is not None, True
        if not answered:
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.pressed and self._stop.value >= AT_ONCE:
            raise KeyboardInterrupt
        self._stop.rise_to(AT_ONCE if self.pressed else STOP)
        if not self.pressed:
            self.pressed, self._answered = True, False


@contextmanager
def deferred_signals() -> Iterator[None]:
    """Have the program's handlers of signals wait until the block is over.

    A handler that raises may do so between any two bytecodes of the main thread, whichever thread of the
    system took the signal: a mask of the main thread alone keeps nothing away. What must be whole, such as
    the start of processes, which nobody could end whose id was lost, belongs in such a block. A second
    signal of a kind does not wait, as what is done may hang.
    """
    if threading.current_thread() is not threading.main_thread():  # no handler is called here
        yield
        return
    waiting: list[int] = []
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    handlers = {number: handler for number, handler in handlers.items() if _may_raise(handler)}

    def wait(number: int, frame: FrameType | None) -> None:
        if number not in waiting:
            waiting.append(number)
        else:
            handler = handlers[signal.Signals(number)]
            assert callable(handler)
            handler(number, frame)

    try:
        for number in handlers:
            signal.signal(number, wait)
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for came in waiting:
            signal.raise_signal(came)


def _may_raise(handler: object) -> bool:
    """Return whether a handler is one of Python, and none that sets a flag."""
    return callable(handler) and not isinstance(getattr(handler, "__self__", None), InterruptHandler)

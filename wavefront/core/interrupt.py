"""Ctrl-C and the other signals that end a program: all of their handlers.

Python calls handlers in the main thread alone, between any two of its bytecodes. In other threads nothing
here does anything.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

from .shared import AT_ONCE, STOP, SharedInt

ORPHAN_TIMEOUT = 1.0  # seconds that a process has to end after its parent
NAMES = "SIGTERM", "SIGHUP", "SIGINT"  # Windows has no SIGHUP, which says that the terminal was closed
SIGNALS = [signal.Signals[name] for name in NAMES if name in signal.Signals.__members__]


def end_with_parent() -> None:
    """Interrupt this process of multiprocessing once its parent has ended: nobody takes its results.

    The sentinel tells that, which a process has only if multiprocessing started it. The id of the parent also
    changes where a terminal is closed and a script goes on. A process that catches the exception, as those of
    `concurrent.futures` do, ends a moment later: the others that it was forked with wait for that.

    Raises
    ------
    KeyboardInterrupt
        If the parent has ended.
    """
    parent = multiprocessing.parent_process()
    if parent is None or parent.sentinel is None:  # a process of loky has a parent, without a sentinel
        return
    if not parent.is_alive():
        timer = threading.Timer(ORPHAN_TIMEOUT, os._exit, (1,))
        timer.daemon = True
        timer.start()
        raise KeyboardInterrupt("the process that started this one has ended")


class InterruptHandler:
    """A context in which Ctrl-C sets a stop flag and raises nothing.

    A KeyboardInterrupt could come while samples are added to the film, or while worker processes are
    being ended, and leave half of it undone. The first Ctrl-C therefore sets `stop` to STOP, the second
    to AT_ONCE, and only a third raises. Where the program has a handler of its own, the context does nothing.
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

    def watch(self, stop: SharedInt) -> None:
        """Set another stop flag from now on, and at once if Ctrl-C was pressed in this context."""
        self._stop, self.pressed = stop, not self._answered
        if self.pressed:
            stop.rise_to(STOP)

    def __enter__(self) -> Self:
        """Install the handler."""
        in_main_thread = threading.current_thread() is threading.main_thread()
        if self._depth and in_main_thread:
            self._depth += 1
        elif in_main_thread:
            default = signal.default_int_handler
            self._signals = [signum for signum in SIGNALS if signal.getsignal(signum) is default]
            for signum in self._signals:
                signal.signal(signum, self._handle)
            self._depth = min(1, len(self._signals))
        return self

    def __exit__(self, kind: object, *raised: object) -> None:
        """Let Ctrl-C raise KeyboardInterrupt again."""
        if not self._depth or threading.current_thread() is not threading.main_thread():
            return
        self._depth -= 1
        if self._depth:
            return
        for signum in self._signals:
            signal.signal(signum, signal.default_int_handler)
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
def deferred_signals(also_the_second: bool = False) -> Iterator[None]:
    """Have the program's handlers of signals wait until the block is over.

    A handler that raises may do so anywhere in the main thread, whichever thread of the system took the
    signal: a mask of the main thread alone keeps nothing away. Steps that must not be cut in two belong in
    such a block, such as the start of processes: nobody could end one whose id was lost. A second signal of a
    kind does not wait unless it is asked for, as the code may hang.
    """
    waiting: list[int] = []
    before = _handlers(_may_raise)

    def wait(number: int, frame: FrameType | None) -> None:
        if number not in waiting:
            waiting.append(number)
        elif not also_the_second:
            before[number](number, frame)

    try:
        with _handled_by(wait, before):
            yield
    finally:
        for number in waiting:
            signal.raise_signal(number)


@contextmanager
def repeated_ctrl_c() -> Iterator[None]:
    """Have Ctrl-C raise at once, and again at the end of the block, which may swallow the first error."""
    before = _handlers(lambda handler: handler is signal.default_int_handler)
    pressed = threading.Event()

    def press(number: int, frame: FrameType | None) -> None:
        pressed.set()
        raise KeyboardInterrupt

    try:
        with _handled_by(press, before):
            yield
    finally:
        if pressed.is_set():
            raise KeyboardInterrupt


@contextmanager
def endings_as_ctrl_c() -> Iterator[list[int]]:
    """Handle SIGTERM and SIGHUP as Ctrl-C, but for one that is ignored, as `nohup` has it.

    A second SIGTERM ends the program at once. SIGHUP, which says that the terminal was closed, may come from
    the system and from the shell, and beside SIGTERM: it counts once.

    Yields
    ------
    list
        The number of the signal that interrupts, if not SIGINT, at the end.
    """
    before = _handlers(lambda handler: handler != signal.SIG_IGN)
    before.pop(signal.SIGINT, None)
    came: list[int] = []

    def handle(number: int, frame: FrameType | None) -> None:
        came.append(number)
        for signum in before:
            if signum != signal.SIGTERM:
                signal.signal(signum, signal.SIG_IGN)
            elif signum == number:
                signal.signal(signum, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)

    handler: Callable[[int, FrameType | None], Any] = handle
    if before and not callable(signal.getsignal(signal.SIGINT)):  # ignored, as in the background of a script
        handler = signal.default_int_handler
        came.append(signal.SIGTERM)  # if anything interrupts
    with _handled_by(handler, before):
        yield came


def _handlers(wanted: Callable[[Any], bool]) -> dict[int, Any]:
    """Return the handlers of signals for which `wanted` is true; none in other threads than the main one."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    return {number: handler for number, handler in handlers.items() if wanted(handler)}


@contextmanager
def _handled_by(handler: Callable[[int, FrameType | None], Any], before: Mapping[int, Any]) -> Iterator[None]:
    """Have a function handle signals in place of the handlers that they have, which come back at the end."""
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def _may_raise(handler: object) -> bool:
    """Return whether a handler is one of Python, and none that sets a flag."""
    return callable(handler) and not isinstance(getattr(handler, "__self__", None), InterruptHandler)

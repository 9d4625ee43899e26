"""A loop that calls a function becomes a generator of the arguments of that function."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextvars import Context
from queue import SimpleQueue
from threading import Semaphore, Thread
from typing import Any, TypeVar

T = TypeVar("T")


class _Dropped(BaseException):
    """Nobody wants the rest."""


def in_turns(loop: Callable[[Callable[[T], None]], None]) -> Generator[T, None, None]:
    """Yield the objects that a loop gives to the function that it is called with.

    The loop runs in a thread of its own, and waits while the caller looks at each. It ends where the
    generator is closed.
    """
    turn, queue = Semaphore(0), SimpleQueue[Any]()
    dropped = False

    def give(thing: T) -> None:
        queue.put((thing, None))
        turn.acquire()
        if dropped:
            raise _Dropped

    def run() -> None:
        turn.acquire()
        try:
            if not dropped:
                loop(give)
            queue.put(None)
        except BaseException as error:
            queue.put((None, error))

    thread = Thread(target=Context().run, args=(run,), daemon=True)
    thread.start()
    try:
        while True:
            turn.release()
            item = queue.get()
            if item is None:
                return
            thing, error = item
            if error is not None:
                raise error
            yield thing
    finally:
        dropped = True
        turn.release()
        thread.join()

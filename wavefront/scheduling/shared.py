"""An integer that this process and those forked from it share, and the exception of work that was stopped."""

from __future__ import annotations

import mmap

STOP = 1  # value of a stop flag: work ends at its next check
AT_ONCE = 2  # value of a stop flag: nobody waits for the work any longer


class Stopped(Exception):
    """Work ended because a stop flag was set, or because its time was up. Its results are discarded."""


class SharedInt:
    """An integer in memory that threads share, and processes that are forked after it was made.

    A stop flag is one of these, with the values 0, `STOP` and `AT_ONCE`.

    The memory has no name, so nothing of it is left when the last process that has it ends. Writing
    takes no lock: of two simultaneous writes one wins.
    """

    def __init__(self) -> None:
        self._value = memoryview(mmap.mmap(-1, 8)).cast("q")

    @property
    def value(self) -> int:
        """The integer, at first 0."""
        return self._value[0]

    def rise_to(self, value: int) -> None:
        """Make the integer at least `value`."""
        if self._value[0] < value:
            self._value[0] = value

    def reset(self) -> None:
        """Make the integer 0."""
        self._value[0] = 0

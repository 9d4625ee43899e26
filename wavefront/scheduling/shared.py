"""A number that this process and those forked from it share, and the error of work that was told to stop."""

from __future__ import annotations

import mmap

STOP = 1  # work is to stop at its next check
AT_ONCE = 2  # nobody waits for it any longer


class Stopped(Exception):
    """Work stopped because it was told to, or because its time was up. What it had is discarded."""


class SharedNumber:
    """A whole number in memory that threads share, and processes that are forked after it was made.

    The memory has no name, so nothing of it is left when the last process that has it ends. To write
    it takes no lock: of two that write at once one wins.
    """

    def __init__(self) -> None:
        self._value = memoryview(mmap.mmap(-1, 8)).cast("q")

    @property
    def value(self) -> int:
        """The number, at first 0."""
        return self._value[0]

    def rise_to(self, value: int) -> None:
        """Make the number at least `value`."""
        if self._value[0] < value:
            self._value[0] = value

    def reset(self) -> None:
        """Make the number 0."""
        self._value[0] = 0

"""Integers that this process and its workers share, and the exception of work that was stopped."""

from __future__ import annotations

import mmap
from contextlib import suppress

STOP = 1  # value of a stop flag: work ends at its next check
AT_ONCE = 2  # value of a stop flag: nobody waits for the work any longer
SIZE = 8  # bytes


class Stopped(Exception):
    """Work ended because a stop flag was set, or because its time was up. Its results are discarded."""


class SharedInt:
    """An integer in memory that threads share, and processes that are forked after it was made.

    A stop flag is one of these, with the values 0, `STOP` and `AT_ONCE`. Other processes of the machine can
    attach to it after `publish`.

    The memory has no name until then, so nothing of it is left when the last process that has it ends.
    Writing takes no lock: of two simultaneous writes one wins.
    """

    def __init__(self) -> None:
        self._value = memoryview(mmap.mmap(-1, SIZE)).cast("q")

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

    def publish(self, path: str) -> None:
        """Move the integer to a new file, so that processes that were not forked can `attach` it.

        It stays usable when the file is removed.
        """
        with open(path, "xb") as file:
            file.write(bytes(SIZE))
        before, self._value = self._value, _mapped(path)
        self.rise_to(before[0])

    def leave_stopped(self) -> None:
        """Leave STOP for those that have attached the integer, and go on in memory of its own.

        Work that begins late, such as a task that a cluster could not withdraw in time, finds it there.
        """
        before, value = self._value, self.value
        self._value = SharedInt()._value
        self.rise_to(value)
        before[0] = max(STOP, value)

    @classmethod
    def attach(cls, path: str) -> SharedInt:
        """Return the integer that was published in a file.

        On another machine, where that file is not found, it is an integer that nobody else writes.
        """
        shared = cls()
        with suppress(OSError):
            shared._value = _mapped(path)
        return shared


def _mapped(path: str) -> memoryview:
    with open(path, "r+b") as file:
        return memoryview(mmap.mmap(file.fileno(), SIZE)).cast("q")

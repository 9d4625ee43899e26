"""Limits of the memory that files take: for a picture, an archive or a scene, checked beforehand."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from ..core.errors import LimitError
from ..core.files import MAX_PIXELS, check_size
from ..core.plural import plural

MEMORY_BYTES = 2**31  # that files of any size may take
PER_BYTE = 128  # bytes of memory that each byte of the files may take beyond that


@contextmanager
def in_memory(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise a SceneError that names a file and its size where memory runs out."""
    try:
        yield
    except MemoryError as error:
        has = f"has {plural(os.path.getsize(path), 'byte')}, and what it holds"
        raise LimitError(f"{os.fspath(path)}: {has} does not fit in memory: {error}") from error


class Budget:
    """The memory that the files of one scene or picture may take. A file of a few bytes can claim any size.

    Parameters
    ----------
    pixels
        Most pixels of one image.
    memory_bytes
        Bytes of memory for all that is read, whatever the size of the files; each of their bytes adds
        `PER_BYTE`.
    """

    def __init__(self, pixels: int = MAX_PIXELS, memory_bytes: int = MEMORY_BYTES) -> None:
        self.pixels = pixels
        self._most, self._charged = memory_bytes, 0
        self._names: set[str] = set()  # of the files

    @classmethod
    def of(cls, data: bytes) -> Budget:
        """Return the budget of one file that has been read."""
        budget = cls()
        budget.add_file(len(data))
        return budget

    def add_file(self, size: int, name: str | os.PathLike[str] = "") -> None:
        """Allow for the memory of a file of `size` bytes; of one with a name only once."""
        if not name or os.fspath(name) not in self._names:
            self._most += PER_BYTE * size
            self._names.add(os.fspath(name))

    @property
    def most(self) -> int:
        """The bytes of memory that may be taken in all."""
        return self._most

    def check_size(self, height: int, width: int) -> None:
        """Refuse an image that is empty or has too many pixels, with a SceneError."""
        check_size(height, width, self.pixels)

    def charge(self, what: str, size: int) -> None:
        """Count memory that is about to be taken.

        Raises
        ------
        SceneError
            If it is too much. The message begins with `what`.
        """
        self._charged += size
        if self._charged > self._most:
            so_far = "" if self._charged == size else f", which makes {self._charged} in all"
            raise LimitError(
                f"{what} takes {plural(size, 'byte')} of memory{so_far}; "
                f"the limit is {self._most} for files of this size (LoadLimits.memory_bytes)"
            )

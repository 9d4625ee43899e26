"""What of a file is damaged, unknown or not supported: one list for each load, and one warning.

What is damaged or unknown in one part of a file costs that part, not the file. A reader leaves it
out, or replaces it by what one named viewer of the format shows, and notes it: glTF as Khronos'
sample viewer; OBJ, PLY, STL, 3MF and DAE as Blender's importers; USD as usdview; Mitsuba and pbrt
as these. An error remains where nothing of the file can be shown, where a limit of `LoadLimits` is
passed, or where an argument of a call is wrong.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Self

from ..core.errors import SceneError, hear_warnings, warn_caller
from ..core.plural import plural
from ..scene.loss import NOT_HONORED, Loss

MOST_SHOWN = 10  # lines of a message


class Losses:
    """Collects what is lost of a file; as a context manager it says all of it at the end.

    Within the block, what `warn_caller` is given is noted, too, whoever calls it.

    Parameters
    ----------
    name
        The file, as it is called in messages.
    strict
        Raise an error in place of the warning.
    """

    def __init__(self, name: str, strict: bool = False) -> None:
        self.name, self.strict = name, strict
        self._noted: dict[Loss, None] = {}

    def note(self, part: str, place: str = "", value: str = "", done: str = NOT_HONORED) -> None:
        """Note a part that is left out, or replaced.

        Parameters
        ----------
        part
            What it is.
        place
            Where it stands: a line or an element of the file, or of another file, whose name is first then.
        value
            The value that was found.
        done
            What was done about it.
        """
        where = place if place.startswith(self.name) else f"{self.name}: {place}" if place else self.name
        self._noted[Loss(where, part, value, done)] = None

    def hear(self, message: str) -> None:
        """Note a warning that begins with its place."""
        self.note(message.removeprefix(f"{self.name}: "), done="")

    @property
    def found(self) -> tuple[Loss, ...]:
        """All that was noted, each once."""
        return tuple(self._noted)

    def report(self) -> None:
        """Warn of all that was noted, if anything was.

        Raises
        ------
        SceneError
            If `strict`.
        """
        lines = self._lines()
        if not lines:
            return
        message = f"{self.name}: {lines[0]}"
        if len(lines) > 1:
            more = [f"and {len(lines) - MOST_SHOWN} more"] if len(lines) > MOST_SHOWN else []
            head = f"{self.name}: {plural(len(lines), 'thing')} not as in the file:"
            message = "\n  ".join([head, *lines[:MOST_SHOWN], *more])
        if self.strict:
            raise SceneError(message)
        warn_caller(message)

    def _lines(self) -> list[str]:
        """Return what was noted as text; the same at several places is one line with their number."""
        alike: dict[tuple[str, str, str], list[Loss]] = {}
        for loss in self._noted:
            alike.setdefault((loss.part, loss.value, loss.done), []).append(loss)
        return [
            first.said(self.name) + (f" ({len(more)} more)" if more else "")
            for first, *more in alike.values()
        ]

    def __enter__(self) -> Self:
        """Listen to warnings of this thread."""
        self._stack = ExitStack()
        self._stack.enter_context(hear_warnings(self.hear))
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Say what was noted: it may also be why the block failed."""
        self._stack.close()
        if kind is None or (issubclass(kind, SceneError) and not self.strict):
            self.report()

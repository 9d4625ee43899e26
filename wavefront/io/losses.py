"""The damaged, unknown and unsupported parts of a file: one list for each load, and one warning.

What is damaged or unknown in one part of a file costs that part, not the file. A reader leaves it
out, or replaces it by what one named viewer of the format shows, and notes it: glTF as Khronos'
sample viewer; OBJ, PLY, STL, 3MF and DAE as Blender's importers; USD as usdview; Mitsuba and pbrt
as these. An error remains where nothing of the file can be shown, where a limit of `LoadLimits` is
passed, or where an argument of a call is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..core.errors import SceneError, exact, hear_warnings, passed_limit, warn_caller
from ..core.plural import plural
from ..scene.loss import NOT_HONORED, Loss

MOST_SHOWN = 10  # lines of a message
MOST_LETTERS = 200  # of a line about malformed data


class Part:
    """A block that reads a part of a file. There may be millions, so it is no generator."""

    __slots__ = ("_done", "_losses", "_malformed", "_place")

    def __init__(self, losses: Losses, place: str, done: str, malformed: tuple[type[Exception], ...]) -> None:
        self._losses, self._place, self._done, self._malformed = losses, place, done, malformed

    def __enter__(self) -> None:
        """Begin."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, *_: object) -> bool:
        """Note an error, unless a limit was passed."""
        if error is None:
            return False
        if isinstance(error, self._malformed) and not isinstance(error, SceneError):
            name = type(error).__name__
            what = f"{self._place} is malformed: {name}: {error}"[:MOST_LETTERS]
        elif isinstance(error, SceneError) and not passed_limit(error):
            what = str(error).removeprefix(f"{self._losses.name}: ").removeprefix(f"{self._place}: ")
        else:
            return False
        place = self._place
        if what.startswith(f"{self._losses.name} "):  # it names its own place
            place, what = what.split(": ", 1) if ": " in what else (place, what)
        self._losses.note(what, "" if place and what.startswith(place) else place, done=self._done)
        return True


class Losses:
    """Collects the losses of a file; as a context manager it reports them at the end.

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
        self._notices: dict[Loss, None] = {}

    def note(self, part: str, place: str = "", value: str = "", done: str = NOT_HONORED) -> None:
        """Note a part that is left out, or replaced.

        Parameters
        ----------
        part
            Its name.
        place
            Where it stands: a line or an element of the file, or of another file, whose name is first then.
        value
            The value that was found.
        done
            The remedy.
        """
        where = place if place.startswith(self.name) else f"{self.name}: {place}" if place else self.name
        self._noted[Loss(where, part, value, done)] = None

    def notice(self, part: str, place: str, done: str) -> None:
        """Note a surprise, which is shown as the file says; with `strict` it is no error.

        The arguments are those of `note`; several places with the same part count as one.
        """
        if not self.strict and all((loss.part, loss.done) != (part, done) for loss in self._notices):
            self._notices[Loss(f"{self.name}: {place}", part, done=done)] = None

    def hear(self, message: str) -> None:
        """Note a warning that begins with its place."""
        self.note(message.removeprefix(f"{self.name}: "), done="")

    def part(
        self, place: str = "", done: str = "left out", malformed: tuple[type[Exception], ...] = ()
    ) -> Part:
        """Return a context that notes an error of its block, which reads a part of the file, and goes on.

        A passed limit ends the load.

        Parameters
        ----------
        place
            As of `note`.
        done
            The remedy, if that part is damaged.
        malformed
            Errors of other types that mean damage, too.
        """
        return Part(self, place, done, malformed)

    def within(
        self, part: str, value: ArrayLike, low: float = 0.0, high: float = 1.0, place: str = ""
    ) -> Doubles:
        """Return numbers clamped to a range, which is noted: files are often outside of it by rounding."""
        numbers = np.asarray(value, np.float64)
        limited = np.clip(numbers, low, high)
        if (limited != numbers).any():
            self.note(part, place, _text(numbers), f"clamped to {_text(limited)}")
        return limited

    def take(self, losses: Iterable[Loss], notices: Iterable[Loss] = ()) -> None:
        """Take over the losses of another list of the same file."""
        self._noted.update(dict.fromkeys(losses))
        self._notices.update({} if self.strict else dict.fromkeys(notices))

    @property
    def notices(self) -> tuple[Loss, ...]:
        """All of which `strict` is no error."""
        return tuple(self._notices)

    @property
    def found(self) -> tuple[Loss, ...]:
        """All that was noted, each once."""
        return tuple(self._noted)

    def nothing(self, what: str) -> SceneError:
        """Return an error of a file of which nothing is shown; it says why."""
        return SceneError(self._message(what) if self._noted else f"{self.name}: {what}")

    def report(self) -> None:
        """Warn of all that was noted, if anything was.

        Raises
        ------
        SceneError
            If `strict`.
        """
        if self._noted and self.strict:
            raise SceneError(self._message())
        if self._noted or self._notices:
            warn_caller(self._message())

    def _message(self, what: str = "") -> str:
        lines = self._lines()
        if len(lines) == 1:
            return ": ".join([self.name, *([what] if what else []), lines[0]])
        more = [f"and {len(lines) - MOST_SHOWN} more"] if len(lines) > MOST_SHOWN else []
        head = f"{self.name}: {what or plural(len(lines), 'thing') + ' not as in the file'}:"
        return "\n  ".join([head, *lines[:MOST_SHOWN], *more])

    def _lines(self) -> list[str]:
        """Return the losses as lines of text; one loss at several places is one line, with their number."""
        alike: dict[tuple[str, str, str], list[Loss]] = {}
        for loss in (*self._noted, *self._notices):
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
        """Report the losses, unless the block failed."""
        self._stack.close()
        if kind is None:
            self.report()


def _text(values: Doubles) -> str:
    return exact(values.item()) if values.size == 1 else " ".join(map(exact, values.ravel().tolist()))

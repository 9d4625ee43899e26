"""Tables of named things: one table for each kind that users can add to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from .errors import SceneError, one_of

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Objects of one kind by name.

    A setting of this kind takes a name in the table, or an object of this kind in place of a name.

    Parameters
    ----------
    setting
        The name of the setting, for messages.
    expected
        Name of the kind of object, for messages.
    entries
        The built-in ones, by name.
    accepts
        Returns True for an object of this kind; by default for everything that can be called.
    group
        The group of entry points by which other packages add to the table, without "wavefront."; by default
        the name of the setting.
    adapt
        Turns a thing that a user gives into an entry of the table; by default it is one already.
    """

    def __init__(
        self,
        setting: str,
        expected: str,
        entries: Mapping[str, T],
        accepts: Callable[[Any], bool] = callable,
        adapt: Callable[[Any], T] = lambda thing: thing,
        group: str | None = None,
    ) -> None:
        self.group = f"wavefront.{group or setting}"
        self.setting, self.expected = setting, expected
        self._entries, self._accepts, self._adapt = dict(entries), accepts, adapt

    @cached_property
    def _plugged(self) -> dict[str, EntryPoint]:
        """The entry points of other packages, by name; a package is imported when its name is used."""
        from importlib.metadata import entry_points  # here, as its import takes 60 ms

        return {point.name: point for point in entry_points(group=self.group)}

    def __getitem__(self, name: str) -> T:
        """Return the thing called `name`."""
        if name not in self._entries and name in self._plugged:
            self._load(self._plugged[name])
        return self._entries[name]

    def _load(self, point: EntryPoint) -> None:
        try:
            thing = point.load()
        except Exception as error:  # whatever the other package raises
            text = f"{self.setting} {point.name!r} of {point.value} cannot be loaded: {error}"
            raise SceneError(text) from error
        self.register(point.name, thing)

    def __iter__(self) -> Iterator[str]:
        """Go through the names, the built-in ones first."""
        return iter(self._entries)

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._entries)

    def find(self, value: Any, setting: str | None = None) -> T:
        """Return the object that a setting names, or the setting itself if it is such an object.

        Parameters
        ----------
        value
            A name in the table, or an object of this kind.
        setting
            Name of the setting in messages, in place of the table's own word.

        Raises
        ------
        SceneError
            If it is neither. The message lists all names and suggests the nearest.
        """
        if not isinstance(value, str) and self._accepts(value):
            return self._adapt(value)
        if isinstance(value, str) and value in self:
            return self[value]
        return self[one_of(setting or self.setting, value, [*self._entries, *self._plugged])]

    def label(self, value: Any) -> str:
        """Return the name of an argument of `find`: that in the table, else that of the function or class.

        Of a dataclass it is the call that makes it, with its parameters.
        """
        if isinstance(value, str):
            return value
        named = (name for name, entry in self._entries.items() if entry is value)
        kind = repr(value) if is_dataclass(value) else type(value).__name__
        return next(named, getattr(value, "__name__", kind))

    def register(self, name: str, thing: Any) -> None:
        """Add a thing under a name of its own.

        Raises
        ------
        SceneError
            If the name is not a string or is taken, or the thing is not of this kind.
        """
        if not isinstance(name, str) or not name:
            raise SceneError(f"the name of {self.expected} must be a string, got {name!r}")
        if name in self._entries:
            raise SceneError(f"{self.setting} {name!r} is registered already; choose another name")
        if not self._accepts(thing):
            raise SceneError(f"{self.setting} {name!r} is {thing!r}; it must be {self.expected}")
        self._entries[name] = self._adapt(thing)

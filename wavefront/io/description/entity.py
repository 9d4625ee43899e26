"""Entities of scene files: shapes, lights, materials and all else that has a type and parameters by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError, exact, finite_array, in_brief, number, one_of
from ...core.suggestions import did_you_mean
from ...shapes.transform import IDENTITY, Matrix
from ..losses import Losses

DIGITS = 3  # to which a number by a hair beyond its limit is rounded
NUMBERS, VECTORS = ("float", "integer"), ("point3", "vector3", "point", "vector")
T = TypeVar("T")
C = TypeVar("C", bound=Callable[..., Any])


class Limit(NamedTuple):
    """The values that a number may have."""

    holds: Callable[[float], Any]
    text: str  # for messages: "it must be ..."


ABOVE_0 = Limit(lambda x: x > 0, "above 0")
CONE = Limit(lambda x: 0 < x <= 90, "above 0 and at most 90 degrees")
BELOW_180 = Limit(lambda x: 0 < x < 180, "above 0 and below 180 degrees")


class Maker(NamedTuple):
    """How entities of a type are converted, and which of their parameters are read."""

    kind: str  # "shape", "bsdf", ...
    convert: Callable[[Any], Any] | None  # None: the type is not supported
    reads: tuple[str, ...] | None = None  # parameters that count; None: those that `convert` reads
    holds: tuple[str, ...] = ()  # kinds of entities in it that count, whatever their names
    harmless: tuple[str, ...] = ()  # parameters that do not change the picture
    note: str = ""  # differences, for the documentation


class Table:
    """The types of a format, by kind and name.

    Parameters
    ----------
    name
        Name of the format, for messages.
    harmless
        Parameters of all entities of a kind that do not change the picture.
    """

    def __init__(self, name: str, harmless: dict[str, str]) -> None:
        self.name, self.harmless = name, harmless
        self.makers: dict[tuple[str, str], Maker] = {}
        self.kinds: dict[str, str] = {}  # by type, where these are of one kind alone

    def converts(
        self,
        kind: str,
        types: str,
        reads: str | None = None,
        holds: str = "",
        harmless: str = "",
        note: str = "",
    ) -> Callable[[C], C]:
        """Put a function that converts entities into the table; each argument is a list of words."""
        ignored = f"{harmless} {self.harmless.get(kind, '')}".split()
        read = None if reads is None else tuple(reads.split())

        def add(convert: C) -> C:
            maker = Maker(kind, convert, read, tuple(holds.split()), tuple(ignored), note)
            self._add(types, maker)
            return convert

        return add

    def unsupported(self, kind: str, types: str) -> None:
        """Put types into the table that the format has, and that are not supported."""
        self._add(types, Maker(kind, None))

    def _add(self, types: str, maker: Maker) -> None:
        self.makers.update({(maker.kind, name): maker for name in types.split()})
        self.kinds.update(dict.fromkeys(types.split(), maker.kind))

    def find(self, kind: str, name: str) -> Maker:
        """Return the maker of the entities of a type.

        Raises
        ------
        SceneError
            If there is no such type.
        """
        if (kind, name) not in self.makers:
            known = [type_name for of, type_name in self.makers if of == kind]
            raise SceneError(f"{self.name} has no such {kind}{did_you_mean(name, known)}")
        return self.makers[kind, name]


@dataclass(eq=False, repr=False)
class Entity:
    """A part of a scene file, such as a shape or a light, with its parameters."""

    kind: str  # a shape, a light, ...
    type: str  # which of these
    name: str  # its own, which may be none
    place: str  # where it is, for messages
    values: dict[str, Any]  # of parameters, and the entities that it holds
    job: Any  # the conversion of which it is a part
    variant: str = ""  # of its kind, such as that of textures of numbers
    title: str = ""  # its name in messages, where the place does not tell it
    types: dict[str, str] = field(default_factory=dict)  # of values that are lists, where a format has types
    matrix: Matrix = field(default_factory=lambda: IDENTITY)  # to the world, where it was stated
    state: Any = None  # what else was in force there
    size: int = 1  # entities in it, and itself
    unread: set[str] = field(init=False)  # parameters that have not counted yet
    maker: Maker | None = field(init=False)  # how it is converted; None for a type that there is not

    def __post_init__(self) -> None:
        self.unread = set(self.values)
        self.retype(self.type)

    def retype(self, type: str) -> None:
        """Give it another type."""
        self.type = type
        self.maker = self.job.table.makers.get((self.kind, type))

    def __repr__(self) -> str:
        return f"<{self.kind} {self.type!r}>"

    @property
    def label(self) -> str:
        """Its place and title, for messages."""
        return f"{self.place}: {self.title}" if self.title else self.place

    @property
    def lost(self) -> Losses:
        """The losses of the load."""
        losses: Losses = self.job.files.losses
        return losses

    def lose(self, what: str) -> None:
        """Note something that is not honored."""
        self.lost.note(f"{self.title}: {what}" if self.title else what, self.place)

    def report(self) -> None:
        """Note the parameters that had no effect."""
        for name in [unread for unread in self.values if unread in self.unread] if self.unread else ():
            value = self.values[name]
            self.lose(f"{value.kind} {name!r}" if isinstance(value, Entity) else name)
        self.unread.clear()

    def check(self) -> None:
        """Note the parameters that the table does not read, if it lists those that it does."""
        maker = self.maker
        if maker is None:
            return
        self.unread.difference_update(maker.harmless)
        if maker.reads is not None:
            self.unread.difference_update(maker.reads)
            if self.unread and maker.holds:
                self.unread.difference_update(name for name, _ in self._children(maker.holds))
            self.report()

    def rename(self, old: str, new: str) -> None:
        """Give a parameter another name, unless there is one of that name."""
        if old not in self.values:
            return
        if old in self.unread and new not in self.values:
            self.unread.add(new)
        self.unread.discard(old)
        for columns in (self.values, self.types):
            columns.setdefault(new, columns.pop(old))

    def harmless(self, names: str) -> None:
        """Note that parameters do not change the picture."""
        self.unread.difference_update(names.split())

    def _children(self, kinds: tuple[str, ...]) -> list[tuple[str, Entity]]:
        named = self.values.items()
        return [(name, child) for name, child in named if isinstance(child, Entity) and child.kind in kinds]

    def children(self, kind: str) -> list[Entity]:
        """Return the entities of a kind that it holds."""
        return [child for _, child in self._children((kind,))]

    def only(self, kind: str) -> Entity:
        """Return the first entity of a kind that it must hold."""
        children = self.children(kind)
        if not children:
            raise SceneError(f"{self.label} holds no {kind}")
        return children[0]

    def get(self, name: str, default: Any = None, *types: str) -> Any:
        """Return a parameter as it is: of one of some types, where the format has types.

        Raises
        ------
        KeyError
            If the table lists the parameters that are read, and this is none of them.
        SceneError
            If it is of another type, or has no value.
        """
        reads = None if self.maker is None else self.maker.reads
        if reads is not None and name not in reads:
            raise KeyError(f"{self.type} does not read {name}")
        self.unread.discard(name)
        if name not in self.types:
            return self.values.get(name, default)
        if self.types[name] not in types:
            raise SceneError(f"{name} is a {self.types[name]}; it must be a {' or '.join(types)}")
        if not len(self.values[name]):
            raise SceneError(f"{name} has no value")
        return self.values[name]

    def one(self, name: str, default: Any, *types: str) -> Any:
        """Return one value of a parameter: the first, where it has several."""
        value = self.get(name, default, *types)
        first = value[0] if name in self.types else value
        return first.item() if name in self.types and isinstance(first, np.generic) else first

    def or_default(self, default: T, read: Callable[[], T]) -> T:
        """Return the value that `read` returns; where it fails, that is noted, and the default is used.

        Raises
        ------
        SceneError
            If there is no default.
        """
        try:
            return read()
        except SceneError:
            if default is None:
                raise
            with self.lost.part(self.label, done=f"{_brief(default)} in its place"):
                raise
        return default

    def number(self, name: str, default: float, limit: Limit | None = None) -> float:
        """Return a number."""

        def read() -> float:
            value = self.one(name, default, *NUMBERS)
            if limit is None:
                return number(name, value)
            checked = number(name, value)
            near = round(checked, DIGITS) + 0.0
            if limit.holds(checked) or not limit.holds(near):
                return number(name, value, *limit)
            self.lost.note(name, self.label, exact(checked), f"taken as {exact(near)}")
            return near

        return self.or_default(default, read)

    def whole(self, name: str, default: int, least: int = 0, most: int = 2**31) -> int:
        """Return a whole number."""
        text = f"a whole number from {least} to {most}"
        return int(self.number(name, default, Limit(lambda x: x == int(x) and least <= x <= most, text)))

    def flag(self, name: str, default: bool = False) -> bool:
        """Return True or False."""

        def read() -> bool:
            value = self.one(name, default, "bool")
            return bool(one_of(name, bool(value) if isinstance(value, np.bool_) else value, (True, False)))

        return self.or_default(default, read)

    def text(self, name: str, default: str | None = None) -> str:
        """Return a string."""

        def read() -> str:
            value = self.one(name, default, "string")
            if not isinstance(value, str):
                raise SceneError(f"{name} is {in_brief(value)}; it must be a string")
            return value

        return read() if default is None else self.or_default(default, read)

    def choice(self, name: str, default: str, choices: tuple[str, ...]) -> str:
        """Return one of some strings, which may be in capital letters where the format has no types."""

        def read() -> str:
            value = self.text(name, default)
            return str(one_of(name, value if name in self.types else value.lower(), choices))

        return self.or_default(default, read)

    def vector(self, name: str, default: Any) -> Doubles:
        """Return a point or vector, (3,)."""
        read = lambda: finite_array(name, self.one(name, default, *VECTORS), (3,))  # noqa: E731
        return read() if default is None else self.or_default(np.asarray(default, np.float64), read)


def _brief(value: Any) -> str:
    """Return the words for a default in a message."""
    if np.shape(value) == (4, 4):
        return "no transform"
    return str(np.asarray(value).tolist()) if np.ndim(value) else repr(value) if value != "" else "nothing"

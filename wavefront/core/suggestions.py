"""Suggestions for unknown names: "did you mean"."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from difflib import get_close_matches
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from .synonyms import SYNONYMS

P = ParamSpec("P")
R = TypeVar("R")


def meant(name: str, known: Iterable[str]) -> str | None:
    """Return the known name of which `name` is a synonym or a misspelling; None if there is none."""
    plain = {_plain(other): other for other in known}
    word = _plain(name)
    if word in plain:
        return plain[word]
    for synonym in SYNONYMS.get(word, ()):
        if _plain(synonym) in plain:
            return plain[_plain(synonym)]
    return _misspelled(word, plain)


def did_you_mean(name: object, known: Iterable[str], places: Iterable[str] = ()) -> str:
    """Return "; did you mean 'x'?" or "; write x" for an unknown name, or "" where nothing is similar.

    Parameters
    ----------
    name
        The unknown name.
    known
        The names that there are.
    places
        Where it was looked for, as in the table of synonyms, the nearest place first.
    """
    if not isinstance(name, str):
        return ""
    plain = {_plain(other): other for other in known}
    word = _plain(name)
    similar = plain.get(word)
    if similar is None:
        answer = synonym_of(word, plain, places)
        if answer:
            return answer
        similar = _misspelled(word, plain)
    return "" if similar is None else f"; did you mean {similar!r}?"


def synonym_of(word: str, plain: dict[str, str], places: Iterable[str]) -> str:
    """Return the answer of the table to a plain word, given the known names by their plain ones, or ""."""
    for key in (*(f"{_plain(place)}.{word}" for place in places), word):
        for answer in SYNONYMS.get(key, ()):
            if _plain(answer) in plain:
                return f"; did you mean {plain[_plain(answer)]!r}?"
            if not _is_name(answer):
                return f"; write {answer}"
    return ""


def _misspelled(word: str, plain: dict[str, str]) -> str | None:
    close = get_close_matches(word, plain, 1, 0.66 if len(word) < 4 else 0.7)  # one letter of three
    return plain[close[0]] if close else None


def _is_name(answer: str) -> bool:
    """Return whether an answer is a name, perhaps of two words, and not text to write."""
    return answer.replace(" ", "_").isidentifier()


class Answering(ABCMeta):
    """The class of classes that answer to the names of other programs."""

    if not TYPE_CHECKING:

        def __getattr__(cls, name: str) -> Any:
            """Raise an AttributeError that says what there is in place of a known name."""
            text = f"type object {cls.__name__!r} has no attribute {name!r}{_instead(cls, name)}"
            raise AttributeError(text, name=name, obj=cls)


class Answers(metaclass=Answering):
    """Base of classes that answer to the names of other programs, of the class and of its objects."""

    __slots__ = ()

    if not TYPE_CHECKING:  # a type checker would take every name for an attribute

        def __getattr__(self, name: str) -> Any:
            """Raise an AttributeError that says what there is in place of a known name."""
            cls = type(self)
            text = f"{cls.__name__!r} object has no attribute {name!r}{_instead(cls, name)}"
            raise AttributeError(text, name=name, obj=self)


def _instead(cls: type, name: str) -> str:
    """Return a hint for a missing attribute: only by the table, as programs ask often."""
    if name.startswith("_"):
        return ""
    word = _plain(name)
    for base in cls.__mro__:
        for answer in SYNONYMS.get(f"{base.__name__.lower()}.{word}", ()):
            return f"; did you mean {answer!r}?" if _is_name(answer) else f"; write {answer}"
    return ""


def suggests_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function suggest a known keyword argument for an unknown one.

    The error is a TypeError, as in Python, and the signature is that of the function.
    """
    code = function.__code__
    known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except TypeError:
            unexpected = unknown_keyword(function, known, args, kwargs)
            if unexpected is None:
                raise
        raise unexpected

    return checked


def unknown_keyword(
    function: Callable[..., object], known: Collection[str], args: Sequence[object], names: Iterable[str]
) -> TypeError | None:
    """Return the error of the first keyword argument that is not known, as in Python; None if all are.

    `args` are the positional arguments.
    """
    for name in names:
        if name not in known:
            title = type(args[0]).__name__ if function.__name__ == "__init__" else function.__qualname__
            hint = did_you_mean(name, known, _places(function, args))
            return TypeError(f"{title}() got an unexpected keyword argument {name!r}{hint}")
    return None


def _places(function: Callable[..., object], args: Sequence[object]) -> Iterator[str]:
    """Yield the places where an argument is looked for: the function, and the classes that it is of."""
    name = function.__qualname__
    if "." not in name:
        yield name
        return
    owner = args[0] if isinstance(args[0], type) else type(args[0])
    for base in owner.__mro__:
        yield f"{base.__name__}()" if name.endswith("__init__") else f"{base.__name__}.{function.__name__}"
        yield base.__name__


def _plain(name: str) -> str:
    return name.lower().replace("_", "")

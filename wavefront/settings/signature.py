"""Functions that take the settings of a render: their signatures, their documentation, unknown names."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from ..core.suggestions import unknown_keyword
from .declaration import SETTINGS

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")

PLACEHOLDER = "{settings}"  # in docstrings, where the settings are described
WIDTH = 100  # of a line of documentation


def takes_settings(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function with `**settings: Unpack[RenderSettings]` show each of them as a parameter.

    Its signature and its documentation have all settings that it has no parameter for. An unknown name is a
    TypeError, as in Python, that suggests a known one.
    """
    signature = settings_signature(inspect.signature(function))
    known = tuple(signature.parameters)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        unexpected = unknown_keyword(function, known, args, kwargs)
        if unexpected is not None:
            raise unexpected
        return function(*args, **kwargs)

    checked.__signature__ = signature  # type: ignore[attr-defined]
    checked.__doc__ = described(function.__doc__)
    return checked


def describes_settings(cls: type[C]) -> type[C]:
    """Let the documentation of a class describe the settings that `__init__` takes."""
    cls.__doc__ = described(cls.__doc__)
    return cls


def settings_signature(signature: inspect.Signature) -> inspect.Signature:
    """Return a signature with a parameter for each setting in place of `**settings`."""
    own = [each for each in signature.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
    taken = {each.name for each in own}
    rest = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=setting.default, annotation=setting.type
        )
        for name, setting in SETTINGS.items()
        if name not in taken
    ]
    return signature.replace(parameters=[*own, *rest])


def described(text: str | None) -> str | None:
    """Return a docstring with the texts of settings that it lacks in place of `{settings}`."""
    before, placeholder, after = (text or "").partition(PLACEHOLDER)
    if not placeholder:
        return text
    indent = before.rpartition("\n")[2]
    missing = (name for name in SETTINGS if f"\n{indent}{name}\n" not in before)
    entries = [f"{name}\n{_wrapped(SETTINGS[name].text, indent + '    ')}" for name in missing]
    return before + f"\n{indent}".join(entries) + after


def _wrapped(text: str, indent: str) -> str:
    """Return text in lines of at most `WIDTH` characters (textwrap would take most of an import)."""
    lines, line = [], indent
    for word in text.split(" "):
        if len(line) + len(word) > WIDTH and line != indent:
            lines.append(line.rstrip())
            line = indent
        line += word + " "
    return "\n".join([*lines, line.rstrip()])

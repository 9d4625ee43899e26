"""Parameters of materials and lights: attributes that are checked whenever they are assigned."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

MISSING = object()


class Parameter:
    """An attribute that is converted and checked whenever it is assigned, in the constructor or later.

    It stands in the instance's own namespace, so reading it costs what reading any attribute does.

    Parameters
    ----------
    convert
        Called with the name for messages, such as "Diffuse reflectance", and the value; returns what is
        kept, or raises a SceneError. What it returns it must take as well.
    argument
        What the constructor calls it, if not by its name; for messages.
    """

    def __init__(self, convert: Callable[[str, Any], Any], argument: str | None = None) -> None:
        self._convert, self._argument = convert, argument
        self._name = self._title = ""

    def __set_name__(self, owner: type, name: str) -> None:
        """Learn the name under which the class has it."""
        self._name, self._title = name, f"{owner.__name__} {self._argument or name}"

    def __set__(self, instance: Any, value: Any) -> None:
        """Keep the value as it is converted; a later one changes what follows from it, too."""
        values = vars(instance)
        known, before = self._name in values, values.get(self._name)
        values[self._name] = self._convert(self._title, value)
        if known:
            try:
                instance.derive()
            except Exception:
                values[self._name] = before
                raise

    if TYPE_CHECKING:

        def __get__(self, instance: Any, owner: type) -> Any: ...


class Parametrized:
    """Something with parameters, which it shows."""

    def derive(self) -> None:
        """Compute what follows from several parameters. Constructors end with it."""

    def __repr__(self) -> str:
        """Name the arguments that would make it; of those by name alone, what is not the default."""
        return f"{type(self).__name__}({', '.join(shown(self))})"


def shown(thing: Any) -> list[str]:
    """Return "name=value" of the constructor's arguments that an object has as attributes."""
    import inspect  # here, as few programs ask

    out = []
    for name, parameter in inspect.signature(type(thing)).parameters.items():
        value = vars(thing).get(name, MISSING)
        if value is MISSING:
            value = vars(thing).get(f"_{name}", MISSING)
        if value is MISSING:
            continue
        text = brief(value)
        usual = value is None or text == brief(parameter.default)
        if parameter.kind is not parameter.KEYWORD_ONLY or not usual:
            out.append(f"{name}={text}")
    return out


def brief(value: Any) -> str:
    """Return a value as a user would write it: equal channels as one number, few digits."""
    if isinstance(value, np.ndarray | np.generic | tuple | list):
        numbers = np.ravel(value)
        if numbers.dtype.kind not in "fiu" or numbers.size > 4:
            return repr(value)
        if numbers.size == 1 or (np.shape(value) == (3, 1) and (numbers == numbers[0]).all()):
            return f"{numbers[0]:.6g}"
        return f"({', '.join(f'{number:.6g}' for number in numbers)})"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)

"""Parameters of materials and lights: attributes that are checked whenever they are assigned."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

MISSING = object()
MOST_SHOWN = 16  # numbers of an array


class Parameter:
    """An attribute that is converted and checked whenever it is assigned, in the constructor or later.

    The value is stored in the instance's own namespace, so reading it costs no more than any attribute.

    Parameters
    ----------
    convert
        Called with the name for messages, such as "Diffuse reflectance", and the value; returns the value
        to store, or raises a SceneError. It must also accept its own results.
    argument
        Name of the constructor's argument, if it differs from the attribute; for messages.
    """

    def __init__(self, convert: Callable[[str, Any], Any], argument: str | None = None) -> None:
        self._convert, self._argument = convert, argument
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        """Record the name of the attribute."""
        self._name = name

    def __set__(self, instance: Any, value: Any) -> None:
        """Store the converted value. After the constructor, recompute the values that follow from it."""
        values = vars(instance)
        known, before = self._name in values, values.get(self._name)
        title = f"{type(instance).__name__} {self._argument or self._name}"
        values[self._name] = self._convert(title, value)
        if known:
            try:
                instance.derive()
            except Exception:
                values[self._name] = before
                raise

    if TYPE_CHECKING:

        def __get__(self, instance: Any, owner: type) -> Any: ...


class Parametrized:
    """Base of classes with parameters; `repr` shows them."""

    def derive(self) -> None:
        """Compute the values that follow from several parameters. Constructors call it at the end."""

    def __repr__(self) -> str:
        """Return the call that makes it; keyword-only arguments are shown if they are not the default."""
        return f"{type(self).__name__}({', '.join(named_arguments(self))})"


def named_arguments(thing: Any) -> list[str]:
    """Return "name=value" of the constructor's arguments that an object has as attributes."""
    import inspect  # imported here, since few programs need it

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
    """Return a value as a user would write it: equal channels as one number, six digits at most.

    Of an array of more than `MOST_SHOWN` numbers it is the shape.
    """
    if isinstance(value, np.ndarray) and value.size > MOST_SHOWN:
        return f"<array {value.shape}>"
    if isinstance(value, np.ndarray | np.generic | tuple | list):
        numbers = np.ravel(value)
        if numbers.dtype.kind not in "fiu" or numbers.size > 4:
            return repr(value)
        if numbers.size == 1 or (np.shape(value) == (3, 1) and (numbers == numbers[0]).all()):
            return f"{numbers[0]:.6g}"
        return f"({', '.join(f'{number:.6g}' for number in numbers)})"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)

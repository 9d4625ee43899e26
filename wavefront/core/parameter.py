"""Parameters of materials and lights: attributes that are checked whenever they are assigned."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, dataclass_transform

import numpy as np

from .errors import SceneError
from .suggestions import Answers, suggests_keywords

T = TypeVar("T")
C = TypeVar("C", bound=type)
MISSING: Any = object()
MOST_SHOWN = 16  # numbers of an array


class Parameter(Generic[T]):
    """An attribute that is converted and checked whenever it is assigned, in the constructor or later.

    The value is stored in the instance's own namespace, so reading it costs no more than any attribute.

    Parameters
    ----------
    convert
        Called with the name for messages, such as "Diffuse reflectance", and the value; returns the value
        to store, or raises a SceneError. It must also accept its own results.
    default, kw_only
        Of the constructor's argument, where `parametrized` makes the constructor.
    alias
        Name of the argument, if it differs from the attribute.
    """

    def __init__(
        self,
        convert: Callable[[str, Any], Any],
        *,
        default: Any = MISSING,
        kw_only: bool = False,
        alias: str | None = None,
    ) -> None:
        self.convert, self.default, self.kw_only, self.alias = convert, default, kw_only, alias
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        """Record the name of the attribute, and of the argument."""
        self._name, self.alias = name, self.alias or name

    def __set__(self, instance: Any, value: T) -> None:
        """Store the converted value. After the constructor, recompute the values that follow from it."""
        values = vars(instance)
        known, before = self._name in values, values.get(self._name)
        values[self._name] = self.convert(f"{type(instance).__name__} {self.alias}", value)
        if known:
            try:
                instance.derive()
            except Exception:
                values[self._name] = before
                raise

    if TYPE_CHECKING:

        def __get__(self, instance: Any, owner: type) -> Any: ...


@dataclass_transform(eq_default=False, field_specifiers=(Parameter,))
def parametrized(cls: C) -> C:
    """Give a class the constructor that its annotated parameters declare, and those of its base classes.

    As in a dataclass, the arguments are in the order of the declarations, keyword-only ones last. The
    constructor assigns all of them, and then calls `derive`.
    """
    declared: dict[str, tuple[Parameter[Any], str]] = {}
    made: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        made.update(vars(sys.modules[base.__module__]))  # where the annotations have their names
        for name, annotation in vars(base).get("__annotations__", {}).items():
            if isinstance(value := vars(base).get(name), Parameter):
                declared[name] = value, annotation.removeprefix("Parameter[").removesuffix("]")
    arguments = {False: ["self"], True: ["*"]}
    for parameter, kind in declared.values():
        default = "" if parameter.default is MISSING else f" = default[{parameter.alias!r}]"
        arguments[parameter.kw_only].append(f"{parameter.alias}: {kind}{default}")
    known = [*arguments[False], *(arguments[True] if len(arguments[True]) > 1 else ())]
    assigned = "".join(f"    self.{name} = {parameter.alias}\n" for name, (parameter, _) in declared.items())
    made["default"] = {parameter.alias: parameter.default for parameter, _ in declared.values()}
    exec(f"def __init__({', '.join(known)}) -> None:\n{assigned}    self.derive()", made)
    init = made["__init__"]
    init.__qualname__, init.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    cls.defaults, cls.__init__ = made["default"], suggests_keywords(init)  # type: ignore[attr-defined, misc]
    return cls


def optional(convert: Callable[[str, Any], Any]) -> Callable[[str, Any], Any]:
    """Return the check of a parameter that may be None."""
    return lambda name, value: None if value is None else convert(name, value)


def instance_of(kind: type, wanted: str) -> Callable[[str, Any], Any]:
    """Return the check of a parameter that is an object of a class; `wanted` names it in messages."""

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, kind):
            raise SceneError(f"{name} must be {wanted}, got {value!r}")
        return value

    return check


class Parametrized(Answers):
    """Base of classes with parameters; `repr` shows them."""

    defaults: ClassVar[dict[str, Any]]  # of the constructor's arguments, where `parametrized` makes it

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

"""Fingerprints: whether two objects, perhaps in two processes, compute the same.

A fingerprint is a hash of the contents of an object: numbers, text, arrays by their bytes, other objects by
the values that pickle would store, nothing of which is run or written. Functions and classes of this package
and of installed ones are known by their names. Those of a user's own program are known by their
bytecode, defaults, and the variables outside of them that they read; a module of the user's that they read
is known by its file.
"""

from __future__ import annotations

import dis
import hashlib
import sys
import types
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from .errors import SceneError

NOT_COMPARED = frozenset(
    ("__module__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__firstlineno__",
     "__static_attributes__", "__abstractmethods__", "_abc_impl", "__annotate__", "__annotate_func__",
     "__annotations_cache__", "__conditional_annotations__")
)  # fmt: skip
INSTALLED = ("site-packages", "dist-packages")  # folders of installed packages
PLAIN = (
    type(None),
    bool,
    int,
    float,
    complex,
    str,
    bytes,
    range,
    slice,
    type(Ellipsis),
    type(NotImplemented),
)
NAMED = (types.BuiltinFunctionType, np.ufunc, types.MethodDescriptorType, types.WrapperDescriptorType,
         types.MethodWrapperType, types.ClassMethodDescriptorType, types.GetSetDescriptorType)  # fmt: skip


def fingerprint(what: str, thing: Any) -> str:
    """Return the fingerprint of a thing, 64 hexadecimal digits.

    Parameters
    ----------
    what
        Name of the object in the message of an error.
    thing
        Anything.

    Raises
    ------
    SceneError
        If a part of it cannot be compared, such as an open file. The message says which part.
    """
    try:
        return _Fingerprints().of(thing, what).hex()
    except RecursionError:
        raise SceneError(
            f"{what} cannot be compared with another one: its parts are nested too deep"
        ) from None


class _Fingerprints:
    """Fingerprints of parts; those of one object are computed once."""

    def __init__(self) -> None:
        self._known: dict[int, bytes] = {}
        self._kept: list[Any] = []  # so that no id is used twice

    def of(self, thing: Any, place: str) -> bytes:
        """Return the fingerprint of a part; `place` says where it is."""
        if isinstance(thing, PLAIN):
            return _hash(type(thing).__name__, repr(thing).encode())
        known = self._known.get(id(thing))
        if known is None:
            self._kept.append(thing)
            self._known[id(thing)] = _hash("part of itself", b"")
            known = self._known[id(thing)] = self._composite(thing, place)
        return known

    def _composite(self, thing: Any, place: str) -> bytes:
        if isinstance(thing, np.ndarray | np.generic) and not np.asarray(thing).dtype.hasobject:
            array = np.asarray(thing)
            return _hash(f"array {array.dtype.str} {array.shape}", np.ascontiguousarray(array).data)
        if type(thing) in (tuple, list):
            return self._all(type(thing).__name__, ((item, f"{place}[{i}]") for i, item in enumerate(thing)))
        if type(thing) in (dict, types.MappingProxyType):
            return self._mapping(thing, place)
        if type(thing) in (set, frozenset):
            return _hash("set", b"".join(sorted(self.of(child, place) for child in thing)))
        if isinstance(thing, types.ModuleType):
            return self._module(thing, place)
        if isinstance(thing, type):
            return self._class(thing, place)
        if isinstance(thing, types.FunctionType):
            return self._function(thing, place)
        if isinstance(thing, types.CodeType):
            return self._code(thing, place)
        if isinstance(thing, types.MethodType):
            return self._all("method", [(thing.__func__, place), (thing.__self__, place)])
        if isinstance(thing, Enum):
            return self._all("member", [(type(thing), place), (thing.name, place)])
        return self._described(thing, place)

    def _described(self, thing: Any, place: str) -> bytes:
        """Return the fingerprint of an object of none of the types above."""
        if isinstance(thing, NAMED):
            owner = getattr(thing, "__self__", None)
            name = f"{getattr(thing, '__module__', None)} {getattr(thing, '__qualname__', thing.__name__)}"
            return self._all(name, [] if isinstance(owner, types.ModuleType) else [(owner, place)])
        if isinstance(thing, types.MemberDescriptorType):
            return _hash("slot", thing.__name__.encode())
        if isinstance(thing, property):
            return self._all("property", [(accessor, place) for accessor in (thing.fget, thing.fset)])
        if isinstance(thing, staticmethod | classmethod):
            return self._all(type(thing).__name__, [(thing.__func__, place)])
        if isinstance(thing, cached_property):
            return self._all("cached", [(thing.func, place)])
        if hasattr(thing, "__wrapped__") and callable(thing):  # such as that of lru_cache
            return self._all("wrapper", [(thing.__wrapped__, place)])
        return self._object(thing, place)

    def _object(self, thing: Any, place: str) -> bytes:
        """Return the fingerprint of an object by the parts that pickle would store."""
        try:
            parts = thing.__reduce_ex__(4)
        except Exception as error:
            raise SceneError(
                f"{place} is a {type(thing).__name__}, which cannot be compared with another one: {error}; "
                f"keep it outside of what is rendered, or give its class a method __getstate__"
            ) from error
        if isinstance(parts, str):
            return _hash("object", f"{type(thing).__module__} {type(thing).__qualname__} {parts}".encode())
        make, arguments, state, items, pairs = (*parts, None, None, None)[:5]
        return self._all(
            "object",
            [
                (make, place),
                *((argument, place) for argument in arguments),
                (_without_caches(type(thing), state), place),
                (None if items is None else list(items), place),
                (None if pairs is None else list(pairs), place),
            ],
        )

    def _mapping(self, mapping: Mapping[Any, Any], place: str) -> bytes:
        pairs = []
        for key, value in mapping.items():
            value_place = f"{place}.{key}" if isinstance(key, str) else f"{place}[{key!r}]"
            pairs.append(self.of(key, place) + self.of(value, value_place))
        return _hash("dict", b"".join(sorted(pairs)))

    def _module(self, module: types.ModuleType, place: str) -> bytes:
        library = _library(module.__name__)
        if library or getattr(module, "__file__", None) is None:
            return _hash("module", f"{library} {module.__name__}".encode())
        try:
            with open(str(module.__file__), "rb") as file:
                return _hash(f"module {module.__name__}", file.read())
        except OSError as error:
            raise SceneError(f"{place}: the module {module.__name__} cannot be read: {error}") from error

    def _class(self, cls: type, place: str) -> bytes:
        library = _library(cls.__module__)
        if library:
            return _hash("class", f"{library} {cls.__module__} {cls.__qualname__}".encode())
        attributes = {name: value for name, value in vars(cls).items() if name not in NOT_COMPARED}
        return self._all(
            f"class {cls.__qualname__}", [(cls.__bases__, place), (attributes, f"{place}.{cls.__qualname__}")]
        )

    def _function(self, function: types.FunctionType, place: str) -> bytes:
        place = f"{place}.{function.__name__}"
        cells = [_content(cell) for cell in function.__closure__ or ()]
        library = _library(function.__module__)
        if library:
            name = f"function {library} {function.__module__} {function.__qualname__}"
            return self._all(name, [(cells, place), (function.__defaults__, place)])
        outside = {
            name: function.__globals__[name]
            for name in sorted(set(_globals_read(function.__code__)))
            if name in function.__globals__
        }
        return self._all(
            "function",
            [
                (function.__code__, place),
                (function.__defaults__, place),
                (function.__kwdefaults__, place),
                (cells, place),
                (outside, place),
            ],
        )

    def _code(self, code: types.CodeType, place: str) -> bytes:
        names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
        return self._all("code", [(child, place) for child in (code.co_code, code.co_consts, names, counts)])

    def _all(self, kind: str, parts: Iterable[tuple[Any, str]]) -> bytes:
        return _hash(kind, b"".join(self.of(thing, place) for thing, place in parts))


def _hash(kind: str, data: Any) -> bytes:
    digest = hashlib.sha256(f"{len(kind)} {kind}".encode())
    digest.update(data)
    return digest.digest()


def _library(module: str | None) -> str:
    """Return the installed package of a module, and its version; "" for a user's own module."""
    top = (module or "").partition(".")[0]
    if top == "__main__":
        return ""
    if top in sys.stdlib_module_names or top in ("wavefront", "numpy"):
        return top  # their versions are compared elsewhere, where a difference is no more than a warning
    package = sys.modules.get(top)
    if not any(folder in (getattr(package, "__file__", None) or "") for folder in INSTALLED):
        return ""
    return f"{top} {getattr(package, '__version__', '')}"


def _globals_read(code: types.CodeType) -> Iterator[str]:
    """Yield the names of variables outside of a function that it reads, and those inside it."""
    for instruction in dis.get_instructions(code):
        if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield instruction.argval
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _globals_read(constant)


def _content(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not assigned yet
        return None


def _without_caches(cls: type, state: Any) -> Any:
    """Return the state of an object without values that follow from the others."""
    if not isinstance(state, dict):
        return state
    return {
        name: value
        for name, value in state.items()
        if not isinstance(getattr(cls, str(name), None), cached_property)
    }

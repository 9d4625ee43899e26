"""Structures of arrays: dataclasses whose fields are arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform

Structure = TypeVar("Structure")


@dataclass_transform(eq_default=False, field_specifiers=(field,))
def soa(cls: type[Structure]) -> type[Structure]:
    """Return a class as a structure of arrays: a dataclass with slots, without `__eq__` and `__repr__`.

    Comparison of such structures would fail, because arrays have no truth value. Every method that is not
    generated saves time in `import wavefront`.
    """
    return dataclass(slots=True, eq=False, repr=False)(cls)

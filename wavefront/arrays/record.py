"""Records: dataclasses of arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

Record = TypeVar("Record")


@dataclass_transform(eq_default=False)
def record(cls: type[Record]) -> type[Record]:
    """Return a class as a dataclass with slots, without `__eq__` and `__repr__`.

    Comparison of records would fail, because arrays have no truth value. Every method that is not generated
    saves time in `import wavefront`.
    """
    return dataclass(slots=True, eq=False, repr=False)(cls)

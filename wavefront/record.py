"""Records: named arrays that belong together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

Record = TypeVar("Record")


@dataclass_transform(eq_default=False)
def record(cls: type[Record]) -> type[Record]:
    """Make a class a dataclass with slots that is not compared or printed field by field.

    Arrays have no truth value, so a comparison of records would fail, and each method that is not
    written saves some of the time that `import wavefront` takes.
    """
    return dataclass(slots=True, eq=False, repr=False)(cls)

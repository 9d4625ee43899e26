"""The base class of sums of samples: fields that files keep, and that merging adds up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import get_annotations
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError


class Sums:
    """Sums whose fields are the attributes that the body of the class annotates.

    A field is an array, other sums, a dictionary of sums by name, or None. An array without elements stands
    for one of zeros.
    """

    __slots__ = ()
    FIELDS: ClassVar[tuple[str, ...]] = ()
    JOINED: ClassVar[tuple[str, ...]] = ()  # fields that do not add up: `merge` of the class joins them

    def __init_subclass__(cls) -> None:
        cls.FIELDS = tuple(dict.fromkeys((*cls.FIELDS, *get_annotations(cls))))

    def _own_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays among the fields, by name."""
        fields = {name: getattr(self, name) for name in self.FIELDS}
        return {name: value for name, value in fields.items() if isinstance(value, np.ndarray)}

    def _parts(self) -> dict[str, Sums]:
        """Return the sums among the fields: by name, those of a dictionary by its keys."""
        fields: dict[str, Any] = {}
        for name in self.FIELDS:
            value = getattr(self, name)
            fields |= value if isinstance(value, dict) else {name: value}
        return {name: value for name, value in fields.items() if isinstance(value, Sums)}

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all sums as arrays by name: "squares", and those of a part as "part.squares"."""
        parts = {
            f"{owner}.{name}": array
            for owner, sums in self._parts().items()
            for name, array in sums.arrays().items()
        }
        return {**self._own_arrays(), **parts}

    def restore(self, arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> None:
        """Become the sums of which `arrays` returned these, each after `prefix`; they are not copied.

        Raises
        ------
        SceneError
            If one is missing, or is of another shape or kind.
        """
        for name, mine in self._own_arrays().items():
            array = arrays.get(prefix + name)
            if (
                array is None
                or array.dtype.kind != mine.dtype.kind
                or (mine.dtype.kind == "f" and array.dtype != mine.dtype)
            ):
                raise SceneError(
                    f"the sums of the samples are incomplete: {prefix + name!r} is missing or of another type"
                )
            if array.shape != mine.shape:
                raise SceneError(
                    f"the sums {prefix + name!r} have shape {array.shape}; it must be {mine.shape}"
                )
            setattr(self, name, array)
        for name, sums in self._parts().items():
            sums.restore(arrays, f"{prefix}{name}.")

    def merge(self, other: Self) -> None:
        """Add the sums of other samples."""
        others = other._own_arrays()
        for name, mine in self._own_arrays().items():
            if others[name].size and name not in self.JOINED:
                setattr(self, name, mine + others[name] if mine.size else others[name].copy())
        parts = other._parts()
        for name, sums in self._parts().items():
            sums.merge(parts[name])


def bytes_per_pixel(make: Callable[[int], Sums]) -> int:
    """Return the bytes per pixel of the sums that `make` returns for a number of pixels."""
    single, double = (sum(array.nbytes for array in make(pixels).arrays().values()) for pixels in (1, 2))
    return double - single

"""Accelerators that are kept from one render of a scene to the next."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from .base import Accelerator, Geometry
from .registry import ACCELERATORS, AcceleratorMaker, engine, make_accelerator


class AcceleratorCache:
    """Makes accelerators, or hands out those of the time before where nothing has changed.

    Whatever was done to a scene in between, all numbers that an accelerator is built from are
    compared. Copies and pickles are empty.
    """

    def __init__(self) -> None:
        self._kept: dict[str, tuple[AcceleratorMaker, list[tuple[Geometry, Accelerator]]]] = {}

    def __reduce__(self) -> tuple[type[AcceleratorCache], tuple[()]]:
        """Leave the accelerators behind: some hold memory of Embree's."""
        return AcceleratorCache, ()

    def maker(self, accel: str | AcceleratorMaker) -> Callable[[Geometry], Accelerator]:
        """Return a maker of the accelerators of one render, given by name or class, one after the other.

        Raises
        ------
        SceneError
            As `make_accelerator` does, when called.
        """
        kind = engine(accel)
        label = ACCELERATORS.label(kind)
        same_kind, last = self._kept.pop(label, (kind, []))
        before = deque(last if same_kind is kind else ())
        now: list[tuple[Geometry, Accelerator]] = []
        self._kept[label] = kind, now

        def make(geometry: Geometry) -> Accelerator:
            cached = before.popleft() if before else None
            if cached is None or not _same(cached[0], geometry):
                cached = None  # frees its memory
                cached = geometry, make_accelerator(geometry, accel)
            now.append(cached)
            return cached[1]

        return make


def _same(a: Any, b: Any) -> bool:
    """Return whether two records of arrays, such as geometries, are of one class and equal."""
    return type(a) is type(b) and all(
        _equal(getattr(a, field.name), getattr(b, field.name)) for field in fields(a)
    )


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    return np.array_equal(a, b)

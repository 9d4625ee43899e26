"""Counting rays."""

from __future__ import annotations

from typing import Any

from ..arrays.vec import Bools, Doubles, Floats, Ints
from .base import Accelerator, Intersections
from .plate import surely_occluded


class RayCounter:
    """An accelerator that counts the rays of another one: rays to nearest surfaces, and shadow rays."""

    def __init__(self, accelerator: Accelerator) -> None:
        self.name = accelerator.name
        self.nearest, self.shadow = 0, 0
        self._accelerator: Any = accelerator

    def closest(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> Intersections:
        """Find the nearest hits of rays (3, n)."""
        self.nearest += origin.shape[1]
        return self._accelerator.closest(origin, direction, exclude_prim, *moment)

    def occluded(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> Bools:
        """Return True for each of the rays (3, n) that something blocks."""
        self.shadow += origin.shape[1]
        return self._accelerator.occluded(origin, direction, distance, exclude_prim, *moment)

    def surely_occluded(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> tuple[Bools, Bools]:
        """Return which rays hit something opaque, (n,), and which others may be blocked, (n,)."""
        self.shadow += origin.shape[1]
        return surely_occluded(self._accelerator, origin, direction, distance, exclude_prim, *moment)

"""What everything that may move has in common: shapes, lights and cameras."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles
from .deformation import Deformation
from .motion import Motion


class Moving:
    """Base of the elements of a scene, which may move.

    An element that moves is also a still one: it has the place and the form of its start. `at` returns it at
    another time.

    Attributes
    ----------
    motion
        Where it goes; None if it stays.
    deformation
        The form that it has at each time; None if it keeps its form.
    """

    __slots__ = ()
    motion: Motion | None = None
    deformation: Deformation | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves or deforms."""
        return self.motion is not None or self.deformation is not None

    @property
    def keys(self) -> Doubles:
        """Seconds (k,) at which it may go or deform another way; none if it is still."""
        parts = [each.keys for each in (self.motion, self.deformation) if each is not None]
        return np.concatenate([np.zeros(0), *parts])

    @property
    def time_span(self) -> tuple[float, float]:
        """When it begins and ends to move, seconds; infinity and minus infinity if it is still."""
        parts = [each for each in (self.motion, self.deformation) if each is not None]
        start = min((each.start for each in parts), default=float("inf"))
        return start, max((each.end for each in parts), default=-float("inf"))

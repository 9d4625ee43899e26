"""The contract of a deformation: arrays of a shape at each time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from ..arrays.vec import Doubles
from .track import Track


class Deformation(ABC):
    """Base class of deformations: what arrays of a shape are at each time.

    Attributes
    ----------
    start, end
        Seconds of the scene between which it deforms. Before and after, the forms of the ends hold.
    """

    start: float
    end: float

    @property
    def keys(self) -> Doubles:
        """Seconds (k,) at which it may go another way, rising; those of its ends where it tells no others."""
        return np.array([self.start, self.end], np.float64)

    @abstractmethod
    def at(self, time: float) -> Mapping[str, Doubles]:
        """Return arrays at a time by the names of the shape's attributes, such as "vertices"."""


class Samples(Deformation):
    """Arrays at certain times, linear between them.

    Parameters
    ----------
    times
        (k,) seconds, rising.
    arrays
        (k, ...) by the names of attributes.
    """

    def __init__(self, times: Doubles, arrays: Mapping[str, Doubles]) -> None:
        self._tracks = {name: Track(times, values) for name, values in arrays.items()}
        self.times = times
        self.start, self.end = float(times[0]), float(times[-1])

    @property
    def keys(self) -> Doubles:
        """The times."""
        return self.times

    def at(self, time: float) -> Mapping[str, Doubles]:
        """Return the arrays at a time."""
        return {name: track.at(time) for name, track in self._tracks.items()}

"""The contract of a motion: a matrix at each time."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ..arrays.vec import Doubles
from ..core.errors import finite_array
from ..core.suggestions import Answers


class Motion(Answers, ABC):
    """Base class of motions: an affine matrix at each time, as of `Keyframes`.

    Attributes
    ----------
    start, end
        Seconds of the scene between which it moves. Before and after, the matrices of the ends hold.

    Examples
    --------
    >>> class Spin(wf.Motion):
    ...     start, end = 0.0, 1.0
    ...     def at_times(self, times):
    ...         angle = 2 * np.pi * np.clip(times, self.start, self.end)
    ...         out = np.tile(np.eye(4), (len(times), 1, 1))
    ...         out[:, 0, 0] = out[:, 2, 2] = np.cos(angle)
    ...         out[:, 0, 2], out[:, 2, 0] = np.sin(angle), -np.sin(angle)
    ...         return out
    >>> box = wf.Box((0, 0, 0), 1).transformed(Spin())
    >>> np.round(wf.Scene(box).at(0.125).bounds[1], 3).tolist()
    [0.707, 0.5, 0.707]
    """

    start: float
    end: float

    @abstractmethod
    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrices (n, 4, 4) at times (n,), for column vectors."""

    @property
    def keys(self) -> Doubles:
        """Seconds (k,) at which it may go another way, rising; those of its ends where it tells no others.

        Motion blur regards the way between them as steady.
        """
        return np.array([self.start, self.end], np.float64)

    def at(self, time: float) -> Doubles:
        """Return the matrix (4, 4) at one time.

        Raises
        ------
        SceneError
            If `at_times` of a motion of your own returns something else.
        """
        found = finite_array(f"{type(self).__name__}.at_times", self.at_times(np.array([time])), (1, 4, 4))
        return found[0]

"""A steady turn about an axis."""

from __future__ import annotations

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles
from .motion import Motion


class Turn(Motion):
    """A turn about an axis at constant speed, counterclockwise as seen against the axis.

    Parameters
    ----------
    axis
        (3,) of any length above 0.
    about
        (3,) a point of it, scene units.
    degrees
        The whole angle.
    start, end
        Seconds, between which it turns.
    """

    def __init__(self, axis: Doubles, about: Doubles, degrees: float, start: float, end: float) -> None:
        self._axis, self._about = axis / np.linalg.norm(axis), about
        self._turns, self.start, self.end = degrees / 360, start, end

    @property
    def keys(self) -> Doubles:
        """Its ends, and the times of all quarters of a turn."""
        return np.linspace(self.start, self.end, int(np.ceil(4 * abs(self._turns))) + 1)

    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrices (n, 4, 4) at times (n,), by Rodrigues' formula."""
        part = np.clip((times - self.start) / ((self.end - self.start) or 1.0), 0, 1)
        sin, cos = (each[:, None, None] for each in sin_cos_turns(self._turns * part))
        x, y, z = self._axis
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        out = np.tile(np.eye(4), (len(times), 1, 1))
        out[:, :3, :3] = cos * np.eye(3) + (1 - cos) * np.outer(self._axis, self._axis) + sin * skew
        out[:, :3, 3] = self._about - out[:, :3, :3] @ self._about
        return out

"""Values over time, between keys: steps, lines, and the cubic splines of glTF.

Source: Khronos Group, glTF 2.0 specification, appendix C (interpolation modes).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.vec import Doubles, Ints
from .quaternions import Arcs, normalized, slerp

STEP, LINEAR, CUBIC = "step", "linear", "cubic"


class Track:
    """Values over time, which hold before the first key and after the last.

    Parameters
    ----------
    times
        (k,) of the keys, rising, seconds.
    values
        (k, ...) at the keys; of cubic splines (k, 3, ...): the tangent before a key, the value, and the
        tangent after it.
    way
        "step", "linear" or "cubic" between the keys.
    turns
        Whether the values (k, 4) are quaternions (x, y, z, w), of which lines are the shortest turns.
    """

    def __init__(self, times: Doubles, values: Doubles, way: str = LINEAR, turns: bool = False) -> None:
        self.times, self.way, self.turns = times, way, turns
        self.values = normalized(values) if turns and way != CUBIC else values

    @property
    def start(self) -> float:
        """Time of the first key, seconds."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Time of the last key, seconds."""
        return float(self.times[-1])

    def at_times(self, times: Doubles) -> Doubles:
        """Return the values (n, ...) at times (n,)."""
        first = np.maximum(np.searchsorted(self.times, times, "right") - 1, 0)
        after = np.minimum(first + 1, len(self.times) - 1)
        return _between(self, self.times, self.values, first, after, times)

    def at(self, time: float) -> Doubles:
        """Return the value at one time."""
        return self.at_times(np.array([time], np.float64))[0]


class Lines:
    """Straight ways from some values to others.

    Parameters
    ----------
    a, b
        (n, ...).
    """

    def __init__(self, a: Doubles, b: Doubles) -> None:
        self._first = np.ascontiguousarray(np.moveaxis(a, 0, -1))
        self._way = np.ascontiguousarray(np.moveaxis(b - a, 0, -1))

    def at(self, part: Doubles, line: Ints) -> Doubles:
        """Return the values (..., n) after parts (n,) in [0, 1] of lines, by index."""
        values = self._way.take(line, -1)
        values *= part
        values += self._first.take(line, -1)
        return values


class Bundle:
    """Tracks of one way and one shape of values, which are evaluated together at one time."""

    def __init__(self, tracks: Sequence[Track]) -> None:
        self._like, counts = tracks[0], np.array([len(track.times) for track in tracks])
        self._times = np.concatenate([track.times for track in tracks])
        self._values = np.concatenate([track.values for track in tracks])
        self._begins = np.cumsum(counts) - counts
        self._after = np.arange(1, len(self._times) + 1)
        self._after[self._begins + counts - 1] -= 1  # the last key of a track holds
        span = self._times[self._after] - self._times
        self._span = np.where(span > 0, span, 1)
        self._ways: Lines | Arcs | None = None  # from each key to the one after it
        if self._like.way == LINEAR:
            self._ways = (Arcs if self._like.turns else Lines)(self._values, self._values[self._after])

    def at(self, time: float) -> Doubles:
        """Return the values (n, ...) of the n tracks."""
        passed = np.add.reduceat(self._times <= time, self._begins, dtype=np.intp)
        first = self._begins + np.maximum(passed - 1, 0)
        if self._ways is None:
            return _between(
                self._like, self._times, self._values, first, self._after[first], np.float64(time)
            )
        part = np.clip((time - self._times.take(first)) / self._span.take(first), 0, 1)
        return np.moveaxis(self._ways.at(part, first), -1, 0)


def _between(
    like: Track, keys: Doubles, values: Doubles, first: Ints, after: Ints, times: Doubles | np.float64
) -> Doubles:
    """Return the values (n, ...) between the keys (n,) before and after times."""
    shape = (-1, *[1] * (values.ndim - 1 - (like.way == CUBIC)))
    span = keys[after] - keys[first]
    part = np.clip((times - keys[first]) / np.where(span > 0, span, 1), 0, 1).reshape(shape)
    if like.way == CUBIC:
        out = _spline(values[first], values[after], part, span.reshape(shape))
        return normalized(out) if like.turns else out
    if like.way == STEP:
        return values[np.where(part.reshape(-1) >= 1, after, first)]
    if like.turns:
        return slerp(values[first], values[after], part)
    start = values[first]
    return np.asarray(start + part * (values[after] - start))


def _spline(a: Doubles, b: Doubles, t: Doubles, span: Doubles) -> Doubles:
    """Return Hermite splines between keys (n, 3, ...) at parts t of the time between them."""
    t2, t3 = t * t, t * t * t
    out: Doubles = (2 * t3 - 3 * t2 + 1) * a[:, 1] + span * (t3 - 2 * t2 + t) * a[:, 2]
    return out + (3 * t2 - 2 * t3) * b[:, 1] + span * (t3 - t2) * b[:, 0]

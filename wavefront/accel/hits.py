"""What a batch of rays has found so far, and the candidates still to be decided."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..vec import Floats, Ints, f4
from .bvh import Ball, Codes, RayBatch
from .triangle import ROUNDOFF, Doubles

PRIM_BITS = 31  # of a sortable word, below those of t
NO_HIT = 0x7F7FFFFF << PRIM_BITS  # of a miss: t = inf
DECIDE = 1 << 14  # candidates decided at a time


class HitRecord(Protocol):
    """Takes hits, and says how far rays still look."""

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Take hits of lanes (k,) at t; those with t <= 0, NaN or inf are none."""

    def add_each(self, part: slice, prim: Ints, t: Doubles) -> None:
        """Take one hit of each lane of a part, (k,)."""

    def reach(self) -> Floats:
        """Return how far each of n rays looks, as `traverse.trace` wants it, (n + 1,)."""


class ClosestHit:
    """The nearest hit of each lane so far, as one sortable word: bits of t, then the primitive."""

    def __init__(self, lanes: RayBatch, ball: Ball) -> None:
        self.lanes, self.ball = lanes, ball
        self.key = np.full(lanes.count, NO_HIT, np.int64)

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Record hits of lanes (k,) at t; those with t <= 0, NaN or inf are none."""
        np.minimum.at(self.key, lane, _keys(prim, t))

    def add_each(self, part: slice, prim: Ints, t: Doubles) -> None:
        """Record one hit of each lane of a part, (k,)."""
        np.minimum(self.key[part], _keys(prim, t), out=self.key[part])

    def reach(self) -> Floats:
        """Look no further than the nearest hit."""
        return _reach(distances(self.key), self.lanes, self.ball)


class AnyHit:
    """Which lanes are blocked so far."""

    def __init__(self, lanes: RayBatch, ball: Ball, distance: Floats) -> None:
        self.lanes, self.ball, self.distance = lanes, ball, distance
        self.blocked = np.zeros(distance.size, bool)

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Block the lanes (k,) with 0 < t < distance."""
        rounded = t.astype(f4)
        self.blocked[lane.compress((rounded > 0) & (rounded < self.distance.take(lane)))] = True

    def add_each(self, part: slice, prim: Ints, t: Doubles) -> None:
        """Block lanes of a part with 0 < t < distance, (k,)."""
        rounded = t.astype(f4)
        self.blocked[part] |= (rounded > 0) & (rounded < self.distance[part])

    def reach(self) -> Floats:
        """Look as far as the distance, and no more when blocked."""
        return _reach(np.where(self.blocked, f4(-np.inf), self.distance), self.lanes, self.ball)


def _keys(prim: Ints, t: Doubles) -> Codes:
    """Words that sort like t, those with equal t like `prim`; what is no hit sorts no lower than NO_HIT."""
    bits = t.astype(f4).view(np.uint32)  # negative numbers and NaN are above inf
    bits -= np.uint32(1)  # now 0 is, too
    key = bits.astype(np.int64)
    key <<= PRIM_BITS
    key |= prim
    return key


def distances(key: Codes) -> Floats:
    """Return the t (n,) of sortable words; inf of NO_HIT."""
    return ((key >> PRIM_BITS) + 1).astype(np.uint32).view(f4)


def prims(key: Codes) -> Ints:
    """Return the primitives (n,) of sortable words; -1 of NO_HIT."""
    prim = key & ((1 << PRIM_BITS) - 1)
    prim[np.flatnonzero(key == NO_HIT)] = -1
    return prim


def _reach(t: Floats, lanes: RayBatch, ball: Ball) -> Floats:
    """Turn t into distances from the point next to the center, in units of the ball's radius; rounded up."""
    far = t * lanes.speed
    out = np.zeros(t.size + 1, f4)
    out[:-1] = (far + lanes.begin + 8 * ROUNDOFF * (far + np.abs(lanes.begin))) * f4(1 / ball.radius)
    out[:-1] += f4(1e-6)
    return out


class Candidates:
    """Collects small arrays of candidates, so that they are decided a few thousand at a time."""

    def __init__(self, decide: Callable[..., None]) -> None:
        self.decide = decide
        self.parts: list[tuple[NDArray[Any], ...]] = []
        self.count = 0

    def add(self, *columns: NDArray[Any]) -> None:
        """Add candidates, arrays of (k,) each."""
        self.parts.append(columns)
        self.count += columns[0].size
        if self.count >= DECIDE:
            self.flush()

    def flush(self) -> None:
        """Decide what has been collected."""
        if self.count:
            self.decide(*(np.concatenate(column) for column in zip(*self.parts, strict=True)))
        self.parts, self.count = [], 0

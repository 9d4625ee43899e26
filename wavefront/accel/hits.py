"""The hits of a batch of rays so far, and a buffer of candidates that are still to be tested."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats, Ints, f4
from .bvh import Ball, Codes, RayBatch
from .triangle import ROUNDOFF

PRIM_BITS = 31  # low bits of a packed hit; those of t are above
NO_HIT = 0x7F7FFFFF << PRIM_BITS  # a packed miss: t = inf
CANDIDATE_BATCH = 1 << 14  # candidates tested at a time


class HitAccumulator(Protocol):
    """Receives hits, and returns the distance up to which further ones matter."""

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Add hits of lanes (k,) at t (k,); t <= 0, NaN and inf are misses."""

    def add_slice(self, lanes: slice, prim: Ints, t: Doubles) -> None:
        """Add one hit of each lane of a slice, (k,)."""

    def t_far(self) -> Floats:
        """Return the largest distance at which a hit still matters, as `bvh.trace` takes it, (n + 1,)."""


class ClosestHit:
    """The nearest hit of each lane so far.

    A hit is packed into one integer, the bits of t above those of the primitive.
    """

    def __init__(self, batch: RayBatch, ball: Ball) -> None:
        self.batch, self.ball = batch, ball
        self.packed = np.full(batch.count, NO_HIT, np.int64)

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Add hits of lanes (k,) at t (k,); t <= 0, NaN and inf are misses."""
        np.minimum.at(self.packed, lane, _pack(prim, t))

    def add_slice(self, lanes: slice, prim: Ints, t: Doubles) -> None:
        """Add one hit of each lane of a slice, (k,)."""
        np.minimum(self.packed[lanes], _pack(prim, t), out=self.packed[lanes])

    def t_far(self) -> Floats:
        """Return the distances of the nearest hits, as `bvh.trace` takes them, (n + 1,)."""
        return _line_t_far(unpack_t(self.packed), self.batch, self.ball)


class AnyHit:
    """A mask of the lanes that are blocked so far."""

    def __init__(self, batch: RayBatch, ball: Ball, distance: Floats) -> None:
        self.batch, self.ball, self.distance = batch, ball, distance
        self.blocked = np.zeros(distance.size, bool)

    def add(self, lane: Ints, prim: Ints, t: Doubles) -> None:
        """Block lanes (k,) that have a hit with 0 < t < distance."""
        rounded = t.astype(f4)
        self.blocked[lane.compress((rounded > 0) & (rounded < self.distance.take(lane)))] = True

    def add_slice(self, lanes: slice, prim: Ints, t: Doubles) -> None:
        """Block the lanes of a slice that have a hit with 0 < t < distance, (k,)."""
        rounded = t.astype(f4)
        self.blocked[lanes] |= (rounded > 0) & (rounded < self.distance[lanes])

    def t_far(self) -> Floats:
        """Return the rays' lengths, or -inf where a ray is blocked, as `bvh.trace` takes them, (n + 1,)."""
        return _line_t_far(np.where(self.blocked, f4(-np.inf), self.distance), self.batch, self.ball)


def _pack(prim: Ints, t: Doubles) -> Codes:
    """Pack hits (k,) into integers that sort by t, then by primitive; misses sort no lower than NO_HIT."""
    bits = t.astype(f4).view(np.uint32)  # as integers, negative numbers and NaN are above inf
    bits -= np.uint32(1)  # so that 0 wraps round to above inf, too
    packed = bits.astype(np.int64)
    packed <<= PRIM_BITS
    packed |= prim
    return packed


def unpack_t(packed: Codes) -> Floats:
    """Return the t (n,) of packed hits; inf for NO_HIT."""
    return ((packed >> PRIM_BITS) + 1).astype(np.uint32).view(f4)


def unpack_prim(packed: Codes) -> Ints:
    """Return the primitives (n,) of packed hits; -1 for NO_HIT."""
    prim = packed & ((1 << PRIM_BITS) - 1)
    prim[np.flatnonzero(packed == NO_HIT)] = -1
    return prim


def _line_t_far(t: Floats, batch: RayBatch, ball: Ball) -> Floats:
    """Return t (n,) as `bvh.trace` takes it, (n + 1,): from the line's foot, in ball radii, rounded up."""
    far = t * batch.direction_length
    out = np.zeros(t.size + 1, f4)
    out[:-1] = (far + batch.begin + 8 * ROUNDOFF * (far + np.abs(batch.begin))) * f4(1 / ball.radius)
    out[:-1] += f4(1e-6)
    return out


class Candidates:
    """Collects small arrays of candidates, and passes them on a few thousand at a time."""

    def __init__(self, test: Callable[..., None]) -> None:
        self.test = test
        self.parts: list[tuple[NDArray[Any], ...]] = []
        self.count = 0

    def add(self, *columns: NDArray[Any]) -> None:
        """Add candidates, arrays of (k,) each."""
        self.parts.append(columns)
        self.count += columns[0].size
        if self.count >= CANDIDATE_BATCH:
            self.flush()

    def flush(self) -> None:
        """Pass on the collected pairs."""
        if self.count:
            self.test(*(np.concatenate(column) for column in zip(*self.parts, strict=True)))
        self.parts, self.count = [], 0

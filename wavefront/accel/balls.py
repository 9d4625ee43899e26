"""Balls around a few primitives, which most rays pass at a distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from ..arrays.vec import ALL, Floats, Ints, Lanes, column, dot, f4
from .primitives import CurvedPrimitives
from .sphere import SpherePrimitives
from .triangle import ROUNDOFF

MOST = 4  # each costs a ray about 15 ns; the matrix product and its preparation cost 100
ENLARGED = 1 + 1e-6  # of a squared radius, for its rounding
MARGIN = f4(64 * ROUNDOFF)  # of squared lengths, more than all rounding errors together


class BoundingBalls:
    """A few balls that bound what rays in float32 may hit.

    Parameters
    ----------
    balls
        Center (3, 1) and squared radius of each, and whether it is a sphere itself.
    """

    def __init__(self, balls: Sequence[tuple[Floats, np.float32, bool]]) -> None:
        self._balls = balls

    @classmethod
    def of(cls, kinds: Sequence[CurvedPrimitives]) -> Self:
        """Return the bounding balls of at most `MOST` curved primitives together."""
        balls: list[tuple[Floats, np.float32, bool]] = []
        for kind in kinds:
            centers, radii = kind.balls
            for center, radius in zip(centers.T, radii, strict=True):
                balls.append((column(center), np.square(radius), isinstance(kind, SpherePrimitives)))
        return cls(balls)

    @classmethod
    def around(cls, triangles: Floats) -> Self:
        """Return the ball around the middle of the box of triangles (m, 3, 3)."""
        corners = triangles.reshape(-1, 3).astype(np.float64)
        middle = (corners.min(0) + corners.max(0)) / 2
        center = middle.astype(f4)
        radius2 = ((corners - center) ** 2).sum(1).max()
        return cls([(column(center), f4(radius2 * ENLARGED), False)])

    def near(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Lanes:
        """Return the lanes (k,) of rays (3, n) that may hit a primitive; a slice where all may.

        `exclude_prim` (n,) is numbered as the primitives are.
        """
        may_hit = np.zeros(origin.shape[1], np.bool_)
        with np.errstate(all="ignore"):
            length2 = dot(direction, direction)
            for number, (center, radius2, is_sphere) in enumerate(self._balls):
                toward = center - origin
                distance2, along = dot(toward, toward), dot(toward, direction)
                slack, along2 = MARGIN * distance2, along * along
                away = distance2 > radius2 + slack
                if is_sphere:  # a ray that leaves it for the outside does not meet it again
                    away |= (exclude_prim == number) & (along2 > slack * length2)
                # |toward × direction|² against its bound; lanes with NaN are kept
                misses = distance2 * length2 - along2 > (radius2 + slack) * length2
                misses |= away & (along < 0)
                may_hit |= ~misses
        lanes = np.flatnonzero(may_hit)
        return ALL if lanes.size == may_hit.size else lanes


def bounding_balls(kinds: Sequence[CurvedPrimitives]) -> BoundingBalls | None:
    """Return the balls of a few curved primitives; None where there are more."""
    return BoundingBalls.of(kinds) if sum(map(len, kinds)) <= MOST else None

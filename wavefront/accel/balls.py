"""Balls around a few primitives, which most rays pass at a distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.vec import ALL, Floats, Ints, Lanes, column, dot, f4
from .primitives import CurvedPrimitives
from .sphere import SpherePrimitives
from .triangle import ROUNDOFF

MOST = 4  # each costs a ray about 15 ns; the matrix product and its preparation cost 100
MARGIN = f4(64 * ROUNDOFF)  # of squared lengths, more than all rounding errors together


class BoundingBalls:
    """The bounding balls of curved primitives, for rays in float32.

    Parameters
    ----------
    kinds
        At most `MOST` primitives together.
    """

    def __init__(self, kinds: Sequence[CurvedPrimitives]) -> None:
        self._balls: list[tuple[Floats, np.float32, bool]] = []
        for kind in kinds:
            centers, radii = kind.balls
            for center, radius in zip(centers.T, radii, strict=True):
                self._balls.append((column(center), np.square(radius), isinstance(kind, SpherePrimitives)))

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
    return BoundingBalls(kinds) if sum(map(len, kinds)) <= MOST else None

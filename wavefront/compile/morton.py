"""Morton codes: cells of a grid in an order that keeps near cells together.

Source: G. M. Morton, "A Computer Oriented Geodetic Data Base and a New Technique in File Sequencing", IBM
report, 1966.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays
from ..arrays.vec import Doubles, Floats, Ints, f4, take

BITS = 5  # along each axis: codes have 15 bits, and NumPy sorts integers of 16 bits by radix

_SPREAD = np.array(
    [sum((i >> bit & 1) << 3 * bit for bit in range(BITS)) for i in range(1 << BITS)], np.uint16
)


class AnyOrder:
    """Keeps lanes in their order: in small scenes sorting costs more than it brings."""

    __slots__ = ()

    def ordered(self, rays: Rays, hits: Hits, lanes: Ints) -> Ints:
        """Return the lanes (k,) as they are."""
        return lanes


@soa
class MortonGrid:
    """A cubic grid of 2^BITS cells along each axis."""

    low: Floats  # (3,) its corner
    per_unit: np.float32  # cells per unit of length

    @classmethod
    def over(cls, half: Doubles) -> MortonGrid:
        """Return a grid over a box around 0 with these half sides (3,)."""
        return cls((-half).astype(f4), f4((1 << BITS) / max(2 * float(half.max()), 1e-30)))

    def ordered(self, rays: Rays, hits: Hits, lanes: Ints) -> Ints:
        """Return lanes (k,) ordered by where they hit."""
        points = take(rays.origin, lanes) + take(rays.direction, lanes) * take(hits.t, lanes)
        return lanes.take(np.argsort(self.codes(points), kind="stable"))

    def codes(self, points: Floats) -> NDArray[np.uint16]:
        """Return the codes (n,) of points (3, n)."""
        code = np.zeros(points.shape[1], np.uint16)
        last = f4((1 << BITS) - 0.5)
        for axis in range(3):
            cell = ((points[axis] - self.low[axis]) * self.per_unit).clip(f4(0), last).astype(np.uint8)
            code |= _SPREAD.take(cell) << np.uint16(axis)
        return code

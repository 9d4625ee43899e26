"""Sums of the light that narrow lobes could bring to sensors (aovs/narrow_lobes.py)."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats, Lanes, f4
from .film import add_in_order
from .sums import Sums


class NarrowSums(Sums):
    """Sums of p and of p² over the samples of each of n pixels; 8 bytes for each pixel.

    They are added in the order of the samples, so that they do not depend on the division of a render into
    jobs. The last bits of merged ones depend on which samples are in which part.
    """

    sums: Floats  # (2, n)

    def __init__(self, pixels: int) -> None:
        self.sums = np.zeros((2, pixels), f4)

    def add(self, lanes: Lanes, throughput: Floats) -> None:
        """Add the next samples of some pixels, p (samples, k)."""
        sums = self.sums[:, lanes]  # a view of a slice, else a copy
        add_in_order(sums, np.stack([throughput, np.square(throughput)]))
        if not isinstance(lanes, slice):
            self.sums[:, lanes] = sums

    def typical(self) -> Floats:
        """Return Σp²/Σp, (n,): p of a typical path that carries light; 0 where there is none."""
        first, second = self.sums
        return second / np.where(first > 0, first, f4(1))

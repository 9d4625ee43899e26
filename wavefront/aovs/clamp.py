"""The limit of the indirect light that a path finds at once: the setting `clamp`, and the AOV "clamped"."""

from __future__ import annotations

import numpy as np

from ..arrays.state import Contribution, Paths
from ..arrays.vec import Floats, Ints, add_to_slots, f4
from .direct_light import is_direct


class Clamp:
    """Scales indirect light down to a limit, and keeps the rest, (3, n) of n samples.

    Parameters
    ----------
    limit
        The most light, as radiance, the mean of its channels.
    n
        Samples of the wave.
    """

    def __init__(self, limit: float, n: int) -> None:
        self.limit, self.light = limit, np.zeros((3, n), f4)

    def clamped(
        self, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats, share: float
    ) -> Floats:
        """Return light `arriving` (3, k) at slots (k,), its indirect part scaled down to the limit.

        A path of several branches is the `share` of a sample, and is clamped like one of a sample of its own.
        Values that are not finite stay so.
        """
        assert paths.depth is not None
        limit, (x, y, z) = f4(self.limit * share), arriving * f4(1 / 3)
        mean = x + y + z
        bright = (mean > limit) & (mean < np.inf) & ~is_direct(paths.depth, contribution)
        lanes = np.flatnonzero(bright)
        if not lanes.size:
            return arriving
        left = arriving.copy()
        left[:, lanes] *= limit / mean.take(lanes)
        removed = arriving.take(lanes, 1) - left.take(lanes, 1)
        add_to_slots(self.light, slot.take(lanes), removed)
        return left

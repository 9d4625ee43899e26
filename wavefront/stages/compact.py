"""Which paths live on."""

from __future__ import annotations

import numpy as np

from ..sampling.sampler import Dimension, Sampler
from ..state import Hits, Paths
from ..vec import Ints, f4

ROULETTE_AFTER = 3  # scattering events before paths may be ended
MAX_SURVIVAL = f4(0.95)


def compact(paths: Paths, hits: Hits, lanes: Ints) -> tuple[Paths, Hits]:
    """Keep the given lanes of paths and hits."""
    if lanes.size == len(paths):
        return paths, hits
    return paths.take(lanes), hits.take(lanes)


def roulette(paths: Paths, sampler: Sampler, bounce: int) -> Paths:
    """End paths that carry little, and make the survivors carry more, so that the mean stays.

    The chance to survive is the largest channel of the throughput, with the compression of
    radiance by refraction taken out (E. Veach, thesis 1997, §10.4.1; pbrt-v4, §13.2.1), at most
    0.95.
    """
    if bounce < ROULETTE_AFTER or not len(paths):
        return paths
    chance = np.minimum(paths.throughput.max(0) * paths.eta2, MAX_SURVIVAL)
    u = sampler.draw_1d(paths.pixel, paths.sample, bounce, Dimension.ROULETTE)
    alive = np.flatnonzero(u < chance)
    survivors = paths.take(alive)
    survivors.throughput = survivors.throughput / chance.take(alive)
    return survivors

"""Blurred pictures beside means of pictures of still scenes at random times."""

from __future__ import annotations

import numpy as np
from significance import ALPHA, render, smallest_p

OPTIONS = {"ground": False, "lighting": None, "branches": 1, "reuse": False}


def strata_means(scene, strata, spp, seed, **options):
    """The mean of stills at one random time in each of some strata of [0, 1], all with their own seeds."""
    times = (np.arange(strata) + np.random.default_rng(seed).random(strata)) / strata
    stills = [
        render(scene.at(time), spp, seed=1000 * seed + number + 1, **options).rgb.astype(float)
        for number, time in enumerate(times.tolist())
    ]
    return np.mean(stills, 0)


def assert_mean_of_stills(scene, runs=8, strata=8, spp=16, still_spp=2, max_error=0.02, **options):
    """Test that blurred pictures and means of stills have the same mean in blocks and over all."""
    options = {**OPTIONS, **options}
    blurred = np.stack(
        [render(scene, spp, seed=run, shutter=(0, 1), **options).rgb.astype(float) for run in range(runs)]
    )
    stills = np.stack([strata_means(scene, strata, still_spp, run + 1, **options) for run in range(runs)])
    side = blurred.shape[1] // 4
    cells = [each.reshape(runs, 4, side, 4, side, 3).mean((2, 4)) for each in (blurred, stills)]
    for level in (cells, [each.mean((1, 2)) for each in cells]):
        assert smallest_p(*level) > ALPHA
    error = np.sqrt(sum(each.mean((1, 2, 3)).var(ddof=1) / runs for each in cells))
    assert error < max_error * stills.mean()

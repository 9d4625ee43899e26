"""The full estimator with paths that pixels share (stages/reuse.py)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.state import Hits, Paths
from ..arrays.vec import Floats, f4
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..sampling.sampler import Sampler
from ..sampling.tiles import WaveTiles
from ..stages.bounce import bounce_sample, branch, copies
from ..stages.compact import roulette, select
from ..stages.guidance import guide
from ..stages.reuse import SHARED_WAYS, add_shared, as_shared, can_reuse, shared_points
from ..stages.shade import direct
from .ladder import li_full
from .steps import accumulate, intersect_and_compact, prepare_shading

JOINED_AFTER = 3  # bounces: a quarter of the paths is left then


def li_reuse(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    max_bounces: int,
    branches: int = 1,
    table: GuideTable | None = None,
) -> Floats:
    """Estimate the same as `li_full`, with paths that pixels share from their second points on.

    Direct light at the first points, and emission that paths meet at their second points, are not shared.
    """
    if not can_reuse(scene):
        return li_full(scene, paths, sampler, max_bounces, branches, table)
    L = np.zeros((3, len(paths)), f4)
    tiles = WaveTiles.of(paths.pixel, paths.sample, sampler.width)
    first, hits = intersect_and_compact(scene, paths, sampler, 0, L, mis=True)
    if max_bounces == 0 or not len(first):
        return L
    shade = guide(prepare_shading(scene, first, hits), table)
    accumulate(L, first, direct(scene, first, shade, sampler, 0, mis=True))
    paths = branch(first, shade, sampler, 0, ways=branches)
    paths = select(paths, roulette(scene, paths, sampler, 0, branches))
    paths, hits = intersect_and_compact(scene, paths, sampler, 1, L, mis=True)
    if max_bounces == 1 or not len(paths):
        return L
    lanes, points = shared_points(scene, paths, hits, branches)
    own = np.setdiff1d(np.arange(len(paths)), lanes, assume_unique=True)
    follow(scene, [(paths.take(own), hits.take(own))], sampler, max_bounces, L, branches, table)
    begun, hits, light = as_shared(paths.take(lanes)), hits.take(lanes), np.zeros((3, lanes.size), f4)
    ways = [(way, hits) for way in copies(begun, SHARED_WAYS)]
    follow(scene, ways, sampler, max_bounces, light, branches, table)
    sums = [(L, light), *([] if first.recorder is None else first.recorder.parts_of_shared())]
    for _, found in sums:
        found *= f4(1 / SHARED_WAYS)
    add_shared(scene, sums, first, shade, points, tiles, branches)
    return L


def follow(
    scene: CompiledScene,
    ways: Sequence[tuple[Paths, Hits]],
    sampler: Sampler,
    max_bounces: int,
    L: Floats,
    branches: int,
    table: GuideTable | None,
) -> None:
    """Follow paths from their second surfaces on, and add the light that they find to L.

    The ways go on one after the other, as smaller arrays fit the cache, and together once few paths are left.

    Parameters
    ----------
    ways
        Records of paths, and their hits on their second surfaces, which are not shaded yet.
    L
        (3, n) radiance of each slot.
    branches, table
        As for `li_full`.
    """
    for bounce in range(1, max_bounces):
        leaving = [
            _scatter(scene, paths, hits, sampler, bounce, L, branches, table)
            for paths, hits in ways
            if len(paths)
        ]
        if bounce == JOINED_AFTER and leaving:
            leaving = [Paths.concatenate(leaving)]
        ways = [intersect_and_compact(scene, paths, sampler, bounce + 1, L, mis=True) for paths in leaving]


def _scatter(
    scene: CompiledScene,
    paths: Paths,
    hits: Hits,
    sampler: Sampler,
    bounce: int,
    L: Floats,
    branches: int,
    table: GuideTable | None,
) -> Paths:
    """Add direct light to L, and return the paths that go on in new directions."""
    shade = guide(prepare_shading(scene, paths, hits), table)
    accumulate(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
    paths = bounce_sample(paths, shade, sampler, bounce)
    return select(paths, roulette(scene, paths, sampler, bounce, branches))

"""The four estimators of the light that reaches the camera: one ladder, simplest first.

Each takes a wave of paths through the loop intersect → compact → shade → bounce-sample and returns the
radiance of every path's slot, (3, n). `max_bounces` counts scattering events: with 0 only light seen
directly is found, with 1 direct light as well.

Examples
--------
>>> from wavefront.integrators import INTEGRATORS
>>> list(INTEGRATORS)
['naive', 'direct_simple', 'direct_mis', 'full']
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from ..aovs.recorder import add_to_slots
from ..arrays.state import Contribution, Hits, Paths
from ..arrays.vec import Floats, Ints, f4, take
from ..compile.scene import CompiledScene
from ..core.registry import Registry
from ..guiding import GuideTable
from ..sampling.sampler import Sampler
from ..sampling.tiles import WaveTiles
from ..stages.alpha import alpha_pass_through
from ..stages.background import show_background
from ..stages.bounce import bounce_sample, branch, copies
from ..stages.caught_shadow import off_catchers
from ..stages.compact import alive, compact, roulette, scattering_lanes, select, specular_lanes
from ..stages.guidance import guide
from ..stages.interaction import interaction
from ..stages.intersect import intersect
from ..stages.medium import absorb
from ..stages.normal_mapping import perturb_normals
from ..stages.reuse import SHARED_WAYS, add_shared, as_shared, can_reuse, shared_points
from ..stages.shade import Shading, direct, emitted, mis_weighted, shading, without_caustics

JOINED_AFTER = 3  # bounces: a quarter of the paths is left then
Integrator: TypeAlias = Callable[[CompiledScene, Paths, Sampler, int], Floats]


def li_naive(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Follow BSDF samples only; light is found by chance."""
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=False)
        if bounce == max_bounces or not len(paths):
            break
        shade = prepare_shading(scene, paths, hits)
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = select(paths, roulette(scene, paths, sampler, bounce))
    return L


def li_direct_simple(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Emission and one light sample at the first surface that is not specular."""
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=False)
        if bounce == max_bounces or not len(paths):
            break
        shade = prepare_shading(scene, paths, hits)
        accumulate(L, paths, direct(scene, paths, shade, sampler, bounce, mis=False))
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = select(paths, np.flatnonzero(paths.specular & alive(paths)))
    return L


def li_direct_mis(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Emission at the first surface that is not specular, and direct light by two samples.

    One sample comes from the lights and one from the BSDF, weighted by the power heuristic.
    """
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=True, keep=specular_lanes)
        if bounce == max_bounces or not len(paths):
            break
        shade = prepare_shading(scene, paths, hits)
        accumulate(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = select(paths, np.flatnonzero(alive(paths)))
    return L


def li_full(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    max_bounces: int,
    branches: int = 1,
    table: GuideTable | None = None,
) -> Floats:
    """Direct light by two samples at every bounce, and with it all indirect light.

    From its first surface each path goes on in so many `branches`. A `table` guides directions.
    """
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=True)
        if bounce == max_bounces or not len(paths):
            break
        shade = guide(prepare_shading(scene, paths, hits), table)
        accumulate(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = branch(paths, shade, sampler, bounce, ways=branches if bounce == 0 else 1)
        paths = select(paths, roulette(scene, paths, sampler, bounce, branches))
    return L


def li_reuse(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    max_bounces: int,
    branches: int = 1,
    table: GuideTable | None = None,
) -> Floats:
    """Estimate what `li_full` does; pixels share what their paths find after their second points.

    Direct light at the first points, and emission that paths meet at their second ones, stay each path's own.
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
    light *= f4(1 / SHARED_WAYS)
    add_shared(scene, L, first, shade, points, light, tiles, branches)
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


def integrator_for(
    integrator: Integrator, branches: int, reuse: bool, table: GuideTable | None
) -> Integrator:
    """Return an integrator whose paths branch, are shared among pixels, and are guided, as asked for."""
    if reuse:
        return partial(li_reuse, branches=branches, table=table)
    if branches == 1 and table is None:
        return integrator
    return partial(li_full, branches=branches, table=table)


WITH_MIS: tuple[Integrator, ...] = (li_direct_mis, li_full)  # weigh light samples against BSDF samples
INTEGRATORS: Registry[Integrator] = Registry(
    "integrator",
    "a function of (scene, paths, sampler, max_bounces)",
    {"naive": li_naive, "direct_simple": li_direct_simple, "direct_mis": li_direct_mis, "full": li_full},
)


def intersect_and_compact(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    bounce: int,
    L: Floats,
    mis: bool,
    keep: Callable[[CompiledScene, Paths, Hits, Contribution], Ints] = scattering_lanes,
) -> tuple[Paths, Hits]:
    """Follow paths to their next surfaces, add the light that they meet to L, and keep some of them.

    With `mis` the light is weighted against light sampling. `keep` returns the lanes of the paths that
    scatter; the others end here.
    """
    hits, left = intersect(scene, paths), paths.exclude_prim
    paths, hits = alpha_pass_through(scene, paths, hits, sampler, bounce)
    emission = without_caustics(scene, paths, left, hits, emitted(scene, paths, hits))
    if bounce == 0:
        emission = show_background(scene, L, paths, hits, emission)
    accumulate(L, paths, mis_weighted(scene, paths, emission) if mis else emission)
    lanes = keep(scene, paths, hits, emission)
    if bounce == 0:
        lanes = off_catchers(scene, hits, lanes)
    kept = compact(scene, paths, hits, lanes)
    if paths.recorder is not None:
        paths.recorder.record_hits(scene, paths, hits, lanes, *kept)
    return kept


def prepare_shading(scene: CompiledScene, paths: Paths, hits: Hits) -> Shading:
    """Weaken the paths by the matter they came through, and make their surfaces ready to shade."""
    surface = interaction(scene, paths, hits)
    perturb_normals(scene, surface)
    absorb(scene, paths.throughput, hits, surface)
    shade = shading(scene, surface)
    if paths.recorder is not None:
        paths.recorder.record_surfaces(scene, paths, shade)
    return shade


def accumulate(L: Floats, paths: Paths, contribution: Contribution) -> None:
    """Add a contribution, times the throughput of its paths, to the slots of L."""
    slot = take(paths.slot, contribution.lanes)
    arriving = take(paths.throughput, contribution.lanes) * contribution.radiance
    if paths.recorder is not None:
        arriving = paths.recorder.clamped(paths, contribution, slot, arriving)
    add_to_slots(L, slot, arriving)
    if paths.recorder is not None:
        paths.recorder.record_light(L, paths, contribution, slot, arriving)

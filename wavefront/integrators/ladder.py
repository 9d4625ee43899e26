"""The four estimators of the light that reaches the camera: one ladder, simplest first.

Each takes a wave of paths through the loop intersect → compact → shade → bounce-sample and returns the
radiance of every path's slot, (3, n). `max_bounces` counts scattering events: with 0 only light seen
directly is found, with 1 direct light as well.
"""

from __future__ import annotations

import numpy as np

from ..arrays.state import Paths
from ..arrays.vec import Floats, f4
from ..compile.scene import CompiledScene
from ..sampling.sampler import Sampler
from ..stages.bounce import bounce_sample
from ..stages.compact import alive, roulette, select, specular_lanes
from ..stages.shade import direct
from .steps import accumulate, intersect_and_compact, prepare_shading, scatter


def li_naive(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Follow BSDF samples only; paths find light by chance."""
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
    """Estimate emission, and direct light at the first surface that is not specular, by one light sample."""
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
    """Estimate emission, and direct light at the first surface that is not specular, by two samples.

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


def li_full(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Estimate direct light by two samples at every bounce, and so all indirect light."""
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=True)
        if bounce == max_bounces or not len(paths):
            break
        paths = scatter(scene, L, paths, hits, sampler, bounce)
    return L

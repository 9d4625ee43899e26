"""The four estimators of the light that reaches the camera: one ladder, simplest first.

Each takes a wave of paths round the loop intersect → pass through → shade → bounce-sample → compact
and returns the radiance of every path's slot, (3, n). `max_bounces` counts scattering events: with 0
only light seen directly is found, with 1 direct light as well.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from .sampling.sampler import Sampler
from .scene import CompiledScene
from .stages.absorb import absorb
from .stages.bounce import bounce_sample, branch
from .stages.compact import carrying, compact, going_on, keep, roulette
from .stages.intersect import intersect
from .stages.passing import pass_through
from .stages.relief import tilt
from .stages.shade import Arrival, Shading, direct, emitted, mis_weighted, shading
from .stages.surface import interact
from .state import Hits, Paths
from .vec import Floats, columns, f4

Integrator: TypeAlias = Callable[[CompiledScene, Paths, Sampler, int], Floats]


def li_naive(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Follow BSDF samples only; light is found by chance."""
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        hits = intersect(scene, paths)
        paths, hits = pass_through(scene, paths, hits, sampler, bounce)
        light = emitted(scene, paths, hits)
        deposit(L, paths, light)
        paths, hits = compact(scene, paths, hits, going_on(scene, hits, light))
        if bounce == max_bounces or not len(paths):
            break
        shade = arrive(scene, paths, hits)
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = keep(paths, roulette(paths, sampler, bounce))
    return L


def li_direct_simple(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Emission and one light sample at the first surface that is not specular."""
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        hits = intersect(scene, paths)
        paths, hits = pass_through(scene, paths, hits, sampler, bounce)
        light = emitted(scene, paths, hits)
        deposit(L, paths, light)
        paths, hits = compact(scene, paths, hits, going_on(scene, hits, light))
        if bounce == max_bounces or not len(paths):
            break
        shade = arrive(scene, paths, hits)
        deposit(L, paths, direct(scene, paths, shade, sampler, bounce, mis=False))
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = keep(paths, np.flatnonzero(paths.specular & carrying(paths)))
    return L


def li_direct_mis(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
    """Emission at the first surface that is not specular, and direct light by two samples.

    One sample comes from the lights and one from the BSDF, weighted by the power heuristic.
    """
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        hits = intersect(scene, paths)
        paths, hits = pass_through(scene, paths, hits, sampler, bounce)
        light = emitted(scene, paths, hits)
        deposit(L, paths, mis_weighted(scene, paths, light))
        paths, hits = compact(scene, paths, hits, np.flatnonzero((hits.prim >= 0) & paths.specular))
        if bounce == max_bounces or not len(paths):
            break
        shade = arrive(scene, paths, hits)
        deposit(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = bounce_sample(paths, shade, sampler, bounce)
        paths = keep(paths, np.flatnonzero(carrying(paths)))
    return L


def li_full(
    scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int, branches: int = 1
) -> Floats:
    """Direct light by two samples at every bounce, and with it all indirect light.

    From its first surface each path goes on in so many `branches`.
    """
    L = np.zeros((3, len(paths)), f4)
    for bounce in range(max_bounces + 1):
        hits = intersect(scene, paths)
        paths, hits = pass_through(scene, paths, hits, sampler, bounce)
        light = emitted(scene, paths, hits)
        deposit(L, paths, mis_weighted(scene, paths, light))
        paths, hits = compact(scene, paths, hits, going_on(scene, hits, light))
        if bounce == max_bounces or not len(paths):
            break
        shade = arrive(scene, paths, hits)
        deposit(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = branch(paths, shade, sampler, bounce, ways=branches if bounce == 0 else 1)
        paths = keep(paths, roulette(paths, sampler, bounce, branches))
    return L


ONE_SAMPLE = ("naive", "direct_simple")  # that find light in one way, and so weigh no samples
INTEGRATORS: dict[str, Integrator] = {
    "naive": li_naive,
    "direct_simple": li_direct_simple,
    "direct_mis": li_direct_mis,
    "full": li_full,
}


def arrive(scene: CompiledScene, paths: Paths, hits: Hits) -> Shading:
    """Weaken the paths by the matter they came through, and make their surfaces ready to shade."""
    surface = interact(scene, paths, hits)
    tilt(scene, surface)
    absorb(scene, paths.throughput, hits, surface)
    return shading(scene, surface)


def deposit(L: Floats, paths: Paths, light: Arrival) -> None:
    """Add light that arrives on some lanes, carried on by their paths, to the slots of L."""
    if light.lanes.size:
        slot = columns(paths.slot, light.lanes)
        arriving = columns(paths.throughput, light.lanes) * light.radiance
        for row, channel in zip(L, arriving, strict=True):  # a row at a time: much faster
            np.add.at(row, slot, channel)

"""Compaction: which paths continue, and Russian roulette."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays.state import Contribution, Hits, Paths
from ..arrays.vec import Bools, Ints, broadcast, f4, highest, take
from ..compile.scene import CompiledScene
from ..sampling.sampler import Dimension, Sampler
from .interaction import material_rows

ROULETTE_THRESHOLD = f4(0.5)  # paths of at least this throughput always survive
TINY = np.finfo(f4).tiny  # least probability of survival: keeps the division finite where a path ends


def compact(scene: CompiledScene, paths: Paths, hits: Hits, lanes: Ints) -> tuple[Paths, Hits]:
    """Return the given lanes of paths and hits, ordered by material group; all must have hit a surface.

    Each group is then a slice, so that shading needs no gather. In large scenes each group is ordered by
    place, so that rays that start near each other are traced together. Fields of the paths that are needed
    only before the hit (`exclude_prim`, `pdf`, `prev_vertex`) are not kept.
    """
    ordered, n = by_group(scene, hits, scene.places.ordered(paths, hits, lanes)), len(paths)
    if ordered is lanes and lanes.size == n:
        return paths, hits
    arrived = replace(
        paths,
        exclude_prim=broadcast(np.intp(-1), n),
        pdf=broadcast(f4(0), n),
        prev_vertex=None,
        left_receiver=None,
    )
    return arrived.take(ordered), hits.take(ordered)


def by_group(scene: CompiledScene, hits: Hits, lanes: Ints) -> Ints:
    """Return lanes (k,) ordered by the groups of their materials; the same array if they are in order."""
    materials = scene.materials
    if len(materials.groups) == 1:
        return lanes
    group = materials.group_of.take(material_rows(scene, hits, lanes))
    if (group[1:] >= group[:-1]).all():
        return lanes
    short = group.astype(np.min_scalar_type(len(materials.groups)))  # NumPy sorts small integers by radix
    return lanes.take(np.argsort(short, kind="stable"))


def select(paths: Paths, lanes: Ints) -> Paths:
    """Return the given lanes of paths."""
    return paths if lanes.size == len(paths) else paths.take(lanes)


def scattering_lanes(scene: CompiledScene, paths: Paths, hits: Hits, emission: Contribution) -> Ints:
    """Return the lanes (k,) of paths that have met a surface, or are scattered by a medium."""
    return hits.met


def specular_lanes(scene: CompiledScene, paths: Paths, hits: Hits, emission: Contribution) -> Ints:
    """Return those of `scattering_lanes` whose last direction no light sample could have found."""
    lanes = scattering_lanes(scene, paths, hits, emission)
    return lanes.compress(take(paths.specular, lanes))


def alive(paths: Paths) -> Bools:
    """Return a mask (n,) of the paths whose throughput is not 0. NaN counts: it must reach the picture."""
    return highest(paths.throughput) != 0


def roulette(scene: CompiledScene, paths: Paths, sampler: Sampler, bounce: int) -> Ints:
    """Return the lanes of paths that survive, and divide their throughput by the probability of that.

    The probability is the ratio of the path's throughput and `ROULETTE_THRESHOLD`, at most 1. The throughput
    counts by its largest channel, times `roulette_scale`, which undoes the scaling of radiance by refraction
    and the effect of a guide, and relative to 1 / branches, with which the paths of a branched path begin.
    During the first `scene.roulette_after` events only paths without throughput end.

    Sources: E. Veach, thesis 1997, §10.4.1; pbrt-v4, §13.2.1.
    """
    if bounce < scene.roulette_after or not len(paths):
        return np.flatnonzero(alive(paths))
    scale = scene.program.branches / ROULETTE_THRESHOLD
    chance = np.clip(highest(paths.throughput) * paths.roulette_scale * scale, TINY, f4(1))
    u = sampler.draw_1d(paths.pixel, paths.sample, bounce, Dimension.ROULETTE)
    paths.throughput /= chance
    return np.flatnonzero(~(u >= chance))  # NaN survives, so that it reaches the picture

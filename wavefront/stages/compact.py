"""Which paths live on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..compile.scene import CompiledScene
from ..sampling.sampler import Dimension, Sampler
from ..state import Contribution, Hits, Paths
from ..vec import Bools, Ints, broadcast, f4, highest, take
from .interaction import material_rows

ROULETTE_AFTER = 2  # scattering events before paths may be ended
SURE = f4(0.5)  # throughput from which on a path lives on for sure
SMALLEST = np.finfo(f4).tiny  # keeps the division finite on lanes that end anyway


def compact(scene: CompiledScene, paths: Paths, hits: Hits, lanes: Ints) -> tuple[Paths, Hits]:
    """Keep the given lanes of paths and hits, all of which hit something, ordered by groups of materials.

    Each group is then a slice, whose columns need not be gathered to be shaded. What the paths
    needed only on their way to the hits is not kept.
    """
    ordered, n = by_group(scene, hits, lanes), len(paths)
    if ordered is lanes and lanes.size == n:
        return paths, hits
    arrived = replace(
        paths, exclude_prim=broadcast(np.intp(-1), n), pdf=broadcast(f4(0), n), prev_vertex=None
    )
    return arrived.take(ordered), hits.take(ordered)


def by_group(scene: CompiledScene, hits: Hits, lanes: Ints) -> Ints:
    """Order lanes (k,) by the groups of the materials that they hit; the same array if they are."""
    materials = scene.materials
    if len(materials.groups) == 1:
        return lanes
    group = materials.group_of.take(material_rows(scene, hits, lanes))
    if (group[1:] >= group[:-1]).all():
        return lanes
    short = group.astype(np.min_scalar_type(len(materials.groups)))  # sorted by radix
    return lanes.take(np.argsort(short, kind="stable"))


def select(paths: Paths, lanes: Ints) -> Paths:
    """Keep the given lanes of paths that set out."""
    return paths if lanes.size == len(paths) else paths.take(lanes)


def scattering_lanes(scene: CompiledScene, paths: Paths, hits: Hits, emission: Contribution) -> Ints:
    """Return the lanes (k,) of paths that met a surface, unless it is a light that scatters nothing."""
    if scene.nonscattering_lights is None:
        return hits.found
    found = hits.prim >= 0
    found[emission.lanes.compress(scene.nonscattering_lights.take(emission.light))] = False
    return np.flatnonzero(found)


def specular_lanes(scene: CompiledScene, paths: Paths, hits: Hits, emission: Contribution) -> Ints:
    """Return those of `scattering_lanes` whose last direction no light sample could have found."""
    lanes = scattering_lanes(scene, paths, hits, emission)
    return lanes.compress(take(paths.specular, lanes))


def alive(paths: Paths) -> Bools:
    """Tell which paths still carry anything, (n,); NaN is kept, so that it is met and counted."""
    return highest(paths.throughput) != 0


def roulette(paths: Paths, sampler: Sampler, bounce: int, branches: int = 1) -> Ints:
    """Choose the lanes that live on, and make them carry more, so that the mean stays.

    Where the largest channel of the throughput, with the compression of radiance by refraction taken
    out, is below `SURE`, the chance to survive is their ratio, and the path carries `SURE` from then
    on (E. Veach, thesis 1997, §10.4.1; pbrt-v4, §13.2.1). Most of the work is saved on paths that carry
    little, and most of the noise comes from ending those that carry much. In the first events only
    paths that carry nothing end. A path that is one of several `branches` began with as much less.
    """
    if bounce < ROULETTE_AFTER or not len(paths):
        return np.flatnonzero(alive(paths))
    chance = np.clip(highest(paths.throughput) * paths.eta_scale * (branches / SURE), SMALLEST, f4(1))
    u = sampler.draw_1d(paths.pixel, paths.sample, bounce, Dimension.ROULETTE)
    paths.throughput /= chance
    return np.flatnonzero(~(u >= chance))  # NaN lives on, to be counted

"""The way through surfaces that are only partly there.

A path that comes upon one meets it with a probability that is its opacity there, and otherwise goes
straight on from just behind it; that is no scattering event. A shadow ray is weakened by
1 − opacity instead: the same mean with less noise. Every step leaves a surface behind for good, so
both ways come to an end by themselves; nothing else bounds the number of steps.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..compile.scene import CompiledScene
from ..errors import RenderError
from ..sampling.sampler import Dimension, Sampler, numbers_of
from ..state import Hits, Paths, Rays, SurfaceInteraction
from ..vec import Floats, dot, f4
from .interaction import interaction, leave
from .intersect import ShadowRays, intersect, reach, visible
from .medium import absorb

Going = TypeVar("Going", bound=Rays)


def alpha_pass_through(
    scene: CompiledScene, paths: Paths, hits: Hits, sampler: Sampler, bounce: int
) -> tuple[Paths, Hits]:
    """Take paths through what is not there for them, to the first surface that is.

    Their `origin` is then behind the last surface that they passed, their `prev_vertex` where they
    scattered last. Each partial surface along a ray has a random number of its own.
    """
    if scene.opacities is None:
        return paths, hits
    partly = scene.opacities.partly
    lanes = np.flatnonzero(partly.take(hits.prim))  # a miss, -1, takes the last entry
    if not lanes.size:
        return paths, hits
    paths = replace(
        paths, origin=paths.origin.copy(), exclude_prim=paths.exclude_prim.copy(), prev_vertex=paths.origin
    )
    numbers = iter(numbers_of(Dimension.OPACITY))
    while lanes.size:
        dimension = next(numbers, None)
        if dimension is None:
            most = len(numbers_of(Dimension.OPACITY))
            raise RenderError(f"a ray meets more than {most} surfaces with an opacity below 1")
        here, at = paths.take(lanes), hits.take(lanes)
        surface = interaction(scene, here, at)
        u = sampler.draw_1d(here.pixel, here.sample, bounce, dimension)
        passing = np.flatnonzero(u >= scene.opacities.at(surface))
        lanes, here, surface = lanes.take(passing), here.take(passing), surface.take(passing)
        absorb(scene, here.throughput, at.take(passing), surface)
        here = _behind(here, surface)
        paths.origin[:, lanes], paths.exclude_prim[lanes] = here.origin, here.exclude_prim
        paths.throughput[:, lanes] = here.throughput
        hits.put(lanes, intersect(scene, here))
        lanes = lanes.compress(partly.take(hits.prim.take(lanes)))
    return paths, hits


def transmittance_along(scene: CompiledScene, rays: ShadowRays) -> Floats:
    """Return the part of the light that gets along shadow rays, (3, k).

    Only rays that something stands in the way of are followed, from surface to surface.
    """
    assert scene.opacities is not None
    part = np.ones_like(rays.direction)
    lanes = np.flatnonzero(~visible(scene, rays))
    rays = rays.take(lanes)
    while lanes.size:
        hits = intersect(scene, rays)
        between = hits.t < reach(rays)
        partly = scene.opacities.partly.take(hits.prim)
        part[:, lanes.compress(between & ~partly)] = 0
        met = np.flatnonzero(between & partly)
        lanes, rays, hits = lanes.take(met), rays.take(met), hits.take(met)
        surface = interaction(scene, rays, hits)
        left = part.take(lanes, 1) * (f4(1) - scene.opacities.at(surface))
        absorb(scene, left, hits, surface)
        part[:, lanes] = left
        rays = replace(
            _behind(rays, surface), error=rays.error + surface.error, distance=rays.distance - hits.t
        )
        on = np.flatnonzero(left.max(0) != 0)
        lanes, rays = lanes.take(on), rays.take(on)
    return part


def _behind(rays: Going, surface: SurfaceInteraction) -> Going:
    """Return rays as they go on from just behind the surfaces that they pass."""
    origin = leave(surface, dot(surface.ng, rays.direction))
    return replace(rays, origin=origin, exclude_prim=surface.prim)

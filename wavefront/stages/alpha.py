"""Alpha: paths and shadow rays at surfaces whose opacity is below 1.

A path hits such a surface with a probability equal to its opacity there (stochastic alpha); otherwise it
continues straight on from just behind the surface, which is not a scattering event. A shadow ray is
multiplied by 1 − opacity instead, which has the same mean and less noise. Every step leaves one more
surface behind, so both loops end.
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
from .interaction import interaction, offset_origin
from .intersect import ShadowRays, intersect, shadow_ray_length, visible
from .medium import absorb

COVERING = f4(0.5)  # opacity from which on a surface hides what is behind it, where nothing is random

AnyRays = TypeVar("AnyRays", bound=Rays)


def alpha_pass_through(
    scene: CompiledScene, paths: Paths, hits: Hits, sampler: Sampler, bounce: int
) -> tuple[Paths, Hits]:
    """Move paths on through the surfaces that they pass, to the first surface that they hit.

    Afterwards `origin` is behind the last surface that a path has passed, and `prev_vertex` is where it
    scattered last. Each of the surfaces along a ray has a random number of its own.

    Raises
    ------
    RenderError
        If a ray meets more surfaces than there are random numbers for.
    """
    if scene.opacities is None:
        return paths, hits
    has_alpha = scene.opacities.has_alpha
    lanes = np.flatnonzero(has_alpha.take(hits.prim))  # a miss, -1, takes the last entry
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
        here = continue_behind(here, surface)
        paths.origin[:, lanes], paths.exclude_prim[lanes] = here.origin, here.exclude_prim
        paths.throughput[:, lanes] = here.throughput
        hits.put(lanes, intersect(scene, here))
        lanes = lanes.compress(has_alpha.take(hits.prim.take(lanes)))
    return paths, hits


def covering_hits(scene: CompiledScene, rays: Rays) -> tuple[Rays, Hits]:
    """Return the nearest hits of rays on surfaces whose opacity is at least `COVERING`.

    Nothing is random here. The rays that are returned start behind the last surface that they have passed.
    """
    hits = intersect(scene, rays)
    if scene.opacities is None:
        return rays, hits
    has_alpha = scene.opacities.has_alpha
    lanes = np.flatnonzero(has_alpha.take(hits.prim))
    rays = replace(rays, origin=rays.origin.copy(), exclude_prim=rays.exclude_prim.copy())
    while lanes.size:
        here, at = rays.take(lanes), hits.take(lanes)
        surface = interaction(scene, here, at)
        passing = np.flatnonzero(scene.opacities.at(surface) < COVERING)
        lanes, here = lanes.take(passing), continue_behind(here.take(passing), surface.take(passing))
        rays.put(lanes, here)
        hits.put(lanes, intersect(scene, here))
        lanes = lanes.compress(has_alpha.take(hits.prim.take(lanes)))
    return rays, hits


def transmittance_along(scene: CompiledScene, rays: ShadowRays) -> Floats:
    """Return the transmittance of shadow rays, (3, k).

    Only rays that hit anything are traced on from surface to surface.
    """
    assert scene.opacities is not None
    part = np.ones_like(rays.direction)
    lanes = np.flatnonzero(~visible(scene, rays))
    rays = rays.take(lanes)
    while lanes.size:
        hits = intersect(scene, rays)
        between = hits.t < shadow_ray_length(rays)
        has_alpha = scene.opacities.has_alpha.take(hits.prim)
        part[:, lanes.compress(between & ~has_alpha)] = 0
        met = np.flatnonzero(between & has_alpha)
        lanes, rays, hits = lanes.take(met), rays.take(met), hits.take(met)
        surface = interaction(scene, rays, hits)
        left = part.take(lanes, 1) * (f4(1) - scene.opacities.at(surface))
        absorb(scene, left, hits, surface)
        part[:, lanes] = left
        rays = replace(
            continue_behind(rays, surface), error=rays.error + surface.error, distance=rays.distance - hits.t
        )
        on = np.flatnonzero(left.max(0) != 0)
        lanes, rays = lanes.take(on), rays.take(on)
    return part


def continue_behind(rays: AnyRays, surface: SurfaceInteraction) -> AnyRays:
    """Return rays that continue from just behind the surfaces."""
    origin = offset_origin(surface, dot(surface.ng, rays.direction))
    return replace(rays, origin=origin, exclude_prim=surface.prim)

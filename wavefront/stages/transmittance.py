"""The transmittance of shadow rays through surfaces with alpha, and rays that go on behind surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..arrays.state import Rays, SurfaceInteraction
from ..arrays.vec import Floats, dot, f4
from ..compile.scene import CompiledScene
from .interaction import interaction, offset_origin
from .intersect import ShadowRays, intersect, shadow_ray_length, visible
from .medium import absorb

AnyRays = TypeVar("AnyRays", bound=Rays)


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

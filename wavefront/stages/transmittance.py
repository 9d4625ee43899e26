"""The transmittance of shadow rays through surfaces with alpha, and rays that go on behind surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..arrays.state import Hits, Rays, SurfaceInteraction
from ..arrays.vec import ALL, Bools, Floats, Lanes, dot, f4, take
from ..compile.scene import CompiledScene
from .interaction import interaction, material_rows, offset_origin
from .intersect import ShadowRays, intersect, shadow_ray_length, visible
from .medium import absorb, arrives, cross, hidden, transmitted

AnyRays = TypeVar("AnyRays", bound=Rays)


def transmittance_along(scene: CompiledScene, rays: ShadowRays, absent: Bools | None = None) -> Floats:
    """Return the transmittance of shadow rays, (3, k).

    Only rays that hit anything are traced on from surface to surface. `absent` says which materials
    (materials,) are not there for them.
    """
    part = np.ones_like(rays.direction)
    seen = visible(scene, rays)
    if rays.media is not None:
        lanes = np.flatnonzero(seen)
        free = rays.take(lanes)
        part[:, lanes] = transmitted(scene, free, free.media, free.distance, free.steps)
        there = arrives(scene, free.media, free.goal)
        if there is not None:
            part[:, lanes.compress(~there)] = 0
    lanes = np.flatnonzero(~seen)
    if absent is None and not may_pass(scene):
        part[:, lanes] = 0
        return part
    rays = rays.take(lanes)
    while lanes.size:
        hits = intersect(scene, rays)
        between = hits.t < shadow_ray_length(rays)
        passes = passable(scene, hits, ALL, rays.media, absent)
        part[:, lanes.compress(between & ~passes)] = 0
        if rays.media is not None:
            length = np.where(between, hits.t, rays.distance)
            part[:, lanes] *= transmitted(scene, rays, rays.media, length, rays.steps)
            there = arrives(scene, rays.media, rays.goal)
            if there is not None:
                part[:, lanes.compress(~between & ~there)] = 0
        met = np.flatnonzero(between & passes)
        lanes, rays, hits = lanes.take(met), rays.take(met), hits.take(met)
        surface = interaction(scene, rays, hits)
        left = part.take(lanes, 1) * (f4(1) - opacities_at(scene, surface, rays.media, absent))
        absorb(scene, left, hits, surface)
        part[:, lanes] = left
        rays = replace(
            continue_behind(rays, surface),
            error=rays.error + surface.error,
            distance=rays.distance - hits.t,
            media=cross(scene, rays.media, surface),
            steps=None if rays.steps is None else rays.steps.again(),
        )
        on = np.flatnonzero(left.max(0) != 0)
        lanes, rays = lanes.take(on), rays.take(on)
    return part


def may_pass(scene: CompiledScene) -> bool:
    """Return whether rays may pass any surface: by its alpha, or because a higher priority hides it."""
    return scene.opacities is not None or (scene.media is not None and bool(scene.media.nested.any()))


def passable(
    scene: CompiledScene, hits: Hits, lanes: Lanes, stack: Any, absent: Bools | None = None
) -> Bools:
    """Return whether some lanes (k,) hit surfaces that rays with stacks (4, k) may pass straight on.

    `absent` says which materials (materials,) are not there for them.
    """
    prim = take(hits.prim, lanes)
    found: Bools = np.zeros(prim.size, np.bool_)
    if scene.opacities is not None:
        found = scene.opacities.has_alpha.take(prim)  # a miss, -1, takes the last entry
    if stack is not None:
        found |= hidden(scene, stack, material_rows(scene, hits, lanes)) & (prim >= 0)
    if absent is not None:
        found |= absent.take(material_rows(scene, hits, lanes)) & (prim >= 0)
    return found


def opacities_at(
    scene: CompiledScene, surface: SurfaceInteraction, stack: Any, absent: Bools | None = None
) -> Floats:
    """Return the opacities (n,) of surfaces to rays with stacks (4, n); those of `absent` materials are 0."""
    opacity: Floats = np.ones(len(surface), f4) if scene.opacities is None else scene.opacities.at(surface)
    if stack is not None:
        opacity[hidden(scene, stack, surface.material)] = 0
    if absent is not None:
        opacity[absent.take(surface.material)] = 0
    return opacity


def continue_behind(rays: AnyRays, surface: SurfaceInteraction) -> AnyRays:
    """Return rays that continue from just behind the surfaces."""
    origin = offset_origin(surface, dot(surface.ng, rays.direction))
    return replace(rays, origin=origin, exclude_prim=surface.prim)

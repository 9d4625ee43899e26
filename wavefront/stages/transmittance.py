"""The transmittance of shadow rays through surfaces and media, and rays that go on behind surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias, TypeVar

import numpy as np

from ..accel.plate import surely_occluded
from ..arrays.state import Hits, Rays, SurfaceInteraction
from ..arrays.vec import ALL, Bools, Floats, Lanes, dot, f4, take
from ..compile.program import Feature, Passage
from ..compile.scene import CompiledScene
from .interaction import interaction, offset_origin, shadow_query
from .intersect import ShadowRays, intersect, shadow_ray_length, visible

AnyRays = TypeVar("AnyRays", bound=Rays)
Veils: TypeAlias = Sequence[Feature]  # those whose surfaces some rays may pass


def transmittance_along(scene: CompiledScene, rays: ShadowRays, veils: Veils | None = None) -> Floats:
    """Return the transmittance of shadow rays, (3, k).

    Only rays that hit anything are traced on from surface to surface. `veils` are the features whose surfaces
    they may pass; by default, those of shadow rays.
    """
    veils = scene.program.see_through if veils is None else veils
    transmittance = np.ones_like(rays.direction)
    blocked, perhaps = _blockers(scene, rays, veils)
    transmittance[:, np.flatnonzero(blocked)] = 0
    seen = ~(blocked | perhaps)
    for dim in scene.program.dim:
        free = np.flatnonzero(seen)
        free_rays, left = rays.take(free), take(transmittance, free)
        dim(left, scene, free_rays, free_rays.distance, np.ones(free.size, np.bool_))
        transmittance[:, free] = left
    lanes = np.flatnonzero(perhaps)
    if not veils:
        transmittance[:, lanes] = 0
        return transmittance
    rays = rays.take(lanes)
    while lanes.size:
        hits = intersect(scene, rays)
        between = hits.t < shadow_ray_length(rays)
        passes = passable(scene, rays, hits, ALL, veils)
        left = take(transmittance, lanes)
        left[:, between & ~passes] = 0
        for dim in scene.program.dim:
            dim(left, scene, rays, np.where(between, hits.t, rays.distance), ~between)
        transmittance[:, lanes] = left
        met = np.flatnonzero(between & passes)
        lanes, left, rays, hits = lanes.take(met), take(left, met), rays.take(met), hits.take(met)
        passage = Passage(scene, rays, interaction(scene, rays, hits), None, 0)
        left *= f4(1) - opacities_at(passage, veils)
        for weaken in scene.program.weaken:
            weaken(left, hits, passage.surface)
        transmittance[:, lanes] = left
        rays = passage.rays = replace(
            continue_behind(rays, passage.surface),
            error=rays.error + passage.surface.error,
            distance=rays.distance - hits.t,
            steps=None if rays.steps is None else rays.steps.again(),
        )
        for cross in scene.program.cross:
            cross(passage)
        on = np.flatnonzero(left.max(0) != 0)
        lanes, rays = lanes.take(on), rays.take(on)
    return transmittance


def _blockers(scene: CompiledScene, rays: ShadowRays, veils: Veils) -> tuple[Bools, Bools]:
    """Return which rays (n,) are blocked whatever the veils, and which others hit anything."""
    if not all(veil.spares_opaque for veil in veils):
        return np.zeros(len(rays), np.bool_), ~visible(scene, rays)
    return surely_occluded(scene.accelerator, *shadow_query(scene, rays, shadow_ray_length(rays)))


def passable(scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes, veils: Veils) -> Bools:
    """Return whether some lanes (k,) hit surfaces that rays may pass straight on."""
    passes = np.zeros(take(hits.prim, lanes).size, np.bool_)
    for veil in veils:
        passes |= veil.passable(scene, rays, hits, lanes)
    return passes


def opacities_at(passage: Passage, veils: Veils) -> Floats:
    """Return the opacities (n,) of surfaces to the rays that have hit them."""
    opacity = np.ones(len(passage.surface), f4)
    for veil in veils:
        veil.thin(opacity, passage)
    return opacity


def continue_behind(rays: AnyRays, surface: SurfaceInteraction) -> AnyRays:
    """Return rays that continue from just behind the surfaces."""
    origin = offset_origin(surface, dot(surface.ng, rays.direction))
    return replace(rays, origin=origin, exclude_prim=surface.prim)

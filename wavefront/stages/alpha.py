"""Alpha: paths and shadow rays at surfaces whose opacity is below 1, and camera rays at unseen surfaces.

A path hits such a surface with a probability equal to its opacity there (stochastic alpha); otherwise it
continues straight on from just behind the surface, which is not a scattering event. A shadow ray is
multiplied by 1 − opacity instead, which has the same mean and less noise. Every step leaves one more
surface behind, so both loops end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays.state import Hits, Paths, Rays, SurfaceInteraction
from ..arrays.vec import ALL, Bools, Floats, Ints, f4, take
from ..compile.scene import CompiledScene
from ..core.errors import RenderError
from ..sampling.sampler import Dimension, Sampler, numbers_of
from .inside import stacks_at
from .interaction import interaction
from .intersect import intersect
from .medium import absorb, cross, fly
from .shadow_catcher import catcher_lanes, shadow_opacity
from .transmittance import continue_behind, opacities_at, passable

COVERING = f4(0.5)  # opacity from which on a surface hides what is behind it, where nothing is random


def alpha_pass_through(
    scene: CompiledScene, paths: Paths, hits: Hits, sampler: Sampler, bounce: int, mis: bool = False
) -> tuple[Paths, Hits]:
    """Move paths on through the surfaces that they pass, to the first surface that they hit.

    Media on the way may scatter them before. With `mis` what these emit is weighted against light samples.

    Afterwards `origin` is behind the last surface that a path has passed, and `prev_vertex` is where it
    scattered last. Each of the surfaces along a ray has a random number of its own.

    Raises
    ------
    RenderError
        If a ray meets more surfaces than there are random numbers for.
    """
    catches = bounce == 0 and scene.shadow_catchers is not None
    absent = scene.unseen if bounce == 0 else None
    lanes = np.arange(len(paths))
    if scene.media is None:
        lanes = _passable(scene, paths, hits, lanes, catches, absent)
        if not lanes.size:
            return paths, hits
    paths = _own_columns(scene, paths)
    for dimension in numbers_of(Dimension.OPACITY):
        lanes = fly(scene, paths, hits, lanes, sampler, bounce, dimension - Dimension.OPACITY, mis)
        lanes = _passable(scene, paths, hits, lanes, catches, absent)
        if not lanes.size:
            return paths, hits
        here, at = paths.take(lanes), hits.take(lanes)
        surface = interaction(scene, here, at)
        opacity = _opacities(scene, here, at, surface, sampler, catches, absent)
        traced = paths.light_traced if catches else None
        if opacity.any() or traced is not None:
            u = sampler.draw_1d(here.pixel, here.sample, bounce, dimension)
            passing = np.flatnonzero(u >= opacity)
            if traced is not None:  # paths from lights do not know how well lit a catcher is: it stops them
                lit = u < opacities_at(scene, surface, here.media, absent)
                traced[lanes.take(passing.compress(lit.take(passing)))] = False
            lanes, here, at = lanes.take(passing), here.take(passing), at.take(passing)
            surface = surface.take(passing)
        absorb(scene, here.throughput, at, surface)
        here = continue_behind(here, surface)
        paths.origin[:, lanes], paths.exclude_prim[lanes] = here.origin, here.exclude_prim
        paths.throughput[:, lanes] = here.throughput
        hits.put(lanes, intersect(scene, here))
        if paths.media is not None:
            paths.media[:, lanes] = cross(scene, here.media, surface)
    most = len(numbers_of(Dimension.OPACITY))
    raise RenderError(f"a ray meets more than {most} surfaces with an opacity below 1")


def _own_columns(scene: CompiledScene, paths: Paths) -> Paths:
    """Return paths with copies of what changes on their way to the next surface."""
    traced = paths.light_traced
    own = replace(
        paths,
        origin=paths.origin.copy(),
        exclude_prim=paths.exclude_prim.copy(),
        prev_vertex=paths.origin,
        light_traced=None if traced is None else np.array(traced),
    )
    if scene.media is None:
        return own
    glow = np.zeros_like(paths.origin) if scene.media.glows else None
    return replace(own, media=np.array(paths.media), throughput=np.array(paths.throughput), glow=glow)


def _passable(
    scene: CompiledScene, paths: Paths, hits: Hits, lanes: Ints, catches: bool, absent: Bools | None
) -> Ints:
    """Return those of some lanes (k,) that hit a surface that they may pass; with `catches`, catchers too."""
    if scene.opacities is None and scene.media is None and absent is None and not catches:
        return lanes[:0]
    stack = None if paths.media is None else take(paths.media, lanes)
    found = passable(scene, hits, lanes, stack, absent)
    if catches:
        found[np.searchsorted(lanes, catcher_lanes(scene, hits, lanes))] = True
    return lanes.compress(found)


def _opacities(
    scene: CompiledScene,
    paths: Paths,
    hits: Hits,
    surface: SurfaceInteraction,
    sampler: Sampler,
    catches: bool,
    absent: Bools | None,
) -> Floats:
    """Return the opacities (n,) of surfaces, with `catches` those of shadows on catchers."""
    everything = np.arange(len(surface))
    opacity = opacities_at(scene, surface, paths.media, absent)
    lanes = catcher_lanes(scene, hits, everything) if catches else everything[:0]
    if lanes.size:
        opacity[lanes] *= shadow_opacity(scene, paths.take(lanes), surface.take(lanes), sampler)
    return opacity


def covering_hits(scene: CompiledScene, rays: Rays) -> tuple[Rays, Hits]:
    """Return the nearest hits of camera rays on surfaces whose opacity is at least `COVERING`.

    Nothing is random here. The rays that are returned start behind the last surface that they have passed.
    Surfaces within something of a higher priority are not there.
    """
    hits, stack = intersect(scene, rays), _nested_stacks(scene, rays)
    lanes = np.flatnonzero(passable(scene, hits, ALL, stack, scene.unseen))
    if not lanes.size:
        return rays, hits
    rays = replace(rays, origin=rays.origin.copy(), exclude_prim=rays.exclude_prim.copy())
    while lanes.size:
        here, at = rays.take(lanes), hits.take(lanes)
        surface, around = interaction(scene, here, at), None if stack is None else take(stack, lanes)
        passing = np.flatnonzero(opacities_at(scene, surface, around, scene.unseen) < COVERING)
        lanes, surface = lanes.take(passing), surface.take(passing)
        here = continue_behind(here.take(passing), surface)
        rays.put(lanes, here)
        hits.put(lanes, intersect(scene, here))
        if stack is not None:
            stack[:, lanes] = cross(scene, take(stack, lanes), surface)
        lanes = lanes.compress(
            passable(scene, hits, lanes, None if stack is None else take(stack, lanes), scene.unseen)
        )
    return rays, hits


def _nested_stacks(scene: CompiledScene, rays: Rays) -> Any:
    """Return what rays begin inside of, (4, n), where that hides surfaces; None where none is hidden."""
    nested = scene.media is not None and scene.media.nested.any()
    return stacks_at(scene, rays.origin) if nested else None

"""Rays that go on behind surfaces, such as those with alpha and those that the camera does not see.

A path hits such a surface with a probability equal to its opacity there (stochastic alpha); otherwise it
continues straight on from just behind the surface, which is not a scattering event. A shadow ray is
multiplied by 1 − opacity instead, which has the same mean and less noise. Every step leaves one more
surface behind, so both loops end. Which surfaces these are, features tell (`Feature.passable`, `thin`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays.state import Hits, Paths, Rays
from ..arrays.vec import ALL, Ints, f4
from ..compile.program import Leg, Passage
from ..compile.scene import CompiledScene
from ..core.errors import RenderError
from ..sampling.sampler import Dimension, numbers_of
from .inside import stacks_at
from .interaction import interaction
from .intersect import intersect
from .transmittance import Veils, continue_behind, opacities_at, passable

COVERING = f4(0.5)  # opacity from which on a surface hides those behind it, where nothing is random


def pass_through(leg: Leg) -> None:
    """Move paths on through the surfaces that they pass, to the first surface that they hit.

    Media on the way may scatter them before. Afterwards `origin` is behind the last surface that a path has
    passed, and `prev_vertex` is where it scattered last. Each of the surfaces along a ray has a random number
    of its own.

    Raises
    ------
    RenderError
        If a ray meets more surfaces than there are random numbers for.
    """
    scene, lanes = leg.scene, np.arange(len(leg.paths))
    veils, walks = scene.program.leg(leg.bounce).see_through, scene.program.walk
    if not walks:
        lanes = lanes.compress(passable(scene, leg.paths, leg.hits, lanes, veils))
        if not lanes.size:
            return
    leg.paths = _own_columns(leg.paths)
    most = len(numbers_of(Dimension.OPACITY))
    for segment in range(most):
        for walk in walks:
            lanes = walk(leg, lanes, segment)
        lanes = lanes.compress(passable(scene, leg.paths, leg.hits, lanes, veils))
        if not lanes.size:
            return
        lanes = _go_on_behind(leg, lanes, veils, segment)
    raise RenderError(f"a ray meets more than {most} surfaces with an opacity below 1")


def _go_on_behind(leg: Leg, lanes: Ints, veils: Veils, segment: int) -> Ints:
    """Decide which of some lanes (k,) pass their surfaces, move these on, and return them."""
    scene, paths = leg.scene, leg.paths
    here, at = paths.take(lanes), leg.hits.take(lanes)
    passage = Passage(scene, here, interaction(scene, here, at), leg.sampler, segment)
    opacity = opacities_at(passage, veils)
    if opacity.any():
        u = leg.sampler.draw_1d(here.pixel, here.sample, leg.bounce, Dimension.OPACITY + segment)
        passing = np.flatnonzero(u >= opacity)
        lanes, at, passage = lanes.take(passing), at.take(passing), passage.take(passing)
    for weaken in scene.program.weaken:
        weaken(passage.rays.throughput, at, passage.surface)
    here = passage.rays = continue_behind(passage.rays, passage.surface)
    leg.hits.put(lanes, intersect(scene, here))
    for cross in scene.program.cross:
        cross(passage)
    paths.origin[:, lanes], paths.exclude_prim[lanes] = here.origin, here.exclude_prim
    paths.throughput[:, lanes] = here.throughput
    if paths.media is not None:
        paths.media[:, lanes] = here.media
    if paths.light_traced is not None:
        paths.light_traced[lanes] = here.light_traced
    return lanes


def _own_columns(paths: Paths) -> Paths:
    """Return paths with copies of the columns that change on their way to the next surface."""
    return replace(
        paths,
        origin=paths.origin.copy(),
        exclude_prim=paths.exclude_prim.copy(),
        prev_vertex=paths.origin,
        throughput=paths.throughput.copy(),
        light_traced=_copied(paths.light_traced),
        media=_copied(paths.media),
    )


def _copied(column: Any) -> Any:
    return None if column is None else np.array(column)


def covering_hits(scene: CompiledScene, rays: Rays) -> tuple[Rays, Hits]:
    """Return the nearest hits of camera rays on surfaces whose opacity is at least `COVERING`.

    Nothing is random here. The rays that are returned start behind the last surface that they have passed.
    """
    hits, veils = intersect(scene, rays), scene.program.seen_through
    if not veils:
        return rays, hits
    rays = replace(rays, origin=rays.origin.copy(), exclude_prim=rays.exclude_prim.copy())
    rays.media = stacks_at(scene, rays.origin, rays.time)
    lanes = np.flatnonzero(passable(scene, rays, hits, ALL, veils))
    while lanes.size:
        here = rays.take(lanes)
        passage = Passage(scene, here, interaction(scene, here, hits.take(lanes)), None, 0)
        passing = np.flatnonzero(opacities_at(passage, veils) < COVERING)
        lanes, passage = lanes.take(passing), passage.take(passing)
        passage.rays = continue_behind(passage.rays, passage.surface)
        for cross in scene.program.cross:
            cross(passage)
        rays.put(lanes, passage.rays)
        hits.put(lanes, intersect(scene, passage.rays))
        lanes = lanes.compress(passable(scene, rays, hits, lanes, veils))
    return rays, hits

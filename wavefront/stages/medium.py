"""Rays through media: absorption, where light is scattered, and what paths are inside of."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.elementary import exp
from ..arrays.state import Hits, Paths, Rays, SurfaceInteraction
from ..arrays.vec import TINY, Bools, Floats, Ints, dot, f4, take
from ..compile.media import crossed
from ..compile.scene import CompiledScene
from ..media.base import GlowWeights, MediumRays
from ..sampling.sampler import Dimension, Sampler
from ..sampling.steps import StepNumbers


def absorb(scene: CompiledScene, throughput: Floats, hits: Hits, surface: SurfaceInteraction) -> None:
    """Attenuate, in place, the throughput of rays that crossed the medium behind the surface that they hit.

    A ray that meets a surface from its back side has crossed its medium: over a length t the
    throughput (3, n) falls by exp(−absorption·t) (Beer and Lambert).
    """
    if scene.absorption is None:
        return
    lanes = np.flatnonzero(surface.back_facing)
    depth = scene.absorption.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
    throughput[:, lanes] *= exp(-depth)


def fly(
    scene: CompiledScene,
    paths: Paths,
    hits: Hits,
    lanes: Ints,
    sampler: Sampler,
    bounce: int,
    segment: int,
    mis: bool,
) -> Ints:
    """Let some lanes (k,) fly through their media, in place; return those that reach their surfaces.

    With `mis` the light that media emit is weighted against light samples.

    Those that are scattered before have `MediaTable.event_of` in place of a primitive, at that distance.
    """
    media = scene.media
    if media is None or paths.media is None:
        return lanes
    medium = media.medium_in(take(paths.media, lanes))
    inside = np.flatnonzero(medium >= 0)
    if not inside.size:
        return lanes
    reached = np.ones(lanes.size, np.bool_)
    medium, some = medium.take(inside), lanes.take(inside)
    address = take(paths.pixel, some), take(paths.sample, some), bounce, Dimension.MEDIUM + segment
    u = sampler.draw_2d(*address)
    steps = StepNumbers.of(sampler.seed, *address) if media.takes_steps else None
    for record, rows, column in media.by_record(medium):
        at = some.take(rows)
        throughput, length = take(paths.throughput, at), take(hits.t, at)
        rays = _within(column, paths, at, length, None if steps is None else steps.take(rows))
        weights = _glow_weights(scene, paths, at, medium.take(rows)) if mis else None
        flight = record.sample(rays, throughput, take(u, rows), weights)
        if flight.light is not None and paths.glow is not None:
            paths.glow[:, at] += throughput * flight.light
        paths.throughput[:, at] = throughput * flight.weight
        met = np.flatnonzero(flight.t < length)
        hits.t[at.take(met)] = flight.t.take(met)
        hits.prim[at.take(met)] = media.event_of.take(medium.take(rows.take(met)))
        if hits.instance is not None:
            hits.instance[at.take(met)] = 0  # it is no part of the instance behind it
        reached[inside.take(rows.take(met))] = False
    return lanes.compress(reached)


def _glow_weights(scene: CompiledScene, paths: Paths, lanes: Ints, medium: Ints) -> GlowWeights | None:
    """Return the weights of what media (k,) emit along some lanes (k,); None where all count in full."""
    assert scene.media is not None
    light = scene.media.light_of.take(medium)
    sampled = np.flatnonzero((light >= 0) & ~take(paths.specular, lanes))
    if not sampled.size:
        return None
    at = lanes.take(sampled)
    origin, start = (
        take(paths.origin, lanes),
        paths.origin if paths.prev_vertex is None else paths.prev_vertex,
    )
    receiver = None if paths.left_receiver is None else paths.left_receiver.take(at)
    chance = scene.lights.pmf(light.take(sampled), take(start, at), receiver)
    ratio = np.zeros(lanes.size, f4)
    ratio[sampled] = chance / np.maximum(take(paths.pdf, at), TINY)
    return GlowWeights(ratio, dot(origin - take(start, lanes), take(paths.direction, lanes)))


def arrives(scene: CompiledScene, stack: Any, goal: Any) -> Bools | None:
    """Return whether rays that end with stacks (4, n) are within the media (n,) where they should end.

    A goal is -1 for rays that end anywhere. None is returned where there is no goal.
    """
    if scene.media is None or goal is None:
        return None
    return (goal < 0) | (scene.media.medium_in(stack) == goal)


def transmitted(
    scene: CompiledScene, rays: Rays, stack: Any, length: Floats, steps: StepNumbers | None
) -> Floats:
    """Return what part of the light media let through over some lengths (n,) of rays, (3, n)."""
    media = scene.media
    assert media is not None
    medium, part = media.medium_in(stack), np.ones_like(rays.direction)
    inside = np.flatnonzero(medium >= 0)
    for record, rows, column in media.by_record(medium.take(inside)):
        at = inside.take(rows)
        some = None if steps is None else steps.take(at)
        part[:, at] = record.transmittance(_within(column, rays, at, length.take(at), some))
    return part


def _within(column: Ints, rays: Any, lanes: Ints, length: Floats, steps: StepNumbers | None) -> MediumRays:
    """Return some lanes (k,) of rays or paths, with the columns of their media and the lengths (k,) there."""
    return MediumRays(column, take(rays.origin, lanes), take(rays.direction, lanes), length, steps)


def hidden(scene: CompiledScene, stack: Any, material: Ints) -> Bools:
    """Return whether surfaces of materials (n,) are within something of a higher priority."""
    if scene.media is None or stack is None or not scene.media.nested.any():
        return np.zeros(material.size, np.bool_)
    return scene.media.hidden(stack, material)


def cross(scene: CompiledScene, stack: Any, surface: SurfaceInteraction) -> Any:
    """Return stacks (4, n) behind surfaces; None where the scene needs none."""
    if scene.media is None or stack is None:
        return stack
    return crossed(stack, scene.media.crossing(surface.material, surface.back_facing))

"""Rays through media: where light is scattered, and the media around paths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.state import Paths, Rays, SurfaceInteraction
from ..arrays.vec import TINY, Bools, Floats, Ints, dot, f4, take
from ..compile.media import ENTRY, MediaTable, crossed
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..compile.touching import TouchingFaces
from ..media.base import GlowWeights, MediumRays
from ..sampling.sampler import Dimension, Sampler
from ..sampling.steps import StepNumbers
from .interaction import interaction
from .intersect import ShadowRays, intersect

LEAST_COS = f4(1 / 64)  # between a ray and a normal, for how far it is moved back


def fly(leg: Leg, lanes: Ints, segment: int) -> Ints:
    """Let some lanes (k,) fly through their media, in place; return those that reach their surfaces.

    Those that are scattered before have `MediaTable.event_of` in place of a primitive, at that distance. What
    media emit is weighted against light samples where these are taken.
    """
    scene, paths, hits, sampler = leg.scene, leg.paths, leg.hits, leg.sampler
    media = scene.media
    assert media is not None
    if media.glows and not segment:
        paths.glow = np.zeros_like(paths.origin)
    medium = media.medium_in(take(paths.media, lanes))
    inside = np.flatnonzero(medium >= 0)
    if not inside.size:
        return lanes
    reached = np.ones(lanes.size, np.bool_)
    medium, inner = medium.take(inside), lanes.take(inside)
    if media.only_absorbs:
        length = take(hits.t, inner)
        paths.throughput[:, inner] *= _through(media, paths, inner, medium, length, None)
        return lanes
    address = take(paths.pixel, inner), take(paths.sample, inner), leg.bounce, Dimension.MEDIUM + segment
    u = sampler.draw_2d(*address)
    steps = StepNumbers.of(sampler.seed, *address) if media.takes_steps else None
    for record, rows, column in media.by_record(medium):
        at = inner.take(rows)
        throughput, length = take(paths.throughput, at), take(hits.t, at)
        rays = _within(column, paths, at, length, None if steps is None else steps.take(rows))
        weights = _glow_weights(scene, paths, at, medium.take(rows)) if leg.mis else None
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
    """Return the weights of emission by media (k,) along some lanes (k,); None where all count in full."""
    assert scene.media is not None
    light = scene.media.light_of.take(medium)
    sampled = np.flatnonzero((light >= 0) & ~take(paths.specular, lanes))
    if not sampled.size:
        return None
    at = lanes.take(sampled)
    origin, start = take(paths.origin, lanes), paths.last_vertex
    receiver = None if paths.left_receiver is None else paths.left_receiver.take(at)
    chance = scene.lights.pmf(light.take(sampled), take(start, at), receiver)
    ratio = np.zeros(lanes.size, f4)
    ratio[sampled] = chance / np.maximum(take(paths.pdf, at), TINY)
    return GlowWeights(ratio, dot(origin - take(start, lanes), take(paths.direction, lanes)))


def begin_in_media(
    scene: CompiledScene,
    rays: ShadowRays,
    paths: Paths,
    stack: Any,
    lanes: Ints,
    light: Ints,
    sampler: Sampler,
    bounce: int,
) -> None:
    """Give shadow rays (k) of some lanes of paths the columns that they need in media.

    Parameters
    ----------
    stack
        (4, n) stacks of the media around rays of all lanes.
    light
        (k,) numbers of the lights that they lead to.
    """
    media = scene.media
    assert media is not None
    rays.media = take(stack, lanes)
    if (media.light_of >= 0).any():
        rays.goal = media.holding(light, len(scene.lights))
    if media.takes_steps:
        address = take(paths.pixel, lanes), take(paths.sample, lanes), bounce
        rays.steps = StepNumbers.of(sampler.seed, *address, Dimension.TRANSMITTANCE)


def dim(part: Floats, scene: CompiledScene, rays: ShadowRays, length: Floats, end: Bools) -> None:
    """Weaken, in place, the part (3, n) of light that gets over some lengths (n,) of shadow rays.

    None gets along rays that `end` (n,) outside of the medium where they should end.
    """
    part *= transmitted(scene, rays, rays.media, length, rays.steps)
    if rays.goal is not None and scene.media is not None:
        at_goal = (rays.goal < 0) | (scene.media.medium_in(rays.media) == rays.goal)
        part[:, end & ~at_goal] = 0


def transmitted(
    scene: CompiledScene, rays: Rays, stack: Any, length: Floats, steps: StepNumbers | None
) -> Floats:
    """Return the transmittance (3, n) of media over some lengths (n,) of rays."""
    media = scene.media
    assert media is not None
    medium, passed = media.medium_in(stack), np.ones_like(rays.direction)
    inside = np.flatnonzero(medium >= 0)
    if inside.size:
        numbers = None if steps is None else steps.take(inside)
        passed[:, inside] = _through(media, rays, inside, medium.take(inside), length.take(inside), numbers)
    return passed


def _through(
    media: MediaTable, rays: Rays, lanes: Ints, medium: Ints, length: Floats, steps: StepNumbers | None
) -> Floats:
    """Return the transmittance (3, k) over lengths (k,) of some lanes of rays in their media."""
    transmittance = np.empty((3, lanes.size), f4)
    for record, rows, column in media.by_record(medium):
        numbers = None if steps is None else steps.take(rows)
        within = _within(column, rays, lanes.take(rows), length.take(rows), numbers)
        transmittance[:, rows] = record.transmittance(within)
    return transmittance


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
    return crossed(stack, crossings(scene, surface))


def crossings(scene: CompiledScene, surface: SurfaceInteraction) -> NDArray[Any]:
    """Return the changes of stacks at surfaces, as `MediaTable.crossing`, a row for each surface.

    There are two rows, (2, n), where shapes lie on each other, and else one, (1, n).
    """
    media = scene.media
    assert media is not None
    crossing = media.crossing(surface.material, surface.back_facing)
    if media.meet:
        return np.stack([_crossing_beside(scene, surface), crossing])
    if media.touching is None:
        return crossing[None]
    return np.stack([_crossing_of_other(scene, media.touching, surface), crossing])


def _crossing_beside(scene: CompiledScene, surface: SurfaceInteraction) -> NDArray[Any]:
    """Return the changes of stacks (n,) at other surfaces at the places of these, where shapes move.

    A short ray through each place tells them, at the time of the path.
    """
    assert scene.media is not None
    entry = scene.media.crossing(surface.material, surface.back_facing)
    other = np.zeros_like(entry)
    lanes = np.flatnonzero((entry != 0) & (surface.prim >= 0))
    here = surface.take(lanes)
    before = f4(4) * here.error / np.maximum(np.abs(dot(here.ng, here.wo)), LEAST_COS)
    rays = Rays(here.point + here.wo * before, -here.wo, here.prim, time=here.time)
    hits = intersect(scene, rays)
    met = np.flatnonzero((hits.prim >= 0) & (hits.t < f4(2) * before))
    beside = interaction(scene, rays.take(met), hits.take(met))
    crossing = scene.media.crossing(beside.material, beside.back_facing)
    # a triangle beside another one of a shape is no other surface
    other[lanes.take(met)] = np.where(crossing == entry.take(lanes.take(met)), ENTRY(0), crossing)
    return other


def _crossing_of_other(
    scene: CompiledScene, touching: TouchingFaces, surface: SurfaceInteraction
) -> NDArray[Any]:
    """Return the changes of stacks (n,) at the surfaces of other shapes that lie on these.

    A ray that begins a little before a surface and does not meet it meets the one that lies on it.
    """
    assert scene.media is not None
    other = np.zeros(len(surface), ENTRY)
    known = np.flatnonzero((surface.prim >= 0) & (surface.prim < touching.number.size))
    number = touching.number.take(surface.prim.take(known))
    lanes, number = known.compress(number >= 0), number.compress(number >= 0)
    if not lanes.size:
        return other
    here = surface.take(lanes)
    before = f4(4) * here.error / np.maximum(np.abs(dot(here.ng, here.wo)), LEAST_COS)
    start, group, layer = (
        here.point + here.wo * before,
        *(column.take(number) for column in (touching.group, touching.layer)),
    )
    for of_layer, (members, accelerator) in enumerate(
        zip(touching.members, touching.accelerators, strict=True)
    ):
        others = np.flatnonzero(layer != of_layer)
        hits = accelerator.closest(take(start, others), -take(here.wo, others), np.full(others.size, -1))
        met = members.take(hits.prim)
        near = (hits.prim >= 0) & (hits.t < f4(2) * before.take(others))
        near &= touching.group.take(met) == group.take(others)
        others, met = others.compress(near), met.compress(near)
        opposite = dot(touching.front.take(met, 1), touching.front.take(number.take(others), 1)) < 0
        back_facing = here.back_facing.take(others) ^ opposite
        other[lanes.take(others)] = scene.media.crossing(touching.material.take(met), back_facing)
    return other

"""Light tracing: paths from lights, for light that comes by smooth glass and mirrors, as in caustics.

A path from the camera meets a small light behind glass or in a mirror by chance only, and a point light
never. So paths are traced from the lights, too, where they are asked for. Each begins at a point on a
specular surface (compile/specular_surfaces.py). Light samples estimate the light there, and BSDF samples
carry it on. At each surface on its way that does not scatter by delta lobes alone, the path is connected to
the camera, and adds to whatever pixel sees that surface.

Paths from the camera leave out just this light: that of delta lights and of surfaces that shine, which a
specular surface sends on by a delta lobe, and which leaves the first surface that the camera sees by
another lobe.

A BSDF is a function of the direction to the camera and that to the light, in this order, also where
light comes along (E. Veach, thesis 1997, §5.2 and §5.3).

Sources: J. Arvo, Backward Ray Tracing, 1986; P. Dutré, E. Lafortune and Y. Willems, Monte Carlo Light Tracing
with Direct Computation of Pixel Intensities, 1993.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Paths, Rays, SoA, SurfaceInteraction, Words
from ..arrays.vec import Bools, Doubles, Floats, Ints, broadcast, dot, f4, highest, length, take
from ..camera import Camera
from ..compile.media import stacks_leaving
from ..compile.program import Leg, Passage
from ..compile.scene import CompiledScene
from ..compile.specular_surfaces import SpecularPoints, SpecularSurfaces
from ..features.motion import Exposure
from ..lights import LightSample, Receiver
from ..sampling.sampler import Dimension, Sampler
from ..stages.bounce import bounce_sample
from ..stages.compact import compact, roulette, select
from ..stages.inside import stacks_at
from ..stages.interaction import interaction, offset_origin, origin_above, query
from ..stages.intersect import ShadowRays, intersect, shadow_rays, visible
from ..stages.passing import pass_through
from ..stages.shade import Shading, radiance_at_samples, shading
from ..stages.transmittance import Veils, opacities_at, transmittance_along

NEARBY = f4(16)  # error bounds within which another surface is at the same place
LOWER_BITS = 2.0**-24  # of a number drawn: how far apart two of them are


@soa
class Splats(SoA):
    """Light that paths from lights add to pixels, which may repeat."""

    path: Ints  # (k,) number of the path
    pixel: Words  # (k,) row-major index within the camera's window
    radiance: Floats  # (3, k) times the number of paths


def trace_light(
    scene: CompiledScene, camera: Camera, sampler: Sampler, pixel: Words, sample: Words, max_bounces: int
) -> Splats:
    """Trace a path from a light for each pair of pixel and sample; they reach any pixels.

    Parameters
    ----------
    scene
        With specular surfaces.
    camera
        In the unit of the compiled scene.
    pixel, sample
        (n,) row-major pixel index, within the camera's window, and sample index.
    max_bounces
        The most scattering events of a path, at least 0.
    """
    scene = replace(scene, program=scene.program.of_lights())
    assert scene.specular_surfaces is not None
    if max_bounces < 2 or scene.lights.choice is None:
        return _nothing()
    paths, hits, flux = _begin(scene, scene.specular_surfaces, camera, sampler, pixel, sample)
    splats = []
    for bounce in range(max_bounces - 1):
        shade = _prepared(scene, paths, hits)
        if bounce:
            splats.append(_connect(scene, camera, sampler, paths, hits, shade, flux, bounce))
        paths = _scatter(scene, paths, hits, shade, sampler, bounce)
        lanes = roulette(scene, paths, sampler, bounce)
        paths = select(paths, lanes)
        hits = intersect(scene, paths)
        if scene.program.weaken:
            t = np.where(hits.prim >= 0, hits.t, f4(0))
            _absorb(scene, paths.throughput, shade.surface.take(lanes), paths.direction, t)
        leg = Leg(scene, sampler, bounce + 1, flux, False, paths.exclude_prim, paths, hits)
        pass_through(leg)
        paths, hits = compact(scene, leg.paths, leg.hits, leg.hits.found)
        if not len(paths):
            break
    else:
        shade = _prepared(scene, paths, hits)
        splats.append(_connect(scene, camera, sampler, paths, hits, shade, flux, max_bounces - 1))
    return Splats.concatenate([_nothing(), *splats])


def _nothing() -> Splats:
    return Splats(np.zeros(0, np.intp), np.zeros(0, np.uint32), np.zeros((3, 0), f4))


def _begin(
    scene: CompiledScene,
    specular: SpecularSurfaces,
    camera: Camera,
    sampler: Sampler,
    pixel: Words,
    sample: Words,
) -> tuple[Paths, Hits, Floats]:
    """Return paths that come from lights and have hit specular surfaces, and the flux (3, n) of each slot.

    The paths of one sample of all pixels follow each other in one sequence of random numbers, so that they
    are spread evenly over specular surfaces and lights.
    """
    width, height = camera.resolution
    address = (np.uint32(width * height % 2**32) + sample).astype(np.uint32), camera.address(pixel)
    choice = sampler.draw_2d(*address, 0, Dimension.SPECULAR_SURFACE).astype(np.float64)
    u_choice = sampler.draw_1d(*address, 0, Dimension.LIGHT)
    exposure, receiver, time = scene.program.find(Exposure), None, None
    if exposure is not None:
        time = exposure.shutter.times(sampler.draw_1d(*address, 0, Dimension.TIME))
        receiver = _at_times(time)
    start = specular.sample(
        choice[0] + choice[1] * LOWER_BITS, sampler.draw_2d(*address, 0, Dimension.SPECULAR_POINT), time
    )
    light, number = scene.lights.sample_li(
        start.point, u_choice, sampler.draw_2d(*address, 0, Dimension.LIGHT_POINT), receiver
    )
    placed = np.isfinite(light.distance) | scene.lights.delta_of.take(number)
    lanes = np.flatnonzero((light.pdf > 0) & placed)
    paths, hits = _arriving(scene, start.take(lanes), light.take(lanes), address, lanes)
    if time is not None:
        paths.time = time.take(lanes)
    paths, hits = compact(scene, paths, hits, np.arange(lanes.size))
    return _lit(scene, specular, paths, hits, light, number, start.area)


def _at_times(time: Doubles) -> Receiver:
    """Return points that light reaches from all sides, at times (n,)."""
    up = np.broadcast_to(np.array([[0], [0], [1]], f4), (3, time.size))
    return Receiver(up, broadcast(np.False_, time.size), time=time)


def _arriving(
    scene: CompiledScene, start: SpecularPoints, light: LightSample, address: tuple[Words, Words], lanes: Ints
) -> tuple[Paths, Hits]:
    """Return paths (k,) that have come from lights to points of specular surfaces, and their hits there."""
    n = lanes.size
    paths = Paths(
        slot=lanes,
        pixel=address[0].take(lanes),
        sample=address[1].take(lanes),
        origin=start.point,
        direction=-light.wi,
        exclude_prim=broadcast(np.intp(-1), n),
        throughput=np.ones((3, n), f4),
        pdf=broadcast(f4(1), n),
        specular=broadcast(np.True_, n),
        roulette_scale=broadcast(f4(1), n),
    )
    hits = Hits(np.zeros(n, f4), start.prim, None, None)
    if scene.interpolates:
        hits.b1, hits.b2 = start.b1, start.b2
    if scene.instances is not None:
        hits.prim, hits.instance = scene.instances.locate(start.prim)
    return paths, hits


def _lit(
    scene: CompiledScene,
    specular: SpecularSurfaces,
    paths: Paths,
    hits: Hits,
    light: LightSample,
    number: Ints,
    area: Floats,
) -> tuple[Paths, Hits, Floats]:
    """Return the paths that nothing blocks on the way from the light, and the flux (3, slots) of each slot.

    `area` (slots,) is the inverse of the densities of their first points.
    """
    surface = interaction(scene, paths, hits)
    light, number = light.take(paths.slot), number.take(paths.slot)
    everything, start = np.arange(len(surface)), origin_above(surface)
    rays = shadow_rays(surface, start, light, everything)
    rays.time = paths.time
    rays.media = paths.media = stacks_at(scene, start, paths.time)
    arriving = radiance_at_samples(scene, rays, light, everything, number)
    arriving = arriving * _transmittance(scene, rays)
    cos = dot(surface.ng, light.wi)
    flux = np.zeros((3, area.size), f4)
    arriving = arriving * (cos * area.take(paths.slot) / light.pdf)
    passage = Passage(scene, paths, surface, None, 0)
    flux[:, paths.slot] = arriving * opacities_at(passage, scene.program.see_through)
    lanes = np.flatnonzero(highest(take(flux, paths.slot)) != 0)
    lanes = lanes.compress(_first(scene, specular, rays.take(lanes)))
    return paths.take(lanes), hits.take(lanes), flux


def _first(scene: CompiledScene, specular: SpecularSurfaces, rays: ShadowRays) -> Bools:
    """Return whether light along rays (k) hits the specular surfaces that they start from, (k,).

    Points are drawn on all faces, but of those that overlap in a plane only the first is ever hit.
    """
    away, nothing = NEARBY * rays.error, broadcast(np.intp(-1), len(rays))
    back = Rays(rays.origin + rays.direction * away, -rays.direction, nothing, time=rays.time)
    hits = scene.accelerator.closest(*query(scene, back))
    return ~((hits.t < 2 * away) & (hits.prim < specular.lowest(rays.exclude_prim)))


def _transmittance(scene: CompiledScene, rays: ShadowRays, veils: Veils = ()) -> Floats:
    """Return the transmittance (3, n), or (n,) where all surfaces are opaque, of rays that may be blocked.

    `veils` are the features whose surfaces they may pass, beside those of shadow rays.
    """
    if scene.program.dims_shadows or veils:
        return transmittance_along(scene, rays, veils or scene.program.see_through)
    return visible(scene, rays).astype(f4)


def _prepared(scene: CompiledScene, rays: Rays, hits: Hits) -> Shading:
    """Return the surfaces that rays hit, ready to shade."""
    surface = interaction(scene, rays, hits)
    for tilt in scene.program.tilt:
        tilt(scene, rays, surface)
    return shading(scene, surface)


def _absorb(
    scene: CompiledScene, flux: Floats, surface: SurfaceInteraction, direction: Floats, t: Floats
) -> None:
    """Attenuate, in place, flux (3, n) that leaves surfaces and goes over lengths t (n,).

    A path from the camera comes the other way, and is weakened where it meets these surfaces from behind.
    """
    behind = surface.back_facing ^ (dot(surface.ng, direction) < 0)
    for weaken in scene.program.weaken:
        weaken(flux, Hits(t, surface.prim, None, None), replace(surface, back_facing=behind))


def _scatter(
    scene: CompiledScene, paths: Paths, hits: Hits, shade: Shading, sampler: Sampler, bounce: int
) -> Paths:
    """Return the paths in new directions; at specular surfaces, where they begin, by delta lobes."""
    left, surface = bounce_sample(paths, shade, sampler, bounce), shade.surface
    # Radiance is divided by η² where it is refracted; flux is not.
    throughput = left.throughput * left.roulette_scale
    if surface.ns is not surface.ng:
        throughput *= _ratio_of_cosines(shade, left)
    rough = np.flatnonzero(~left.specular)
    if rough.size:
        wo = take(left.direction, rough)
        stack = _around(shade, paths, rough, wo)
        point, wi = surface.point.take(rough, 1), take(surface.wo, rough)
        weight = _towards(scene, hits.take(rough), point, wo, wi, stack, _times(paths, rough))
        pdf = take(left.pdf, rough)
        throughput[:, rough] = take(paths.throughput, rough) * np.where(
            pdf > 0, weight / np.where(pdf > 0, pdf, 1), 0
        )
    return replace(left, throughput=throughput, roulette_scale=broadcast(f4(1), len(left)))


def _ratio_of_cosines(shade: Shading, left: Paths) -> Floats:
    """Return the factor (n,) of shading normals for light along paths from lights (Veach 1997, eq. 5.19)."""
    surface = shade.surface
    before, after = (
        _divided(np.abs(dot(a, direction)), np.abs(dot(b, direction)))
        for a, b, direction in (
            (surface.ns, surface.ng, surface.wo),
            (surface.ng, surface.ns, left.direction),
        )
    )
    return before * after


def _divided(a: Floats, b: Floats) -> Floats:
    """Return a / b (n,), and 0 where b is 0."""
    return np.where(b > 0, a / np.where(b > 0, b, f4(1)), f4(0))


def _times(paths: Paths, lanes: Ints) -> Doubles | None:
    """Return the times (k,) of some lanes; None where nothing moves."""
    return None if paths.time is None else paths.time.take(lanes)


def _around(shade: Shading, paths: Paths, lanes: Ints, wo: Floats) -> Any:
    """Return the stacks (4, k) of light that leaves some lanes along wo (3, k); None without media."""
    if paths.media is None:
        return None
    cos = dot(take(shade.surface.ng, lanes), wo)
    return stacks_leaving(take(paths.media, lanes), take(shade.crossing, lanes), cos)


def _towards(
    scene: CompiledScene,
    hits: Hits,
    point: Floats,
    wo: Floats,
    wi: Floats,
    stack: Any,
    time: Doubles | None,
) -> Floats:
    """Return f times two cosines (3, k), given light that comes from wi (3, k) and leaves along wo (3, k).

    `stack` (4, k) has the media around where it leaves, at times (k,). The cosines are that of wo with the
    geometric normal, and that of wi with the shading normal over that with the geometric one, as the flux
    that arrives has the latter.
    """
    rays = Rays(point, -wo, broadcast(np.intp(-1), wo.shape[1]), media=stack, time=time)
    shade = _prepared(scene, rays, replace(hits, t=np.zeros_like(hits.t)))
    local = shade.frame.to_local(wi)
    cos, cos_g = shade.cosines(local, wi)
    f, _ = shade.evaluate(local)
    return f * (_divided(cos, np.abs(cos_g)) * np.abs(dot(shade.surface.ng, wo)))


def _connect(
    scene: CompiledScene,
    camera: Camera,
    sampler: Sampler,
    paths: Paths,
    hits: Hits,
    shade: Shading,
    flux: Floats,
    bounce: int,
) -> Splats:
    """Return the splats of the light that paths bring to surfaces."""
    surface = shade.lit().surface  # the first lanes: those after them have only delta lobes
    n = len(surface)
    address = paths.pixel[:n], paths.sample[:n], bounce
    lens = sampler.draw_2d(*address, Dimension.LENS) if camera.uses_lens else None
    eye, film, importance = _connections(scene, camera, surface.point, _times(paths, np.arange(n)), lens)
    lanes = _seen(scene, camera, film, paths, hits, n)
    to_eye = take(eye, lanes) - surface.point.take(lanes, 1)
    distance = length(to_eye)
    wo = to_eye / distance
    seen = surface.take(lanes)
    arriving = take(flux, paths.slot.take(lanes)) * take(paths.throughput, lanes)
    stack = _around(shade, paths, lanes, wo)
    time = _times(paths, lanes)
    weight = _towards(scene, hits.take(lanes), seen.point, wo, seen.wo, stack, time)
    radiance = arriving * (weight * importance.take(lanes).astype(f4))
    lit = np.flatnonzero(highest(radiance) != 0)
    seen, wo = seen.take(lit), take(wo, lit)
    rays = ShadowRays(
        origin=offset_origin(seen, dot(seen.ng, wo)),
        direction=wo,
        exclude_prim=seen.prim,
        error=seen.error,
        distance=distance.take(lit),
        cos_light=broadcast(f4(1), lit.size),
        media=None if stack is None else take(stack, lit),
        time=None if time is None else time.take(lit),
    )
    radiance = take(radiance, lit) * _transmittance(scene, rays, scene.program.seen_through)
    if scene.program.weaken:
        _absorb(scene, radiance, seen, wo, rays.distance)
    at = lanes.take(lit)
    return Splats(paths.slot.take(at), _pixels(camera, film.take(at, 1)), radiance)


def _connections(
    scene: CompiledScene, camera: Camera, point: Floats, time: Doubles | None, lens: Floats | None
) -> tuple[Floats, Doubles, Doubles]:
    """Return `Camera.connections` for points (3, n) at times (n,)."""
    exposure = scene.program.find(Exposure)
    if exposure is None or time is None:
        return camera.connections(point, scene.center, lens)
    eye, film, importance = camera.connections(exposure.to_camera(time, point), scene.center, lens)
    return exposure.seen_from(time, eye, eye)[0], film, importance


def _seen(scene: CompiledScene, camera: Camera, film: Doubles, rays: Rays, hits: Hits, n: int) -> Ints:
    """Return those of the first n lanes whose film points (2, n) are in the camera's window."""
    x0, y0, x1, y1 = camera.window
    x, y = film
    inside = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
    for veil in scene.program.unseen:
        inside &= ~veil.passable(scene, rays, hits, slice(n))
    return np.flatnonzero(inside)


def _pixels(camera: Camera, film: Doubles) -> Words:
    """Return the row-major indices (k,) within the window of the pixels that film points (2, k) are in."""
    x0, y0, x1, _ = camera.window
    column, row = (np.floor(coordinate).astype(np.int64) for coordinate in film)
    return ((row - y0) * (x1 - x0) + (column - x0)).astype(np.uint32)

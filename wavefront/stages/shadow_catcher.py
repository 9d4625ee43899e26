"""The opacity of shadow catchers to camera rays: the part of the direct light that something blocks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays.state import Hits, Paths, SurfaceInteraction
from ..arrays.vec import INV_PI, Floats, Ints, dot, f4, luminance, positive, take
from ..compile.scene import CompiledScene
from ..lights import LightSample, Receiver
from ..sampling.mis import power_heuristic
from ..sampling.sampler import Dimension, Sampler
from ..sampling.steps import StepNumbers
from ..sampling.warp import cosine_hemisphere
from .interaction import material_rows, origin_above
from .intersect import ShadowRays, shadow_rays, visible
from .transmittance import transmittance_along

CANDIDATES = 8  # of light samples, and again of directions, at each point
FIRST_VERTEX = 2**17  # candidates draw numbers as at vertices beyond those of any path


def catcher_lanes(scene: CompiledScene, hits: Hits, lanes: Ints) -> Ints:
    """Return those of some lanes (k,) that hit a shadow catcher."""
    if scene.shadow_catchers is None:
        return lanes[:0]
    met = lanes.compress(take(hits.prim, lanes) >= 0)
    return met.compress(scene.shadow_catchers.take(material_rows(scene, hits, met)))


def shadow_opacity(
    scene: CompiledScene, paths: Paths, surface: SurfaceInteraction, sampler: Sampler
) -> Floats:
    """Return opacities (n,) whose mean is the part of the direct light that is blocked on the way to points.

    Sources: J. Talbot, D. Cline and P. Egbert, "Importance Resampling for Global Illumination", EGSR 2005;
    M. Chao, "A General Purpose Unequal Probability Sampling Plan", Biometrika 1982 (choice of a candidate).
    """
    start, n = origin_above(surface), len(surface)
    total, which = np.zeros(n, f4), np.full(n, -1)
    wi, distance, cos_light = np.zeros((3, n), f4), np.zeros(n, f4), np.ones(n, f4)
    for number, (light, of_light, weight) in enumerate(_candidates(scene, paths, surface, start, sampler)):
        total += weight
        u = sampler.draw_1d(paths.pixel, paths.sample, FIRST_VERTEX + number, Dimension.OPACITY)
        chosen = np.flatnonzero(u * total < weight)
        wi[:, chosen], which[chosen] = take(light.wi, chosen), of_light.take(chosen)
        distance[chosen], cos_light[chosen] = take(light.distance, chosen), take(light.cos_light, chosen)
    lit = np.flatnonzero(total > 0)
    sample = LightSample(wi, np.zeros_like(wi), np.ones(n, f4), distance, cos_light)
    rays = shadow_rays(surface, start, sample, lit)
    _enter_media(scene, paths, sampler, rays, lit, which)
    opacity = np.zeros(n, f4)
    if scene.opacities is None and scene.media is None:
        opacity[lit] = ~visible(scene, rays)
    else:
        opacity[lit] = f4(1) - luminance(transmittance_along(scene, rays))
    return opacity


def _enter_media(
    scene: CompiledScene, paths: Paths, sampler: Sampler, rays: ShadowRays, lanes: Ints, number: Ints
) -> None:
    """Let rays (k,) of some lanes begin in the media of their paths; `number` (n,) is of the lights."""
    if scene.media is None or paths.media is None:
        return
    rays.media = take(paths.media, lanes)
    if (scene.media.light_of >= 0).any():
        rays.goal = scene.media.holding(take(number, lanes), len(scene.lights))
    if scene.media.takes_steps:
        address = take(paths.pixel, lanes), take(paths.sample, lanes), FIRST_VERTEX
        rays.steps = StepNumbers.of(sampler.seed, *address, Dimension.TRANSMITTANCE)


def _candidates(
    scene: CompiledScene, paths: Paths, surface: SurfaceInteraction, start: Floats, sampler: Sampler
) -> Iterator[tuple[LightSample, Ints, Floats]]:
    """Yield samples of arriving light, the numbers (n,) of the lights, and the irradiance (n,) of each.

    Lights are sampled, and directions for the environment, with weights of multiple importance sampling.
    """
    n, environment = len(surface), int(scene.light_of[-1])
    frame = surface.frame()
    receiver = Receiver(surface.ns, np.ones(n, np.bool_))
    for number in range(CANDIDATES if scene.lights.choice is not None else 0):
        address = paths.pixel, paths.sample, FIRST_VERTEX + number
        u_light = sampler.draw_1d(*address, Dimension.LIGHT)
        light, which = scene.lights.sample_li(
            start, u_light, sampler.draw_2d(*address, Dimension.LIGHT_POINT), receiver
        )
        cos = positive(dot(surface.ns, light.wi))
        sampled = light.pdf > 0
        pdf = np.where(sampled, light.pdf, f4(1))
        weight = scene.lights.mis_weight(which, pdf, cos * INV_PI)
        weight = np.where(which == environment, weight, f4(1))
        yield light, which, np.where(sampled, luminance(light.radiance) * cos * weight / pdf, f4(0))
    if environment < 0:
        return
    numbers = np.full(n, environment)
    for number in range(CANDIDATES, 2 * CANDIDATES):
        u = sampler.draw_2d(paths.pixel, paths.sample, FIRST_VERTEX + number, Dimension.DIRECTION)
        local = cosine_hemisphere(u)
        wi = frame.to_world(local)
        pdf = scene.lights.pdf_li(numbers, start, wi, receiver)
        weight = power_heuristic(local[2] * INV_PI, pdf)
        radiance = scene.lights.le(numbers, wi)
        far = LightSample(wi, radiance, local[2] * INV_PI, np.full(n, np.inf, f4), np.ones(n, f4))
        yield far, numbers, luminance(radiance) * f4(np.pi) * weight


def off_catchers(scene: CompiledScene, hits: Hits, lanes: Ints) -> Ints:
    """Return those of some lanes (k,) that hit no shadow catcher: shadows on these are black."""
    if scene.shadow_catchers is None:
        return lanes
    return lanes.compress(~scene.shadow_catchers.take(material_rows(scene, hits, lanes)))

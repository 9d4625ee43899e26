"""Shadow catchers: the camera sees only the shadows on them.

Their opacity to camera rays is the part of the direct light that something blocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Paths, Rays, SurfaceInteraction
from ..arrays.vec import INV_PI, Bools, Floats, Ints, Lanes, dot, f4, luminance, positive, take
from ..compile.program import Facts, Feature, Leg, Passage
from ..compile.scene import CompiledScene
from ..lights import LightSample, Receiver
from ..sampling.mis import power_heuristic
from ..sampling.sampler import Dimension, Sampler
from ..sampling.warp import cosine_hemisphere
from ..stages.interaction import material_rows, origin_above
from ..stages.intersect import shadow_rays, visible
from ..stages.medium import begin_in_media
from ..stages.transmittance import transmittance_along

CANDIDATES = 8  # of light samples, and again of directions, at each point
FIRST_VERTEX = 2**17  # candidates draw numbers as at vertices beyond those of any path


@soa
class ShadowCatchers(Feature):
    """Shows the camera the shadows on some surfaces, and nothing else of these."""

    camera_only = True
    drawn = True
    catching: Bools  # (materials,)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a material catches shadows."""
        catching = np.array([material.bsdf.catches_shadows for material in facts.materials], np.bool_)
        return cls(catching) if catching.any() else None

    def passable(self, scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes) -> Bools:
        """Return which of some lanes (k,) hit shadow catchers."""
        return self.catching.take(material_rows(scene, hits, lanes)) & (take(hits.prim, lanes) >= 0)

    def thin(self, opacity: Floats, passage: Passage) -> None:
        """Lower the opacities of catchers to those of the shadows on them."""
        lanes = np.flatnonzero(self.catching.take(passage.surface.material))
        if not lanes.size:
            return
        at, before = passage.take(lanes), opacity.take(lanes)
        assert at.sampler is not None
        opacity[lanes] = before * shadow_opacity(at.scene, at.rays, at.surface, at.sampler)
        if at.rays.light_traced is not None:
            # Paths from lights do not know how well lit a catcher is: it stops them.
            u = at.sampler.draw_1d(at.rays.pixel, at.rays.sample, 0, Dimension.OPACITY + at.segment)
            passage.rays.light_traced[lanes] &= ~((u < before) & (u >= opacity.take(lanes)))

    def meet(self, leg: Leg) -> None:
        """End paths that hit catchers: shadows on these are black."""
        leg.lanes = leg.lanes.compress(~self.catching.take(material_rows(leg.scene, leg.hits, leg.lanes)))


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
    if surface.time is not None:
        rays.time = surface.time.take(lit)
    if scene.media is not None:
        number_of = take(which, lit)
        begin_in_media(scene, rays, paths, paths.media, lit, number_of, sampler, FIRST_VERTEX)
    opacity = np.zeros(n, f4)
    if scene.program.dims_shadows:
        opacity[lit] = f4(1) - luminance(transmittance_along(scene, rays))
    else:
        opacity[lit] = ~visible(scene, rays)
    return opacity


def _candidates(
    scene: CompiledScene, paths: Paths, surface: SurfaceInteraction, start: Floats, sampler: Sampler
) -> Iterator[tuple[LightSample, Ints, Floats]]:
    """Yield samples of arriving light, the numbers (n,) of the lights, and the irradiance (n,) of each.

    Lights are sampled, and directions for the environment, with weights of multiple importance sampling.
    """
    n, environment = len(surface), int(scene.light_of[-1])
    frame = surface.frame()
    receiver = Receiver(surface.ns, np.ones(n, np.bool_), time=surface.time)
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
        radiance = scene.lights.le(numbers, wi, time=surface.time)
        far = LightSample(wi, radiance, local[2] * INV_PI, np.full(n, np.inf, f4), np.ones(n, f4))
        yield far, numbers, luminance(radiance) * f4(np.pi) * weight

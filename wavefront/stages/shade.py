"""Light at a hit: what the surface emits, and what one light sends there directly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bsdfs import Bsdf
from ..frame import Frame
from ..sampling.mis import power_heuristic
from ..sampling.sampler import Dimension, Sampler
from ..scene import CompiledScene
from ..state import Hits, Paths, Surface
from ..vec import Floats, Ints, columns, dot, f4
from .intersect import shadow_rays, visible
from .passing import let_through
from .shine import shine_at_hits, shine_at_samples
from .surface import above


@dataclass(slots=True)
class Arrival:
    """Light that arrives on some lanes."""

    lanes: Ints  # (k,)
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²


@dataclass(slots=True)
class Emission(Arrival):
    """Light met by rays: only the lanes that meet some."""

    light: Ints  # (k,) number of the light


@dataclass(slots=True)
class Shading:
    """Surfaces ready for their materials: local frames, and the lanes grouped by material."""

    surface: Surface
    frame: Frame
    wo: Floats  # (3, n) local frame
    groups: list[tuple[slice, Bsdf]]  # lanes of each group, in order, and its material bound to them

    def lit(self) -> Shading:
        """Return the first lanes, those that light sampling serves: the rest has only delta lobes."""
        groups = [(lanes, bsdf) for lanes, bsdf in self.groups if not bsdf.specular]
        if len(groups) == len(self.groups):
            return self
        first = slice(groups[-1][0].stop if groups else 0)
        frame = Frame(self.frame.x[:, first], self.frame.y[:, first], self.frame.z[:, first])
        return Shading(self.surface.take(first), frame, self.wo[:, first], groups)


def emitted(scene: CompiledScene, paths: Paths, hits: Hits) -> Emission:
    """Return the light that the paths' rays meet: emitting surfaces, and the environment on a miss."""
    light = scene.light_of.take(hits.prim)  # a miss, -1, takes the last entry
    lanes = np.flatnonzero(light >= 0)
    light = light.take(lanes)
    radiance = scene.lights.le(light, paths.direction.take(lanes, 1))
    if scene.uneven is not None:
        shine_at_hits(scene, paths.take(lanes), hits.take(lanes), light, radiance)
    return Emission(lanes, radiance, light)


def mis_weighted(scene: CompiledScene, paths: Paths, emission: Emission) -> Arrival:
    """Return the emission weighted against light sampling; in full after a delta lobe."""
    sampled = np.flatnonzero(~paths.specular.take(emission.lanes))
    if not sampled.size:
        return emission
    lanes = emission.lanes.take(sampled)
    start = (paths.origin if paths.vertex is None else paths.vertex).take(lanes, 1)
    pdf = scene.lights.pdf_li(emission.light.take(sampled), start, paths.direction.take(lanes, 1))
    weight = np.ones(len(emission.lanes), f4)
    weight[sampled] = power_heuristic(paths.pdf.take(lanes), pdf)
    return Arrival(emission.lanes, emission.radiance * weight)


def shading(scene: CompiledScene, surface: Surface) -> Shading:
    """Set up local frames, and tell the groups of materials apart; `compact` has put them in order."""
    frame = surface.frame()
    wo = frame.to_local(surface.wo)
    materials = scene.materials
    if len(materials.groups) == 1:
        return Shading(surface, frame, wo, [(slice(0, len(surface)), materials.groups[0].bind(surface))])
    groups = []
    group_of = materials.group_of.take(surface.material)
    starts = np.searchsorted(group_of, np.arange(len(materials.groups) + 1))
    for number in np.flatnonzero(np.diff(starts)):
        lanes = slice(int(starts[number]), int(starts[number + 1]))
        groups.append((lanes, materials.groups[number].bind(surface.take(lanes))))
    return Shading(surface, frame, wo, groups)


def direct(
    scene: CompiledScene, paths: Paths, shade: Shading, sampler: Sampler, bounce: int, mis: bool
) -> Arrival:
    """Return the light that one sampled light sends to each point and on along wo.

    With `mis` it is weighted by the power heuristic against BSDF sampling. Surfaces that have
    only delta lobes get none.
    """
    shade = shade.lit()
    if scene.lights.choice is None or not shade.groups:
        return Arrival(np.zeros(0, np.intp), np.zeros((3, 0), f4))
    surface, n = shade.surface, len(shade.surface)
    address = paths.pixel[:n], paths.sample[:n], bounce
    # with one light there is nothing to choose
    alone = len(scene.lights) == 1
    u_choice = np.zeros(n, f4) if alone else sampler.draw_1d(*address, Dimension.LIGHT)
    u_point = sampler.draw_2d(*address, Dimension.LIGHT_POINT)
    # from where a reflected ray would start, so that mis_weighted finds the same densities
    start = above(surface)
    light, number = scene.lights.sample_li(start, u_choice, u_point)
    cos_g = dot(surface.ng, light.wi)
    f_cos, pdf = evaluate(shade, shade.frame.to_local(light.wi), cos_g)
    lanes = np.flatnonzero((light.pdf > 0) & (f_cos.max(0) != 0))  # NaN stays, to be counted
    light, number, f_cos, pdf = light.take(lanes), number.take(lanes), f_cos.take(lanes, 1), pdf.take(lanes)
    weight = scene.lights.mis_weight(number, light.pdf, pdf) if mis else f4(1)
    rays = shadow_rays(surface, start, lanes, light, cos_g.take(lanes))
    if scene.uneven is not None:
        light.radiance = shine_at_samples(scene, rays, number, u_point.take(lanes, 1), light.radiance)
    radiance = f_cos * light.radiance * (weight / light.pdf)
    if scene.opacities is not None:
        return Arrival(lanes, radiance * let_through(scene, rays))
    seen = np.flatnonzero(visible(scene, rays))
    return Arrival(lanes.take(seen), radiance.take(seen, 1))


def evaluate(shade: Shading, wi: Floats, cos_g: Floats) -> tuple[Floats, Floats]:
    """Return f·|cosθ| (3, n) and the pdf (n,) of local directions wi (3, n).

    `cos_g` (n,), against the geometric normal, must agree with wi on the side that light
    comes from: where the two normals disagree there is no light, so none leaks through.
    """
    n = wi.shape[1]
    cos = np.abs(wi[2]) * (wi[2] * cos_g > 0)
    if len(shade.groups) == 1:
        f, pdf = shade.groups[0][1].evaluate(shade.wo, wi)
        return f * cos, pdf
    f, pdf = np.empty((3, n), f4), np.empty(n, f4)
    for lanes, bsdf in shade.groups:
        part_f, part_pdf = bsdf.evaluate(columns(shade.wo, lanes), columns(wi, lanes))
        f[:, lanes], pdf[lanes] = part_f, part_pdf
    f *= cos
    return f, pdf

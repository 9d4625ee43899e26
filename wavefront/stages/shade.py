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
from ..vec import Bools, Floats, Ints, dot, f4
from .intersect import visible


@dataclass(slots=True)
class Emission:
    """Light met by rays: only the lanes that meet some."""

    lanes: Ints  # (k,)
    light: Ints  # (k,) number of the light
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²


@dataclass(slots=True)
class Shading:
    """Surfaces ready for their materials: local frames, and the lanes grouped by material."""

    surface: Surface
    frame: Frame
    wo: Floats  # (3, n) local frame
    groups: list[tuple[Ints, Bsdf]]  # lanes of each group, and its material bound to them


def emitted(scene: CompiledScene, paths: Paths, hits: Hits) -> Emission:
    """Return the light that the paths' rays meet: emitting surfaces, and the environment on a miss."""
    light = np.append(scene.light_of, scene.environment).take(hits.prim)  # -1 takes the last
    lanes = np.flatnonzero(light >= 0)
    light = light.take(lanes)
    radiance = scene.lights.le(light, paths.direction.take(lanes, 1))
    return Emission(lanes, light, radiance)


def mis_weighted(scene: CompiledScene, paths: Paths, emission: Emission) -> Floats:
    """Return the emission (3, k) weighted against light sampling; in full after a delta lobe."""
    before = paths.take(emission.lanes)
    pdf_light = scene.lights.pdf_li(emission.light, before.origin, before.direction)
    weight = np.where(before.specular, f4(1), power_heuristic(before.pdf, pdf_light))
    return emission.radiance * weight


def shading(scene: CompiledScene, surface: Surface) -> Shading:
    """Set up local frames and group the lanes by material."""
    frame = surface.frame()
    wo = frame.to_local(surface.wo)
    materials = scene.materials
    if len(materials.groups) == 1:
        groups = [(np.arange(len(surface)), materials.groups[0].bind(surface))]
    else:
        groups = []
        group_of = materials.group_of.take(surface.material)
        for number, bsdf in enumerate(materials.groups):
            lanes = np.flatnonzero(group_of == number)
            if lanes.size:
                groups.append((lanes, bsdf.bind(surface.take(lanes))))
    return Shading(surface, frame, wo, groups)


def direct(scene: CompiledScene, paths: Paths, shade: Shading, sampler: Sampler, bounce: int, mis: bool) -> Floats:
    """Return the light (3, n) that one sampled light sends to each point and on along wo.

    With `mis` it is weighted by the power heuristic against BSDF sampling. Surfaces that have
    only delta lobes get none.
    """
    radiance = np.zeros((3, len(paths)), f4)
    if scene.lights.choice is None:
        return radiance
    surface = shade.surface
    address = paths.pixel, paths.sample, bounce
    u_choice = sampler.draw_1d(*address, Dimension.LIGHT)
    u_point = sampler.draw_2d(*address, Dimension.LIGHT_POINT)
    light, delta = scene.lights.sample_li(surface.point, u_choice, u_point)
    f, pdf = evaluate(shade, shade.frame.to_local(light.wi), dot(surface.ng, light.wi))
    # f holds the cosine from here on
    ok = np.flatnonzero((light.pdf > 0) & (f.max(0) > 0))
    if not ok.size:
        return radiance
    light, f, pdf, delta = light.take(ok), f.take(ok, 1), pdf.take(ok), delta.take(ok)
    weight = np.where(delta, f4(1), power_heuristic(light.pdf, pdf)) if mis else f4(1)
    arriving = f * light.radiance * (weight / light.pdf)
    seen = np.flatnonzero(visible(scene, surface.take(ok), light))
    radiance[:, ok.take(seen)] = arriving.take(seen, 1)
    return radiance


def evaluate(shade: Shading, wi: Floats, cos_g: Floats) -> tuple[Floats, Floats]:
    """Return f·|cosθ| (3, n) and the pdf (n,) of local directions wi (3, n).

    `cos_g` (n,), against the geometric normal, must agree with wi on the side that light
    comes from: where the two normals disagree there is no light, so none leaks through.
    """
    n = wi.shape[1]
    f, pdf = np.zeros((3, n), f4), np.zeros(n, f4)
    for lanes, bsdf in shade.groups:
        if bsdf.specular:
            continue
        part_f, part_pdf = bsdf.evaluate(shade.wo.take(lanes, 1), wi.take(lanes, 1))
        f[:, lanes], pdf[lanes] = part_f, part_pdf
    f *= np.where(same_side(wi, cos_g), np.abs(wi[2]), f4(0))
    return f, pdf


def same_side(wi: Floats, cos_g: Floats) -> Bools:
    """Tell where shading and geometric normal agree on the side of local directions wi, (n,)."""
    return wi[2] * cos_g > 0

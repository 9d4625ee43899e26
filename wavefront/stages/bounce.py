"""The next direction of each path, or several."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays.state import Paths
from ..arrays.vec import ALL, Floats, Ints, f4, normalize, signs, take
from ..bsdfs import BsdfSample, sampled
from ..sampling.sampler import Dimension, Sampler
from .interaction import LIFT
from .shade import Shading


def branch(paths: Paths, shade: Shading, sampler: Sampler, bounce: int, ways: int) -> Paths:
    """Continue each path in several ways, each with an equal part of the throughput.

    The path before is shared by all.
    """
    if ways == 1:
        return bounce_sample(paths, shade, sampler, bounce)
    paths = Paths.concatenate([bounce_sample(way, shade, sampler, bounce) for way in copies(paths, ways)])
    paths.throughput *= f4(1 / ways)
    paths.recorder.branched(ways)
    return paths


def copies(paths: Paths, count: int) -> list[Paths]:
    """Return copies of paths that go on with different random numbers.

    Sample s becomes the samples s·count to s·count + count − 1 from here on, so that the copies of all
    samples of a pixel are spread together.
    """
    numbers = [paths.sample * np.uint32(count) + np.uint32(copy) for copy in range(count)]
    return [replace(paths, sample=sample) for sample in numbers]


def bounce_sample(paths: Paths, shade: Shading, sampler: Sampler, bounce: int) -> Paths:
    """Sample the BSDF at each point and return the paths as they leave it.

    The throughput is 0 where there is no sample. Where shading and geometric normal disagree on the
    side of the sampled direction, this is folded (normal_mapping.py) if a normal map has tilted the
    normal. If vertex normals have, the throughput is 0 at opaque surfaces; at others it is turned.
    """
    surface = shade.surface
    sample = _sample(shade, _numbers(paths, shade, sampler, bounce))
    sample, direction, roulette_scale = shade.aim(paths, sample, sampler, bounce)
    cos, cos_g = shade.cosines(sample.wi, direction)
    specular = sample.specular
    turned = _strayed(shade, sample.wi, cos)
    if turned.size:
        direction[:, turned], cos_g[turned] = _turn(shade, turned, direction, cos_g, sample.wi[2])
        cos[turned] = LIFT
        specular = specular.copy()
        specular[turned] = True  # light sampling cannot find these directions
    throughput = paths.throughput * sample.weight
    if not (cos > 0).all():
        lost = np.flatnonzero(~(cos > 0))
        throughput[:, lost] *= f4(0) * cos.take(lost)  # NaN stays, so that it reaches the picture
    left = Paths(
        slot=paths.slot,
        pixel=paths.pixel,
        sample=paths.sample,
        origin=shade.origins(cos_g),
        direction=direction,
        exclude_prim=shade.unmet(surface.prim, direction, ALL),
        throughput=throughput,
        pdf=sample.pdf,
        specular=specular,
        roulette_scale=roulette_scale,
        media=paths.media,
        time=paths.time,
        light_traced=paths.light_traced,
        depth=paths.depth,
        met_rough=paths.met_rough,
        left_receiver=shade.receiver,
        recorder=paths.recorder,
    )
    shade.leave(paths, left, cos_g, bounce)
    paths.recorder.record_scattering(paths, shade, left)
    return left


def _strayed(shade: Shading, wi: Floats, cos: Floats) -> Ints:
    """Return the lanes (k,) of clear surfaces whose local directions lead to the wrong side of `ng`.

    `cos` (n,) is 0 there. At an opaque surface such light is lost. Light that meets a clear one is
    not: it is reflected or gets through.
    """
    if shade.surface.ns is shade.surface.ng:
        return np.zeros(0, np.intp)
    lanes_of_groups = [
        take(np.arange(cos.size), lanes)[(cos[lanes] == 0) & (wi[2, lanes] != 0)]
        for lanes, bsdf in shade.groups
        if bsdf.transmissive
    ]
    return np.concatenate(lanes_of_groups) if lanes_of_groups else np.zeros(0, np.intp)


def _turn(shade: Shading, lanes: Ints, direction: Floats, cos_g: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Return directions (3, k) of some lanes, turned to the side of `ng` that z tells, and their cosines.

    Reflected light stays outside or inside, refracted light crosses, and the index of refraction
    and the absorption, which go by the geometric side, are those of the side that the ray is on.
    A turned direction is the nearest one on that side that makes the cosine `LIFT` with the surface.
    The renderers pbrt-v4 and Mitsuba 3 keep the direction and let the ray start on the side that it
    leads to, which leaves a refracted ray where it was, but weakened by η².
    """
    ng, cos = shade.surface.ng.take(lanes, 1), cos_g.take(lanes)
    wanted = LIFT * signs(z.take(lanes))
    return normalize(direction.take(lanes, 1) + ng * (wanted - cos)), wanted


def _sample(shade: Shading, u: Floats) -> BsdfSample:
    """Return BSDF samples of all lanes, drawn by group."""
    if len(shade.groups) == 1:
        return sampled(shade.groups[0][1], shade.wo, u)
    n = u.shape[1]
    out = BsdfSample(
        np.empty((3, n), f4), np.empty((3, n), f4), np.empty(n, f4), np.empty(n, np.bool_), np.ones(n, f4)
    )
    assert out.eta is not None
    for lanes, bsdf in shade.groups:
        sample = sampled(bsdf, take(shade.wo, lanes), take(u, lanes))
        out.wi[:, lanes], out.weight[:, lanes] = sample.wi, sample.weight
        out.pdf[lanes], out.specular[lanes] = sample.pdf, sample.specular
        if sample.eta is not None:
            out.eta[lanes] = sample.eta
    return out


def _numbers(paths: Paths, shade: Shading, sampler: Sampler, bounce: int) -> Floats:
    """Return two numbers per lane for the direction, and a third for the lobe if any BSDF reads it."""
    address = paths.pixel, paths.sample, bounce
    rows = max((bsdf.dimensions for _, bsdf in shade.groups), default=0)
    if rows == 0:
        return np.empty((0, len(paths)), f4)
    direction = sampler.draw_2d(*address, Dimension.DIRECTION)
    if rows <= 2:
        return direction
    return np.concatenate([direction, sampler.draw_1d(*address, Dimension.LOBE)[None]])

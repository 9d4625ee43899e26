"""The next direction of each path."""

from __future__ import annotations

import numpy as np

from ..sampling.sampler import Dimension, Sampler
from ..state import Paths
from ..vec import columns, dot, f4
from .shade import Shading
from .surface import leave


def bounce_sample(paths: Paths, shade: Shading, sampler: Sampler, bounce: int) -> Paths:
    """Sample the BSDF at each point and return the paths as they leave it.

    The throughput is 0 where there is no sample, and where shading and geometric normal disagree
    on the side of the sampled direction.
    """
    n = len(paths)
    surface = shade.surface
    wi, weight = np.empty((3, n), f4), np.empty((3, n), f4)
    pdf, specular, eta2 = np.empty(n, f4), np.empty(n, np.bool_), paths.eta2.copy()
    u = _numbers(paths, shade, sampler, bounce)
    for lanes, bsdf in shade.groups:
        sample = bsdf.sample_f(columns(shade.wo, lanes), columns(u[: bsdf.dimensions], lanes))
        wi[:, lanes], weight[:, lanes] = sample.wi, sample.weight
        pdf[lanes], specular[lanes] = sample.pdf, sample.specular
        if sample.eta is not None:
            eta2[lanes] *= sample.eta**2
    direction = shade.frame.to_world(wi)
    cos_g = dot(surface.ng, direction)
    sides = wi[2] * cos_g
    weight *= np.where(np.isnan(sides), sides, sides > 0)  # NaN stays, to be counted
    return Paths(
        slot=paths.slot,
        pixel=paths.pixel,
        sample=paths.sample,
        origin=leave(surface.point, surface.error, surface.ng, direction),
        direction=direction,
        leaving=surface.prim,
        throughput=paths.throughput * weight,
        pdf=pdf,
        specular=specular,
        eta2=eta2,
    )


def _numbers(paths: Paths, shade: Shading, sampler: Sampler, bounce: int) -> np.ndarray:
    """Draw as many numbers as the materials present read: 2 for the direction, a third for the lobe."""
    address = paths.pixel, paths.sample, bounce
    rows = max((bsdf.dimensions for _, bsdf in shade.groups), default=0)
    u = np.empty((max(rows, 2), len(paths)), f4)
    if rows:
        u[:2] = sampler.draw_2d(*address, Dimension.DIRECTION)
    if rows > 2:
        u[2] = sampler.draw_1d(*address, Dimension.LOBE)
    return u

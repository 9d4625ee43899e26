"""The first stage: camera rays become paths."""

from __future__ import annotations

import numpy as np

from ..camera import Camera
from ..compile.scene import CompiledScene
from ..filters import Filter, box
from ..sampling.sampler import Dimension, Sampler
from ..state import Paths, Words
from ..vec import broadcast, f4


def generate(
    scene: CompiledScene, camera: Camera, sampler: Sampler, pixel: Words, sample: Words, filter: Filter = box
) -> Paths:
    """Return paths that start at the camera, one for each pair of pixel and sample.

    Parameters
    ----------
    pixel, sample
        (n,) row-major pixel index, within the camera's window, and sample index.
    filter
        Distributes the samples of a pixel in and around it.
    """
    width, n = camera.film[0], len(pixel)
    pixel = camera.address(pixel)
    jitter = filter(sampler.draw_2d(pixel, sample, 0, Dimension.PIXEL))
    row = pixel // np.uint32(width)
    x = (pixel - row * np.uint32(width)).astype(f4) + jitter[0]
    y = row.astype(f4) + jitter[1]
    lens = sampler.draw_2d(pixel, sample, 0, Dimension.LENS) if camera.uses_lens else None
    origin, direction = camera.rays(x, y, scene.center, lens)
    return Paths(
        slot=np.arange(n),
        pixel=pixel,
        sample=sample,
        origin=origin,
        direction=direction,
        exclude_prim=np.full(n, -1, np.intp),
        throughput=np.ones((3, n), f4),
        pdf=broadcast(f4(1), n),
        specular=broadcast(np.True_, n),
        roulette_scale=broadcast(f4(1), n),
    )

"""The first stage: camera rays become paths."""

from __future__ import annotations

import numpy as np

from ..arrays.state import Paths, Rays, Words
from ..arrays.vec import Floats, broadcast, f4
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..sampling.filters import Filter, box
from ..sampling.sampler import Dimension, Sampler

HALF = f4(0.5)


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
    n = len(pixel)
    pixel = camera.address(pixel)
    jitter = filter(sampler.draw_2d(pixel, sample, 0, Dimension.PIXEL))
    column, row = _corners(camera, pixel)
    x, y = column + jitter[0], row + jitter[1]
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
        left_rough=None if scene.specular_surfaces is None else broadcast(np.False_, n),
    )


def center_rays(scene: CompiledScene, camera: Camera, pixel: Words) -> Rays:
    """Return the rays through the centers of pixels (n,) and the center of the lens."""
    column, row = _corners(camera, camera.address(pixel))
    origin, direction = camera.rays(column + HALF, row + HALF, scene.center)
    return Rays(origin, direction, np.full(len(pixel), -1, np.intp))


def _corners(camera: Camera, address: Words) -> tuple[Floats, Floats]:
    """Return the film points (n,), (n,) of the upper left corners of pixels (n,) of the whole picture."""
    width = np.uint32(camera.resolution[0])
    row = address // width
    return (address - row * width).astype(f4), row.astype(f4)

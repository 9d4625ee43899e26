"""The first stage: camera rays become paths."""

from __future__ import annotations

import numpy as np

from ..arrays.state import Paths, Rays, Words
from ..arrays.vec import Floats, Ints, broadcast, f4
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..sampling.filters import Filter, box
from ..sampling.sampler import Dimension, Sampler
from .sensors import sensor_of_camera

HALF = np.full((2, 1), 0.5, f4)
NOWHERE = np.empty(0, np.intp)
# a ray beyond the largest scene, which meets nothing
OUTSIDE, AWAY = np.array([[2.0**30], [0.0], [0.0]], f4), np.array([[0.0], [0.0], [1.0]], f4)


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
    n, sensor = len(pixel), sensor_of_camera(camera)
    pixel = camera.address(pixel)
    at = filter(sampler.draw_2d(pixel, sample, 0, Dimension.PIXEL))
    lens = sampler.draw_2d(pixel, sample, 0, Dimension.LENS) if camera.uses_lens else None
    origin, direction, blind = _seen(scene, camera, pixel, at, lens)
    throughput = np.ones((3, n), f4)
    throughput[:, blind] = 0
    paths = Paths(
        slot=np.arange(n),
        pixel=pixel,
        sample=sample,
        origin=origin,
        direction=direction,
        exclude_prim=np.full(n, -1, np.intp),
        throughput=throughput,
        pdf=broadcast(f4(1), n),
        specular=broadcast(np.True_, n),
        roulette_scale=broadcast(f4(1) if sensor is None else f4(1) / sensor.total, n),
        sensor=sensor,
    )
    for expose in scene.program.expose:
        expose(scene, camera, paths, pixel, lambda at: sampler.draw_1d(at, sample, 0, Dimension.TIME))
    for begin in scene.program.begin:
        begin(scene, paths)
    return paths


def center_rays(scene: CompiledScene, camera: Camera, pixel: Words) -> Rays:
    """Return the rays through the centers of pixels (n,) and of the lens, when the shutter is half over."""
    origin, direction, _ = _seen(scene, camera, camera.address(pixel), HALF, None)
    rays = Rays(origin, direction, np.full(len(pixel), -1, np.intp))
    for expose in scene.program.expose:
        expose(scene, camera, rays, camera.address(pixel), lambda at: broadcast(f4(0.5), len(at)))
    return rays


def _seen(
    scene: CompiledScene, camera: Camera, pixel: Words, at: Floats, lens: Floats | None
) -> tuple[Floats, Floats, Ints]:
    """Return the rays of film points, and which of these see nothing: their rays lead away from the scene."""
    origin, direction = camera.pixel_rays(pixel, at, scene.center, lens)
    if camera.projection.sees_all:
        return origin, direction, NOWHERE
    blind = np.flatnonzero(np.isnan(direction[0]))
    origin[:, blind], direction[:, blind] = OUTSIDE, AWAY
    return origin, direction, blind

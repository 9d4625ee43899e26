"""Tracing a job: one wave of paths from the camera to its radiance."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from ..accel.base import Accelerator, Intersections
from ..accel.counter import RayCounter
from ..aovs.recorder import SampleRecorder, recorded_aovs
from ..arrays.path_recorder import NOBODY, PathRecorder
from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, Ints, broadcast
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..core.errors import SceneError
from ..core.interrupt import end_with_parent
from ..core.shared import SharedInt, Stopped
from ..features.view import seen_with
from ..guiding import GuideTable
from ..integrators import Integrator, integrator_for
from ..integrators.light_tracing import trace_light
from ..sampling.filters import Filter
from ..sampling.sampler import Sampler, SamplerMaker
from ..sampling.tiles import Tiles
from ..stages.generate import generate
from .jobs import Job, JobResult, WaveResult

FIRST_SAMPLE_TIMEOUT = 3.0  # seconds that a wave of first samples may take even if the time is up


class WaveMonitor:
    """Data that all workers share.

    Attributes
    ----------
    stop
        The stop flag.
    surfaces
        How many surfaces the longest path under way has met.
    """

    def __init__(self) -> None:
        self.stop, self.surfaces = SharedInt(), SharedInt()

    def check(self, surfaces: int, deadline: float) -> None:
        """Record that a wave has come to another surface of its paths.

        Raises
        ------
        Stopped
            If the stop flag is set, or the wave's deadline is over.
        KeyboardInterrupt
            If this is a process of multiprocessing, and its parent has ended.
        """
        end_with_parent()
        self.surfaces.rise_to(surfaces)
        if self.stop.value or time.perf_counter() > deadline:
            raise Stopped


@soa
class Tracer:
    """The tracer of jobs: all that the views of a session share."""

    scene: CompiledScene
    make_sampler: SamplerMaker  # from a seed and the width of a picture
    seed: int
    filter: Filter
    integrator: Integrator
    max_bounces: int
    layers: tuple[str, ...] = ()  # sampled ones that are asked for
    table: GuideTable | None = None  # guides the paths of views that want it
    clamp: float | None = None  # the limit of indirect light that a path finds at once

    @property
    def recorded_aovs(self) -> tuple[str, ...]:
        """The AOVs that jobs return, those with a key by it."""
        return recorded_aovs(self.layers, self.scene)

    def sampler(self, width: int) -> Sampler:
        """Return the sampler of a picture of this width, pixels."""
        return self.make_sampler(self.seed, width)

    def radiance(
        self,
        scene: CompiledScene,
        camera: Camera,
        sampler: Sampler,
        pixels: Words,
        samples: Words,
        recorder: PathRecorder = NOBODY,
        tiles: Tiles | None = None,
    ) -> Floats:
        """Return the radiance (3, n) of samples (n,) of pixels (n,), from the camera to the last surface.

        Parameters
        ----------
        scene, camera, sampler
            As the view has them.
        recorder
            Looks on.
        tiles
            Those whose pixels share paths; None where none do.
        """
        paths = generate(scene, camera, sampler, pixels, samples, self.filter)
        recorder.prepare(paths)
        integrator = integrator_for(self.integrator, tiles)
        radiance = integrator(scene, paths, sampler, self.max_bounces + camera.scatterings)
        _check_radiance(integrator, radiance, pixels.size)
        return radiance


def trace_job(tracer: Tracer, monitor: WaveMonitor, job: Job) -> JobResult:
    """Trace the waves of a job, one after the other.

    Raises
    ------
    Stopped
        If `monitor` or the deadline ends a wave between two bounces.
    """
    return [_trace_wave(tracer, monitor, wave) for wave in job.waves()]


def _trace_wave(tracer: Tracer, monitor: WaveMonitor, job: Job) -> WaveResult:
    """Trace the paths of a job, all at once, from the camera to their radiance."""
    begin = time.perf_counter()
    k, n = job.pixels.size, job.samples
    camera, deadline = job.view.camera, job.view.deadline
    if not job.first_sample:
        deadline = max(deadline, begin + FIRST_SAMPLE_TIMEOUT)
    accelerator = MonitoredAccelerator(tracer.scene.accelerator, monitor, deadline)
    whole = replace(tracer.scene, accelerator=accelerator)  # as paths from lights meet it
    pixels, samples, tiles = np.tile(job.pixels, n), _samples(job), job.view.tiles
    scene = seen_with(whole, tracer.table if job.view.guided else None, job.view.branches, tiles)
    recorder = SampleRecorder(tracer.layers, scene, k * n, tracer.clamp) if tracer.layers else None
    sampler = tracer.sampler(camera.resolution[0])
    radiance = tracer.radiance(scene, camera, sampler, pixels, samples, recorder or NOBODY, tiles)
    finite = np.logical_and.reduce(np.isfinite(radiance))
    if recorder is not None:
        finite &= recorder.finish(integrator_for(tracer.integrator, tiles), radiance)
    splats = None
    if scene.specular_surfaces is not None:
        splats = trace_light(whole, camera, sampler, pixels, samples, tracer.max_bounces)
        good = np.isfinite(splats.radiance).all(0)
        finite[splats.path[~good]] = False
        splats = splats.take(np.flatnonzero(good))
    bad = np.flatnonzero(~finite)
    layers = None if recorder is None else recorder.result(n, bad)
    radiance[:, bad] = 0
    seconds = time.perf_counter() - begin
    rays = accelerator.nearest + accelerator.shadow
    return WaveResult(radiance.reshape(3, n, k), bad, rays, seconds, layers, splats)


def _check_radiance(integrator: Integrator, radiance: Any, lanes: int) -> None:
    """Check the shape of the result of an integrator, which may be a user's."""
    if np.shape(radiance) != (3, lanes):
        name = getattr(integrator, "__name__", "integrator")
        answer = "None" if radiance is None else f"the shape {np.shape(radiance)}"
        raise SceneError(f"{name} returns {answer}; an integrator must return (3, n) = (3, {lanes})")


def _samples(job: Job) -> Words:
    """Index of the sample of each path of a job, (lanes,)."""
    first = job.view.first_sample + job.first_sample
    if job.samples == 1:
        return broadcast(np.uint32(first), job.pixels.size)
    samples = np.arange(first, first + job.samples, dtype=np.uint32)
    return np.repeat(samples, job.pixels.size)


class MonitoredAccelerator(RayCounter):
    """An accelerator for one wave: passes rays on to another one, counts them, and ends the wave in time.

    Every bounce of every integrator asks for the nearest surfaces, so here a wave can be ended between
    two bounces, and no integrator needs to know of it.
    """

    def __init__(self, accelerator: Accelerator, monitor: WaveMonitor, deadline: float) -> None:
        super().__init__(accelerator)
        self._monitor, self._deadline, self._surfaces = monitor, deadline, 0

    def closest(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> Intersections:
        """Find the nearest hits of rays (3, n).

        Raises
        ------
        Stopped
            If the wave is to end.
        """
        self._monitor.check(self._surfaces, self._deadline)
        self._surfaces += 1
        return super().closest(origin, direction, exclude_prim, *moment)

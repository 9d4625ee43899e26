"""Pieces of work: which samples of which pixels, and what tracing them comes to."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..accel.base import Accelerator, Intersections
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..errors import RenderError, warn_caller
from ..film import Film
from ..filters import Filter
from ..image import Image
from ..integrators import Integrator
from ..memory import check_memory
from ..record import record
from ..sampling.sampler import Sampler
from ..stages.generate import generate
from ..state import Words
from ..vec import Bools, Floats, Ints, broadcast
from .shared import SharedNumber, Stopped

MAX_BAD_SAMPLES = 1e-4  # part of all samples that may be lost to NaN before it is an error
PATIENCE = 3.0  # seconds that a wave of first samples may take even if the time is up
FILM_BYTES = 179  # of a pixel of the film
PICTURE_BYTES = 64  # of a pixel of the picture, and of what is needed to make it
SPARE_BYTES = 16 << 20
LONG_PATH = 1000  # surfaces along a path, after which it will hardly end by itself


@dataclass(frozen=True, slots=True)
class Job:
    """A piece of work: a block of addresses, some pixels × consecutive samples."""

    pixels: Words  # (k,) row-major indices, rising
    first_sample: int
    samples: int

    @property
    def lanes(self) -> int:
        """Number of paths."""
        return self.pixels.size * self.samples

    def __str__(self) -> str:
        """Name the block in an error message."""
        last = self.first_sample + self.samples - 1
        return f"samples {self.first_sample} to {last} of {self.pixels.size} pixels from {self.pixels[0]} on"


@record
class JobResult:
    """What a piece of work came to."""

    radiance: Floats  # (3, samples, pixels)
    bad: Ints  # lanes whose radiance was not finite; it is 0 there
    rays: int  # queries of the accelerator
    seconds: float  # that it took its worker


@dataclass(frozen=True)
class Watch:
    """What ends waves under way, and what they tell of themselves; all workers share it."""

    stop: SharedNumber = field(default_factory=SharedNumber)
    surfaces: SharedNumber = field(default_factory=SharedNumber)  # along the longest path under way
    deadline: float = math.inf  # by `time.perf_counter`

    def look(self, surfaces: int, deadline: float) -> None:
        """Take note that a wave with a deadline of its own has come to its next surface.

        Raises
        ------
        Stopped
            If the wave is to end: somebody has asked for that, or its time is up.
        """
        self.surfaces.rise_to(surfaces)
        if self.stop.value or time.perf_counter() > deadline:
            raise Stopped


def trace_job(
    scene: CompiledScene,
    camera: Camera,
    sampler: Sampler,
    filter: Filter,
    estimate: Integrator,
    max_bounces: int,
    watch: Watch,
    job: Job,
) -> JobResult:
    """Take one wave of paths from the camera to its radiance.

    Raises
    ------
    Stopped
        If `watch` ends the wave between two bounces.
    """
    begin = time.perf_counter()
    k, n = job.pixels.size, job.samples
    deadline = watch.deadline if job.first_sample else max(watch.deadline, begin + PATIENCE)
    counter = WatchedAccelerator(scene.accelerator, watch, deadline)
    scene = replace(scene, accelerator=counter)
    paths = generate(scene, camera, sampler, np.tile(job.pixels, n), _samples(job), filter)
    radiance = estimate(scene, paths, sampler, max_bounces)
    bad = np.flatnonzero(~np.isfinite(radiance).all(0))
    radiance[:, bad] = 0
    return JobResult(radiance.reshape(3, n, k), bad, counter.rays, time.perf_counter() - begin)


def _samples(job: Job) -> Words:
    """Index of the sample of each path of a piece, (lanes,)."""
    if job.samples == 1:
        return broadcast(np.uint32(job.first_sample), job.pixels.size)
    samples = np.arange(job.first_sample, job.first_sample + job.samples, dtype=np.uint32)
    return np.repeat(samples, job.pixels.size)


class WatchedAccelerator:
    """An accelerator for one wave: hands rays on to another one, counts them, and ends the wave in time.

    Every bounce of every integrator asks for the nearest surfaces, so here a wave can be ended between
    two bounces, and no integrator needs to know of it.
    """

    def __init__(self, accelerator: Accelerator, watch: Watch, deadline: float) -> None:
        self.name = accelerator.name
        self.rays = 0
        self._accelerator, self._watch, self._deadline = accelerator, watch, deadline
        self._surfaces = 0

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hits of rays (3, n).

        Raises
        ------
        Stopped
            If the wave is to end.
        """
        self._watch.look(self._surfaces, self._deadline)
        self._surfaces += 1
        self.rays += origin.shape[1]
        return self._accelerator.closest(origin, direction, exclude_prim)

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Tell whether anything is in the way of rays (3, n)."""
        self.rays += origin.shape[1]
        return self._accelerator.occluded(origin, direction, distance, exclude_prim)


def split_jobs(pixels: Words, first: int, last: int, wave_size: Callable[[int], int]) -> Iterator[Job]:
    """Cut samples `first` to `last` of some pixels into pieces.

    Every pixel's samples come in order. No piece has more paths than `wave_size` says, told how many
    are left, when a sweep over the pixels begins.
    """
    while first < last:
        lanes = wave_size((last - first) * pixels.size)
        parts = -(-pixels.size // lanes)
        width = -(-pixels.size // parts)  # equal parts: a small wave costs almost as much as a large one
        depth = min(max(1, lanes // width), last - first)
        for start in range(0, pixels.size, width):
            yield Job(pixels[start : start + width], first, depth)
        first += depth


class Tally:
    """What all waves have come to so far.

    Raises
    ------
    SceneError
        If there is not enough memory for the film and the picture.

    Attributes
    ----------
    film
        The sums of their samples.
    bad
        Those of them that were not finite.
    rays
        Queries of the accelerator.
    """

    def __init__(self, width: int, height: int) -> None:
        pixels = width * height
        picture = PICTURE_BYTES * pixels + SPARE_BYTES
        check_memory(f"a picture of {width}x{height} pixels", FILM_BYTES * pixels + picture)
        self.film, self.bad, self.rays = Film(width, height), BadSamples(), 0
        self._reserve: Any = np.empty(picture, np.uint8)  # for the picture so far when memory has run out

    @property
    def samples(self) -> int:
        """Number of samples on the film."""
        return int(self.film.count.sum())

    def image(self, metadata: dict[str, Any]) -> Image:
        """Make a picture of what there is; no wave can be added after that."""
        self._reserve = None
        return self.film.image(metadata)

    def add(self, job: Job, wave: JobResult) -> None:
        """Add a wave, the next of its pixels."""
        self.film.add(job.pixels, wave.radiance)
        self.bad.note(job, wave)
        self.rays += wave.rays


class BadSamples:
    """Counts samples that were not finite; none is dropped in silence."""

    def __init__(self) -> None:
        self.count = 0
        self.first = ""

    def note(self, job: Job, wave: JobResult) -> None:
        """Count the bad lanes of a wave and remember the first of all."""
        if wave.bad.size and not self.count:
            sample, pixel = divmod(int(wave.bad[0]), job.pixels.size)
            self.first = f"pixel {job.pixels[pixel]}, sample {job.first_sample + sample}"
        self.count += wave.bad.size

    def report(self, image: Image) -> None:
        """Warn of bad samples in a picture.

        Raises
        ------
        RenderError
            If they are more than 1e-4 of all. It has the picture, where they count as black.
        """
        if not self.count:
            return
        samples = image.metadata["samples"]
        message = f"{self.count} of {samples} samples were not finite and count as black; first: {self.first}"
        if self.count > MAX_BAD_SAMPLES * samples:
            raise RenderError(message, image)
        warn_caller(message)

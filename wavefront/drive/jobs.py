"""The order of tracing: passes of a render, their jobs, the sizes of jobs, and the time."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import Floats, Ints, distinct
from ..camera import Camera
from ..core.plural import plural
from ..film.aov_samples import AovSamples
from ..film.film import MUCH_RARE, OUTLIERS, Film
from ..integrators.light_tracing import Splats
from ..sampling.tiles import Tiles, whole_tiles

MIN_SPP = 32  # before anything is decided by an error estimate
QUICK_SPP = 4  # likewise, for a picture that is denoised
EXACT = 1e-6  # squared error, relative to the greatest, below which a pixel does not count there
MOST_RARE = 0.9  # part of the squared error, from where on it counts as this part
DEEPEST = 8  # samples of a pixel that a job should have: the more, the less it costs to send and add sums
DEPTH_SHARE = 1 / 2  # of the samples so far, so that the pixels of a render that is ended differ by no more,
# and of those left, so that all workers end at about the same time
FIRST_WAVE = 4096  # lanes, while the speed is unknown and there is a time to keep
SMALL_WAVE = 1 << 16  # lanes; in smaller waves a path costs more
LARGE_WAVE = 1 << 17  # lanes; in larger waves it costs hardly less
LANES_AT_ONCE = 1 << 19  # lanes of all workers together where that is a wave for each: 400 MB
SMALLEST_WAVE = 64  # paths; without memory for as few there is an error
SHARE = 1 / 4  # largest job, as a part of the rest for each worker
MAX_JOB_SECONDS = 1.0  # seconds that a large job may take, for progress waits for it
GRACE = 1.1  # times the seconds that were given: when waves under way are discarded
SHORT, LONG = 1 / 60, 1 / 20  # parts of the time there is that a wave should take
SMOOTHING = 0.3  # weight of the latest wave in the expected cost of a path
SQUARE = 8  # pixels on each side of a square whose pixels get the same number of samples


@soa
class Pass:
    """Samples to take before the next decision."""

    pixels: Words  # (k,) row-major indices, rising
    first: int  # index of the first sample
    last: int  # one past that of the last


def passes(
    film: Film,
    spp: int,
    noise: float | None,
    square_of: Ints,
    begun: Pass | None = None,
    everywhere: bool = False,
) -> Iterator[Pass]:
    """Yield the passes of a render, one after the other; each decides by the film at that time.

    Without `noise` there is one pass. With it there are more while the estimated error of the
    picture is above `noise`, at 32, 48, 64, 96, 128 ... samples, for those squares of pixels
    whose own error is above it. A decision depends on the film alone, never on timing, so the
    picture is the same for any number of workers and any wave size.

    A square, not a pixel, is the unit, because samples that decide when to stop are no longer
    unbiased: a pixel that has not yet found its bright samples would look done. In the
    estimate of a square no pixel weighs much. Measured (benchmarks/adaptive_bias.py), with squares of 8 × 8
    pixels, the means of a Cornell box and of glass and metal are off by less than 0.1 %, and squares by
    0.3 %; with decisions per pixel by up to 0.6 %, and squares by 2 %.

    Where light is traced from the lights, too, all pixels get equally many samples: each of them brings a
    path that may reach any pixel.

    Where more than `MUCH_RARE` of the squared error rests on few samples, most pixels have not met its
    cause, and the estimate is too small. The render goes on then until the estimate is as much smaller.

    Parameters
    ----------
    square_of
        (pixels,) number of the square of each pixel.
    begun
        The pass with which a render begins that goes on from a checkpoint.
    everywhere
        Whether each pixel must have an error of `noise` at most, not the picture: a square gets more samples
        while one of its pixels has more.
    """
    pixels = np.arange(film.count.size, dtype=np.uint32)
    if noise is None:
        yield Pass(pixels, 0, spp)
        return
    if film.light is not None:
        square_of = np.zeros_like(square_of)
    sizes = np.maximum(np.bincount(square_of), 1)  # a window of a picture may have none of a square
    first = 0
    if begun is not None:
        pixels, first = begun.pixels, begun.first
    while pixels.size and first < spp:
        last = min(next_stop(first), spp)
        yield Pass(pixels, first, last)
        first = last
        error = film.relative_variance(0 if everywhere else OUTLIERS)
        # inf where noise**2 would be an error
        limit = noise * noise * _trust(film.rare_part(error))
        if (error.max() if everywhere else error.mean()) <= limit:
            return
        above = np.bincount(square_of, error > limit) > 0
        noisy = above if everywhere else np.bincount(square_of, error) / sizes > limit
        pixels = pixels[noisy[square_of[pixels]]]


def passes_until_clean(film: Film, spp: int, limit: float, begun: Pass | None = None) -> Iterator[Pass]:
    """Yield passes of all pixels, at 4, 6, 8, 12, 16 ... samples, until the picture is clean once denoised.

    It is when the mean error of lit pixels is at most `limit`. All of them count, also those of heavy tails,
    whose few bright samples a denoiser smears; but each by its error, as eyes see it, not by its square.
    docs/record/choices.md has the figures that tell the limit.

    Parameters
    ----------
    begun
        The pass with which a render begins that goes on from a checkpoint.
    """
    pixels = np.arange(film.count.size, dtype=np.uint32)
    first = 0 if begun is None else begun.first
    while first < spp:
        last = min(next_stop(first, QUICK_SPP), spp)
        yield Pass(pixels, first, last)
        first = last
        squared = film.relative_variance(0)
        lit = squared > squared.max() * EXACT
        trust = _trust(film.rare_part(squared))
        if not lit.any() or np.sqrt(squared[lit]).mean() <= limit * math.sqrt(trust):
            return


def _trust(rare: float | None) -> float:
    """Return the factor of squared errors to reach, given the part that is rare."""
    return 1 - min(rare, MOST_RARE) if rare is not None and rare > MUCH_RARE else 1.0


def unfinished(film: Film, step: Pass) -> Iterator[Pass]:
    """Yield the rest of a pass: a pass for each number of samples that its pixels have."""
    count = film.count[step.pixels]
    for done in distinct(count[count < step.last]):
        yield Pass(step.pixels[count == done], done, step.last)


def next_stop(samples: int, least: int = MIN_SPP) -> int:
    """Return the samples at the decision after that at `samples`: powers of two and halfway between."""
    if samples < least:
        return least
    power = 1 << (samples.bit_length() - 1)
    return power * 3 // 2 if samples < power * 3 // 2 else power * 2


@soa
class CameraJob:
    """Data that all jobs of one picture share.

    It travels with each job, so that workers that have been started can trace another view.
    """

    camera: Camera  # in the unit of the compiled scene
    deadline: float = math.inf  # when jobs under way are discarded, by `time.perf_counter`
    first_sample: int = 0  # index of the first sample of every pixel
    branches: int = 1  # ways in which a path goes on from its first surface
    reuse: bool = False  # pixels share paths, so those of a tile (sampling/tiles.py) belong in one job
    guided: bool = False  # by the table of the tracer

    @property
    def tiles(self) -> Tiles | None:
        """The tiles whose pixels share paths; None where none do."""
        return self.camera.tiles if self.reuse else None

    def parts(self, pixels: Words, width: int) -> Iterator[Words]:
        """Split pixels (k,) into parts of at most `width`, or of one tile where tiles stay whole."""
        if self.tiles is None:
            for start in range(0, pixels.size, width):
                yield pixels[start : start + width]
            return
        if pixels.size <= width:
            yield pixels
            return
        order, cuts = whole_tiles(self.camera.address(pixels), self.tiles)
        start = 0
        while start < pixels.size:
            fitting = int(np.searchsorted(cuts, start + width, side="right"))
            end = int(cuts[max(fitting - 1, 0)])
            if end <= start:
                end = int(cuts[fitting])
            yield pixels.take(np.sort(order[start:end]))
            start = end

    def squares(self) -> Ints:
        """Return the number of the square of each pixel, (pixels,): all pixels of one get samples together.

        Their side is `SQUARE` pixels. Where pixels share paths they are blocks of whole tiles.
        """
        width, height = self.camera.size
        pixels = np.arange(width * height, dtype=np.uint32)
        if self.tiles is not None:
            return self.tiles.block_of(self.camera.address(pixels))
        return pixels // width // SQUARE * np.intp(-(-width // SQUARE)) + pixels % width // SQUARE

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the time that is left as well: the clocks of two machines differ."""
        values = [getattr(self, field.name) for field in fields(self)]
        return _received, (values, self.deadline - time.perf_counter(), platform.node())


def _received(values: list[Any], left: float, machine: str) -> CameraJob:
    view = CameraJob(*values)
    if machine != platform.node():
        view.deadline = time.perf_counter() + left
    return view


@soa
class Job:
    """A block of samples: some pixels × consecutive samples."""

    view: CameraJob
    pixels: Words  # (k,) row-major indices, rising
    first_sample: int  # counted from that of the view
    samples: int
    wave_size: int | None = None  # paths that are traced at once; None for all

    @property
    def lanes(self) -> int:
        """Number of paths."""
        return self.pixels.size * self.samples

    @property
    def end(self) -> int:
        """One past the last sample, counted from the first of the view."""
        return self.first_sample + self.samples

    @property
    def lanes_at_once(self) -> int:
        """Number of paths that are traced at once."""
        return self.lanes if self.wave_size is None else min(self.lanes, self.wave_size)

    def waves(self) -> Iterator[Job]:
        """Yield the waves of the job, as jobs; the samples of every pixel come in order."""
        if self.lanes_at_once == self.lanes:
            yield self
            return
        depth = min(self.samples, self.lanes_at_once)
        parts = -(-self.pixels.size // (self.lanes_at_once // depth))
        for pixels in self.view.parts(self.pixels, -(-self.pixels.size // parts)):
            for first in range(self.first_sample, self.end, depth):
                yield Job(self.view, pixels, first, min(depth, self.end - first))

    def halves(self) -> tuple[Job, ...]:
        """Return jobs for parts of at most half the pixels, in smaller waves; a pixel or tile stays whole."""
        parts = self.view.parts(self.pixels, max(1, -(-self.pixels.size // 2)))
        wave_size = max(1, self.lanes_at_once // 2)
        return tuple(Job(self.view, pixels, self.first_sample, self.samples, wave_size) for pixels in parts)

    def __str__(self) -> str:
        """Name the block in an error message."""
        first, last = (self.view.first_sample + sample for sample in (self.first_sample, self.end - 1))
        return f"samples {first} to {last} of {plural(self.pixels.size, 'pixel')} from {self.pixels[0]} on"


@soa
class WaveResult:
    """The result of a wave of a job."""

    radiance: Floats  # (3, samples, pixels)
    bad: Ints  # lanes whose radiance was not finite; it is 0 there
    rays: int  # queries of the accelerator
    seconds: float  # that it took its worker
    layers: AovSamples | None = None  # None where no sampled AOV is asked for
    splats: Splats | None = None  # of as many paths from lights; None where none are traced


JobResult: TypeAlias = list[WaveResult]  # of each wave


def split_jobs(
    view: CameraJob,
    pixels: Words,
    first: int,
    last: int,
    job_size: Callable[[int], int],
    wave_size: int | None = None,
) -> Iterator[Job]:
    """Split samples `first` to `last` of some pixels into jobs.

    Every pixel's samples come in order. No job has more paths than `job_size` returns, which is given the
    number of paths left, when a sweep over the pixels begins; but jobs of one tile may, where tiles stay
    whole. The last pixel is in the last job of a sweep. Waves of a job have at most `wave_size` paths.
    """
    while first < last:
        lanes = job_size((last - first) * pixels.size)
        depth = min(max(1, int(min(first, last - first) * DEPTH_SHARE)), DEEPEST, lanes)
        parts = -(-pixels.size * depth // lanes)
        width = -(-pixels.size // parts)  # equal parts: a small wave costs almost as much as a large one
        depth = min(max(1, lanes // width), last - first)
        for chunk in view.parts(pixels, width):
            yield Job(view, chunk, first, depth, wave_size)
        first += depth


def default_wave_size(workers: int) -> int:
    """Return the lanes of the largest wave that suits a number of workers."""
    return min(max(LANES_AT_ONCE // workers, SMALL_WAVE), LARGE_WAVE)


class Scheduler:
    """Sizes jobs, and admits jobs for as long as they will be done in time.

    Parameters
    ----------
    begin
        When the render began, by `time.perf_counter`.
    seconds
        Time that it may take; None for any.
    wave_size
        Lanes of the largest wave; None for a size that suits the number of workers.
    workers
        Waves that are traced at once.
    branches
        Lanes that a path may become.
    waves_per_job
        How many waves of the largest size a job may have where there is no time to keep.
    """

    def __init__(
        self,
        begin: float,
        seconds: float | None,
        wave_size: int | None,
        workers: int,
        branches: int = 1,
        waves_per_job: int = 1,
    ) -> None:
        self.time_up = False  # jobs were not admitted any more
        self._begin, self._seconds, self._workers = begin, seconds, workers
        wave_size = default_wave_size(workers) if wave_size is None else wave_size
        self._largest = max(1, wave_size // branches)
        self._least = min(self._largest, max(1, SMALL_WAVE // branches))
        self._size = min(FIRST_WAVE, self._largest)  # where there is a time to keep
        self._waves_per_job = waves_per_job
        self._under_way = 0  # paths
        self._cost = 0.0  # expected seconds of a worker per path

    @property
    def elapsed(self) -> float:
        """Seconds since the render began."""
        return time.perf_counter() - self._begin

    @property
    def spent(self) -> float:
        """Seconds that the render has used: all it was given once there was no time for a further job."""
        return max(self.elapsed, self._seconds or 0.0) if self.time_up else self.elapsed

    @property
    def deadline(self) -> float:
        """When waves under way are discarded, by `time.perf_counter`."""
        return math.inf if self._seconds is None else self._begin + GRACE * self._seconds

    @property
    def wave_size(self) -> int:
        """How many paths a wave may have."""
        return self._largest

    def job_size(self, left: int) -> int:
        """Return how many paths a job may have.

        Large jobs cost less per path. But no worker should have much to do when the others are done
        with all that are `left`, or when the time is up, and nobody should have to wait long for a job.
        """
        short = max(self._least, int(MAX_JOB_SECONDS / self._cost)) if self._cost else self._least
        if self._seconds is not None:
            return min(short, self._size)
        largest = self._largest * self._waves_per_job
        return min(largest, short, max(self._least, int(left * SHARE / self._workers)))

    def halve(self, paths: int) -> bool:
        """Have no more waves of this size, for which there was no memory; False if they are small."""
        if paths <= SMALLEST_WAVE:
            return False
        self._largest = max(1, min(self._largest, paths // 2))
        self._least, self._size = (min(size, self._largest) for size in (self._least, self._size))
        return True

    def in_time(self, jobs: Iterator[Job]) -> Iterator[Job]:
        """Yield the jobs for as long as they will be done in time.

        The first sample of every pixel is always taken.
        """
        for job in jobs:
            self.time_up = job.first_sample > 0 and self._late(job.lanes)
            if self.time_up:
                return
            self._under_way += job.lanes
            yield job

    def job_done(self, job: Job, spent: float) -> None:
        """Record that a job is done, and how many seconds it took its worker."""
        self._under_way -= job.lanes
        cost = spent / job.lanes
        self._cost = (1 - SMOOTHING) * self._cost + SMOOTHING * cost if self._cost else cost
        if self._seconds is None:
            return
        # larger waves cost less per path, smaller ones end nearer to the time
        if spent < SHORT * self._seconds:
            self._size = max(self._size, min(self._largest, 2 * job.lanes))
        elif spent > LONG * self._seconds:
            self._size = min(self._size, max(1, int(job.lanes * LONG * self._seconds / spent)))

    def _late(self, lanes: int) -> bool:
        """Return True if `lanes` more paths after those under way would be done too late."""
        if self._seconds is None:
            return False
        wait = (self._under_way + lanes) * self._cost / self._workers
        return self.elapsed + wait > self._seconds

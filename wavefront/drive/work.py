"""The work of a render: passes become jobs as long as there is time, and jobs become samples."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from itertools import chain
from typing import TypeAlias

from ..core.errors import RenderError
from ..core.interrupt import end_with_parent
from ..core.progress import Bar, Progress
from ..core.shared import SharedInt, Stopped
from .accumulator import Accumulator
from .adaptive import Pass, passes, unfinished
from .inline import AnyPool
from .jobs import CameraJob, Job, JobResult, split_jobs

FIRST_WAVE = 4096  # lanes, while the speed is unknown and there is a time to keep
SMALL_WAVE = 1 << 16  # lanes; in smaller waves a path costs more
LARGE_WAVE = 1 << 17  # lanes; in larger waves it costs hardly less
LANES_AT_ONCE = 1 << 19  # lanes of all workers together where that is a wave for each: 400 MB
SMALLEST_WAVE = 64  # paths; without memory for as few there is an error
SHARE = 1 / 4  # part of what is left for each worker that a job may be
MAX_JOB_SECONDS = 1.0  # seconds that a large job may take, for progress waits for it
GRACE = 1.1  # times the seconds that were given: when waves under way are discarded
SHORT, LONG = 1 / 60, 1 / 20  # parts of the time there is that a wave should take
SMOOTHING = 0.3  # weight of the latest wave in what a path is expected to cost


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
        Lanes of the largest wave; None for what suits the number of workers.
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


PassSplitter: TypeAlias = Callable[[Pass], Iterable[Pass]]


class RenderLoop:
    """The loop that renders one view.

    Parameters
    ----------
    view
        What is rendered.
    accumulator
        Takes the results.
    scheduler
        Sizes the jobs and keeps the time.
    spp, noise, seconds, progress
        As for `render`; `spp` is the most samples that a pixel may get.
    quick
        Whether the error is looked at early, as the picture will be denoised.
    end
        How the picture ends by itself, for the bar; None where that was asked for.
    begun
        The pass under way, if the accumulator has samples of an earlier part of the render.

    Attributes
    ----------
    stopped
        Whether jobs under way were discarded, because the stop flag was set or the time was up.
    interrupted
        Whether the user's function or signal handler raised KeyboardInterrupt.
    failure
        The error that ended the loop, if one did.
    step
        The pass under way; None before the first one.
    """

    def __init__(
        self,
        view: CameraJob,
        accumulator: Accumulator,
        scheduler: Scheduler,
        *,
        spp: int,
        noise: float | None,
        seconds: float | None,
        progress: Progress,
        begun: Pass | None = None,
        quick: bool = False,
        end: str | None = None,
    ) -> None:
        self.view, self.accumulator, self.scheduler = view, accumulator, scheduler
        self.spp, self.step = spp, begun
        self._noise, self._seconds, self._progress, self._quick = noise, seconds, progress, quick
        self._end = end
        self.stopped = self.interrupted = False
        self.failure: Exception | None = None

    def sweeps(
        self,
        pool: AnyPool,
        surfaces: SharedInt,
        wave_done: Callable[[], object],
        split: PassSplitter,
    ) -> Generator[bool]:
        """Trace everything; yield when all pixels of a pass have the same number of samples.

        Nothing is yielded after the last jobs.

        Parameters
        ----------
        pool
            Traces the jobs.
        surfaces
            How many surfaces the longest path under way has met.
        wave_done
            Called when a job is done, and every now and then while none is.
        split
            Splits a pass into shorter ones.

        Yields
        ------
        bool
            True at the end of a pass, or of a shorter one.
        """
        most = self.accumulator.film.count.size * self.spp
        with Bar(self._progress, most, self._seconds, self._end) as bar:

            def waiting() -> None:
                end_with_parent()
                bar.wait(surfaces.value, self.scheduler.elapsed)
                wave_done()

            try:
                film = self.accumulator.film
                if film.count.any():  # those of an earlier part of the render
                    bar.advance(self.accumulator.samples, self.scheduler.elapsed)
                squares, everywhere = self.view.squares(), self.view.camera.sensor is not None
                for step in passes(film, self.spp, self._noise, squares, self.step, everywhere, self._quick):
                    self.step = step
                    if step.first:
                        yield True
                    parts = [part for rest in unfinished(film, step) for part in split(rest)]
                    jobs = self.scheduler.in_time(self._jobs(parts))
                    for job, result in self._results(pool, jobs, waiting):
                        self.accumulator.add(job, result)
                        self.scheduler.job_done(job, sum(wave.seconds for wave in result))
                        wave_done()
                        surfaces.reset()
                        bar.advance(job.lanes, self.scheduler.elapsed)
                        if job.pixels[-1] == step.pixels[-1] and job.end < step.last:
                            yield any(job.end == part.last for part in parts)
                    if self.scheduler.time_up:
                        return
            except Stopped:
                self.stopped = True
            except KeyboardInterrupt:
                self.interrupted = True
            except (MemoryError, RenderError) as error:
                self.failure = error

    def _results(
        self,
        pool: AnyPool,
        jobs: Iterator[Job],
        waiting: Callable[[], None],
    ) -> Iterator[tuple[Job, JobResult]]:
        """Yield jobs with their results, in order; those for which there was no memory are halved.

        Raises
        ------
        MemoryError
            If there is none for a few paths either.
        """
        given: deque[Job] = deque()  # to the pool; their results have not come yet

        def remember(jobs: Iterator[Job]) -> Iterator[Job]:
            try:
                for job in jobs:
                    given.append(job)
                    yield job
            except MemoryError as error:  # no further jobs would come
                raise RenderError(f"out of memory: {error}") from error

        while True:
            try:
                for job, result in pool.run(remember(jobs), waiting):
                    given.popleft()
                    yield job, result
                return
            except MemoryError:
                pool.discard()
                if not given or not self.scheduler.halve(max(job.lanes_at_once for job in given)):
                    raise
            halves = [half for job in given for half in job.halves()]
            given.clear()
            jobs = chain(halves, jobs)

    def _jobs(self, parts: Iterable[Pass]) -> Iterator[Job]:
        for part in parts:
            scheduler = self.scheduler
            yield from split_jobs(
                self.view, part.pixels, part.first, part.last, scheduler.job_size, scheduler.wave_size
            )


def undivided(step: Pass) -> Iterator[Pass]:
    """Yield a pass as it is."""
    yield step


def doubling(step: Pass) -> Iterator[Pass]:
    """Split a pass where the number of samples of a pixel is a power of two."""
    first = step.first
    while first < step.last:
        last = min(step.last, 1 << first.bit_length())
        yield Pass(step.pixels, first, last)
        first = last

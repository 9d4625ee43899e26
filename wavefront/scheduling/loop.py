"""The loop of a render: passes become jobs, and the results of the jobs go to the accumulator."""

from __future__ import annotations

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
from .scheduler import Scheduler

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

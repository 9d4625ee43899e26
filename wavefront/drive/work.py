"""The work on a picture: passes become jobs as long as there is time, and jobs become samples."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from itertools import chain
from typing import TypeAlias

from ..core.errors import RenderError
from ..core.interrupt import end_with_parent
from ..core.progress import Bar
from ..core.shared import Stopped
from .inline import AnyPool
from .jobs import Job, JobResult, Pass, passes, passes_until_clean, split_jobs, unfinished
from .picture import Picture
from .tracing import WaveMonitor

PassSplitter: TypeAlias = Callable[[Pass], Iterable[Pass]]


class Work:
    """The work on one picture, which can be left and gone on with.

    Parameters
    ----------
    picture
        Takes the samples.
    pool
        Traces the jobs.
    monitor
        The data that workers share with the session.
    wave_done
        Called when a job is done, and every now and then while none is.

    Attributes
    ----------
    stopped
        Whether jobs under way were discarded, because the stop flag was set or the time was up.
    interrupted
        Whether the user's function or signal handler raised KeyboardInterrupt.
    failure
        The error that ended the work, if one did.
    """

    def __init__(
        self, picture: Picture, pool: AnyPool, monitor: WaveMonitor, wave_done: Callable[[], object]
    ) -> None:
        self._picture, self._pool, self._monitor, self._wave_done = picture, pool, monitor, wave_done
        self._sweeps: Generator[bool] | None = None
        self.stopped = self.interrupted = False
        self.failure: Exception | None = None

    @property
    def time_up(self) -> bool:
        """Whether the work ended, or jobs were not begun, as the time was up; also after a stop."""
        return self.stopped or self._picture.scheduler.time_up

    def sweeps(self, split: PassSplitter) -> Generator[bool]:
        """Return the sweeps that were begun, or begin them.

        A sweep ends when all pixels of a pass have the same number of samples. Nothing is yielded after the
        last jobs.

        Parameters
        ----------
        split
            Splits a pass into shorter ones.

        Yields
        ------
        bool
            True at the end of a pass, or of a shorter one.
        """
        if self._sweeps is None:
            self._sweeps = self._all_sweeps(split)
        return self._sweeps

    def discard(self) -> None:
        """End the work."""
        if self._sweeps is not None:
            self._sweeps.close()

    def _all_sweeps(self, split: PassSplitter) -> Generator[bool]:
        picture, settings = self._picture, self._picture.plan.settings
        values, most = settings.values, picture.film.count.size * settings.max_spp
        try:
            with Bar(values["progress"], most, values["seconds"], settings.end) as bar:
                if picture.samples:  # those of an earlier part of the render
                    bar.advance(picture.samples, picture.scheduler.elapsed)
                for step in self._passes():
                    picture.step = step
                    if step.first:
                        yield True
                    yield from self._sweeps_of(step, split, bar)
                    if picture.scheduler.time_up:
                        return
        except Stopped:
            self.stopped = True
        except KeyboardInterrupt:
            self.interrupted = True
        except (MemoryError, RenderError) as error:
            self.failure = error

    def _passes(self) -> Iterator[Pass]:
        """Return the passes of the picture, one after the other."""
        picture, settings = self._picture, self._picture.plan.settings
        film, noise = picture.film, settings.values["noise"]
        if settings.quick and noise is not None:
            return passes_until_clean(film, settings.max_spp, noise, picture.step)
        everywhere = picture.camera.sensor is not None
        return passes(film, settings.max_spp, noise, picture.view.squares(), picture.step, everywhere)

    def _sweeps_of(self, step: Pass, split: PassSplitter, bar: Bar) -> Iterator[bool]:
        """Put the samples of a pass on the film; yield at the end of each sweep but the last."""
        picture, scheduler, surfaces = self._picture, self._picture.scheduler, self._monitor.surfaces
        portions = [portion for rest in unfinished(picture.film, step) for portion in split(rest)]

        def waiting() -> None:
            end_with_parent()
            bar.wait(surfaces.value, scheduler.elapsed)
            self._job_done()

        for job, result in self._results(scheduler.in_time(self._jobs(portions)), waiting):
            picture.add(job, result)
            scheduler.job_done(job, sum(wave.seconds for wave in result))
            self._job_done()
            surfaces.reset()
            bar.advance(job.lanes, scheduler.elapsed)
            if job.pixels[-1] == step.pixels[-1] and job.end < step.last:
                yield any(job.end == part.last for part in portions)

    def _job_done(self) -> None:
        """Make the geometric AOVs while workers trace the first jobs; they are stopped as these are."""
        self._picture.geometric_aovs(self._monitor)
        self._wave_done()

    def _jobs(self, parts: Iterable[Pass]) -> Iterator[Job]:
        view, scheduler = self._picture.view, self._picture.scheduler
        for portion in parts:
            yield from split_jobs(
                view, portion.pixels, portion.first, portion.last, scheduler.job_size, scheduler.wave_size
            )

    def _results(self, jobs: Iterator[Job], waiting: Callable[[], None]) -> Iterator[tuple[Job, JobResult]]:
        """Yield jobs with their results, in order; those for which there was no memory are halved.

        Raises
        ------
        MemoryError
            If there is none for a few paths either.
        """
        queue: deque[Job] = deque()  # to the pool; their results have not come yet

        def remember(jobs: Iterator[Job]) -> Iterator[Job]:
            try:
                for job in jobs:
                    queue.append(job)
                    yield job
            except MemoryError as error:  # no further jobs would come
                raise RenderError(f"out of memory: {error}") from error

        while True:
            try:
                for job, result in self._pool.run(remember(jobs), waiting):
                    queue.popleft()
                    yield job, result
                return
            except MemoryError:
                self._pool.discard()
                if not queue or not self._picture.scheduler.halve(max(job.lanes_at_once for job in queue)):
                    raise
            halves = [half for job in queue for half in job.halves()]
            queue.clear()
            jobs = chain(halves, jobs)


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

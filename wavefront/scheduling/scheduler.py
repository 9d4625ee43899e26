"""The scheduler: how large jobs are, and whether there is time for more."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

from .jobs import Job

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

"""When a render is done: after so many samples, at a noise level, or when its time is up."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .film import Film
from .state import Words
from .vec import Ints
from .work import Piece

MIN_SPP = 32  # before anything is decided by an error estimate
TILE = 8  # pixels; decisions are made for squares of this side
FIRST_WAVE = 4096  # lanes, while the speed is unknown and there is a time to keep
SMALL_WAVE = 1 << 16  # lanes; in smaller waves a path costs more
LARGE_WAVE = 1 << 17  # lanes; in larger waves it costs hardly less
AT_ONCE = 1 << 19  # lanes of all workers together where that is a wave for each: 400 MB
SHARE = 1 / 4  # part of what is left for each worker that a wave may be
PATIENCE = 1.0  # seconds that a large wave may take, for progress waits for it
GRACE = 1.1  # times the seconds that were given: when waves under way are discarded
SHORT, LONG = 1 / 60, 1 / 20  # parts of the time there is that a wave should take
SMOOTHING = 0.3  # weight of the latest wave in what a path is expected to cost


@dataclass(frozen=True, slots=True)
class Pass:
    """Samples to take before the next decision."""

    pixels: Words  # (k,) row-major indices, rising
    first: int  # index of the first sample
    last: int  # one past that of the last


def passes(film: Film, spp: int, noise: float | None) -> Iterator[Pass]:
    """Yield what is to be done, one pass after the other; each decides by what is on the film then.

    Without `noise` there is one pass. With it there are more while the estimated error of the
    picture is above `noise`, at 32, 48, 64, 96, 128 ... samples, for those tiles of 8 × 8 pixels
    whose own error is above it. A decision depends on the film alone, never on timing, so the
    picture is the same for any number of workers and any wave size.

    A tile, not a pixel, is the unit, because samples that decide when to stop are no longer
    unbiased: a pixel that has not yet found its bright samples would look done. In the
    estimate of a tile no pixel weighs much. Measured (benchmarks/adaptive_bias.py) the means of a
    Cornell box and of glass and metal are off by less than 0.1 %, and blocks of 8 × 8 pixels by 0.3 %;
    with decisions per pixel by up to 0.6 %, and blocks by 2 %.
    """
    pixels = np.arange(film.count.size, dtype=np.uint32)
    if noise is None:
        yield Pass(pixels, 0, spp)
        return
    tile_of = _tiles(*film.size)
    sizes = np.bincount(tile_of)
    first = 0
    while pixels.size and first < spp:
        last = min(next_stop(first), spp)
        yield Pass(pixels, first, last)
        first = last
        error = film.relative_variance()
        if error.mean() <= noise**2:
            return
        noisy = np.bincount(tile_of, error) / sizes > noise**2
        pixels = pixels[noisy[tile_of[pixels]]]


def next_stop(samples: int) -> int:
    """Number of samples at the decision after that at `samples`: powers of two and halfway between."""
    if samples < MIN_SPP:
        return MIN_SPP
    power = 1 << (samples.bit_length() - 1)
    return power * 3 // 2 if samples < power * 3 // 2 else power * 2


def _tiles(width: int, height: int) -> Ints:
    """Number of the tile of each pixel, (pixels,)."""
    across = -(-width // TILE)
    rows, columns = np.arange(height) // TILE, np.arange(width) // TILE
    return (rows[:, None] * across + columns).reshape(-1)


class Clock:
    """Hands out work as long as it will be done in time; sizes waves to fit.

    Parameters
    ----------
    begin
        When the render began, by `time.perf_counter`.
    seconds
        Time that it may take; None for any.
    wave_size
        Lanes of the largest wave; None for what suits so many workers.
    workers
        Waves that are traced at once.
    branches
        Lanes that a path may become.
    """

    def __init__(
        self, begin: float, seconds: float | None, wave_size: int | None, workers: int, branches: int = 1
    ) -> None:
        self.up = False  # work was turned away, or discarded
        self._begin, self._seconds, self._workers = begin, seconds, workers
        if wave_size is None:
            wave_size = min(max(AT_ONCE // workers, SMALL_WAVE), LARGE_WAVE)
        self._largest = max(1, wave_size // branches)
        self._least = min(self._largest, max(1, SMALL_WAVE // branches))
        self._size = min(FIRST_WAVE, self._largest)  # where there is a time to keep
        self._under_way = 0  # paths
        self._cost = 0.0  # expected seconds of a worker per path

    @property
    def elapsed(self) -> float:
        """Seconds since the render began."""
        return time.perf_counter() - self._begin

    @property
    def deadline(self) -> float:
        """When waves under way are discarded, by `time.perf_counter`."""
        return math.inf if self._seconds is None else self._begin + GRACE * self._seconds

    def wave_size(self, left: int) -> int:
        """Return how many paths a wave may have.

        Large waves cost less per path. But no worker should have much to do when the others are done,
        with all that are `left` or when the time is up, and nobody should have to wait for one.
        """
        patience = max(self._least, int(PATIENCE / self._cost)) if self._cost else self._least
        if self._seconds is not None:
            return min(patience, self._size)
        return min(self._largest, patience, max(self._least, int(left * SHARE / self._workers)))

    def in_time(self, pieces: Iterator[Piece]) -> Iterator[Piece]:
        """Pass on pieces for as long as they will be done in time.

        The first sample of every pixel is always taken.
        """
        for piece in pieces:
            self.up = piece.first_sample > 0 and self._late(piece.lanes)
            if self.up:
                return
            self._under_way += piece.lanes
            yield piece

    def note(self, piece: Piece, spent: float) -> None:
        """Take note that a piece is done, and how many seconds it took its worker."""
        self._under_way -= piece.lanes
        cost = spent / piece.lanes
        self._cost = (1 - SMOOTHING) * self._cost + SMOOTHING * cost if self._cost else cost
        if self._seconds is None:
            return
        # larger waves cost less per path, smaller ones end nearer to the time
        if spent < SHORT * self._seconds:
            self._size = max(self._size, min(self._largest, 2 * piece.lanes))
        elif spent > LONG * self._seconds:
            self._size = min(self._size, max(1, int(piece.lanes * LONG * self._seconds / spent)))

    def _late(self, lanes: int) -> bool:
        """Tell whether `lanes` more paths after those under way would come too late."""
        if self._seconds is None:
            return False
        wait = (self._under_way + lanes) * self._cost / self._workers
        return self.elapsed + wait > self._seconds

"""The passes of a render: which pixels get more samples, until all have enough or the noise is low enough."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import Ints, distinct
from ..film.film import MUCH_RARE, OUTLIERS, Film

MIN_SPP = 32  # before anything is decided by an error estimate
QUICK_SPP = 4  # likewise, for a picture that is denoised
EXACT = 1e-6  # squared error, relative to the greatest, below which a pixel does not count there
MOST_RARE = 0.9  # part of the squared error, from where on it counts as this part


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
    quick: bool = False,
) -> Iterator[Pass]:
    """Yield what is to be done, one pass after the other; each decides by what is on the film then.

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

    Where more than `MUCH_RARE` of the squared error rests on few samples, most pixels have not met what makes
    the error, and the estimate is too small. The render goes on then until the estimate is as much smaller.

    Parameters
    ----------
    square_of
        (pixels,) number of the square of each pixel.
    begun
        The pass with which a render begins that goes on from a checkpoint.
    everywhere
        Whether each pixel must have an error of `noise` at most, not the picture: a square gets more samples
        while one of its pixels has more.
    quick
        Whether decisions begin at `QUICK_SPP`. Then all pixels get equally many samples.
    """
    pixels = np.arange(film.count.size, dtype=np.uint32)
    if noise is None:
        yield Pass(pixels, 0, spp)
        return
    if film.light is not None or quick:
        square_of = np.zeros_like(square_of)
    sizes = np.maximum(np.bincount(square_of), 1)  # a window of a picture may have none of a square
    first = 0
    if begun is not None:
        pixels, first = begun.pixels, begun.first
    while pixels.size and first < spp:
        last = min(next_stop(first, QUICK_SPP if quick else MIN_SPP), spp)
        yield Pass(pixels, first, last)
        first = last
        error = film.relative_variance(0 if everywhere else OUTLIERS)
        if quick:
            noisy = error > error.max() * EXACT
            error = error[noisy] if noisy.any() else error
        # inf where noise**2 would be an error
        limit = noise * noise * _trust(film.rare_part(error))
        if (error.max() if everywhere else error.mean()) <= limit:
            return
        if quick:
            continue
        above = np.bincount(square_of, error > limit) > 0
        noisy = above if everywhere else np.bincount(square_of, error) / sizes > limit
        pixels = pixels[noisy[square_of[pixels]]]


def _trust(rare: float | None) -> float:
    """Return by what squared errors that are asked for are multiplied, given the part that is rare."""
    return 1 - min(rare, MOST_RARE) if rare is not None and rare > MUCH_RARE else 1.0


def unfinished(film: Film, step: Pass) -> Iterator[Pass]:
    """Yield what is left of a pass: a pass for each number of samples that its pixels have."""
    count = film.count[step.pixels]
    for done in distinct(count[count < step.last]):
        yield Pass(step.pixels[count == done], done, step.last)


def next_stop(samples: int, least: int = MIN_SPP) -> int:
    """Return the samples at the decision after that at `samples`: powers of two and halfway between."""
    if samples < least:
        return least
    power = 1 << (samples.bit_length() - 1)
    return power * 3 // 2 if samples < power * 3 // 2 else power * 2

"""The accumulator adds up the results of jobs, and makes the picture so far from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ..arrays.vec import Bytes
from ..core.errors import RenderError, warn_caller
from ..film.aov_names import aov_of
from ..film.film import Film
from ..film.light_sums import LightSums
from ..film.picture_sums import empty_sums
from ..film.sums import bytes_per_pixel
from ..image.image import Image, film_image, last_film_image
from ..integrators.light_tracing import Splats
from .jobs import Job, JobResult, WaveResult

MAX_BAD_SAMPLES = 1e-4  # part of all samples that may be lost to NaN before it is an error
PICTURE_BYTES = 108  # of a pixel of the picture, and of what is needed to make it
AOV_BYTES = 8  # of a pixel and channel of an AOV and its error
SPARE_BYTES = 16 << 20


def picture_memory(size: Sequence[int], layers: Sequence[str] = (), light_tracing: bool = False) -> int:
    """Return how many bytes the sums of samples, and the picture of them, need.

    Parameters
    ----------
    size
        (width, height)
    layers
        The sampled AOVs, those with a key by it, such as "light_groups.sun"; of up to 127 samples.
    light_tracing
        Whether there are paths from lights, too.
    """
    sums = _bytes_of_sums(tuple(layers), light_tracing)
    picture = PICTURE_BYTES + AOV_BYTES * sum(aov_of(name).channels for name in layers)
    return (sums + picture) * size[0] * size[1] + SPARE_BYTES


@cache
def _bytes_of_sums(layers: tuple[str, ...], light_tracing: bool) -> int:
    """Return how many bytes each pixel takes of the sums."""
    return bytes_per_pixel(lambda pixels: empty_sums((pixels, 1), layers, light_tracing))


class Accumulator:
    """Sums over all jobs that are done; `make_budget` checks before that there is memory for them.

    Parameters
    ----------
    size, layers, light_tracing
        As for `picture_memory`.

    Attributes
    ----------
    sums
        The sums of their samples, and of their sampled AOVs.
    bad
        Those of them that were not finite.
    rays
        Queries of the accelerator.
    """

    def __init__(self, size: Sequence[int], layers: Sequence[str] = (), light_tracing: bool = False) -> None:
        self.sums = empty_sums(size, layers, light_tracing)
        self.bad, self.rays = BadSamples(), 0
        # for the picture so far when memory has run out
        self._reserve: Bytes | None = np.empty(PICTURE_BYTES * size[0] * size[1] + SPARE_BYTES, np.uint8)

    @property
    def film(self) -> Film:
        """The film."""
        return self.sums.film

    @property
    def samples(self) -> int:
        """Number of samples on the film."""
        return int(self.film.count.sum())

    def add(self, job: Job, result: JobResult) -> None:
        """Add the result of a job, the next of its pixels."""
        for wave, of_wave in zip(job.waves(), result, strict=True):
            self._add_wave(wave, of_wave)

    def _add_wave(self, wave: Job, result: WaveResult) -> None:
        self.film.add(wave.pixels, result.radiance, result.bad)
        if self.film.light is not None and result.splats is not None:
            self._add_splats(self.film.light, wave, result.splats)
        if self.sums.layers is not None:
            assert result.layers is not None
            self.sums.layers.add(
                wave.pixels, result.layers, result.radiance, most=wave.end, dropped=result.bad
            )
        self.bad.count_in(wave, result)
        self.rays += result.rays

    def _add_splats(self, sums: LightSums, wave: Job, splats: Splats) -> None:
        """Add what the paths from lights of a wave bring, sample by sample."""
        first, number = wave.view.first_sample + wave.first_sample, splats.path // wave.pixels.size
        for sample in range(wave.samples):
            some = splats.take(np.flatnonzero(number == sample))
            sums.add(first + sample, wave.pixels.size, some.pixel, some.radiance)

    def release_reserve(self) -> None:
        """Free the memory that is kept for the last picture."""
        self._reserve = None

    def image(self, metadata: dict[str, Any], keep_sums: bool = False) -> Image:
        """Return the picture so far; numbers of samples, rays and noise join the metadata.

        With `keep_sums` it can be merged; then no more samples must be added.
        """
        return film_image(self.sums, {**metadata, **self.counts()}, keep_sums)

    def last_image(self, metadata: dict[str, Any]) -> Image:
        """Return the picture, as `image` does, and free the sums that it is made from on the way."""
        return last_film_image(self.sums, {**metadata, **self.counts()})

    def counts(self) -> dict[str, Any]:
        """Return numbers of samples and rays, for the metadata of the picture."""
        return {
            "spp": self.samples / self.film.count.size,
            "samples": self.samples,
            "rays": self.rays,
            "bad_samples": self.bad.count,
        }

    def state(self) -> dict[str, Any]:
        """Return what is counted beside the sums, for a checkpoint."""
        return {"rays": self.rays, "bad": self.bad.count, "first_bad": list(self.bad.first)}

    def count_earlier(self, state: Mapping[str, Any]) -> None:
        """Take over what `state` returned in an earlier part of the render."""
        self.rays, self.bad.count = state["rays"], state["bad"]
        self.bad.first = state["first_bad"][0], state["first_bad"][1]


class BadSamples:
    """Counts samples that were not finite; none is dropped in silence."""

    def __init__(self) -> None:
        self.count = 0
        self.first = 0, 0  # pixel and sample, if there is any

    def count_in(self, job: Job, result: WaveResult) -> None:
        """Count the bad lanes of a wave, which is a job of its own, and remember the first of all."""
        if result.bad.size and not self.count:
            sample, pixel = divmod(int(result.bad[0]), job.pixels.size)
            sample += job.view.first_sample + job.first_sample
            self.first = int(job.pixels[pixel]), sample
        self.count += result.bad.size

    def report(self, image: Image, cause_of: Callable[[int, int], str]) -> None:
        """Warn of bad samples in a picture; `cause_of` a pixel and a sample returns where the value is from.

        Raises
        ------
        RenderError
            If they are more than 1e-4 of all. It has the picture, where they are left out.
        """
        if not self.count:
            return
        samples = image.metadata["samples"]
        pixel, sample = self.first
        cause = cause_of(pixel, sample)
        first = f"pixel {pixel}, sample {sample}" + (f", {cause}" if cause else "")
        message = f"{self.count} of {samples} samples were not finite and were dropped; first: {first}"
        if self.count > MAX_BAD_SAMPLES * samples:
            raise RenderError(message, image)
        warn_caller(message)

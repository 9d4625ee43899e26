"""What a render ends with: errors that have the picture so far, and warnings about the picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..core.counted import counted
from ..core.errors import Interrupted, RenderError, warn_caller
from ..image import Image
from ..integrators import Integrator
from ..scene import Scene

LONG_PATH = 1000  # surfaces along a path, after which it will hardly end by itself
FEWEST_PIXELS = 256  # smaller pictures are measurements and are not checked for being black or white
MUCH_LIGHT = 0.02  # part of the picture's light
DIM = 1e-3  # radiance below which a picture looks black


@contextmanager
def setup_errors() -> Iterator[None]:
    """Turn Ctrl-C and a lack of memory before there is a picture into the errors of a render."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted("interrupted while the scene was set up: there is no picture yet") from None
    except MemoryError as error:
        raise RenderError(f"out of memory while the scene was set up: {error}") from error


def interrupted(image: Image, spp: int | None, go_on: str = "") -> Interrupted:
    """Return the error that says how much of `spp` samples per pixel there is; None if that is open.

    `go_on` says how the render goes on, if it does.
    """
    if not image.metadata["samples"]:
        return Interrupted("interrupted: there is no picture yet")
    found = image.metadata["spp"]
    there = f"{found:.4g} of " + counted(spp, "sample") if spp else counted(found, "sample", form=".4g")
    return Interrupted(f"interrupted: the picture so far has {there} per pixel{go_on}", image)


def is_black_or_white(image: Image) -> bool:
    """Return whether every pixel is black or almost, or every pixel is above 1."""
    if image.rgb.shape[0] * image.rgb.shape[1] < FEWEST_PIXELS:
        return False
    return bool(image.rgb.max() < DIM or image.rgb.min() > 1)


def render_error(failure: Exception, image: Image) -> RenderError:
    """Return the error that says why a render could not go on, with the picture so far."""
    message = str(failure)
    if isinstance(failure, MemoryError):
        message = f"out of memory: {failure}; use fewer workers, a smaller wave_size or a smaller picture"
    return RenderError(message, _picture_so_far(image))


def _picture_so_far(image: Image) -> Image | None:
    return image if image.metadata["samples"] else None


def check_first_samples(image: Image, seconds: float | None, surfaces: int) -> None:
    """Warn of pixels without a sample when the time was up, or raise if there is nothing else.

    `surfaces` is how many a path under way had met.
    """
    assert image.counts is not None
    without = int((image.counts == 0).sum())
    why = (
        f"when seconds={seconds:g} were over, a wave of paths was under way that had met {surfaces} "
        "surfaces; allow more time or lower max_bounces"
    )
    if without == image.counts.size:
        raise RenderError(f"there is no picture: {why}")
    if without:
        of = f"of {image.counts.size}"
        black = counted(
            without, f"pixel {of} has no sample and is black", f"pixels {of} have no sample and are black"
        )
        warn_caller(f"{black}: {why}")


def warn_of_clamped_light(image: Image, clamp: float) -> None:
    """Warn where a clamp has darkened the picture by more than `MUCH_LIGHT`."""
    part = image.metadata["clamped"]
    if part > MUCH_LIGHT:
        warn_caller(
            f"clamp={clamp:g} removed {100 * part:.1f} % of the light, so the picture is too dark: "
            'raise it; the layer "clamped" shows where'
        )


def warn_of_noise(image: Image, asked: float) -> None:
    """Warn when samples or time ran out above the noise that was asked for."""
    found = image.metadata
    if found["noise"] <= asked:
        return
    noise = "unknown" if np.isnan(found["noise"]) else f"{found['noise']:.4g}"
    warn_caller(
        f"noise={asked:.4g} was not reached: it is {noise} after "
        f"{counted(found['spp'], 'sample', form='.4g')} per pixel in {found['seconds']:.3g} s"
    )


def warn_of_long_paths(max_bounces: int) -> None:
    """Warn that paths have met more than `LONG_PATH` surfaces."""
    warn_caller(
        f"paths have met more than {LONG_PATH} surfaces, and may meet max_bounces={max_bounces}: "
        "the scene is closed, and its materials absorb next to nothing, so hardly any path ends "
        "before. Lower max_bounces or the reflectance"
    )


def warn_of_unseen_lights(scene: Scene, integrator: str | Integrator) -> None:
    """Warn of lights that an integrator cannot find."""
    if integrator != "naive":
        return
    unseen = [light for light in scene.lights if light.delta]
    if unseen:
        kinds = ", ".join(sorted({type(light).__name__ for light in unseen}))
        warn_caller(f"the naive integrator cannot find lights without size ({kinds})")

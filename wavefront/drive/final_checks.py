"""The end of a render: errors that have the picture so far, and warnings about the picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..arrays.vec import Bools
from ..core.errors import Interrupted, RenderError, warn_caller
from ..core.plural import plural
from ..image import Image
from ..integrators import INTEGRATORS
from ..sampling.tiles import others_in_tile
from .picture import Picture

LONG_PATH = 1000  # surfaces along a path, after which it will hardly end by itself
FEWEST_PIXELS = 256  # smaller pictures are measurements and are not checked for being black or white
MUCH_LIGHT = 0.02  # part of the picture's light
DIM = 1e-3  # radiance below which a picture looks black
BLOCKS, BLOCK_SAMPLES = 8, 256  # parts of a picture along its sides, and samples of each that make it known
MANY_DIM = 0.25  # part of the blocks, of which others may show no shape


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
    """Return the error that tells the samples per pixel so far, of `spp` (None: of an open number).

    `go_on` says how the render goes on, if it does.
    """
    if not image.metadata["samples"]:
        return Interrupted("interrupted: there is no picture yet")
    samples = image.metadata["spp"]
    progress = f"{samples:.4g} of " + plural(spp, "sample") if spp else plural(samples, "sample", form=".4g")
    return Interrupted(f"interrupted: the picture so far has {progress} per pixel{go_on}", image)


def render_error(failure: Exception, image: Image) -> RenderError:
    """Return the error that says why a render could not go on, with the picture so far."""
    message = str(failure)
    if isinstance(failure, MemoryError):
        message = f"out of memory: {failure}; use fewer workers, a smaller wave_size or a smaller picture"
    return RenderError(message, image if image.metadata["samples"] else None)


def warn_of_long_paths(max_bounces: int) -> None:
    """Warn that paths have met more than `LONG_PATH` surfaces."""
    warn_caller(
        f"paths have met more than {LONG_PATH} surfaces, and may meet max_bounces={max_bounces}: "
        "the scene is closed, and its materials absorb next to nothing, so hardly any path ends "
        "before. Lower max_bounces or the reflectance"
    )


def check_last_image(image: Image, picture: Picture, time_up: bool, surfaces: int) -> None:
    """Warn of defects of the last picture.

    Parameters
    ----------
    image
        The picture.
    picture
        The picture while it was rendered.
    time_up
        Whether the render was ended before its time.
    surfaces
        How many surfaces the longest path under way has met.

    Raises
    ------
    RenderError
        If there is no picture, or too many samples are not finite.
    """
    settings, values = picture.plan.settings, picture.plan.settings.values
    if time_up:
        _check_first_samples(image, values["seconds"], surfaces)
    picture.bad.report(image, lambda pixel, sample: _cause_of_bad_sample(picture, pixel, sample))
    metadata = image.metadata
    if values["clamp"] is not None and metadata["clamped"] > MUCH_LIGHT:
        warn_caller(
            f"clamp={values['clamp']:g} removed {100 * metadata['clamped']:.1f} % of the light, so the "
            'picture is too dark: raise it; the AOV "clamped" shows where'
        )
    in_picture = picture.camera.sensor is None
    if in_picture and values["background"] is None and _is_black_or_white(image):
        from .diagnosis import warn_of_black_or_white  # here, as most pictures do without

        integrator = INTEGRATORS.label(values["integrator"])
        warn_of_black_or_white(
            image, picture.plan.scene, picture.view.camera, integrator, values["max_bounces"]
        )
    ended = time_up or picture.film.count.max() == settings.max_spp
    asked = values["noise"] is not None and not settings.by_itself
    if asked and ended and not metadata["noise"] <= values["noise"]:
        noise = "unknown" if np.isnan(metadata["noise"]) else f"{metadata['noise']:.4g}"
        warn_caller(
            f"noise={values['noise']:.4g} was not reached: it is {noise} after "
            f"{plural(metadata['spp'], 'sample', form='.4g')} per pixel in {metadata['seconds']:.3g} s"
        )


def _is_black_or_white(image: Image) -> bool:
    """Return whether every pixel is black or almost, or may be for the most part, or every one is above 1."""
    if image.rgb.shape[0] * image.rgb.shape[1] < FEWEST_PIXELS:
        return False
    return bool(image.rgb.max() < DIM or image.rgb.min() > 1 or dim_blocks(image).mean() > MANY_DIM)


def dim_blocks(image: Image) -> Bools:
    """Return which of BLOCKS × BLOCKS parts of a picture are almost black; none where that may be noise."""
    height, width = image.rgb.shape[:2]
    brightest = image.rgb.max(2)
    sums = brightest.astype(np.float64)
    for axis, side in ((0, height), (1, width)):
        edges = np.arange(BLOCKS) * side // BLOCKS
        sums = np.add.reduceat(sums, edges, axis=axis)
    pixels = brightest.size / BLOCKS**2
    if pixels < 1 or pixels * image.metadata["spp"] < BLOCK_SAMPLES:
        return np.zeros((BLOCKS, BLOCKS), np.bool_)
    return np.asarray(sums < DIM * pixels)


def _check_first_samples(image: Image, seconds: float | None, surfaces: int) -> None:
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
        black = plural(
            without, f"pixel {of} has no sample and is black", f"pixels {of} have no sample and are black"
        )
        warn_caller(f"{black}: {why}")


def _cause_of_bad_sample(picture: Picture, pixel: int, sample: int) -> str:
    """Return in which bounce, and at which material, a sample that is not finite became so."""
    from .diagnosis import first_nan  # here, as most pictures do without

    plan, camera, pixels = picture.plan, picture.view.camera, np.array([pixel], np.uint32)
    if plan.choice.reuse:
        every = camera.address(np.arange(camera.size[0] * camera.size[1], dtype=np.uint32))
        pixels = np.append(pixels, others_in_tile(every, pixel, camera.tiles).astype(np.uint32))
    return first_nan(plan.scene.lighted, plan.tracer, picture.view, pixels, sample)

"""Checks of the last picture of a render: warnings of what is wrong with it, and errors."""

from __future__ import annotations

import numpy as np

from ..image import Image
from ..integrators import INTEGRATORS
from ..sampling.tiles import others_in_tile
from ..scheduling.loop import RenderLoop
from .final_checks import check_first_samples, is_black_or_white, warn_of_clamped_light, warn_of_noise
from .plan import Plan


def check_last_image(image: Image, plan: Plan, loop: RenderLoop, surfaces: int) -> None:
    """Warn of what is wrong with the last picture.

    Parameters
    ----------
    image
        The picture.
    plan, loop
        How it was rendered.
    surfaces
        How many surfaces the longest path under way has met.

    Raises
    ------
    RenderError
        If there is no picture, or too many samples are not finite.
    """
    settings, accumulator = plan.settings, loop.accumulator
    time_up = loop.stopped or loop.scheduler.time_up
    if time_up:
        check_first_samples(image, settings.values["seconds"], surfaces)
    accumulator.bad.report(image, lambda pixel, sample: _cause_of_bad_sample(plan, loop, pixel, sample))
    if settings.values["clamp"] is not None:
        warn_of_clamped_light(image, settings.values["clamp"])
    if settings.values["background"] is None and is_black_or_white(image):
        from .diagnosis import warn_of_black_or_white  # here, as most pictures do without

        warn_of_black_or_white(
            image,
            plan.scene.lighted,
            plan.scene.compiled,
            loop.view.camera,
            INTEGRATORS.label(settings.values["integrator"]),
            settings.values["max_bounces"],
        )
    if settings.values["noise"] is not None and (time_up or accumulator.film.count.max() == settings.max_spp):
        warn_of_noise(image, settings.values["noise"])


def _cause_of_bad_sample(plan: Plan, loop: RenderLoop, pixel: int, sample: int) -> str:
    """Return in which bounce, and at which material, a sample that is not finite became so."""
    from .nan_trace import first_fault  # here, as most pictures do without

    camera, pixels = loop.view.camera, np.array([pixel], np.uint32)
    if plan.choice.reuse:
        every = camera.address(np.arange(camera.size[0] * camera.size[1], dtype=np.uint32))
        pixels = np.append(pixels, others_in_tile(every, pixel, camera.film[0]).astype(np.uint32))
    return first_fault(plan.scene.lighted, plan.tracer, loop.view, pixels, sample)

"""render(): plans the waves, runs them, returns an Image."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .accel import most_copies
from .accel.registry import ACCELERATORS, AcceleratorMaker
from .camera import Camera
from .compile.scene import compile_scene
from .diagnosis import warn_of_black_or_white
from .errors import Interrupted, RenderError, SceneError, number, warn_caller
from .exact_sum import MAX_TERMS
from .filters import FILTERS, Filter
from .image import Image
from .integrators import INTEGRATORS, WITH_MIS, Integrator, li_full
from .lighting import check_lighting, choose_preset, lighted
from .lights.samplers import LIGHT_SAMPLERS, LightSamplerMaker
from .materials import MaterialLike
from .progress import Bar, Progress, phase
from .sampling.sampler import SAMPLERS, SamplerMaker, make_sampler
from .scene import Scene
from .scheduling.adaptive import passes
from .scheduling.blas import reserve_buffers
from .scheduling.crew import PoolMaker
from .scheduling.executors import EXECUTORS, Workers, choose_executor, worker_count
from .scheduling.interrupt import CtrlC
from .scheduling.jobs import LONG_PATH, Job, JobResult, Tally, Watch, split_jobs, trace_job
from .scheduling.scheduler import Scheduler
from .scheduling.shared import Stopped
from .subject import View, as_scene
from .suggestions import suggests_keywords
from .version import VERSION

DEFAULT_SPP = 100
MAX_BRANCH_SAMPLES = 2**32  # a sample's index is 32 bits of its address, and each branch has one
MAX_BRANCHES = 64
MAX_SPP_FOR_NOISE = 2**16  # where only `noise` was given


@suggests_keywords
def render(
    scene: Any,
    spp: int | None = None,
    *,
    camera: Camera | None = None,
    size: tuple[int, int] | None = None,
    material: MaterialLike | None = None,
    up: ArrayLike | None = None,
    lighting: str | None = "auto",
    ground: bool = False,
    integrator: str | Integrator = "full",
    max_bounces: int = 12,
    seed: int = 0,
    sampler: str | SamplerMaker = "sobol",
    accel: str | AcceleratorMaker = "auto",
    workers: int | None = None,
    executor: str | PoolMaker | None = None,
    noise: float | None = None,
    seconds: float | None = None,
    filter: str | Filter = "box",
    light_sampler: str | LightSamplerMaker = "spatial",
    branches: int = 1,
    wave_size: int | None = None,
    progress: Progress = None,
) -> Image:
    """Render a picture.

    Parameters
    ----------
    scene
        A `Scene`, the path of a mesh file, a `trimesh.Trimesh` or `trimesh.Scene`, a pair
        (vertices, faces), a shape, or a list of these.
    spp
        Samples per pixel, at least 1; by default 100. With `noise` or `seconds` the most that a
        pixel gets; by default then 65536, and with `seconds` as many as there is time for.
    camera
        What sees the scene, in place of the scene's own camera. Without either the scene is framed.
    size
        (width, height) in pixels, in place of the camera's; by default (512, 512).
    material
        What bare meshes are made of: those of files and of trimesh, where it replaces what they say,
        (vertices, faces), and shapes that were given no material.
    up
        What is up in the scene: a vector (3,), or the name of an axis, such as "z" for most STL and CAD
        files; by default "y". It turns the camera that frames a scene without one, and the `lighting` and
        the `ground`.
    lighting
        "studio", "softbox", "three_point", "cloudy" or "even": adds the light of that name, which
        `studio` describes, to the scene's own. "auto" adds "studio" where nothing shines, with a
        warning, and nothing elsewhere; None adds nothing.
    ground
        Adds a level ground under the scene that catches its shadow and fades into the background. It
        belongs to the picture alone: the scene, its bounds and the numbers of its shapes stay.
    integrator
        "full", "direct_mis", "direct_simple" or "naive". This and the other settings that take names also
        take a thing of your own, such as a function; docs/extending.md has an example of each.
    max_bounces
        Scattering events along a path: 0 shows only light seen directly, 1 direct light.
    seed
        The same seed gives the same picture, bit for bit, unless `seconds` is given.
    sampler
        "sobol"; "bluenoise", whose error at few samples is even to the eye; or "independent".
    accel
        Ray queries by "numpy", by "embree" (`pip install embreex`), or "auto".
    workers
        How many waves are traced at once; by default one per core.
    executor
        What workers are: "processes" or "threads". By default processes, which are faster, on Linux
        when there is work for more than a moment, and threads otherwise. The picture is the same.
    noise
        Go on until the estimated relative error of the picture is no more than this: 0.02 means
        2 %. It is the root of the relative MSE that `compare` would find against a converged
        picture. Noisy parts get more samples than calm ones, and every pixel at least 32. When
        `spp` or `seconds` end the render above it, a warning says so.
    seconds
        Go on until this time is used, scene setup included; waves that are still under way a tenth
        later are discarded. Every pixel gets its first sample all the same, unless a wave of them
        takes over three seconds. With `noise` as well, whichever comes first.
    filter
        How the samples of a pixel are spread: "box" (evenly over the pixel), "tent" (radius 1
        pixel) or "gaussian" (σ 0.5 pixels, cut off at 1.5 from the center).
    light_sampler
        How one light of many is chosen at a point: "spatial" weighs what each brings there, "power"
        its power alone, "uniform" nothing.
    branches
        In how many ways the path of a sample goes on from the first surface, at most 64; only "full"
        has any. Two to four make a sample dearer, but less noisy by more where most of the noise is in
        indirect light, as in a room.
    wave_size
        The most paths that are traced together by one worker; by default what suits their number and
        speed, at most 131 072. The picture does not depend on it.
    progress
        By default a bar appears when a render takes over two seconds. False shows none; a
        function is called with how much is done and how much there is at most: samples, or
        seconds where `seconds` is given. While a wave takes long it is called every second.

    Returns
    -------
    Image

    Raises
    ------
    SceneError
        If an argument or the scene is malformed. It is a ValueError.
    Interrupted
        After Ctrl-C, within about two seconds; at a second Ctrl-C at once. It is a KeyboardInterrupt,
        and its `image` is the picture so far.
    RenderError
        If the render cannot go on: memory runs out, worker processes die again and again, more than
        1e-4 of the samples are not finite, or `seconds` are over before there is one sample. Its
        `image` is the picture so far.
    """
    begin = time.perf_counter()
    branches = _whole("branches", branches, 1, MAX_BRANCHES)
    spp = _most_samples(spp, noise, seconds, min(MAX_TERMS, MAX_BRANCH_SAMPLES // branches))
    max_bounces = _whole("max_bounces", max_bounces, 0, 2**16)
    if wave_size is not None:
        wave_size = _whole("wave_size", wave_size, 1, 2**24)
    estimate = _estimator(integrator, branches)
    spread = FILTERS.find(filter)
    ACCELERATORS.find(accel)
    LIGHT_SAMPLERS.find(light_sampler)
    check_lighting(lighting)
    make_sampler(sampler, seed)  # checks both before the scene is read
    workers = worker_count(workers)
    choose_executor(executor, workers, 0)
    seen = View(camera, size, up)
    with _setting_up():
        reserve_buffers(1)
        subject = as_scene(scene, material, progress)
        camera = seen.of(subject)
        tally = Tally(*camera.size)
        draw = make_sampler(sampler, seed, camera.film[0])
        preset = choose_preset(subject, lighting)
        complete = lighted(subject, preset, ground=ground, up=seen.up)
        _warn_unseen_lights(complete, integrator)
        with phase("building the scene", progress):
            compiled = compile_scene(
                complete,
                subject.accelerators.maker(accel),
                light_sampler,
                most_copies(accel),
                mis=INTEGRATORS.find(integrator) in WITH_MIS,
            )
        view = compiled.view(camera)

    clock = Scheduler(begin, seconds, wave_size, workers, branches)
    watch = Watch(deadline=clock.deadline)
    trace = partial(trace_job, compiled, view, draw, spread, estimate, max_bounces, watch)
    most = tally.film.count.size * spp
    executor = choose_executor(executor, workers, most * branches)
    failure: Exception | None = None
    with CtrlC(watch.stop) as ctrl_c:
        with (
            Bar(progress, most, seconds) as bar,
            Workers[Job, JobResult](trace, workers, executor, watch.stop) as crew,
        ):
            patience = _Patience(watch, clock, bar, max_bounces)
            try:
                for step in passes(tally.film, spp, noise):
                    jobs = clock.in_time(split_jobs(step.pixels, step.first, step.last, clock.wave_size))
                    for job, wave in crew.run(jobs, patience.wait):
                        tally.add(job, wave)
                        clock.note(job, wave.seconds)
                        patience.end_of_wave()
                        bar.advance(job.lanes, clock.elapsed)
                    if clock.up:
                        break
            except Stopped:
                clock.up = not ctrl_c.pressed
            except KeyboardInterrupt:  # from the user's function, or a handler of the program's own
                ctrl_c.pressed = True
            except (MemoryError, RenderError) as error:
                failure = error
        image = tally.image(
            {
                "lighting": preset,
                "integrator": INTEGRATORS.label(integrator),
                "max_bounces": max_bounces,
                "seed": seed,
                "sampler": SAMPLERS.label(sampler),
                "filter": FILTERS.label(filter),
                "branches": branches,
                "accelerator": compiled.accelerator.name,
                "workers": workers,
                "executor": EXECUTORS.label(executor),
                "seconds": clock.elapsed,
                "spp": tally.samples / tally.film.count.size,
                "samples": tally.samples,
                "rays": tally.rays,
                "bad_samples": tally.bad.count,
                "interrupted": ctrl_c.pressed,
                "version": VERSION,
                "numpy": np.__version__,
            }
        )
    if failure is not None:
        raise _render_error(failure, image) from failure
    if ctrl_c.pressed:
        raise _interrupted(image, spp if noise is None and seconds is None else None)
    if clock.up:
        _check_first_samples(image, seconds, watch.surfaces.value)
    tally.bad.report(image)
    warn_of_black_or_white(image, complete, compiled, view, INTEGRATORS.label(integrator), max_bounces)
    if noise is not None and (clock.up or tally.film.count.max() == spp):
        _warn_of_noise(image, noise)
    return image


@contextmanager
def _setting_up() -> Iterator[None]:
    """Name what ends a render before there is a picture: Ctrl-C and a lack of memory."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted("interrupted while the scene was set up: there is no picture yet") from None
    except MemoryError as error:
        raise RenderError(f"out of memory while the scene was set up: {error}") from error


class _Patience:
    """What is done while waves take long: time is shown, and once a warning given."""

    def __init__(self, watch: Watch, clock: Scheduler, bar: Bar, max_bounces: int) -> None:
        self._watch, self._clock, self._bar = watch, clock, bar
        self._max_bounces = max_bounces
        self._warned = max_bounces <= LONG_PATH

    def wait(self) -> None:
        """Be called now and then while no wave is done."""
        self._bar.wait(self._watch.surfaces.value, self._clock.elapsed)
        self._warn_of_long_paths()

    def end_of_wave(self) -> None:
        """Be called when a wave is done."""
        self._warn_of_long_paths()
        self._watch.surfaces.reset()

    def _warn_of_long_paths(self) -> None:
        if self._warned or self._watch.surfaces.value <= LONG_PATH:
            return
        self._warned = True
        warn_caller(
            f"paths have met more than {LONG_PATH} surfaces, and may meet max_bounces={self._max_bounces}: "
            "the scene is closed, and its materials absorb next to nothing, so hardly any path ends "
            "before. Lower max_bounces or the reflectance"
        )


def _picture_so_far(image: Image) -> Image | None:
    return image if image.metadata["samples"] else None


def _interrupted(image: Image, spp: int | None) -> Interrupted:
    """Return the error that says how much of `spp` samples per pixel there is; None if that is open."""
    if not image.metadata["samples"]:
        return Interrupted("interrupted: there is no picture yet")
    of = "" if spp is None else f" of {spp}"
    return Interrupted(
        f"interrupted: the picture so far has {image.metadata['spp']:.4g}{of} samples per pixel", image
    )


def _render_error(failure: Exception, image: Image) -> RenderError:
    """Return the error that says why a render could not go on, with the picture so far."""
    message = str(failure)
    if isinstance(failure, MemoryError):
        message = f"out of memory: {failure}; use fewer workers, a smaller wave_size or a smaller picture"
    return RenderError(message, _picture_so_far(image))


def _check_first_samples(image: Image, seconds: float | None, surfaces: int) -> None:
    """Warn of pixels without a sample when the time was up, or raise if there is nothing else.

    `surfaces` is how many a path under way had met.
    """
    assert image.counts is not None
    without = int((image.counts == 0).sum())
    why = (
        f"when seconds={seconds} were over, a wave of paths was under way that had met {surfaces} surfaces; "
        "allow more time or lower max_bounces"
    )
    if without == image.counts.size:
        raise RenderError(f"there is no picture: {why}")
    if without:
        warn_caller(f"{without} pixels of {image.counts.size} have no sample and are black: {why}")


def _estimator(integrator: str | Integrator, branches: int) -> Integrator:
    """Return the integrator with this name, for paths with so many branches."""
    estimate = INTEGRATORS.find(integrator)
    if branches == 1:
        return estimate
    if estimate is not li_full:
        label = INTEGRATORS.label(integrator)
        raise SceneError(f"branches is {branches}; with integrator={label!r} it must be 1")
    return partial(li_full, branches=branches)


def _most_samples(spp: int | None, noise: float | None, seconds: float | None, most: int) -> int:
    """Return the most samples that a pixel may get; check all that says when to stop."""
    for name, value in (("noise", noise), ("seconds", seconds)):
        if value is not None:
            number(name, value, lambda x: x > 0, "above 0")
    if spp is not None:
        return _whole("spp", spp, 1, most)
    if seconds is not None:
        return most
    return DEFAULT_SPP if noise is None else MAX_SPP_FOR_NOISE


def _whole(name: str, value: Any, low: int, high: int) -> int:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not low <= value <= high:
        raise SceneError(f"{name} is {value!r}; it must be a whole number from {low} to {high}")
    return int(value)


def _warn_of_noise(image: Image, asked: float) -> None:
    """Warn when samples or time ran out above the noise that was asked for."""
    found = image.metadata
    if found["noise"] <= asked:
        return
    noise = "unknown" if np.isnan(found["noise"]) else f"{found['noise']:.4g}"
    warn_caller(
        f"noise={asked:.4g} was not reached: it is {noise} after {found['spp']:.4g} samples per pixel "
        f"in {found['seconds']:.3g} s"
    )


def _warn_unseen_lights(scene: Scene, integrator: str | Integrator) -> None:
    if integrator != "naive":
        return
    unseen = [light for light in scene.lights if light.delta]
    if unseen:
        kinds = ", ".join(sorted({type(light).__name__ for light in unseen}))
        warn_caller(f"the naive integrator cannot find lights without size ({kinds})")

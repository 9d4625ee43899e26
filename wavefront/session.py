"""A session: a render that can be watched, stopped and pointed at another view."""

from __future__ import annotations

import os
import time
from collections.abc import Generator, Iterator, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .accel import Accelerator, Geometry, most_copies
from .accel.registry import AcceleratorMaker
from .camera import Camera, image_size
from .checkpoint import Checkpoint
from .compile.scene import compile_scene
from .errors import RenderError, SceneError, warn_caller
from .filters import FILTERS, Filter
from .geometric_layers import IDS, ShapeTable, geometric_layers
from .guiding import GuideTable
from .image import Image
from .integrators import INTEGRATORS, WITH_MIS, Integrator, li_naive
from .layers import BOXES, geometric_names
from .lighting import choose_preset, lighted
from .lights.samplers import LightSamplerMaker
from .materials import MaterialLike
from .object_boxes import object_boxes, silhouettes
from .outcome import (
    LONG_PATH,
    check_first_samples,
    interrupted,
    is_black_or_white,
    render_error,
    setup_errors,
    warn_of_clamped_light,
    warn_of_long_paths,
    warn_of_noise,
    warn_of_unseen_lights,
)
from .pilot import train
from .progress import Progress, phase
from .renderable import as_scene, choose_camera
from .resuming import CheckpointFile, render_identity, scene_fingerprint
from .sampling.sampler import SAMPLERS, SamplerMaker
from .scheduling.accumulator import Accumulator, check_picture_memory
from .scheduling.adaptive import Pass
from .scheduling.blas import reserve_buffers, single_threaded_blas
from .scheduling.delivery import can_be_sent
from .scheduling.executors import EXECUTORS, ExecutorLike, needs_pickling
from .scheduling.interrupt import InterruptHandler
from .scheduling.jobs import Job, JobResult, View
from .scheduling.loop import PassSplitter, RenderLoop, doubling, undivided
from .scheduling.pool import WorkerPool
from .scheduling.scheduler import Scheduler
from .scheduling.shared import STOP
from .scheduling.tracing import Tracer, WaveMonitor, trace_job
from .settings import AUTO, Settings, check_camera
from .suggestions import suggests_keywords
from .trial import Trial, is_worth_it, run_trial
from .version import VERSION

SNAPSHOT_INTERVAL = 1.0  # seconds between two pictures of a long pass


class Session:
    """A render that can be watched, stopped and pointed at another view.

    Iteration goes on with the render and yields the picture so far after each pass: at 1, 2, 4, 8 ... samples
    per pixel, or where `noise` decides anew, and at least about once a second where the passes over all
    pixels take no longer. The last picture is that of `render`, bit for bit. While the caller looks at a
    picture, workers go on with the next few waves.

    As a context manager the session keeps its workers until the end of the block, and leaves no
    process, thread or shared memory behind it, also after an error or Ctrl-C. Outside of a block, workers
    that were idle for 10 seconds end, and start again when they are needed.

    Parameters
    ----------
    scene, spp, camera, size, material, up, lighting, ground, background
        As for `render`.
    integrator, max_bounces, seed, samples, sampler, accel, filter, light_sampler, branches, guide, reuse
        As for `render`.
    workers, executor, noise, seconds, clamp, wave_size, max_memory, strict, aovs, denoise, progress
        As for `render`.
    checkpoint, checkpoint_interval
        As for `render`.

    Raises
    ------
    SceneError
        If an argument or the scene is malformed.
    Interrupted
        After Ctrl-C while a picture is waited for.
    RenderError
        If the render cannot go on.

    Examples
    --------
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> with wf.Session(scene, spp=4, size=(16, 16), progress=False) as session:
    ...     for image in session:
    ...         print(image.spp)
    1
    2
    4
    """

    @suggests_keywords
    def __init__(
        self,
        scene: Any,
        spp: int | None = None,
        *,
        camera: Camera | None = None,
        size: tuple[int, int] | None = None,
        material: MaterialLike | None = None,
        up: ArrayLike | None = None,
        lighting: str | None = "auto",
        ground: bool = False,
        background: str | ArrayLike | None = None,
        integrator: str | Integrator = "full",
        max_bounces: int = 12,
        seed: int = 0,
        samples: range | None = None,
        sampler: str | SamplerMaker = "sobol",
        accel: str | AcceleratorMaker = "auto",
        workers: int | None = None,
        executor: str | ExecutorLike | None = None,
        noise: float | None = None,
        seconds: float | None = None,
        filter: str | Filter = "box",
        light_sampler: str | LightSamplerMaker = "spatial",
        branches: int | str = 1,
        guide: bool | str = False,
        reuse: bool = False,
        clamp: float | None = None,
        wave_size: int | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_interval: float = 60,
        max_memory: int | str | None = None,
        strict: bool = False,
        aovs: str | Sequence[str] = (),
        denoise: bool = False,
        progress: Progress = None,
    ) -> None:
        begin = time.perf_counter()
        self._in_block = self._closed = self._once = False
        self.command: dict[str, Any] | None = None
        self._settings = Settings(
            spp=spp,
            camera=camera,
            size=size,
            material=material,
            up=up,
            lighting=lighting,
            ground=ground,
            background=background,
            integrator=integrator,
            max_bounces=max_bounces,
            seed=seed,
            samples=samples,
            sampler=sampler,
            accel=accel,
            workers=workers,
            executor=executor,
            noise=noise,
            seconds=seconds,
            filter=filter,
            light_sampler=light_sampler,
            branches=branches,
            guide=guide,
            reuse=reuse,
            clamp=clamp,
            wave_size=wave_size,
            checkpoint=checkpoint,
            checkpoint_interval=checkpoint_interval,
            max_memory=max_memory,
            strict=strict,
            aovs=aovs,
            denoise=denoise,
            progress=progress,
        )
        with setup_errors():
            self._set_up(scene, begin)

    def _set_up(self, subject: Any, begin: float) -> None:
        """Compile the scene and begin the first picture."""
        settings = self._settings
        reserve_buffers(1)
        self._scene = as_scene(subject, settings.material, settings.progress)
        camera = choose_camera(self._scene, settings.camera, settings.size, settings.up_vector)
        check_picture_memory(*camera.size)
        settings.budget(camera.size)  # before work; again when the memory of the scene is known
        self._preset = choose_preset(self._scene, settings.lighting)
        self._lighted = lighted(self._scene, self._preset, ground=settings.ground, up=settings.up_vector)
        warn_of_unseen_lights(self._lighted, settings.integrator)
        with phase("building the scene", settings.progress):
            make_accelerator = self._scene.accelerators.maker(settings.accel)

            def make(geometry: Geometry) -> Accelerator:
                self._geometries.append(geometry)
                return make_accelerator(geometry)

            self._geometries: list[Geometry] = []
            self._fingerprint: str | None = None
            compiled = compile_scene(
                self._lighted,
                make,
                settings.light_sampler,
                most_copies(settings.accel),
                mis=INTEGRATORS.find(settings.integrator) in WITH_MIS,
            )
            self._compiled = replace(compiled, background=settings.background_color)
        self._shape_table = ShapeTable(self._lighted.shapes)
        self._tracer = Tracer(
            self._compiled,
            settings.sampler_maker(),
            FILTERS.find(settings.filter),
            self._estimator(camera),
            settings.max_bounces,
            settings.sampled_layers,
            settings.clamp,
        )
        self._budget = settings.budget(camera.size, self._tracer.recorded_layers)
        self._make_pool(settings.executor_for(camera.size))
        self._begin_picture(camera, self._new_accumulator(camera), begin)

    def _estimator(self, camera: Camera) -> Integrator:
        """Return the integrator; what is to be learned or decided is, for the camera."""
        settings = self._settings
        self._branches, self._guided = 1 if settings.branches == AUTO else int(settings.branches), False
        if not settings.decides:
            return settings.estimator(None, self._branches)
        with phase("learning where light comes from", settings.progress), single_threaded_blas:
            view, width = self._compiled.view(camera), camera.film[0]
            table = None
            if settings.guide:
                sampler = settings.pilot_sampler(width)
                table = train(self._compiled, view, sampler, settings.max_bounces)
            table = self._decide(view, width, table)
        self._guided = table is not None
        return settings.estimator(table, self._branches)

    def _decide(self, view: Camera, width: int, table: GuideTable | None) -> GuideTable | None:
        """Decide about what is "auto": the number of branches, and whether a table is used."""
        settings = self._settings
        samplers = settings.pilot_sampler(width, 1), settings.pilot_sampler(width, 2)

        def trial(guided_by: GuideTable | None) -> Trial:
            return run_trial(self._compiled, view, samplers, settings.max_bounces, guided_by)

        fixed = None if settings.branches == AUTO else self._branches
        if settings.guide == AUTO and table is not None:
            guided, plain = trial(table), trial(None)
            pays = is_worth_it(guided, plain, fixed)
            found, table = (guided, table) if pays else (plain, None)
        elif fixed is None:
            found = trial(table)
        else:
            return table
        if fixed is None:
            self._branches = found.best_ways()
        return table

    def _make_pool(self, executor: str | ExecutorLike) -> None:
        """Make a pool of workers, which start with the first job."""
        if self._settings.executor is None and needs_pickling(executor) and not can_be_sent(self._tracer):
            executor = "threads"
        self._executor = executor
        self._monitor = WaveMonitor()
        self.interrupt_handler = InterruptHandler(self._monitor.stop)
        work = partial(trace_job, self._tracer, self._monitor)
        self._pool = WorkerPool[Job, JobResult](
            work, self._budget.workers, executor, self._monitor.stop, self._settings.strict
        )
        if self._in_block:
            self._pool.__enter__()

    def _new_accumulator(self, camera: Camera) -> Accumulator:
        """Return sums for a picture and its layers."""
        accumulator = Accumulator(*camera.size)
        accumulator.add_layers(self._tracer.recorded_layers)
        return accumulator

    def _begin_picture(self, camera: Camera, accumulator: Accumulator, begin: float) -> None:
        """Get ready for a picture of a view; `begin` is when it was asked for, by `time.perf_counter`."""
        settings = self._settings
        view = self._compiled.view(camera)
        if settings.samples is not None or settings.checkpoint is not None:
            accumulator.sums.identity = self._identity(view)
        self._checkpoint, earlier = None, None
        if settings.checkpoint is not None:
            self._checkpoint = CheckpointFile(settings.checkpoint, settings.checkpoint_interval)
            earlier = self._checkpoint.resume(accumulator, settings)
        begun = None
        if earlier is not None:
            begin -= earlier.state["seconds"]
            if earlier.pixels is not None:
                begun = Pass(earlier.pixels, earlier.state["first"], settings.max_spp)
        scheduler = Scheduler(
            begin, settings.seconds, self._budget.wave_size, self._budget.workers, self._branches
        )
        self._loop = RenderLoop(
            View(view, scheduler.deadline, settings.first_sample, settings.reuse),
            accumulator,
            scheduler,
            spp=settings.max_spp,
            noise=settings.noise,
            seconds=settings.seconds,
            progress=settings.progress,
            begun=begun,
        )
        self._camera = camera
        self._geometric: dict[str, NDArray[Any]] = {}
        self._boxes: list[dict[str, Any]] | None = None
        self._sweeps: Generator[bool] | None = None
        self._last_snapshot = begin
        self._stopped = self._ended = self._warned = False

    # --- Use ------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """Keep the workers until the end of the block."""
        self._in_block = True
        self._pool.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the session."""
        self._in_block = False
        self.close()

    def __iter__(self) -> Self:
        """Go on with the render; a second loop goes on where the first one was left."""
        return self

    def __next__(self) -> Image:
        """Render until there is another picture, and return it.

        Raises
        ------
        StopIteration
            If the last picture was returned, or the session was stopped or closed.
        Interrupted
            After Ctrl-C; its `image` is the picture so far.
        RenderError
            If the render cannot go on; its `image` is the picture so far.
        """
        if self._ended:
            raise StopIteration
        with self.interrupt_handler:
            if self._stopped:  # since the last picture
                self._keep_render()
                self._ended = True
                self._pool.cancel()
                raise StopIteration
            for pass_ended in self._sweeps_of(doubling):
                if pass_ended or time.perf_counter() - self._last_snapshot >= SNAPSHOT_INTERVAL:
                    snapshot = self._image()
                    self._last_snapshot = time.perf_counter()
                    if not self.interrupt_handler.pressed:
                        return snapshot
            image = self._end()
        if image is None:
            raise StopIteration
        return image

    def run(self) -> Image:
        """Render to the end and return the picture.

        Raises
        ------
        Interrupted
            After Ctrl-C; its `image` is the picture so far.
        RenderError
            If the render cannot go on, or is over already.
        """
        return self._run()

    def run_once(self) -> Image:
        """Render to the end and return the picture; after that the session can only be closed.

        It takes less memory than `run`: sums are freed while the picture is made from them.

        Raises
        ------
        Interrupted, RenderError
            As `run`.
        """
        self._once = True
        return self._run()

    def _run(self) -> Image:
        if self._ended:
            raise RenderError("the render is over; set_camera begins another picture")
        with self.interrupt_handler:
            for _ in () if self._stopped else self._sweeps_of(undivided):
                pass
            image = self._end()
        if image is None:
            raise RenderError("the render was stopped before there was a picture")
        return image

    def set_camera(self, camera: Camera | None, size: tuple[int, int] | None = None) -> None:
        """Begin another picture of the same scene, without compiling it again.

        What was rendered so far is dropped. Workers that have been started go on with the new picture, and
        `seconds` count from now on.

        Parameters
        ----------
        camera
            What sees the scene; None for the scene's own camera, or one that frames it.
        size
            (width, height) in pixels, in place of the camera's.

        Raises
        ------
        SceneError
            If one of them is malformed. The picture that was begun is not changed.
        """
        begin, settings = time.perf_counter(), self._settings
        if self._closed:
            raise RenderError("the session is closed")
        if self._checkpoint is not None:
            raise SceneError(
                "a session with a checkpoint renders one view; begin another session for this one"
            )
        check_camera("camera", camera)
        size = None if size is None else image_size(size)
        camera = choose_camera(self._scene, camera, size, settings.up_vector)
        self._compiled.view(camera)  # checks its distance
        budget = settings.budget(camera.size, self._tracer.recorded_layers)
        accumulator = self._new_accumulator(camera)
        executor = settings.executor_for(camera.size)
        with self.interrupt_handler:
            self._discard_sweeps()
            if not self._pool.closed:
                self._pool.cancel()
            others = (executor, self._executor) == ("processes", "threads")
            others |= budget.workers != self._budget.workers
            self._budget = budget
            if self._monitor.stop.value or others or settings.decides:
                self._pool.close()
                self._tracer.integrator = self._estimator(camera)
                self._make_pool(executor)
        self._begin_picture(camera, accumulator, begin)

    def stop(self) -> None:
        """End the render: the loop ends, with the picture so far where one is waited for.

        It can be called from another thread, and from a function that is given as `progress`.
        """
        self._stopped = True
        self._monitor.stop.rise_to(STOP)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint of the picture so far, from which `render(checkpoint=path)` goes on.

        `Image.load` reads the file as a picture.

        Raises
        ------
        SaveError
            If it cannot be written. The old file is intact.
        SceneError
            If a part of the scene cannot be compared with that of the next render. The message names it.
        """
        sums = self._loop.accumulator.sums
        sums.identity = sums.identity or self._identity(self._loop.view.camera)
        self._make_checkpoint().write(path)

    def identity(self) -> dict[str, Any]:
        """Return what another render must have in common with this one so that its samples are the same.

        These are settings, and fingerprints of the scene, the camera and functions of your own. `spp` and
        `seconds` are no part of it.

        Raises
        ------
        SceneError
            If a part of the scene, such as an attribute of a BSDF of your own, cannot be compared.
        """
        return self._identity(self._loop.view.camera)

    def silhouettes(self, camera: Camera | None = None) -> Iterator[tuple[int, NDArray[np.bool_]]]:
        """Yield the id of each shape and the pixels (height, width) that it would cover if it were alone.

        Ids and rays are those of the layer `shape_id`. Shapes that would cover no pixel are left out.

        Parameters
        ----------
        camera
            What sees the scene; None for the camera of the picture.
        """
        return silhouettes(self._compiled, self._camera if camera is None else camera)

    def close(self) -> None:
        """End the render and all workers; the session cannot be used again."""
        with self.interrupt_handler:
            if not self._ended:
                self._keep_render()
            self._closed = self._ended = True
            self._discard_sweeps()
            self._pool.close()

    # --- The picture ----------------------------------------------------------------------------------

    def _sweeps_of(self, split: PassSplitter) -> Generator[bool]:
        """Return the loop that was begun, or begin it."""
        if self._sweeps is None:
            self._make_geometric_layers()
            self._sweeps = self._loop.sweeps(self._pool, self._monitor.surfaces, self._wave_done, split)
        return self._sweeps

    def _make_geometric_layers(self) -> None:
        """Trace the geometric layers and the boxes that are asked for."""
        names = geometric_names(self._settings.aovs)
        given = self._compiled, self._camera, self._shape_table
        if names:
            self._geometric = geometric_layers(*given, names)
        if BOXES in self._settings.aovs:
            self._boxes = object_boxes(*given)

    def _add_geometric_layers(self, image: Image) -> None:
        """Give a picture its geometric layers; all pictures but the last get copies."""
        for name, layer in self._geometric.items():
            image.layers[name] = layer if self._ended else layer.copy()
            if name in IDS:
                image.names[IDS[name]] = self._shape_table.names(IDS[name])
        if self._boxes is not None:
            image.metadata[BOXES] = deepcopy(self._boxes)

    def _discard_sweeps(self) -> None:
        if self._sweeps is not None:
            self._sweeps.close()

    def _wave_done(self) -> None:
        """Write the checkpoint when it is due, and warn once of paths that do not end."""
        if self._checkpoint is not None:
            self._checkpoint.write_if_due(self._make_checkpoint)
        long = self._settings.max_bounces > LONG_PATH and self._monitor.surfaces.value > LONG_PATH
        if long and not self._warned:
            self._warned = True
            warn_of_long_paths(self._settings.max_bounces)

    def _end(self) -> Image | None:
        """Return the last picture when the loop is over, or raise what ended it; None if there is none."""
        loop, settings = self._loop, self._settings
        self._ended = True
        if loop.failure is not None or self._interrupted:
            self._pool.close()
        else:
            self._pool.cancel()
        loop.accumulator.release_reserve()
        not_written = None
        if self._checkpoint is not None:
            not_written = self._checkpoint.write(self._make_checkpoint)
        image = self._image(cut_short=self._interrupted or self._stopped, last=True)
        if not_written is not None and (loop.failure is not None or self._interrupted):
            warn_caller(f"the checkpoint was not written: {not_written}")
        if loop.failure is not None:
            raise render_error(loop.failure, image) from loop.failure
        if not self._interrupted and not self._stopped:
            self._report(image)
        if self._interrupted:
            raise interrupted(image, settings.target_spp)
        if not_written is not None:
            raise RenderError(f"the checkpoint was not written: {not_written}", image) from not_written
        if not loop.accumulator.samples:
            return None
        return image.denoise() if settings.denoise else image

    @property
    def _interrupted(self) -> bool:
        return self._loop.interrupted or self.interrupt_handler.pressed

    def _report(self, image: Image) -> None:
        """Warn of what is wrong with the last picture.

        Raises
        ------
        RenderError
            If there is no picture, or too many samples are not finite.
        """
        loop, settings = self._loop, self._settings
        time_up = loop.stopped or loop.scheduler.time_up
        if time_up:
            check_first_samples(image, settings.seconds, self._monitor.surfaces.value)
        loop.accumulator.bad.report(image, self._cause_of_bad_sample)
        if settings.clamp is not None:
            warn_of_clamped_light(image, settings.clamp)
        if settings.background is None and is_black_or_white(image):
            from .diagnosis import warn_of_black_or_white  # here, as most pictures do without

            warn_of_black_or_white(
                image,
                self._lighted,
                self._compiled,
                loop.view.camera,
                INTEGRATORS.label(settings.integrator),
                settings.max_bounces,
            )
        if settings.noise is not None and (time_up or loop.accumulator.film.count.max() == settings.max_spp):
            warn_of_noise(image, settings.noise)

    def _cause_of_bad_sample(self, pixel: int, sample: int) -> str:
        """Return in which bounce, and at which material, a sample that is not finite became so."""
        from .faults import PathChecker  # here, as most pictures do without

        settings, tracer, camera = self._settings, self._tracer, self._loop.view.camera
        integrator = INTEGRATORS.find(settings.integrator)
        checker = PathChecker(
            self._lighted,
            tracer.scene,
            camera,
            tracer.sampler(camera.film[0]),
            tracer.filter,
            tracer.max_bounces,
            self._branches,
            light_samples=integrator is not li_naive,
            mis=integrator in WITH_MIS,
        )
        return checker.first_fault(pixel, sample)

    def _identity(self, camera: Camera) -> dict[str, Any]:
        """Return what another render must have in common with this one, whose camera is in scene units."""
        if self._fingerprint is None:
            self._fingerprint = scene_fingerprint(self._compiled, self._geometries)
        return render_identity(
            self._settings,
            self._fingerprint,
            self._compiled.accelerator.name,
            camera,
            self._tracer.recorded_layers,
        )

    def _keep_render(self) -> None:
        """Write the checkpoint of a render that is left before its end; warn if that is not possible."""
        error = None if self._checkpoint is None else self._checkpoint.write(self._make_checkpoint)
        if error is not None:
            warn_caller(f"the checkpoint was not written: {error}")

    def _make_checkpoint(self) -> Checkpoint:
        """Return the render so far."""
        loop, accumulator = self._loop, self._loop.accumulator
        step = loop.step if self._settings.noise is not None else None
        state = {
            **accumulator.state(),
            "seconds": loop.scheduler.elapsed,
            "first": 0 if step is None else step.first,
        }
        metadata = {**self._metadata(cut_short=True), **accumulator.counts()}
        pixels = None if step is None else step.pixels
        return Checkpoint(accumulator.sums, metadata, state, pixels, self.command)

    def _image(self, cut_short: bool = False, last: bool = False) -> Image:
        """Return the picture so far; the last one can be merged with others if `samples` were given."""
        keep_sums = last and self._settings.samples is not None
        if last and self._once and not keep_sums:
            image = self._loop.accumulator.last_image(self._metadata(cut_short))
        else:
            image = self._loop.accumulator.image(self._metadata(cut_short), keep_sums)
        self._add_geometric_layers(image)
        return image

    def _metadata(self, cut_short: bool) -> dict[str, Any]:
        """Return the settings and results of the picture so far."""
        settings = self._settings
        first = settings.first_sample
        most = int(self._loop.accumulator.film.count.max())
        return {
            "lighting": self._preset,
            "background": _background_label(settings.background),
            "integrator": INTEGRATORS.label(settings.integrator),
            "max_bounces": settings.max_bounces,
            "seed": settings.seed,
            "sampler": SAMPLERS.label(settings.sampler),
            "sample_ranges": [[first, first + most]],
            "filter": FILTERS.label(settings.filter),
            "branches": self._branches,
            "guide": settings.guide,
            "guided": self._guided,
            "reuse": settings.reuse,
            "clamp": settings.clamp,
            "accelerator": self._compiled.accelerator.name,
            "workers": self._budget.workers,
            "executor": EXECUTORS.label(self._executor),
            "seconds": self._loop.scheduler.elapsed,
            "interrupted": cut_short,
            "version": VERSION,
            "numpy": np.__version__,
        }


def _background_label(background: Any) -> Any:
    """Return the background as metadata have it."""
    return np.ravel(background).tolist() if isinstance(background, np.ndarray) else background

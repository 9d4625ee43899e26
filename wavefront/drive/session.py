"""The session, which drives a render picture by picture."""

from __future__ import annotations

import os
import shlex
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Self, Unpack

from ..aovs.boxes import silhouettes
from ..aovs.geometric import ShapeTable
from ..arrays.vec import Bools
from ..camera import Camera, ImageSize, check_camera, image_size
from ..core.errors import Interrupted, RenderError, SaveError, SceneError, warn_caller
from ..core.interrupt import InterruptHandler
from ..core.shared import STOP, SharedInt
from ..core.suggestions import suggests_keywords
from ..film.picture_sums import PictureSums
from ..image import Image
from ..integrators.stage_list import StageList
from ..io.to_scene import as_scene, choose_camera, coloring_of
from ..scene import Scene
from ..settings import RenderSettings, Settings, describes_settings, takes_settings
from ..workers.machine import reserve_buffers
from ..workers.pool import WorkerPool
from .choice import learn_guide
from .final_checks import (
    LONG_PATH,
    check_last_image,
    interrupted,
    render_error,
    setup_errors,
    warn_of_long_paths,
)
from .hints import Hints
from .inline import AnyPool, InlineWorker
from .picture import Picture
from .plan import fits_a_wave, make_budget, make_plan, with_choice
from .prepared_scene import PreparedScene
from .tracing import Tracer, WaveMonitor, trace_job
from .work import Work, doubling, undivided


class SoleUse:
    """A context that nobody can enter while it is entered: a second one gets an error, and does not wait."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._user = 0  # the thread that is within

    def __enter__(self) -> None:
        """Enter.

        Raises
        ------
        RenderError
            If the context is entered already.
        """
        if not self._lock.acquire(blocking=False):
            by = "another thread" if self.elsewhere else "the caller of this function"
            raise RenderError(f"the session is in use by {by}; meanwhile it can only be stopped or dropped")
        self._user = threading.get_ident()

    def __exit__(self, *raised: object) -> None:
        """Let others enter."""
        self._user = 0
        self._lock.release()

    @property
    def elsewhere(self) -> bool:
        """Whether another thread is within."""
        return self._lock.locked() and self._user != threading.get_ident()

    def wait(self) -> None:
        """Wait until nobody is within."""
        with self._lock:
            pass


SNAPSHOT_INTERVAL = 1.0  # seconds between two pictures of a long pass


@describes_settings
class Session:
    """A render that can be watched, stopped and given another camera.

    Iteration continues the render and yields the picture so far after each pass: at 1, 2, 4, 8 ... samples
    per pixel, or where `noise` chooses pixels again, and at least about once a second where a pass over all
    pixels takes no longer. The last picture is that of `render`, bit for bit. While the caller looks at a
    picture, workers go on with the next few waves.

    As a context manager the session keeps its workers until the end of the block, and leaves no
    process, thread or shared memory behind it, also after an error or Ctrl-C. Outside of a block, workers
    that were idle for 10 seconds end, and start again when they are needed.

    One thread at a time may use it: meanwhile others may only `stop`, `drop` or `close` it.

    Parameters
    ----------
    scene
        As for `render`.
    {settings}

    Raises
    ------
    SceneError
        If an argument or the scene is malformed.
    Interrupted
        After Ctrl-C while the session renders.
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

    @takes_settings
    def __init__(self, scene: Any, spp: int | None = None, **settings: Unpack[RenderSettings]) -> None:
        begin = time.perf_counter()
        self._in_block = self._closed = self._once = self._stopped = self._dropped = False
        self.command: dict[str, Any] | None = None  # of the command line, for checkpoints
        self.interrupt_handler = InterruptHandler(SharedInt())
        self._use = SoleUse()
        self._settings = Settings(spp=spp, **settings)
        with setup_errors():
            self._set_up(scene, begin)

    def _set_up(self, subject: Any, begin: float) -> None:
        """Compile the scene and begin the first picture."""
        values = self._settings.values
        scene = as_scene(
            subject,
            values["material"],
            values["progress"],
            values["smooth"],
            coloring=coloring_of(values),
        )
        settings = self._settings = self._settings.after(scene.settings)
        reserve_buffers(1)
        values = settings.values
        camera, framed = choose_camera(
            scene,
            values["camera"] or _camera_of_file(scene, settings),
            values["size"],
            values["up"],
            values["view"],
            values["fov"],
        )
        # before work, for the least demand; again when the memory of the scene is known
        make_budget(settings, camera.size, values["executor"] or "threads")
        self._scene = PreparedScene(scene, settings, camera, camera if framed else None)
        if camera.sensor is None:
            settings = self._settings = settings.ending(self._scene.light_is_chosen)
        self._hints = Hints(settings, self._scene)
        table = learn_guide(settings, self._scene.compiled, camera)
        self._plan = with_choice(make_plan(settings, self._scene, camera, table), camera)
        self._make_pool()
        try:
            with self.interrupt_handler:
                self._pool.start()  # before there are sums, of which forked processes would keep old copies
                self._begin_picture(camera, self._plan.sums(camera.size), begin)
        except BaseException:
            with self.interrupt_handler:
                self._pool.close()
            raise

    def _make_pool(self) -> None:
        """Make a pool of workers, which start with the first job if not before."""
        self._monitor = WaveMonitor()
        self.interrupt_handler.watch(self._monitor.stop)
        work = partial(trace_job, self._plan.tracer)
        self._pool: AnyPool
        if self._plan.inline:
            self._pool = InlineWorker(work, self._monitor)
        else:
            self._pool = WorkerPool(
                partial(work, self._monitor),
                self._plan.budget.workers,
                self._plan.executor,
                self._monitor.stop,
                self._settings.values["strict"],
            )
        if self._in_block:
            self._pool.__enter__()

    def _begin_picture(self, camera: Camera, sums: PictureSums, begin: float) -> None:
        """Get ready for a picture of a view; `begin` is when it was asked for, by `time.perf_counter`."""
        self._picture = Picture(self._plan, camera, sums, begin)
        self._work = Work(self._picture, self._pool, self._monitor, self._wave_done)
        self._last_snapshot = begin
        self._ended = self._warned = False

    # --- Use ------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """Keep the workers until the end of the block."""
        self._in_block = True
        self._pool.__enter__()
        return self

    def __exit__(self, *raised: object) -> None:
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
        with self.interrupt_handler, self._use:
            if self._stopped:  # since the last picture
                self._keep_render()
                self._ended = True
                self._pool.cancel()
                raise StopIteration
            for pass_ended in self._work.sweeps(doubling):
                if pass_ended or time.perf_counter() - self._last_snapshot >= SNAPSHOT_INTERVAL:
                    snapshot = self._picture.image()
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
        with self.interrupt_handler, self._use:
            for _ in () if self._stopped else self._work.sweeps(undivided):
                pass
            image = self._end()
        if image is None:
            raise RenderError("the render was stopped before there was a picture")
        return image

    @suggests_keywords
    def set_camera(self, camera: Camera | None, size: ImageSize | None = None) -> None:
        """Begin another picture of the same scene, without compiling it again.

        The picture so far is dropped. Workers that have been started continue with the new picture, and
        `seconds` are counted from now on.

        Parameters
        ----------
        camera
            The camera; None for the scene's own camera, or one that frames it.
        size
            (width, height) in pixels, in place of the camera's.

        Raises
        ------
        SceneError
            If one of them is malformed, or the session has a checkpoint. The picture that was begun is not
            changed.
        RenderError
            If the session is closed.
        """
        begin, settings = time.perf_counter(), self._settings
        if self._closed:
            raise RenderError("the session is closed")
        if self._picture.file is not None:
            raise SceneError(
                "a session with a checkpoint renders one view; begin another session for this one"
            )
        check_camera("camera", camera)
        size = None if size is None else image_size(size)
        values = settings.values
        camera, _ = choose_camera(
            self._scene.scene, camera, size, values["up"], values["view"], values["fov"]
        )
        self._scene.check_camera(camera)
        executor = settings.executor_for(camera.size)
        budget = make_budget(settings, camera.size, executor, self._plan.tracer.recorded_aovs)
        sums = self._plan.sums(camera.size)
        with self.interrupt_handler, self._use:
            self._work.discard()
            self._stopped = self._dropped = False  # a stop from now on is one of the new picture
            if not self._pool.closed:
                self._pool.cancel()
            other_workers = (executor, self._plan.executor) == ("processes", "threads")
            other_workers |= budget.workers != self._plan.budget.workers
            other_workers |= fits_a_wave(settings, camera.size, budget) != self._plan.inline
            other_workers |= camera.moves or self._picture.camera.moves  # their motions are part of the plan
            table = learn_guide(settings, self._scene.compiled, camera)
            other_workers |= table is not self._plan.tracer.table
            if self._monitor.stop.value or other_workers:
                self._pool.close()
                self._plan = make_plan(settings, self._scene, camera, table)
                self._make_pool()
            else:
                self._plan = replace(self._plan, budget=budget)
            self._plan = with_choice(self._plan, camera)
            self._begin_picture(camera, sums, begin)

    def suits(self, camera: Camera | None) -> bool:
        """Return whether light and ground are those for another camera; None is one that frames the scene."""
        return self._scene.suits(camera, self._settings)

    def stop(self) -> None:
        """End the render: the loop over the session ends with the picture so far.

        It can be called from another thread, and from a function that is given as `progress`.
        """
        self._stopped = True
        self._monitor.stop.rise_to(STOP)

    def drop(self) -> None:
        """End the render as `stop` does, but without a picture of it, as another view follows."""
        self._dropped = True
        self.stop()

    def start_workers(self) -> None:
        """Start the workers now; otherwise they start with the first samples.

        Raises
        ------
        RenderError
            If one cannot be started.
        """
        self._pool.start()

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
        sums = self._picture.sums
        sums.identity = sums.identity or self._picture.identity()
        self._picture.checkpoint(self.command).write(path)

    def identity(self) -> dict[str, Any]:
        """Return the properties that another render must share so that its samples are the same.

        These are settings, and fingerprints of the scene, the camera and functions of your own. `spp` and
        `seconds` are not part of it.

        Raises
        ------
        SceneError
            If a part of the scene, such as an attribute of a BSDF of your own, cannot be compared.
        """
        return self._picture.identity()

    @suggests_keywords
    def silhouettes(self, camera: Camera | None = None) -> Iterator[tuple[int, Bools]]:
        """Yield the id of each shape and the pixels (height, width) that it would cover if it were alone.

        Ids and rays are those of the AOV `shape_id`. Shapes that would cover no pixel are left out.

        Parameters
        ----------
        camera
            The camera; None for that of the picture.
        """
        return silhouettes(self._plan.tracer.scene, self._picture.camera if camera is None else camera)

    @property
    def stages(self) -> StageList:
        """The stages that run, and the features that act between them, as `wf.program` lists them."""
        return self._plan.stages

    def tell_hints(self, image: Image) -> None:
        """Write hints to stderr if the picture took over ten seconds: one line each, once in a session.

        `render` does so where it shows its progress.

        Parameters
        ----------
        image
            The last picture of the session.
        """
        self._hints.tell(image)

    def close(self) -> None:
        """End the render and all workers; the session cannot be used again.

        A render that another thread waits for ends with its picture so far.
        """
        if self._use.elsewhere:
            self.stop()
            self._use.wait()
        with self.interrupt_handler, self._use:
            if not self._ended:
                self._keep_render()
            self._closed = self._ended = True
            self._work.discard()
            self._pool.close()

    # --- The picture ----------------------------------------------------------------------------------

    def _wave_done(self) -> None:
        """Write the checkpoint when it is due, and warn once of paths that do not end."""
        self._picture.keep_if_due(self.command)
        long = self._settings.values["max_bounces"] > LONG_PATH and self._monitor.surfaces.value > LONG_PATH
        if long and not self._warned:
            self._warned = True
            warn_of_long_paths(self._settings.values["max_bounces"])

    def _end(self) -> Image | None:
        """Return the last picture when the work is over, or raise the error that ended it; None if none."""
        picture, work, settings = self._picture, self._work, self._settings
        self._ended = True
        self._leave_workers()
        picture.release_reserve()
        if self._dropped and not self._failed:
            return None
        not_written = picture.keep(self.command)
        image = picture.last_image(self._interrupted or self._stopped, free_sums=self._once)
        if not (self._failed or self._stopped):
            check_last_image(image, picture, work.time_up, self._monitor.surfaces.value)
        if self._failed:
            raise self._error(image, not_written) from work.failure
        if not_written is not None:
            raise RenderError(f"the checkpoint was not written: {not_written}", image) from not_written
        if not picture.samples:
            return None
        image = image.denoise() if settings.values["denoise"] else image
        if not (self._interrupted or self._stopped) and settings.values["progress"] in (None, True):
            self.tell_hints(image)
        return image

    def _leave_workers(self) -> None:
        """Close the pool, or have its workers wait for another picture."""
        if self._failed:
            self._pool.close()
        elif self._once:
            self._pool.begin_closing()
        else:
            self._pool.cancel()

    def _error(self, image: Image, not_written: SaveError | MemoryError | None) -> RenderError | Interrupted:
        """Return the error of work that failed or was interrupted, with the picture so far."""
        if not_written is not None:
            warn_caller(f"the checkpoint was not written: {not_written}")
        if self._work.failure is not None:
            return render_error(self._work.failure, image)
        return interrupted(image, self._settings.target_spp, "" if not_written else self._how_to_go_on())

    @property
    def _failed(self) -> bool:
        return self._work.failure is not None or self._interrupted

    @property
    def tracer(self) -> Tracer:
        """How its jobs are traced."""
        return self._plan.tracer

    @property
    def shapes(self) -> ShapeTable:
        """Names and ids of the shapes of its scene."""
        return self._scene.shapes

    @property
    def camera(self) -> Camera:
        """Of the picture that it renders."""
        return self._picture.camera

    @property
    def _interrupted(self) -> bool:
        return self._work.interrupted or self.interrupt_handler.pressed

    def _how_to_go_on(self) -> str:
        """Return the part of a message on the checkpoint; "" without one."""
        if self._settings.values["checkpoint"] is None:
            return ""
        path = os.fspath(self._settings.values["checkpoint"])
        how = "the same call" if self.command is None else f"wavefront resume {shlex.quote(path)}"
        return f"; {path} holds it, and {how} goes on from there"

    def _keep_render(self) -> None:
        """Write the checkpoint of a render that is left before its end; warn if that is not possible."""
        error = self._picture.keep(self.command)
        if error is not None:
            warn_caller(f"the checkpoint was not written: {error}")


def _camera_of_file(scene: Scene, settings: Settings) -> Camera | None:
    """Return the camera of a file that is read anew for each time, as it moves while the shutter is open."""
    if scene.file_moments is None or settings.shutter is None:
        return None
    return scene.file_moments.camera_between(scene, settings.shutter.begin, settings.shutter.end)

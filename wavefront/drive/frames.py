"""Frames: pictures of one scene at many times."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from operator import is_
from typing import Any, TypeAlias, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..animation import numbered
from ..arrays.vec import Doubles
from ..camera import Camera
from ..core.errors import SceneError, finite_array, number
from ..core.files import path_name
from ..core.progress import Bar
from ..film.aov_names import chosen_aovs, flow_names
from ..image import Image
from ..io.to_scene import COLORING, as_scene, coloring_of
from ..scene import Scene
from ..settings import RenderSettings, Settings, takes_settings
from ..workers.executors import EXECUTORS, worker_count
from ..workers.pool import WorkerPool
from .session import Session

FPS = 24.0  # where none is given
MOST_FRAMES = 1_000_000
OF_BARE = ("material", "smooth", *COLORING)  # settings that are applied before there are moments

SceneAt: TypeAlias = Callable[[float], Any]  # the scene of a time


@takes_settings
def render_frames(  # type: ignore[misc]  # its shutter is a part of a frame
    source: Any,
    times: Iterable[float] | None = None,
    spp: int | None = None,
    *,
    fps: float | None = None,
    shutter: float | None = None,
    animation: str | int | bool | None = None,
    **settings: Unpack[RenderSettings],
) -> Iterator[Image]:
    """Render a scene at several times, one after the other.

    Without a shutter each image is that of `render(source.at(time))` with the same settings, bit for bit:
    also its seed is the same one for all frames. Still parts of the scene are built once. With an `executor`
    of your own, such as a client of Dask or an executor of mpi4py, whole frames are its jobs, and the
    scene is sent to each worker once.

    Parameters
    ----------
    source
        What `render` takes, such as the path of an animated file or a scene with `Keyframes`; or a function
        that takes a time and returns that.
    times
        Seconds. By default from the start of the scene to just before its end, by `fps`.
    spp
        As for `render`.
    fps
        Frames per second, 24 by default.
    shutter
        Part of the time of a frame for which the shutter is open, around its time: with 0.5 motion from a
        quarter of a frame before to a quarter after is blurred. None: each frame is one moment.
    animation
        Of a file: the name or number of one of its animations, as for `load`.
    {settings}

    Yields
    ------
    Image
        When it is done.

    Notes
    -----
    A `checkpoint` has a place for the number of the frame, such as "frame_{:04d}.wfck". The same call then
    goes on where the last one ended, also within a frame.

    Raises
    ------
    SceneError
        If an argument or the scene is malformed, there is no time, or a function is given without times.
    Interrupted
        After Ctrl-C; its `image` is the picture so far.

    Examples
    --------
    >>> aside = wf.Keyframes([0, 0.5], [(0, 0, 0), (1, 0, 0)])
    >>> ball = wf.Sphere((0, 0, 0), 1).transformed(aside)
    >>> scene = wf.Scene([ball], wf.Environment(1))
    >>> [image.shape for image in wf.render_frames(scene, spp=1, fps=4, size=(16, 16))]
    [(16, 16, 3), (16, 16, 3)]
    """
    options: dict[str, Any] = {**settings}
    rate = FPS if fps is None else number("fps", fps, lambda x: x > 0, "above 0")
    open_for = None
    if shutter is not None:
        open_for = number("shutter", shutter, lambda x: x > 0, "above 0") / rate
    scene_at, span = _source(source, animation, options, open_for is not None)
    moments = frame_times(times, rate, span)
    options_of_frames = _with_flow_times(options, moments)
    jobs = [
        (time, _settings_of_frame(options_of_frames[at], at, time, open_for))
        for at, time in enumerate(moments.tolist())
    ]
    Settings(spp=spp, **jobs[0][1])  # checks them
    frames = _by_jobs if _takes_frames(options.get("executor")) else _one_by_one
    begin = clock.perf_counter()
    with Bar(options.get("progress"), len(jobs), None, unit="frame") as bar:
        for image in frames(scene_at, jobs, spp, options):
            bar.advance(1, clock.perf_counter() - begin)
            yield image


def frame_times(times: Any, fps: float, span: tuple[float, float] | None) -> Doubles:
    """Return the times (n,) of frames, seconds: those given, or all of a span by a number per second.

    Raises
    ------
    SceneError
        If they are malformed, there is none, or there is no span.
    """
    rate = number("fps", fps, lambda x: x > 0, "above 0")
    if times is not None:
        moments = finite_array("times", _as_list(times), (None,))
        if not len(moments):
            raise SceneError("times is empty; render_frames needs at least one")
        return moments
    if span is None:
        raise SceneError("source is a function of time; give its times")
    count = max(1, round((span[1] - span[0]) * rate))
    if count > MOST_FRAMES:
        raise SceneError(f"fps is {rate:g}, which makes {count} frames; there may be {MOST_FRAMES}")
    return span[0] + np.arange(count) / rate


def _as_list(times: Any) -> ArrayLike:
    """Return times for an array; those of an iterator as a list."""
    return list(times) if isinstance(times, Iterator) else times


def _source(
    source: Any, animation: str | int | bool | None, options: dict[str, Any], blurred: bool
) -> tuple[SceneAt, tuple[float, float] | None]:
    """Return a function from a time to the scene, and the span in which it moves; None for a user's function.

    Settings of bare meshes are taken out of those given. Where the frames are blurred the scene is the same
    for all times, and moves.
    """
    if callable(source) and not isinstance(source, type):
        if animation is not None:
            raise SceneError("animation is for files; source is a function of time")
        return source, None
    bare = {name: options.pop(name) for name in OF_BARE if name in options}
    reading = {} if animation is None else {"animation": animation}
    values = Settings(**bare).values
    scene = as_scene(
        source,
        values["material"],
        options.get("progress"),
        values["smooth"],
        reading=reading,
        coloring=coloring_of(values),
    )
    return partial(_same, scene) if blurred else scene.at, (scene.start, scene.end)


def _same(scene: Scene, time: float) -> Scene:
    """Return a scene that moves, whatever the time."""
    return scene


def _settings_of_frame(
    options: dict[str, Any], at: int, time: float, open_for: float | None
) -> dict[str, Any]:
    """Return the settings of a frame by its number and its time: it has its own checkpoint, and no bar.

    Where the shutter is open for some time, seconds, a camera that is given moves meanwhile.
    """
    frame = {**options, "progress": False}
    if open_for is not None:
        frame["shutter"] = time - open_for / 2, time + open_for / 2
    if options.get("checkpoint") is not None:
        frame["checkpoint"] = numbered(path_name(options["checkpoint"]), at)
    if options.get("camera") is not None and open_for is None:
        frame["camera"] = options["camera"].at(time)
    return frame


def _with_flow_times(options: dict[str, Any], moments: Doubles) -> list[dict[str, Any]]:
    """Return the settings of frames, those of optical flow with the times of the frames before and after.

    Before the first frame and after the last one, the time goes on as between it and the next one.
    """
    if options.get("flow_times") is not None or not flow_names(chosen_aovs("aovs", options.get("aovs", ()))):
        return [options] * len(moments)
    if len(moments) < 2:
        raise SceneError("flow of one frame needs flow_times=(before, after), the times of other frames")
    ends = 2 * moments[0] - moments[1], 2 * moments[-1] - moments[-2]
    around = np.concatenate([ends[:1], moments, ends[1:]])
    return [
        {**options, "flow_times": pair}
        for pair in zip(around[:-2].tolist(), around[2:].tolist(), strict=True)
    ]


def _takes_frames(executor: Any) -> bool:
    """Return whether an executor is given frames, not waves: those of the user's own."""
    return executor is not None and not isinstance(executor, str)


# --- One frame after the other, in this process ---------------------------------------------------------


def _one_by_one(
    scene_at: SceneAt, jobs: list[tuple[float, dict[str, Any]]], spp: int | None, options: dict[str, Any]
) -> Iterator[Image]:
    """Render frames one after the other; a session goes on where only the camera has moved."""
    before: Scene | None = None
    # what a user's function returns may be the same objects, changed in place
    own = isinstance(getattr(scene_at, "__self__", None), Scene)
    with ExitStack() as stack:
        session: Session | None = None
        for time, settings in jobs:
            scene = _scene_at(scene_at, time, settings)
            camera = settings.get("camera") or scene.camera
            if (
                own
                and session is not None
                and before is not None
                and _goes_on(session, before, scene, camera, settings)
            ):
                session.set_camera(camera, settings.get("size"))
            else:
                stack.pop_all().close()
                if before is not None:
                    scene.accelerators = before.accelerators
                session = stack.enter_context(Session(scene, spp, **settings))
            before = scene
            yield session.run()


def _scene_at(scene_at: SceneAt, time: float, settings: dict[str, Any]) -> Scene:
    """Return the scene of a time; the result of a function is made one, by settings of bare meshes."""
    subject = scene_at(time)
    bare = {name: settings.pop(name) for name in OF_BARE if name in settings}
    if isinstance(subject, Scene) and not bare:
        return subject
    values = Settings(**bare).values
    return as_scene(subject, values["material"], False, values["smooth"], coloring=coloring_of(values))


def _goes_on(
    session: Session, before: Scene, scene: Scene, camera: Camera | None, settings: dict[str, Any]
) -> bool:
    """Return whether the session of a scene renders another one, which must differ in its camera alone."""
    lists = (before.shapes, scene.shapes), (before.lights, scene.lights)
    same = all(len(a) == len(b) and all(map(is_, a, b)) for a, b in lists)
    same &= before.medium is scene.medium and before.settings == scene.settings
    timed = any(settings.get(name) is not None for name in ("shutter", "flow_times"))
    same &= settings.get("checkpoint") is None and not timed
    return same and session.suits(camera)


# --- Frames as jobs of an executor ----------------------------------------------------------------------


def _by_jobs(
    scene_at: SceneAt, jobs: list[tuple[float, dict[str, Any]]], spp: int | None, options: dict[str, Any]
) -> Iterator[Image]:
    """Have the workers of an executor render a frame each; the function of scenes is sent to them once."""
    executor = options["executor"]
    EXECUTORS.find(executor)
    count = worker_count(options.get("workers"), executor)
    serial = {"executor": "threads", "workers": 1}
    with WorkerPool(
        partial(_frame, scene_at, spp), count, executor, strict=bool(options.get("strict"))
    ) as pool:
        frames = [(time, {**settings, **serial}) for time, settings in jobs]
        for _, image in pool.run(frames):
            yield image


def _frame(scene_at: SceneAt, spp: int | None, job: tuple[float, dict[str, Any]]) -> Image:
    """Return the frame of a time."""
    time, settings = job
    scene = _scene_at(scene_at, time, settings)
    with Session(scene, spp, **settings) as session:
        return session.run()

"""Many views of one scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Unpack

from numpy.typing import ArrayLike

from .camera import Camera, ImageSize
from .camera.moves import orbit
from .core.errors import SceneError, iterable
from .core.suggestions import suggests_keywords
from .drive import Session
from .image import Image
from .io.to_scene import as_scene, choose_camera
from .settings import RenderSettings, refuse, takes_settings, whole_number
from .settings.checks import check_view

MOST_VIEWS = 1_000_000  # on a turntable


@takes_settings
def render_many(
    scene: Any, cameras: Iterable[Camera], spp: int | None = None, **settings: Unpack[RenderSettings]
) -> Iterator[Image]:
    """Render a scene from several cameras, one after the other.

    The scene is compiled once, and the workers are kept. Each image is that of `render` with its camera,
    bit for bit.

    Parameters
    ----------
    scene, spp
        As for `render`.
    cameras
        What sees the scene.
    {settings}

    Yields
    ------
    Image
        When it is done.

    Raises
    ------
    SceneError
        If a setting or the scene is malformed, or there is no camera.
    Interrupted
        After Ctrl-C; its `image` is the picture so far.

    Examples
    --------
    >>> scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], wf.Environment(1))
    >>> cameras = wf.turntable(scene, 3, size=(16, 16))
    >>> [image.shape for image in wf.render_many(scene, cameras, spp=1)]
    [(16, 16, 3), (16, 16, 3), (16, 16, 3)]
    """
    views = iterable("cameras", cameras, "cameras, such as wf.turntable(scene, 12)")
    first = next(views, None)
    if first is None:
        raise SceneError("cameras is empty; render_many needs at least one")
    refuse(settings, {"camera": "render_many takes cameras"})
    settings["camera"] = first
    with Session(scene, spp, **settings) as session:
        yield session.run()
        for camera in views:
            session.set_camera(camera, settings.get("size"))
            yield session.run()


@suggests_keywords
def turntable(
    scene: Any,
    n: int = 60,
    *,
    size: ImageSize | None = None,
    up: ArrayLike = "auto",
    view: str | ArrayLike | None = None,
    fov: float | None = None,
) -> list[Camera]:
    """Return n cameras on a circle around the middle of a scene, at equal angles: a turntable.

    The first is the scene's camera, or one that frames it with room for a whole turn.

    Parameters
    ----------
    scene
        What `render` takes.
    n
        From 1 to a million.
    size
        (width, height) in pixels, in place of the camera's.
    up
        What is up in the scene: (3,), the name of an axis, or "auto", as for `render`.
    view, fov
        The first camera, as for `render`.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> cameras = wf.turntable(wf.Sphere((0, 0, 0), 1), 4, size=(16, 16))
    >>> len(cameras)
    4
    """
    n = whole_number(1, MOST_VIEWS)("n", n)
    if view is not None:
        check_view("view", view)
    subject = as_scene(scene, None, False)
    axis = subject.vertical(up)
    camera, _ = choose_camera(subject, None, size, axis, view, fov, turning=True)
    return [orbit(camera, subject.bounds.mean(0), 360 * k / n, axis) for k in range(n)]

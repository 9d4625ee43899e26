"""`view()`: a page in the browser that shows a scene, rendered while one looks."""

from __future__ import annotations

import atexit
import sys
import threading
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Self, Unpack

from ..camera import Camera
from ..codecs.tone import AUTO, TONE_NAMES
from ..core.errors import RenderError, SceneError, number, one_of
from ..core.suggestions import suggests_keywords
from ..drive import Session
from ..drive.notebook import in_kernel
from ..image import Image
from ..io.to_scene import COLORING, as_scene, choose_camera, coloring_of
from ..scene import Scene
from ..scene.state import scene_state
from ..settings import DEFAULT_SPP, RenderSettings, refuse, takes_settings
from ..workers.executors import choose_executor, needs_pickling, worker_count
from .guard import token_of
from .player import Player
from .priority import giving_way
from .refiner import FIRST_DIVISOR, Refiner, ViewerFrame
from .shown import VIEWER_AOVS
from .viewpoint import Viewpoint

if TYPE_CHECKING:
    from ..watching.path import PathVertices
    from .clicked_path import PathOf

# Paths: a movement waits for less of a smaller wave, and one of half the size costs 10 % more.
WAVE_SIZE = 1 << 15
POLL = 0.5  # seconds
FIRST_SEEN = 10.0  # seconds that a moment is waited for while a scene plays
WATCH = 0.5  # seconds between looks at whether the scene has changed
FRAME = "100%", 600  # width and height of the page in a notebook
# settings that decide where paths go
OF_PATHS = frozenset(
    (
        "seed",
        "sampler",
        "integrator",
        "max_bounces",
        "light_sampler",
        "lighting",
        "ground",
        "up",
        "accel",
        "filter",
    )
)
REFUSED = dict.fromkeys(("checkpoint", "samples", "progress"), "it is for a picture of one view")


class Viewer:
    """A page that shows a scene. `view` makes it.

    As a context manager it is closed at the end of the block.

    Parameters
    ----------
    session
        Renders the pictures; the viewer closes it.
    viewpoint
        The first view.
    host, port
        Host and port of the server.
    token
        The token that the address of the page must have; "" for none.
    renew
        Makes a session of the scene as it is now; None where it cannot change.
    state
        Returns the state of the scene, which differs once it was changed; None if nobody is to look.
    tone
        The first tone curve.
    spp
        Samples per pixel of the last picture of a view; None where they are not known before.
    path_of
        Traces the path of a pixel of a view.
    span
        Start and end of a scene that moves, seconds; None of one that is still.

    Attributes
    ----------
    url
        The address of the page, with its token.
    elsewhere
        The address for other machines, if the server listens for them; else None.

    Examples
    --------
    >>> import wavefront as wf
    >>> ball = wf.Sphere((0, 0, 0), 1)
    >>> with wf.view(ball, spp=4, size=(32, 32), open_browser=False, block=False) as viewer:
    ...     same = wf.render(ball, spp=4, camera=viewer.camera)
    """

    def __init__(
        self,
        session: Session,
        viewpoint: Viewpoint,
        host: str,
        port: int,
        token: str,
        tone: str,
        spp: int | None,
        renew: Callable[[float | None], Session] | None = None,
        state: Callable[[], object] | None = None,
        path_of: PathOf | None = None,
        span: tuple[float, float] | None = None,
    ) -> None:
        self._renew, self._state = renew, state
        self._player = None if span is None else Player(span, self._play_on)
        self._wanted: Camera | None = None
        self._latest: ViewerFrame | None = None
        self._error: Exception | None = None  # that ended the newest view
        self._page: Page | None = None
        self._news = threading.Condition()
        self._closed = threading.Event()
        self._refiner = Refiner(session, self._show, self._fail)
        try:
            self._refiner.start()
            self._look(viewpoint)
            from .page import Page, TimeControls  # while workers trace, as it takes long to import viser

            path_of = path_of or _no_path
            look, seen, watch = self._look, self._refiner.refine, None
            if span is not None:
                watch = TimeControls(span, self.seek, self.play, self.pause)
            self._page = Page(host, port, token, viewpoint, spp, tone, look, seen, path_of, watch)
        except BaseException:
            self._refiner.close()
            raise
        self.url, self.elsewhere = self._page.url, self._page.elsewhere
        atexit.register(self.close)
        if state is not None:
            self._shown_state = state()
            threading.Thread(target=self._watch, name="wavefront-viewer-watch", daemon=True).start()
        if self._latest is not None:
            self._page.show(self._latest)

    def __repr__(self) -> str:
        """Say where the page is."""
        return f"<Viewer at {self.url}{', closed' if self._closed.is_set() else ''}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        """Close the viewer."""
        self.close()

    @property
    def camera(self) -> Camera:
        """The camera of the view that the page shows: `render` with it gives the same picture."""
        assert self._wanted is not None
        return self._wanted

    @property
    def image(self) -> Image | None:
        """The newest picture; None if there is none yet."""
        return None if self._latest is None else self._latest.image

    @suggests_keywords
    def wait_for_picture(self, timeout: float | None = None) -> Image:
        """Wait until the picture of the view is done, and return it.

        Parameters
        ----------
        timeout
            Seconds; None waits as long as it takes.

        Raises
        ------
        RenderError
            If the time is over, or the viewer was closed. Its `image` is the newest picture.
        """
        self._refiner.refine()
        with self._news:
            self._news.wait_for(lambda: self._done() or self._closed.is_set(), timeout)
            if self._latest is not None and self._latest.final and self._done():
                return self._latest.image
        if self._error is not None:
            raise RenderError(f"the view was not rendered: {self._error}", self.image) from self._error
        why = "was closed" if self._closed.is_set() else f"has no last picture after {timeout} s"
        raise RenderError(f"the viewer {why}", self.image)

    def update(self) -> None:
        """Show the scene as it is now, after its shapes, materials or lights were changed.

        It is done by itself within a second or two where objects of the scene were changed or replaced. Of
        arrays that were changed in place, such as `mesh.vertices[0] = ...`, only this call knows.

        Raises
        ------
        SceneError
            If the scene cannot be rendered as it is; the page shows the old one.
        RenderError
            If the viewer is closed.

        Examples
        --------
        >>> import wavefront as wf
        >>> ball = wf.Sphere((0, 0, 0), 1)
        >>> with wf.view(ball, spp=4, size=(32, 32), open_browser=False, block=False) as viewer:
        ...     ball.material = "gold"
        ...     viewer.update()
        ...     image = viewer.wait_for_picture()
        """
        if self._closed.is_set() or self._renew is None:
            raise RenderError("the viewer is closed")
        if self._state is not None:
            self._shown_state = self._state()
        session = self._renew(self.time)
        with self._news:
            self._wanted, self._error = copy(self.camera), None  # a view of its own, to be waited for
        self._refiner.replace(session, self._wanted)

    # --- Time -----------------------------------------------------------------------------------------

    @property
    def time(self) -> float | None:
        """The time that is shown of a scene that moves, seconds; None of one that is still."""
        return None if self._player is None else self._player.time

    def seek(self, time: float) -> None:
        """Show the scene at another time.

        Parameters
        ----------
        time
            Seconds of the scene.

        Raises
        ------
        SceneError
            If the time is not finite, or nothing moves.
        RenderError
            If the viewer is closed.
        """
        player = self._moving()
        player.pause()
        player.time = number("time", time)
        self.update()

    def play(self) -> None:
        """Let the time of the scene run on, again and again, until `pause`.

        Of each moment there is a quick picture; it refines when the time stands still.

        Raises
        ------
        SceneError
            If nothing moves.
        """
        self._moving().play()

    def pause(self) -> None:
        """Hold the time; the picture refines."""
        self._moving().pause()

    def _moving(self) -> Player:
        if self._player is None:
            raise SceneError("nothing moves in the scene of the viewer")
        return self._player

    def _play_on(self, time: float) -> None:
        """Show a moment, and wait for its first picture."""
        with suppress(RenderError):  # it has been closed
            self.update()
            with self._news:
                self._news.wait_for(lambda: self._seen() or self._closed.is_set(), FIRST_SEEN)
            if self._page is not None:
                self._page.tell_time(time)

    def _seen(self) -> bool:
        """Return whether there is a picture of the newest view."""
        return self._error is not None or (self._latest is not None and self._latest.camera is self._wanted)

    def _watch(self) -> None:
        """Update the picture once the scene has changed, and then stayed as it is for a moment."""
        assert self._state is not None
        before = self._shown_state
        while not self._closed.wait(WATCH):
            state = self._state()
            if state == before and state != self._shown_state:
                try:
                    self.update()
                except Exception as error:  # as of a scene that is not complete yet
                    self._shown_state = state
                    self._fail(error)
            before = state

    def wait(self) -> None:
        """Wait until the viewer is closed, or for Ctrl-C, which closes it."""
        try:
            while not self._closed.wait(POLL):
                pass
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """End the render and the server; no process, thread or socket is left."""
        if self._closed.is_set():
            return
        self._closed.set()
        atexit.unregister(self.close)
        with self._news:
            self._news.notify_all()
        if self._player is not None:
            self._player.pause()
        self._refiner.close()
        if self._page is not None:
            self._page.close()

    def _look(self, viewpoint: Viewpoint) -> None:
        """Begin pictures of a view; called in the page's event loop."""
        camera = viewpoint.camera
        with self._news:
            self._wanted, self._error = camera, None
        self._refiner.look(camera)

    def _done(self) -> bool:
        """Return whether no better picture of the newest view follows."""
        latest = self._latest
        final = latest is not None and latest.final and latest.camera is self._wanted
        return final or self._error is not None

    def _show(self, frame: ViewerFrame) -> None:
        with self._news:
            self._latest = frame
            self._news.notify_all()
        if self._page is not None:
            self._page.show(frame)

    def _fail(self, error: Exception) -> None:
        with self._news:
            self._error = error
            self._news.notify_all()
        if self._page is not None:
            self._page.say(f"stopped: {error}")


@takes_settings
def view(
    scene: Any,
    spp: int | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    token: str | bool = True,
    tone: str = AUTO,
    open_browser: bool = True,
    block: bool | None = None,
    **settings: Unpack[RenderSettings],
) -> Viewer:
    """Show a scene in the browser, where you can move around while the picture refines.

    It needs viser: `pip install viser`, the extra `viewer`.

    Parameters
    ----------
    scene
        As for `render`.
    spp
        Samples per pixel of the last picture of a view; by default it ends by itself, as for `render`.
    host
        The address to listen at. By default only this machine can connect; "0.0.0.0" lets all machines of
        the network in that know the token.
    port
        Where to listen; if it is taken, one of the next.
    token
        What the address of the page has as `?token=`; requests without it are refused. True draws one, which
        later viewers of the program have, too, so that an open page finds them at the same port;
        a text is taken as it is, and False lets in all who can connect.
    tone
        The tone curve that the page begins with, as for `Image.save`; the page can change it.
    open_browser
        Whether to open the page. In a notebook it is shown in a frame below the cell in any case.
    block
        True waits for Ctrl-C, and closes the viewer then. None does so in scripts, whose end would close the
        viewer, and returns at once in notebooks and at a prompt.
    {settings}

    Returns
    -------
    Viewer

    Raises
    ------
    SceneError
        If an argument or the scene is malformed, or nothing can listen there.
    ImportError
        If viser is not installed.

    Examples
    --------
    >>> import wavefront as wf
    >>> ball = wf.Sphere((0, 0, 0), 1)
    >>> with wf.view(ball, spp=4, size=(32, 32), open_browser=False, block=False) as viewer:
    ...     image = viewer.wait_for_picture()
    """
    _check_viser()
    refuse(settings, REFUSED)
    if not isinstance(port, int) or not 0 <= port < 2**16:
        raise SceneError(f"port is {port!r}; it must be a whole number from 0 to 65535")
    token = token_of(token)
    one_of("tone", tone, TONE_NAMES)
    coloring = coloring_of(settings)
    for name in COLORING:
        settings.pop(name, None)  # type: ignore[misc]
    material, smooth = settings.pop("material", None), settings.pop("smooth", "auto")
    subject = as_scene(scene, material, smooth=smooth, coloring=coloring)
    viewer = _opened(subject, spp, host, port, token, tone, settings)
    in_notebook = in_kernel()
    if in_notebook:
        _show_frame(viewer.url)
    elif open_browser:
        webbrowser.open(viewer.url)
    if block or (block is None and not in_notebook and not hasattr(sys, "ps1")):
        also = f", and for other machines {viewer.elsewhere}" if viewer.elsewhere else ""
        print(f"wavefront: {viewer.url}{also} shows the scene; Ctrl-C ends", flush=True)
        viewer.wait()
    return viewer


def _opened(
    scene: Scene, spp: int | None, host: str, port: int, token: str, tone: str, settings: RenderSettings
) -> Viewer:
    """Return a viewer of a scene with settings of `Session`."""
    up = scene.vertical(settings.get("up", "auto"))
    framing = settings.pop("view", None), settings.pop("fov", None)
    camera, _ = choose_camera(scene, settings.get("camera"), settings.get("size"), up, *framing)
    viewpoint = Viewpoint.of(camera.at(scene.start), scene.reach, up)
    aovs = settings.pop("aovs", ())
    wanted = (*((aovs,) if isinstance(aovs, str) else aovs), *VIEWER_AOVS)
    width, height = (max(1, side // FIRST_DIVISOR) for side in viewpoint.camera.resolution)
    settings |= {"camera": viewpoint.camera, "size": (width, height), "aovs": wanted, "progress": False}
    if settings.get("wave_size") is None:
        settings["wave_size"] = WAVE_SIZE
    if settings.get("executor") is None:
        settings["executor"] = _executor(settings.get("workers"), (spp or DEFAULT_SPP) * viewpoint.pixels)

    shown = [scene]  # at the time that is shown

    def renew(time: float | None) -> Session:
        scene.check()
        shown[0] = scene if time is None else scene.at(time)
        with giving_way():
            return Session(shown[0], spp, **settings)

    def path_of(view: Viewpoint, pixel: tuple[int, int]) -> PathVertices:
        from ..watching.trace import Wave  # here, as few look at a path

        known = {name: value for name, value in settings.items() if name in OF_PATHS}
        return Wave(shown[0], size=None, camera=view.camera, **known).path(pixel, sample=0)

    span = (scene.start, scene.end) if scene.moves else None
    first = renew(None if span is None else span[0])
    state = partial(scene_state, scene)
    return Viewer(first, viewpoint, host, port, token, tone, spp, renew, state, path_of, span)


def _no_path(view: Viewpoint, pixel: tuple[int, int]) -> PathVertices:
    raise SceneError("the viewer does not know the scene of its session")


def _executor(workers: int | None, paths: int) -> str | None:
    """Choose an executor once, before there are other threads.

    None leaves the choice to the session, where it depends on whether the scene can be pickled.
    """
    chosen = choose_executor(None, worker_count(workers), paths)
    return chosen if isinstance(chosen, str) and not needs_pickling(chosen) else None


def _check_viser() -> None:
    if find_spec("viser") is None:
        raise ImportError("the viewer needs viser: pip install viser")


def _show_frame(url: str) -> None:
    from IPython.display import IFrame, display

    width, height = FRAME
    display(IFrame(url, width, height, extras=['allow="clipboard-write"']))

"""The page of a viewer: a picture behind an orbit camera, with controls, served by viser."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..codecs import png_jpeg
from ..codecs.tone import TONE_NAMES
from ..core.errors import RenderError, SceneError, one_of
from ..denoising import FEW, is_quick
from ..image import Image
from ..settings import DEFAULT_SPP
from ..workers.machine import trim_heap
from .background_denoiser import BackgroundDenoiser
from .clicked_path import ClickedPath
from .first_paint import FirstPaint, asked_first
from .guard import Guard, take_values
from .refiner import ViewerFrame
from .shown import CHOICES, shown_codes
from .viewpoint import FOV, Viewpoint, within

if TYPE_CHECKING:
    from .clicked_path import PathOf

QUALITY = 85  # of pictures while they refine, sent as jpg; the last one is a png
ARRIVAL = 3.0  # seconds in which a page that connects takes the view; before, it has views of its own
MOST_AT_ONCE = 1 << 15  # pixels of pictures that are shown denoised only: Open Image Denoise takes 0.06 s
DENOISER = "denoiser"  # in the metadata of pictures that were denoised
PAUSE = 0.1  # seconds between pictures that refine, so that the browser has time for movements
EVERYWHERE = "0.0.0.0", "::", ""  # hosts that are reached from other machines, too
STOPS = 6.0  # exposure, up and down
STEPS = 200  # of a slider
SAME_SHAPE = 0.03  # relative difference of the aspects of two pictures that are shown as the same
COPY = (
    "const c=this.dataset.code;(navigator.clipboard?navigator.clipboard.writeText(c):Promise.reject())"
    ".then(()=>{this.textContent='copied'},()=>prompt('Copy the camera:',c))"
)
LINE = "padding:0 0.6em 0.6em;font-size:0.9em"
BUTTON = (
    "width:100%;padding:0.5em;border:0;border-radius:0.3em;cursor:pointer;"
    "background:#2b6cb0;color:#fff;font:inherit;font-size:0.85em"
)


@dataclass(frozen=True)
class TimeControls:
    """The controls of the time of a scene that moves."""

    span: tuple[float, float]  # start and end, seconds
    seek: Callable[[float], object]
    play: Callable[[], object]
    pause: Callable[[], object]


class Page:
    """The page of a viewer.

    Parameters
    ----------
    host, port
        Where it listens; if the port is taken, at one of the next ones.
    token
        The token that the address of the page must have; "" for none.
    viewpoint
        The first view.
    most_spp
        Samples per pixel of the last picture of a view; None where they are not known before.
    tone
        The first tone curve.
    look
        Called with the viewpoint when it has changed; it must return at once.
    connected
        Called when a browser has loaded the page; it must return at once, too.
    path_of
        Traces the path of a pixel of a view.
    watch
        Sets the time of a scene that moves; None for one that is still.

    Raises
    ------
    SceneError
        If the page cannot listen there.
    """

    def __init__(
        self,
        host: str,
        port: int,
        token: str,
        viewpoint: Viewpoint,
        most_spp: int | None,
        tone: str,
        look: Callable[[Viewpoint], object],
        connected: Callable[[], object],
        path_of: PathOf,
        watch: TimeControls | None = None,
    ) -> None:
        self._watch = watch
        self._look, self._connected, self._most_spp = look, connected, most_spp
        self._lock = threading.Condition()
        self._acts = ThreadPoolExecutor(1, thread_name_prefix="wavefront-page-acts")  # starts with the first
        self._viewpoint = viewpoint
        self._exposure, self._choice, self._tone = 0.0, "rgb", tone
        self._frame: ViewerFrame | None = None
        self._denoised: tuple[ViewerFrame, Image] | None = None  # the newest one
        self._fresh = self._closed = False
        self._sized = False  # whether a page has said how large it is
        self._codes: NDArray[np.uint8] | None = None  # of the picture that is shown
        self._arrived: set[int] = set()  # pages that have taken the view
        self._sent: tuple[ViewerFrame | None, float] = None, 0.0  # the newest one that was sent, and when
        guard = Guard(host, token)
        self._server = _serve(
            host, port, FirstPaint(guard, self._picture, lambda: self._begin_at(self.viewpoint))
        )
        take_values(self._server)
        where = f":{self._server.get_port()}/{guard.query}"
        self.url = f"http://{_address(host)}{where}"
        self.elsewhere = f"http://{socket.gethostname()}{where}" if host in EVERYWHERE else None
        self._add_camera()
        self._add_controls()
        self.path = ClickedPath(self._server, lambda: self.viewpoint, path_of, self.say)
        self._server.on_client_connect(self._greet)
        self._server.on_client_disconnect(self._forget)
        self._denoiser = BackgroundDenoiser(
            self._take_denoised, lambda error: self.say(f"not denoised: {error}")
        )
        self._presenter = threading.Thread(target=self._present, name="wavefront-page", daemon=True)
        self._presenter.start()

    @property
    def viewpoint(self) -> Viewpoint:
        """The view of the page."""
        with self._lock:
            return self._viewpoint

    def show(self, frame: ViewerFrame) -> None:
        """Show a picture; it returns at once, and of several the newest is shown."""
        with self._lock:
            self._frame = frame
            self._refresh()

    def say(self, text: str) -> None:
        """Show a line of text in place of the state of the picture."""
        self._state.content = _line(text)
        self._copy.content = self._copy_button()

    def close(self) -> None:
        """End the server and all threads."""
        with self._lock:
            self._closed = True
            self._refresh()
        self._acts.shutdown(wait=False, cancel_futures=True)
        self._presenter.join()
        self._denoiser.close()
        with _silence():
            self._server.stop()
        self._server._thread_executor.shutdown(wait=True)

    # --- Elements of the page --------------------------------------------------------------------------

    def _add_camera(self) -> None:
        view = self._viewpoint
        self._server.scene.configure_environment_map(None)  # no light, as there is nothing but a picture
        self._server.scene.configure_default_lights(False)
        self._server.scene.set_up_direction(view.up)
        self._begin_at(view)

    def _begin_at(self, view: Viewpoint) -> None:
        """Let pages that connect begin with a view."""
        camera, around = self._server.initial_camera, view.surroundings
        camera.up = np.array(view.up)
        camera.position = around.to_page(view.origin)
        camera.look_at = around.to_page(view.target)
        camera.fov = float(np.radians(view.fov))

    def _add_controls(self) -> None:
        gui, view = self._server.gui, self._viewpoint
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        gui.set_panel_label("wavefront")
        self._state = gui.add_html(_line("…"))  # markdown would be compiled for each picture
        if self._watch is not None:
            self._add_time(self._watch)
        layer = gui.add_dropdown("layer", tuple(CHOICES), initial_value="rgb")
        layer.on_update(self._on(lambda event: self._show_as(choice=event.target.value)))
        tone = gui.add_dropdown("tone", TONE_NAMES, initial_value=self._tone)
        tone.on_update(self._on(lambda event: self._show_as(tone=event.target.value)))
        exposure = gui.add_slider("exposure", -STOPS, STOPS, 0.1, 0.0, hint="stops")
        exposure.on_update(self._on(lambda event: self._show_as(exposure=event.target.value)))
        hints = {"fov": "degrees", "focus": "distance, scene units", "aperture": "diameter, scene units"}
        titles = {"fov": "field of view", "focus": "focus", "aperture": "aperture"}
        for name in view.controls:
            low, high = FOV if name == "fov" else view.ranges[name]
            step = 0.5 if name == "fov" else float(f"{(high - low) / STEPS:.1g}")
            slider = gui.add_slider(titles[name], low, high, step, getattr(view, name), hint=hints[name])
            slider.on_update(self._on(partial(self._set_lens, name)))
        save = gui.add_button("save picture")
        save.on_click(self._on(self._save))
        self._copy = gui.add_html(self._copy_button())

    def _add_time(self, watch: TimeControls) -> None:
        """Add a slider of the time, and a box to play."""
        gui, (start, end) = self._server.gui, watch.span
        step = float(f"{((end - start) or 1.0) / STEPS:.1g}")
        self._time = gui.add_slider("time", start, max(end, start + step), step, start, hint="seconds")
        self._time.on_update(self._on(partial(self._scrub, watch)))
        self._playing = gui.add_checkbox("play", False)
        self._playing.on_update(self._on(partial(self._play, watch)))

    def tell_time(self, time: float) -> None:
        """Show the time of a scene that plays."""
        self._time.value = time

    def _scrub(self, watch: TimeControls, event: Any) -> None:
        if event.client is not None:  # not the clock
            time = within("time", event.target.value, *watch.span)
            self._playing.value = False
            self._in_background(partial(watch.seek, time))

    def _play(self, watch: TimeControls, event: Any) -> None:
        if event.client is not None:
            self._in_background(watch.play if event.target.value else watch.pause)

    def _in_background(self, act: Callable[[], object]) -> None:
        """Run a function that takes longer than the event loop may wait, in the order of the calls."""
        self._acts.submit(self._tried, act)

    def _tried(self, act: Callable[[], object]) -> None:
        try:
            act()
        except (SceneError, RenderError) as error:
            self.say(str(error))

    def _copy_button(self) -> str:
        code = escape(self._viewpoint.code, quote=True)
        button = f'<button style="{BUTTON}" data-code="{code}" onclick="{COPY}">copy camera as code</button>'
        return f'<div style="padding:0 0.6em 0.6em">{button}</div>'

    # --- Events of the page ----------------------------------------------------------------------------

    def _on(self, act: Callable[[Any], object]) -> Callable[[Any], Any]:
        """Return the callback of viser's event loop, in the order of the messages; bad values are ignored."""

        async def react(event: Any) -> None:
            with suppress(SceneError):
                act(event)

        return react

    async def _greet(self, client: Any) -> None:
        """Follow the camera of a page that has connected."""
        client.camera.on_update(self._on(partial(self._move, time.monotonic() + ARRIVAL)))
        await self._on(self._resize)(client.camera)
        self._connected()

    def _move(self, arrival: float, camera: Any) -> None:
        """Show the view of a page, once it has taken that of the others, or the time for that is over."""
        page, view = camera.client.client_id, self.viewpoint
        if page not in self._arrived:
            if not _is_at(camera, view) and time.monotonic() < arrival:
                self._resize(camera)
                return
            self._arrived.add(page)
        view = view.moved(camera.position, camera.look_at, camera.up_direction)
        self._change(view.resized(camera.image_width, camera.image_height))

    async def _forget(self, client: Any) -> None:
        """Keep nothing for the next page when the last one is left: it may have another shape."""
        if not self._server.get_clients() and not self._closed:
            with self._lock:
                self._sized = False
            self._server.scene.set_background_image(None)
            trim_heap()  # memory that connections took

    def _resize(self, camera: Any) -> None:
        self._change(self.viewpoint.resized(camera.image_width, camera.image_height))
        with self._lock:
            self._sized = True
            self._refresh()

    def _set_lens(self, name: str, event: Any) -> None:
        self._change(self.viewpoint.with_lens(**{name: event.target.value}))
        if name == "fov":
            for client in self._server.get_clients().values():
                client.camera.fov = float(np.radians(self.viewpoint.fov))

    def _change(self, viewpoint: Viewpoint) -> None:
        with self._lock:
            if viewpoint == self._viewpoint:
                return
            self._viewpoint = viewpoint
        self._look(viewpoint)

    def _show_as(self, choice: str | None = None, exposure: Any = None, tone: str | None = None) -> None:
        if choice is not None:
            one_of("layer", choice, CHOICES)
        if tone is not None:
            one_of("tone", tone, TONE_NAMES)
        if exposure is not None:
            exposure = within("exposure", exposure, -STOPS, STOPS)
        with self._lock:
            self._choice = self._choice if choice is None else choice
            self._exposure = self._exposure if exposure is None else exposure
            self._tone = self._tone if tone is None else tone
            self._refresh()

    def _save(self, event: Any) -> None:
        with self._lock:
            codes = self._codes
        if codes is not None:
            png = png_jpeg.encode(codes, ".png", 2.2)
            event.client.send_file_download("wavefront.png", png, save_immediately=True)

    # --- Pictures of the page --------------------------------------------------------------------------

    def _picture(self) -> bytes | None:
        """Return the picture that is shown, as a jpg; None if there is none yet."""
        with self._lock:
            codes = self._codes
        return None if codes is None else png_jpeg.encode(codes, ".jpg", 2.2)

    def _refresh(self) -> None:
        """Wake the presenter; the lock is held."""
        self._fresh = True
        self._lock.notify()

    def _present(self) -> None:
        """Send the newest picture whenever there is one. Runs in a thread of its own."""
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._fresh)
                self._lock.wait_for(self._urgent, max(0.0, self._sent[1] + PAUSE - time.monotonic()))
                if self._closed:
                    return
                self._fresh = False
                frame, choice, denoised = self._frame, self._choice, self._denoised
                exposure, tone = self._exposure, self._tone
            if frame is None:
                continue
            image = self._shown(frame, choice, denoised)
            try:
                codes = shown_codes(image, choice, exposure, tone)
            except SceneError as error:
                self.say(str(error))
                continue
            with self._lock:
                self._codes = codes
                self._sent = frame, time.monotonic()
            self._send(codes, frame, image)

    def _shown(self, frame: ViewerFrame, choice: str, denoised: tuple[ViewerFrame, Image] | None) -> Image:
        """Return a picture as it is shown: denoised, if that is wanted and done; begin it otherwise."""
        image = frame.image
        few = choice == "rgb" and is_quick() and image.spp < FEW and not frame.final
        wants = (choice == "denoised" or few) and DENOISER not in image.metadata
        at_once = wants and is_quick() and image.rgb.size <= 3 * MOST_AT_ONCE
        self._denoiser.want(frame if wants and not at_once else None)
        if at_once:
            with suppress(RenderError):  # of the library: it is shown as it is
                return image.denoise()
        of_view = wants and denoised is not None and denoised[0].camera is frame.camera
        return denoised[1] if of_view and denoised is not None else image

    def _take_denoised(self, frame: ViewerFrame, image: Image) -> None:
        """Show a picture that was denoised, if it is still wanted."""
        with self._lock:
            self._denoised = frame, image
            self._refresh()

    def _about(self, frame: ViewerFrame, image: Image) -> str:
        """Return the words about denoising for the line below the picture."""
        if DENOISER in image.metadata:
            return f" · denoised at {image.spp} spp" if image.spp < frame.image.spp else " · denoised"
        if self._choice != "denoised":
            return ""
        return " · denoising" if is_quick() else " · denoising, slowly: pip install pyoidn makes it quick"

    def _urgent(self) -> bool:
        """Return whether a picture may not wait: any but a better one of the same view."""
        last, frame = self._sent[0], self._frame
        better = last is not None and frame is not None and frame is not last and frame.camera is last.camera
        return self._closed or not better or (frame is not None and frame.final)

    def _send(self, codes: NDArray[np.uint8], frame: ViewerFrame, image: Image) -> None:
        """Send a picture, unless the page would stretch it, and the line about it."""
        if not self._sized or not _same_shape(frame.camera.resolution, self.viewpoint.size):
            return
        last = frame.final and (image is frame.image or image.spp == frame.image.spp)
        kind = {"format": "png"} if last else {"format": "jpeg", "jpeg_quality": QUALITY}
        self._server.scene.set_background_image(np.ascontiguousarray(codes), **kind)
        if not self._sized:  # the last page was left meanwhile
            self._server.scene.set_background_image(None)
        height, width = codes.shape[:2]
        of = "" if self._most_spp is None else f" of {self._most_spp}"
        noise = frame.image.metadata["noise"]
        error = f" · error {noise:.2%}" if np.isfinite(noise) else ""
        self._state.content = _line(
            f"{width} × {height} · {frame.image.spp}{of} spp{error}{self._about(frame, image)}{_ended(frame)}"
        )
        # not with the first picture of a view, which is in a hurry
        if (width, height) == frame.camera.resolution:
            self._copy.content = self._copy_button()
        self._server.flush()  # viser would wait for more messages


def _same_shape(size: tuple[int, int], other: tuple[int, int]) -> bool:
    """Return whether two pictures have about the same aspect; small ones are rounded."""
    return abs(size[0] * other[1] / (size[1] * other[0]) - 1) < SAME_SHAPE + 1 / min(*size, *other)


def _is_at(camera: Any, view: Viewpoint) -> bool:
    """Return whether the camera of a page is that of a view."""
    around = view.surroundings
    pairs = (camera.position, around.to_page(view.origin)), (camera.look_at, around.to_page(view.target))
    return all(np.allclose(of_page, of_view, rtol=1e-3, atol=1e-3) for of_page, of_view in pairs)


def _ended(frame: ViewerFrame) -> str:
    """Return the words about a last picture that has ended by itself."""
    by_itself = frame.final and frame.image.metadata.get("end") is not None
    return f' · quality="reference" takes {DEFAULT_SPP}' if by_itself else ""


def _line(text: str) -> str:
    """Return a line of text for the panel."""
    return f'<div style="{LINE}">{escape(text)}</div>'


def _serve(host: str, port: int, first_paint: FirstPaint) -> Any:
    """Start a server of viser that asks `first_paint` first."""
    import viser

    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as free:  # viser would look for a port forever
            free.bind(address)
    except (OSError, UnicodeError) as error:
        raise SceneError(f"the viewer cannot listen at host {host!r}: {error}") from error
    with _silence(), asked_first(first_paint):
        return viser.ViserServer(host, port, verbose=False)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep viser from printing lines of its own, by rich."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def _address(host: str) -> str:
    """Return the address of a host for a browser on this machine."""
    if host in EVERYWHERE:
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host

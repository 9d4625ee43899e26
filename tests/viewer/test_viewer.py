"""The viewer without a browser: its loop, what pages may say, what is served, and what is left."""

from __future__ import annotations

import asyncio
import gc
import gzip
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from importlib.machinery import ModuleSpec
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, cast
from urllib.parse import urlsplit

import imageio.v3 as iio
import numpy as np
import pytest
from inside import (
    CHOICES,
    VIEWER_AOVS,
    FirstPaint,
    Guard,
    Page,
    Refiner,
    ViewerFrame,
    Viewpoint,
    asked_first,
    is_message,
    is_own_address,
    main,
    shown_codes,
    token_of,
)
from inside import background_denoiser as denoiser_module
from inside import page as page_module
from inside import refiner as module
from scripts import SOON, eventually

import wavefront as wf

viser = pytest.importorskip("viser")
msgspec = pytest.importorskip("msgspec")  # comes with viser, as the next ones
zstandard = pytest.importorskip("zstandard")
websockets = pytest.importorskip("websockets.sync.client")
exceptions = pytest.importorskip("websockets.exceptions")
datastructures = pytest.importorskip("websockets.datastructures")

BALL = wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((0.7, 0.3, 0.1)))], wf.Environment(1))
CAMERA = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(64, 48))


# --- The loop -------------------------------------------------------------------------------------


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """First pictures of one size, however long they take."""
    monkeypatch.setattr(module, "TOO_LONG", float("inf"))
    monkeypatch.setattr(module, "SHORT", 0.0)


class Scripted:
    """Stands for a session: each picture waits for `go`, so that the order of events is known."""

    def __init__(self, pictures: int = 3) -> None:
        self.pictures = pictures
        self.views: list[tuple[wf.Camera, tuple[int, int]]] = []
        self.drops = 0
        self.started = False
        self.closed = False
        self.go = threading.Semaphore(0)
        self.entered = threading.Semaphore(0)  # released when a picture is waited for
        self._left = 0
        self._stopped = False

    def __enter__(self) -> Scripted:
        return self

    def start_workers(self) -> None:
        self.started = True

    def set_camera(self, camera: wf.Camera, size: tuple[int, int] | None = None) -> None:
        self.views.append((camera, size or camera.resolution))
        self._left, self._stopped = self.pictures, False

    def __iter__(self) -> Scripted:
        return self

    def __next__(self) -> wf.Image:
        if not self._left or self._stopped:
            raise StopIteration
        self.entered.release()
        assert self.go.acquire(timeout=SOON)
        self._left -= 1
        width, height = self.views[-1][1]
        return wf.Image(np.zeros((height, width, 3), np.float32), self.pictures - self._left)

    def drop(self) -> None:
        self.drops += 1
        self._stopped = True
        self.go.release()

    def close(self) -> None:
        self.closed = True


class Watched:
    """A refiner over a scripted session, and what it shows."""

    def __init__(self, session: Any) -> None:
        self.frames: list[ViewerFrame] = []
        self.errors: list[Exception] = []
        self.refiner = Refiner(cast(wf.Session, session), self.frames.append, self.errors.append)
        self.refiner.start()
        self.refiner.refine()


def entered(session: Scripted) -> None:
    """Wait until the loop waits for a picture."""
    assert session.entered.acquire(timeout=SOON)


@pytest.mark.usefixtures("steady")
def test_a_view_begins_small_and_refines() -> None:
    """One picture of lower resolution, then all of the whole one, of which the last is marked."""
    session = Scripted()
    watched = Watched(session)
    watched.refiner.look(CAMERA)
    session.go.release(10)
    assert eventually(lambda: watched.frames and watched.frames[-1].final)
    watched.refiner.close()
    assert session.closed
    assert [size for _, size in session.views] == [(21, 16), (64, 48)]
    assert [(frame.image.spp, frame.final) for frame in watched.frames] == [
        (1, False),
        (1, False),
        (2, False),
        (3, False),
        (3, True),
    ]
    assert session.drops == 1  # at the end


@pytest.mark.usefixtures("steady")
def test_a_movement_stops_a_picture_that_refines() -> None:
    session = Scripted(pictures=1000)
    watched = Watched(session)
    watched.refiner.look(CAMERA)
    entered(session)
    session.go.release()
    entered(session)  # in full resolution
    other = wf.Camera.look_at((0, 0, 6), (0, 0, 0), size=(64, 48))
    watched.refiner.look(other)
    assert session.drops == 1
    assert eventually(lambda: len(session.views) == 3)
    assert session.views[2] == (other, (21, 16))
    watched.refiner.close()
    assert not any(frame.final for frame in watched.frames)


@pytest.mark.usefixtures("steady")
def test_a_first_picture_is_finished_and_shown_while_the_view_moves() -> None:
    """Otherwise nothing would be seen of a movement; views that were left meanwhile are skipped."""
    session = Scripted()
    watched = Watched(session)
    cameras = [wf.Camera.look_at((0, 0, z), (0, 0, 0), size=(64, 48)) for z in (3, 4, 5)]
    watched.refiner.look(cameras[0])
    entered(session)
    watched.refiner.look(cameras[1])
    watched.refiner.look(cameras[2])
    assert session.drops == 0
    session.go.release(10)
    assert eventually(lambda: watched.frames and watched.frames[-1].final)
    watched.refiner.close()
    assert [camera for camera, _ in session.views] == [cameras[0], cameras[2], cameras[2]]
    assert watched.frames[0].camera is cameras[0]


@pytest.mark.usefixtures("steady")
def test_an_error_ends_a_view_and_not_the_viewer() -> None:
    session = Scripted()
    watched = Watched(session)
    error = wf.SceneError("too far away")
    real = session.set_camera

    def set_camera(camera: wf.Camera, size: tuple[int, int] | None = None) -> None:
        if camera is not CAMERA:
            raise error
        real(camera, size)

    session.set_camera = set_camera  # type: ignore[method-assign]
    watched.refiner.look(wf.Camera.look_at((0, 0, 6), (0, 0, 0), size=(64, 48)))
    assert eventually(lambda: watched.errors == [error])
    watched.refiner.look(CAMERA)
    session.go.release(10)
    assert eventually(lambda: watched.frames and watched.frames[-1].final)
    watched.refiner.close()


def test_the_last_picture_is_that_of_render() -> None:
    """Bit for bit, also after other views that were left early, and with the layers of a page."""
    session = wf.Session(BALL, 16, camera=CAMERA, workers=2, aovs=VIEWER_AOVS, progress=False)
    watched = Watched(session)
    for z in (3, 4, 5):
        watched.refiner.look(wf.Camera.look_at((0, 1, z), (0, 0, 0), size=(64, 48)))
        time.sleep(0.03)
    assert eventually(lambda: watched.frames and watched.frames[-1].final)
    watched.refiner.close()
    last = watched.frames[-1]
    assert last.camera.origin[2] == 5
    expected = wf.render(BALL, 16, camera=last.camera, progress=False)
    assert last.image.rgb.tobytes() == expected.rgb.tobytes()
    assert watched.errors == []


# --- Viewpoints -------------------------------------------------------------------------------------


def viewpoint(camera: wf.Camera = CAMERA) -> Viewpoint:
    return Viewpoint.of(camera, BALL.bounds, np.array([0.0, 1, 0]))


def test_code_of_a_camera_makes_it_again() -> None:
    """With all of its bits, and with few digits."""
    view = viewpoint(wf.Camera.look_at((1.23456789, 2, 3), (0.1, 0, 0), fov=33, size=(64, 48)))
    for each in (view, view.with_lens(aperture=0.125, focus=2.5)):
        copied = eval(each.code, {"wf": wf})
        for part in ("origin", "rotation"):
            assert (getattr(copied, part) == getattr(each.camera, part)).all()
        for part in ("fov", "aperture", "focus"):
            assert (
                getattr(copied.projection, part) == getattr(each.camera.projection, part) or part == "focus"
            )
        assert copied.resolution == (64, 48)
    assert "1.23457" in view.code
    assert "aperture" not in view.code


@pytest.mark.parametrize("scale", [1e-3, 1, 1e6])
def test_a_viewpoint_is_that_of_the_scenes_camera(scale: float) -> None:
    """To six digits, in scenes of any size; on the page the scene has the radius 1."""
    scene = wf.Scene([wf.Sphere((5 * scale, 0, 0), scale)], wf.Environment(1))
    camera = scene.framing_camera(fov=30, size=(64, 48))
    view = Viewpoint.of(camera, scene.bounds, np.array([0.0, 1, 0]))
    assert np.abs(view.camera.origin - camera.origin).max() < 1e-5 * scale
    assert np.abs(view.camera.rotation - camera.rotation).max() < 1e-5
    assert np.abs(view.surroundings.to_page(view.target)).max() < 1e-5
    origin, target = map(view.surroundings.to_page, (view.origin, view.target))
    assert view.moved(origin, target, view.up).origin == pytest.approx(view.origin, abs=1e-5 * scale)


def test_a_rolled_camera_keeps_its_roll() -> None:
    """Up is what the camera has for up then; a panorama becomes a perspective view."""
    rolled = wf.Camera.look_at((0, 0, 5), (0, 0, 0), up=(1, 1, 0), size=(64, 48))
    assert np.abs(viewpoint(rolled).camera.rotation - rolled.rotation).max() < 1e-5
    assert viewpoint(wf.Camera.panorama((0, 0, 5), (0, 0, 0), size=(64, 32))).fov == 40


def test_a_fisheye_stays_one() -> None:
    """In the picture and in the code that is copied, but no control changes its lens."""
    lens = wf.Fisheye(150, mapping="equisolid")
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(64, 48)).replace(projection=lens)
    view = viewpoint(camera)
    assert view.camera.projection is lens
    assert view.controls == ()
    assert repr(eval(view.code, {"wf": wf})) == repr(view.camera)
    assert viewpoint(camera.replace(projection=wf.Camera.look_at((0, 0, 5), (0, 0, 0)).projection)).controls


def test_a_picture_has_the_shape_of_the_page_and_not_more_pixels_than_allowed() -> None:
    view = viewpoint(CAMERA.resized((400, 300)))
    assert view.resized(1600, 900).size == (462, 260)
    assert view.resized(200, 100).size == (200, 100)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("origin", "target", "up"),
    [
        ((NAN, 0, 0), (0, 0, 0), (0, 1, 0)),
        ((0, 0, 5), (0, INF, 0), (0, 1, 0)),
        ((0, 0, 1e9), (0, 0, 0), (0, 1, 0)),
        ((0, 0, 5), (0, 0, 5), (0, 1, 0)),
        ((0, 0, 5), (0, 0, 0), (0, 0, 1)),
        ((0, 0, 5), (0, 0, 0), (0, 0, 0)),
        ((0, 0), (0, 0, 0), (0, 1, 0)),
        ("far", (0, 0, 0), (0, 1, 0)),
        (None, (0, 0, 0), (0, 1, 0)),
    ],
)
def test_places_that_are_none_are_refused(origin: Any, target: Any, up: Any) -> None:
    with pytest.raises(wf.SceneError):
        viewpoint().moved(origin, target, up)


@pytest.mark.parametrize("size", [(0, 10), (10, 10**9), (NAN, 10), ("wide", 10), (None, 10), (-5, 10)])
def test_sizes_that_are_none_are_refused(size: Any) -> None:
    with pytest.raises(wf.SceneError, match=r"^page (width|height)"):
        viewpoint().resized(*size)


@pytest.mark.parametrize(
    "lens", [{"fov": 179}, {"fov": NAN}, {"aperture": -1}, {"aperture": 1e9}, {"focus": 0}, {"focus": "near"}]
)
def test_lenses_that_are_none_are_refused(lens: Any) -> None:
    with pytest.raises(wf.SceneError, match=r"must be (from|a number)"):
        viewpoint().with_lens(**lens)


# --- Layers -----------------------------------------------------------------------------------------


def test_layers_are_shown_as_colors() -> None:
    image = wf.render(BALL, 4, camera=CAMERA, aovs=VIEWER_AOVS, progress=False)
    shown = {choice: shown_codes(image, choice, 0) for choice in CHOICES if choice != "denoised"}
    for codes in shown.values():
        assert codes.shape == (48, 64, 3)
        assert codes.dtype == np.uint8
    assert (shown["rgb"] == image.to_uint8()).all()
    smooth = image.denoise("nonlocal_means")
    assert (shown_codes(smooth, "denoised", 1, "agx") == smooth.to_uint8(exposure=1, tone="agx")).all()
    assert (shown_codes(image, "rgb", 0, "agx") != shown["rgb"]).any()
    middle, corner = (24, 32), (0, 0)
    assert shown["depth"][middle].tolist() == [255, 255, 255]  # the nearest
    assert shown["normal"][middle][2] > 250  # towards the camera
    assert shown["depth"][corner].tolist() == shown["normal"][corner].tolist() == [217, 217, 217]
    assert (shown["ids"][middle] != shown["ids"][corner]).any()
    for choice in ("albedo", "normal", "depth", "ids"):
        assert (shown_codes(image, choice, 3) == shown[choice]).all()
    assert shown_codes(image, "rgb", 1).mean() > shown["rgb"].mean()


def test_a_transparent_background_is_gray() -> None:
    image = wf.render(BALL, 4, camera=CAMERA, aovs=VIEWER_AOVS, background="transparent", progress=False)
    assert shown_codes(image, "rgb", 0)[0, 0].tolist() == [217, 217, 217]


# --- What pages may do ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "own", "ours"),
    [
        ("127.0.0.1:8080", "127.0.0.1", True),
        ("localhost:8080", "127.0.0.1", True),
        ("LOCALHOST.:8080", "127.0.0.1", True),
        ("[::1]:8080", "::1", True),
        ("192.168.1.7:8080", "0.0.0.0", True),
        ("[fe80::1]:8080", "::", True),
        (f"{socket.gethostname().upper()}:8080", "0.0.0.0", True),
        (f"{socket.gethostname()}.local", "0.0.0.0", True),
        ("desk.example:8080", "desk.example", True),
        ("evil.example:8080", "127.0.0.1", False),
        ("evil.example:8080", "0.0.0.0", False),
        ("evil.example:8080", "desk.example", False),
        ("127.0.0.1.evil.example", "0.0.0.0", False),
        ("localhost@evil.example", "127.0.0.1", False),
        ("[", "127.0.0.1", False),
        ("", "127.0.0.1", False),
        ("", "", False),
    ],
)
def test_names_that_others_can_make_lead_here_are_refused(host: str, own: str, ours: bool) -> None:
    """Also where the whole network may connect: that is when it matters (DNS rebinding)."""
    assert is_own_address(host, own) == ours


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
@pytest.mark.parametrize(
    ("headers", "refused"),
    [
        ([("Host", "localhost:8080")], False),  # no Origin: not a browser, or a page that loads
        ([("Host", "localhost:8080"), ("Origin", "http://localhost:8080")], False),
        ([("Host", "localhost:8080"), ("Origin", "http://evil.example")], True),
        ([("Host", "localhost:8080"), ("Origin", "http://localhost:8888")], True),  # another server
        ([("Host", "localhost:8080"), ("Origin", "null")], True),
        ([("Host", "localhost:8080"), ("Origin", "http://[")], True),
        ([("Host", "evil.example:8080"), ("Origin", "http://evil.example:8080")], True),
        ([("Host", "localhost:8080"), ("Host", "evil.example")], True),
        ([], True),
    ],
)
def test_pages_of_other_sites_are_refused(host: str, headers: list[tuple[str, str]], refused: bool) -> None:
    """Whether they know the token or not, and where there is none."""
    for token, path in (("", "/"), ("secret", "/?token=secret")):
        guard = Guard(host, token)
        assert (guard.refusal(path, datastructures.Headers(headers)) is not None) == refused


@pytest.mark.parametrize(
    "path", ["/", "/?token=", "/?token=secre", "/?token=secret2", "/?x=secret", "/?token=\u00e9"]
)
def test_requests_without_the_token_are_refused(path: str) -> None:
    """The page's, the picture's and the WebSocket's alike; a token may have any letters."""
    headers = datastructures.Headers(Host="localhost:8080")
    assert Guard("127.0.0.1", "secret").refusal(path, headers) is not None
    for token in ("secret", 'a&b=c%\u00e9"<'):
        guard = Guard("127.0.0.1", token)
        assert guard.refusal("/first.jpg" + guard.query, headers) is None
        assert not set(guard.query) & set('"<> ')


def test_tokens_are_drawn_given_or_left_out() -> None:
    """A drawn one is that of the program, with 192 bits."""
    drawn = {token_of(True) for _ in range(10)}
    assert len(drawn) == 1
    assert all(len(bytes.fromhex(token)) == 24 for token in drawn)
    assert (token_of("mine"), token_of(False)) == ("mine", "")
    for wrong in ("", None, 3, b"mine"):
        with pytest.raises(wf.SceneError, match=r"^token is .*; it must be a text that is not empty"):
            token_of(wrong)  # type: ignore[arg-type]


CAMERA_MESSAGE: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0, 0, 0),
    "position": (0, 0, 3.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 48,
    "image_width": 64,
    "look_at": (0.0, 0, 0),
    "up_direction": (0.0, 1, 0),
}
VALUE_MESSAGE: dict[str, Any] = {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1.5}}
MALFORMED: list[Any] = [
    {},
    [],
    None,
    7,
    {"type": "NoSuchMessage"},
    {"type": ["GuiUpdateMessage"]},
    {"type": "ShareUrlRequest"},
    {"type": "ViewerCameraMessage"},
    CAMERA_MESSAGE | {"position": "far"},
    CAMERA_MESSAGE | {"position": (0, 0)},
    CAMERA_MESSAGE | {"fov": None},
    CAMERA_MESSAGE | {"more": 1},
    VALUE_MESSAGE | {"updates": {"max": 1e9}},
    VALUE_MESSAGE | {"updates": {"value": 1, "max": 2}},
    VALUE_MESSAGE | {"updates": {"value": [1]}},
    VALUE_MESSAGE | {"updates": {}},
    VALUE_MESSAGE | {"updates": None},
    VALUE_MESSAGE | {"uuid": 3},
]


def test_only_cameras_and_values_may_be_sent() -> None:
    """Not limits, names or callbacks of elements, no other messages, and nothing that is none."""
    encode = msgspec.msgpack.encode
    for message in (CAMERA_MESSAGE, VALUE_MESSAGE, VALUE_MESSAGE | {"updates": {"value": "rgb"}}):
        assert is_message(encode(message))
        assert not is_message(encode(message)[:-1])
        assert not is_message(encode(message) + b"0")
    for message in MALFORMED:
        assert not is_message(encode(message)), message
    for data in (b"", b"\xc1", b"\x91" * 100_000, "text", None):
        assert not is_message(data)


@pytest.fixture
def viewer() -> Iterator[wf.Viewer]:
    """A viewer of a ball, closed at the end, when nothing must be left."""
    before = set(threading.enumerate())
    with wf.view(BALL, 4, camera=CAMERA, port=0, open_browser=False, block=False) as viewer:
        yield viewer
    assert eventually(lambda: set(threading.enumerate()) <= before)
    assert multiprocessing.active_children() == []
    with pytest.raises(OSError):  # nobody listens
        urllib.request.urlopen(viewer.url, timeout=5)


class Client:
    """Speaks to a viewer as its page does."""

    def __init__(self, viewer: wf.Viewer, **options: Any) -> None:
        base, mark, query = viewer.url.replace("http", "ws").partition("?")
        options = {"subprotocols": [f"viser-v{viser.__version__}"], **options}
        address = base + options.pop("address", mark + query)
        self.socket = websockets.connect(address, compression=None, max_size=None, **options)
        self._looked = False

    def send(self, kind: str, **values: Any) -> None:
        """Send a message."""
        self.socket.send(msgspec.msgpack.encode({"type": kind, **values}))

    def look(self, **values: Any) -> None:
        """Send a camera."""
        camera = {name: value for name, value in CAMERA_MESSAGE.items() if name != "type"}
        if not self._looked:  # where pages are before they take the view, which is that of CAMERA
            for z in (-5.0, 3.0, 5 / np.sqrt(3)):
                self.send("ViewerCameraMessage", **(camera | {"position": (0, 0, float(z))}))
        self._looked = True
        self.send("ViewerCameraMessage", **(camera | values))


def test_a_page_moves_the_camera(viewer: wf.Viewer) -> None:
    assert "127.0.0.1" in viewer.url
    client = Client(viewer)
    client.look(position=(1.0, 0.5, 3.0), image_width=48)
    assert eventually(lambda: viewer.camera.resolution == (48, 48))
    image = viewer.wait_for_picture(SOON)
    assert viewer.image is image
    expected = wf.render(BALL, 4, camera=viewer.camera, progress=False)
    assert image.rgb.tobytes() == expected.rgb.tobytes()
    radius = np.sqrt(3)
    assert viewer.camera.origin.tolist() == pytest.approx([radius, radius / 2, 3 * radius], abs=1e-4)
    client.socket.close()


@pytest.fixture
def clock(viewer: wf.Viewer, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Time as the page knows it, which stands still until `now` is changed."""
    clock = SimpleNamespace(now=time.monotonic())
    monkeypatch.setattr(page_module, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


def test_views_that_a_page_has_before_it_takes_ours_are_not_shown(
    viewer: wf.Viewer, clock: SimpleNamespace
) -> None:
    """But for a time only, as some cameras cannot be taken; its size counts at once."""
    client = Client(viewer)
    client._looked = True
    for z in (-5.0, 3.0):
        client.look(position=(0.0, 0, z), image_width=48)
    assert eventually(lambda: viewer.camera.resolution == (48, 48))
    assert viewer.camera.origin.tolist() == [0, 0, 5]
    before = viewer.camera
    clock.now += page_module.ARRIVAL
    client.look(position=(0.0, 0, 3.0), image_width=48)
    assert eventually(lambda: viewer.camera is not before)
    assert viewer.camera.origin[2] == pytest.approx(3 * np.sqrt(3), abs=1e-4)
    client.socket.close()


def test_a_page_gets_a_picture_when_it_has_said_how_large_it_is(viewer: wf.Viewer) -> None:
    """It would stretch one of another shape over its window. One that was left has none for the next."""
    viewer.wait_for_picture(SOON)
    for width in (48, 100):
        client = Client(viewer)
        with pytest.raises(TimeoutError):
            pictures(client, 0.5)
        client._looked = True  # or it says another size first
        client.look(image_width=width)
        codes = pictures(client, SOON)
        assert codes.shape[1] / codes.shape[0] == pytest.approx(width / 48, rel=0.05)
        client.socket.close()
        assert eventually(lambda: not viewer._page._server.get_clients())  # type: ignore[union-attr]


def pictures(client: Client, timeout: float) -> np.ndarray:
    """Return the next picture that a page is sent."""
    end = time.monotonic() + timeout
    while True:
        window = kinds(client.socket.recv(timeout=max(0, end - time.monotonic())))
        for message in msgspec.msgpack.decode(window)["messages"]:
            if message["type"] == "BackgroundImageMessage" and message["rgb_data"]:
                return iio.imread(message["rgb_data"])


def kinds(data: bytes) -> bytes:
    """Return the messages of a window as they are before they are compressed."""
    size = int.from_bytes(data[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])


@pytest.mark.usefixtures("clock")
def test_what_a_page_says_is_checked(viewer: wf.Viewer) -> None:
    """Cameras that are none change nothing, and other messages do nothing; the viewer goes on."""
    client = Client(viewer)
    client.look()
    assert eventually(lambda: viewer.camera.origin[2] < 5.2 and viewer.camera.origin[2] != 5)
    before = viewer.camera
    client.look(position=(NAN, 0, 0))
    client.look(position=(0.0, 0, 0))
    client.look(image_width=10**9)
    client.look(up_direction=(0.0, 0, 0))
    client.send("ShareUrlRequest")
    client.send("FileTransferStartUpload", source_component_uuid="x", transfer_uuid="y", filename="f",
                mime_type="text/plain", part_count=1, size_bytes=1)  # fmt: skip
    client.send("GuiUpdateMessage", uuid="nothing", updates={"value": 3})
    time.sleep(0.2)
    assert viewer.camera is before
    client.look(image_width=48)
    assert eventually(lambda: viewer.camera.resolution == (48, 48))
    client.socket.close()


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"address": ""}, 403),
        ({"address": "?token=wrong"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"additional_headers": {"Host": "evil.example"}}, 403),
        ({"subprotocols": ["viser-v0"]}, 400),
        ({"subprotocols": None}, 400),
    ],
)
def test_a_page_that_may_not_connect_is_refused(
    viewer: wf.Viewer, capfd: pytest.CaptureFixture[str], change: dict[str, Any], status: int
) -> None:
    with pytest.raises(exceptions.InvalidStatus) as refused:
        Client(viewer, **change)
    assert refused.value.response.status_code == status
    assert capfd.readouterr() == ("", "")


def status(url: str, **headers: str) -> int:
    """Return how a request is answered."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=SOON) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_nothing_but_the_page_is_served(viewer: wf.Viewer) -> None:
    """No file of the machine, however it is named; and nothing without the token."""
    base, _, query = viewer.url.partition("?")
    assert len(query) > 40
    assert status(viewer.url) == status(f"{base}first.jpg?{query}") == 200
    for path in ("../page.py", "%2e%2e/%2e%2e/_viser.py", "/etc/passwd", "..%5c..%5c_viser.py", "index.php"):
        assert status(f"{base}{path}?{query}") == 404
    for path in ("a" * 5000, "a" * 300, "b/" * 2000, "%00", "a%00b.js"):
        assert status(f"{base}{path}?{query}") == 404
    for path in ("", "first.jpg", "index.html", "?token=wrong", "../page.py"):
        assert status(base + path) == 403
    assert status(viewer.url, Host="evil.example") == status(viewer.url, Origin="http://evil.example") == 403


def test_memory_of_connections_is_given_back(viewer: wf.Viewer, calls_of: Any) -> None:
    """When the last page is left: the C library would keep it."""
    trimmed: list[None] = []
    calls_of("wavefront.viewer.page.trim_heap", lambda: trimmed.append(None))
    pages = [Client(viewer) for _ in range(2)]
    for page in pages:
        page.look()
    assert eventually(lambda: len(viewer._page._server.get_clients()) == 2)
    pages[0].socket.close()
    assert eventually(lambda: len(viewer._page._server.get_clients()) == 1)
    assert not trimmed
    pages[1].socket.close()
    assert eventually(lambda: trimmed)


def test_a_token_may_be_given_or_left_out() -> None:
    """Pages of other sites are refused all the same, also where the network may connect."""
    shared: dict[str, Any] = {"size": (16, 16), "port": 0, "open_browser": False, "block": False}
    with wf.view(BALL, 1, token="a b&c", **shared) as viewer:
        assert viewer.url.endswith("/?token=a%20b%26c")
        assert viewer.elsewhere is None
        assert status(viewer.url) == 200
        assert status(viewer.url.partition("?")[0]) == 403
    with wf.view(BALL, 1, token=False, host="0.0.0.0", **shared) as viewer:
        assert viewer.url.endswith("/")
        assert viewer.elsewhere == viewer.url.replace("127.0.0.1", socket.gethostname())
        assert status(viewer.url) == 200
        assert status(viewer.url, Host="evil.example", Origin="http://evil.example") == 403


def is_closed(client: Client) -> None:
    """Read what a viewer sends until it closes the connection."""
    with suppress(exceptions.ConnectionClosed):
        while True:
            client.socket.recv(timeout=SOON)


def test_what_is_no_message_changes_and_prints_nothing(
    viewer: wf.Viewer, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """No traceback, whatever comes: the page that sent it goes on, and so do the others."""
    client = Client(viewer)
    slider = viewer._page._server.gui  # type: ignore[union-attr]
    for name in list(slider._gui_input_handle_from_uuid):
        for value in ("none", NAN, 10**18, True, -5):
            client.send("GuiUpdateMessage", uuid=name, updates={"value": value})
    for message in MALFORMED:
        client.socket.send(msgspec.msgpack.encode(message))
    for data in (b"", b"\xc1", b"\x91" * 10_000, "text"):
        client.socket.send(data)
    client.look(image_width=48)
    assert eventually(lambda: viewer.camera.resolution == (48, 48))
    for data in (b"\x00\xff" * 100, b"GET\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n"):
        where = urlsplit(viewer.url)
        with socket.create_connection((where.hostname, where.port), timeout=SOON) as raw:
            raw.sendall(data)
            raw.shutdown(socket.SHUT_WR)
            while raw.recv(1 << 16):
                pass
    for frames in (b"\x83\x80....", b"\xff\x80....", b"\x81\x84....\xd1..."):  # of no kind, and no text
        broken = Client(viewer)
        broken.socket.socket.sendall(frames)
        is_closed(broken)
    large = Client(viewer)
    large.socket.send(bytes(1 << 20))
    is_closed(large)
    client.socket.close()
    viewer.close()
    gc.collect()  # tasks that failed say so then
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Page, list[tuple[float, ViewerFrame]]]]:
    """A page without a viewer, and what it sends, and when."""
    page = Page(
        "127.0.0.1",
        0,
        "",
        viewpoint(),
        None,
        "none",
        look=lambda view: None,
        connected=lambda: None,
        path_of=None,
    )
    frames: list[tuple[float, ViewerFrame]] = []
    page._send = lambda codes, frame, image: frames.append((page._sent[1], frame))  # type: ignore[method-assign]
    yield page, frames
    page.close()


def frame(spp: int, camera: wf.Camera = CAMERA, final: bool = False) -> ViewerFrame:
    """Return a picture of a view."""
    return ViewerFrame(wf.Image(np.zeros((48, 64, 3), np.float32), spp), camera, final)


def test_pictures_that_refine_leave_the_page_time(sent: Any) -> None:
    page, frames = sent
    for number in (1, 2, 3):
        page.show(frame(page_module.FEW + number))
        assert eventually(lambda number=number: len(frames) == number)
    assert all(after - before > 0.09 for (before, _), (after, _) in pairwise(frames))


def test_other_pictures_do_not_wait(sent: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of other views and the last one are sent at once, and so is another exposure."""
    monkeypatch.setattr(page_module, "PAUSE", 10 * SOON)
    page, frames = sent
    other = wf.Camera.look_at((0, 0, 6), (0, 0, 0), size=(64, 48))
    few = page_module.FEW  # with fewer samples a denoised picture would follow
    shown = [frame(few), frame(few, other), frame(2 * few, other, final=True)]
    for each in shown:
        page.show(each)
        assert eventually(lambda each=each: frames and frames[-1][1] is each)
        if each is shown[1]:
            page.show(frame(few + 1, other))  # waits, and is left out
            time.sleep(0.1)
    page._show_as(exposure=1)
    assert eventually(lambda: len(frames) == 4)
    assert [each for _, each in frames] == [*shown, shown[-1]]


def looks(seed: int = 0) -> wf.Image:
    """Return a noisy picture with the layers of a page."""
    settings: dict[str, Any] = {"seed": seed, "aovs": VIEWER_AOVS, "progress": False}
    return wf.render(BALL, 4, camera=CAMERA.resized((16, 12)), **settings)


@pytest.fixture
def slow_filter(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[list[wf.Image], threading.Semaphore]]:
    """A denoiser that waits for `go` and doubles the picture; and what it was given."""
    given: list[wf.Image] = []
    go = threading.Semaphore(0)

    def denoise(image: wf.Image) -> wf.Image:
        given.append(image)
        go.acquire()
        return wf.Image(2 * image.rgb, image.spp, image.metadata, layers=image.layers)

    monkeypatch.setattr(wf.Image, "denoise", denoise)
    quick = ModuleType("pyoidn")
    quick.__spec__ = ModuleSpec("pyoidn", None)
    monkeypatch.setitem(sys.modules, "pyoidn", quick)
    yield given, go
    go.release(1000)


def test_denoising_is_never_in_the_way(sent: Any, slow_filter: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Controls and pictures go on; of several pictures the newest is next."""
    (page, frames), (given, go) = sent, slow_filter
    images = [looks(seed) for seed in range(4)]
    monkeypatch.setattr(page_module, "MOST_AT_ONCE", 0)
    page._show_as(choice="denoised")
    for image in images[:3]:
        page.show(ViewerFrame(image, CAMERA, final=False))
        assert eventually(lambda image=image: frames and frames[-1][1].image is image)
    assert given == [images[0]]
    page._show_as(exposure=1, tone="agx")
    assert eventually(lambda: (page._codes == shown_codes(images[2], "rgb", 1, "agx")).all())
    go.release()
    assert eventually(lambda: given == [images[0], images[2]])
    brighter = wf.Image(2 * images[0].rgb, 4)
    assert eventually(lambda: (page._codes == shown_codes(brighter, "rgb", 1, "agx")).all())
    page.show(ViewerFrame(images[3], wf.Camera.look_at((0, 0, 6), (0, 0, 0), size=(64, 48)), final=True))
    assert eventually(lambda: (page._codes == shown_codes(images[3], "rgb", 1, "agx")).all())


def test_few_samples_are_shown_denoised_where_that_is_quick(sent: Any, slow_filter: Any) -> None:
    """The picture as it is until then, with more samples, and at the end."""
    (page, _), (given, go) = sent, slow_filter
    go.release(1000)
    few, more = looks(), wf.Image(looks().rgb, page_module.FEW, layers=looks().layers)
    page.show(ViewerFrame(few, CAMERA, final=False))
    assert eventually(lambda: page._codes is not None and (page._codes == (2 * few).to_uint8()).all())
    for image, final in ((more, False), (few, True)):
        page.show(ViewerFrame(image, CAMERA, final))
        assert eventually(lambda image=image: (page._codes == image.to_uint8()).all())
    assert given == [few]


def test_a_small_first_picture_is_never_shown_with_its_noise(sent: Any, slow_filter: Any) -> None:
    """Nor is a picture denoised that is so already."""
    (page, frames), (given, go) = sent, slow_filter
    few = looks()
    page.show(ViewerFrame(few, CAMERA, final=False))
    assert eventually(lambda: given == [few])
    assert not frames
    go.release(1000)
    assert eventually(lambda: page._codes is not None and (page._codes == (2 * few).to_uint8()).all())
    clean = wf.Image(few.rgb, 8, {"denoiser": "oidn"}, layers=few.layers)
    page._show_as(choice="denoised")
    page.show(ViewerFrame(clean, CAMERA, final=True))
    assert eventually(lambda: (page._codes == clean.to_uint8()).all())
    assert given == [few]


def test_a_slow_denoiser_is_a_process_that_another_view_ends(
    missing: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It gives what `denoise` does. Nothing is left of it."""
    first, second = ViewerFrame(looks(), CAMERA, True), ViewerFrame(looks(1), CAMERA.resized((8, 8)), True)
    expected = second.image.denoise()
    missing("pyoidn")  # here, not in the process
    done: list[tuple[ViewerFrame, wf.Image]] = []
    errors: list[Exception] = []
    denoiser = denoiser_module.BackgroundDenoiser(
        lambda frame, image: done.append((frame, image)), errors.append
    )
    denoiser.want(first)
    assert eventually(lambda: denoiser._process is not None)
    process = denoiser._process
    denoiser.want(second)
    assert eventually(lambda: done)
    assert process is not None
    assert process.returncode < 0
    ((frame, image),) = done
    assert frame is second
    assert image.rgb.tobytes() == expected.rgb.tobytes()
    monkeypatch.setattr(denoiser_module, "COMMAND", "raise OSError('no room')")
    denoiser.want(first)
    assert eventually(lambda: errors)
    assert str(errors[0]) == "OSError: no room"
    monkeypatch.setattr(denoiser_module, "COMMAND", "import time; time.sleep(1000)")
    denoiser.want(second)
    assert eventually(lambda: denoiser._process is not None)
    process = denoiser._process
    denoiser.close()
    assert process is not None
    assert process.poll() is not None
    assert len(done) == 1


def test_a_page_gets_a_picture_with_its_first_requests(viewer: wf.Viewer) -> None:
    """The newest one, as a jpg that pages of other sites cannot show."""
    codes = viewer.wait_for_picture(SOON).to_uint8().astype(float)
    assert eventually(lambda: first(viewer.url).shape == codes.shape)
    assert np.abs(first(viewer.url) - codes).mean() < 3


def first(url: str) -> np.ndarray:
    """Return the picture that a page fetches while it loads."""
    request = urllib.request.Request(url.replace("/?", "/first.jpg?"))
    with urllib.request.urlopen(request, timeout=SOON) as answer:
        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert answer.headers["Cache-Control"] == "no-store"
        return iio.imread(answer.read())


@pytest.mark.parametrize("encoding", ["gzip", "identity"])
def test_the_page_is_that_of_viser_with_a_picture(viewer: wf.Viewer, encoding: str) -> None:
    """And with our title; compressed if the browser can read that."""
    request = urllib.request.Request(viewer.url, headers={"Accept-Encoding": encoding})
    with urllib.request.urlopen(request, timeout=SOON) as answer:
        page = answer.read()
        assert answer.headers.get("Content-Encoding", "identity") == encoding
    page = gzip.decompress(page) if encoding == "gzip" else page
    assert page.count(b"url(/first.jpg" + viewer.url[viewer.url.index("?") :].encode() + b")") == 1
    assert page.count(b"<title>wavefront</title>") == 1
    assert b'<div id="root"></div>' in page


def test_servers_of_others_are_left_as_they_are() -> None:
    from websockets.asyncio import server

    async def answers() -> tuple[bytes, bytes]:
        with asked_first(FirstPaint(Guard("127.0.0.1", ""), lambda: b"jpg", lambda: None)):
            plain = server.serve(lambda socket: None, "127.0.0.1", 0)  # type: ignore[arg-type, return-value]
            own = server.serve(
                lambda socket: None,  # type: ignore[arg-type, return-value]
                "127.0.0.1",
                0,
                process_request=lambda connection, request: connection.respond(418, "own"),
            )
        async with plain as first, own as second:
            return await page_of(first), await page_of(second)

    async def page_of(listening: Any) -> bytes:
        reader, writer = await asyncio.open_connection(*listening.sockets[0].getsockname())
        writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        line = await reader.readline()
        writer.close()
        return line.split()[1]

    assert asyncio.run(answers()) == (b"426", b"418")


@pytest.mark.skipif(not hasattr(os, "getpriority"), reason="the system has no priorities")
def test_workers_give_way_to_the_page() -> None:
    """Not this process, which sends the pictures, and no other one that was there."""
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(SOON,))
    other.start()
    own = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        with wf.view(
            BALL, 4, size=(16, 16), executor="processes", workers=2, port=0, open_browser=False, block=False
        ):
            workers = [each for each in multiprocessing.active_children() if each.pid != other.pid]
            assert len(workers) == 2
            assert all(os.getpriority(os.PRIO_PROCESS, each.pid or 0) >= 10 for each in workers)
            assert os.getpriority(os.PRIO_PROCESS, 0) == own
            assert os.getpriority(os.PRIO_PROCESS, other.pid or 0) == own
    finally:
        other.kill()
        other.join()


def test_a_viewer_refuses_what_it_cannot_do() -> None:
    refused = [
        ({"checkpoint": "file"}, "checkpoint is 'file'; it is for a picture of one view"),
        ({"samples": range(3)}, "samples is range"),
        ({"port": 70000}, "port is 70000; it must be a whole number from 0 to 65535"),
        ({"spp": 0}, "spp is 0"),
        ({"token": ""}, "token is ''"),
        ({"tone": "loud"}, "tone is 'loud'"),
        ({"host": "no such host."}, "cannot listen at host 'no such host.'"),
        ({"host": "203.0.113.1"}, "cannot listen at host '203.0.113.1'"),
    ]
    before = set(threading.enumerate())
    for settings, text in refused:
        with pytest.raises(wf.SceneError, match=text):
            wf.view(BALL, **{"open_browser": False, "block": False, "size": (16, 16), **settings})  # type: ignore[arg-type]
    assert set(threading.enumerate()) <= before


@pytest.mark.parametrize("scene", [BALL, BALL.shapes[0]], ids=["own light", "chosen light"])
def test_a_view_ends_as_a_picture_of_render_does(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    line = page_module._line
    monkeypatch.setattr(page_module, "_line", lambda text: lines.append(text) or line(text))
    with wf.view(scene, size=(16, 16), port=0, open_browser=False, block=False) as viewer:
        client = Client(viewer)
        client.look()
        assert eventually(lambda: any('quality="reference"' in each for each in lines))
        found, camera = viewer.wait_for_picture(SOON), viewer.camera
        client.socket.close()
    asked = wf.render(scene, camera=camera, progress=False)
    assert (found.rgb == asked.rgb).all()
    assert found.metadata.get("denoiser") == asked.metadata.get("denoiser")
    assert any("denoised" in each for each in lines if "reference" in each) == asked.metadata["quick"]


def test_a_viewer_that_is_closed_says_so() -> None:
    viewer = wf.view(BALL, 4, size=(16, 16), port=0, open_browser=False, block=False)
    assert repr(viewer) == f"<Viewer at {viewer.url}>"
    viewer.close()
    viewer.close()
    viewer.wait()
    assert repr(viewer) == f"<Viewer at {viewer.url}, closed>"


SCRIPT = """
import wavefront as wf
viewer = wf.view(wf.Sphere((0, 0, 0), 1), 100_000, lighting="studio", port=0, open_browser=False, block=False)
print("shown", flush=True)
"""


@pytest.mark.slow
def test_a_script_that_ends_ends_its_viewer() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT], capture_output=True, text=True, timeout=120
    )
    assert (done.stdout, done.stderr, done.returncode) == ("shown\n", "", 0)


@pytest.mark.slow
def test_the_command_ends_at_ctrl_c(tmp_path: Path) -> None:
    mesh = tmp_path / "triangle.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    command = [sys.executable, "-m", "wavefront", "view", str(mesh), "--no-browser", "--port", "0"]
    process = subprocess.Popen(
        [*command, "--size", "64x48", "--spp", "4"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("wavefront: http://127.0.0.1:"), line
        assert status(line.split()[1]) == 200
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=SOON)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0, output + errors
    assert "Traceback" not in errors


def test_the_command_has_a_token_unless_told(calls_of: Any, tmp_path: Path) -> None:
    mesh = tmp_path / "triangle.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    views = calls_of("wavefront.cli.view_commands.view", lambda scene, **settings: None)
    for words in ([], ["--token", "mine"], ["--no-token"]):
        assert main(["view", str(mesh), *words]) == 0
    assert [view.named["token"] for view in views] == [True, "mine", False]

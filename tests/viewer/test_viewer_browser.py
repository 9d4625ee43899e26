"""The viewer in a browser: headless Chromium loads the page, drags the picture and presses buttons."""

from __future__ import annotations

import io
import multiprocessing
import shutil
import threading
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh
from scripts import eventually

import wavefront as wf

viser = pytest.importorskip("viser")
playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium"),
    pytest.mark.filterwarnings("default"),  # of the driver of the browser
]
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 800, "height": 600}
SOON = 60.0  # seconds

SCENE = wf.Scene(
    [
        wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((0.8, 0.2, 0.1))),
        wf.Sphere((2, 0, 0), 1, material=wf.Diffuse((0.1, 0.3, 0.8))),
        wf.Rectangle((-5, -1, -5), (0, 0, 10), (10, 0, 0)),
    ],
    wf.Environment(0.8),
)
CAMERA = wf.Camera.look_at((1, 2, 7), (1, 0, 0), size=(320, 240))
SPP = 16


@pytest.fixture
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *SOFTWARE_GL])
        yield chromium
        chromium.close()


@pytest.fixture
def viewer() -> Iterator[wf.Viewer]:
    before = set(threading.enumerate())
    with wf.view(SCENE, SPP, camera=CAMERA, port=0, open_browser=False, block=False) as viewer:
        yield viewer
    assert eventually(lambda: set(threading.enumerate()) <= before, SOON)
    assert multiprocessing.active_children() == []


@pytest.fixture
def page(viewer: wf.Viewer, browser: Any) -> Any:
    """The page of the viewer, when it shows the last picture of its first view."""
    page = browser.new_context(viewport=SIZE, permissions=["clipboard-read", "clipboard-write"]).new_page()
    page.goto(viewer.url)
    page.get_by_text("spp").wait_for(timeout=1000 * SOON)
    assert eventually(lambda: viewer.camera.resolution == (320, 240))
    viewer.wait_for_picture(SOON)
    page.get_by_text(f"{SPP} of {SPP} spp").wait_for(timeout=1000 * SOON)
    return page


def shot(page: Any) -> np.ndarray:
    """Return what the page shows, without the panel, as floats."""
    page.wait_for_timeout(500)
    return iio.imread(io.BytesIO(page.screenshot()))[300:, :, :3].astype(float)


def drag(page: Any, dx: int, dy: int) -> None:
    page.mouse.move(300, 450)
    page.mouse.down()
    for k in range(1, 11):
        page.mouse.move(300 + dx * k // 10, 450 + dy * k // 10)
    page.mouse.up()


EXPOSURE, FIELD_OF_VIEW, FOCUS, APERTURE = range(4)  # the sliders, from the top


def enter(page: Any, slider: int, text: str) -> None:
    """Type a value into the field beside a slider."""
    page.get_by_role("textbox").nth(slider).fill(text)
    page.keyboard.press("Enter")


def expected(viewer: wf.Viewer, **options: Any) -> wf.Image:
    """Return the picture of the view as `render` makes it by default."""
    return wf.render(SCENE, SPP, camera=viewer.camera, progress=False, **options)


def test_a_page_shows_the_picture_of_render(page: Any, viewer: wf.Viewer) -> None:
    last = viewer.wait_for_picture(SOON)
    reference = expected(viewer)
    assert last.rgb.tobytes() == reference.rgb.tobytes()
    codes = reference.to_uint8().astype(float)
    seen = shot(page)
    rows = np.arange(300, 600) * codes.shape[0] // 600
    columns = np.arange(800) * codes.shape[1] // 800
    assert np.abs(seen - codes[rows][:, columns]).mean() < 6  # the browser interpolates


def test_a_page_has_a_picture_before_its_scripts_run(viewer: wf.Viewer, browser: Any) -> None:
    codes = viewer.wait_for_picture(SOON).to_uint8().astype(float)
    page = browser.new_context(viewport=SIZE, java_script_enabled=False).new_page()
    page.goto(viewer.url)
    assert page.title() == "wavefront"
    rows, columns = np.arange(300, 600) * 240 // 600, np.arange(800) * 320 // 800
    assert np.abs(shot(page) - codes[rows][:, columns]).mean() < 6  # the browser interpolates


DARK = wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0))], [wf.PointLight((9, 9, 9), 1)])


def test_a_black_picture_replaces_the_first_one_when_somebody_acts(browser: Any) -> None:
    """Otherwise black may mean that nothing has been drawn yet."""
    is_drawn = "document.documentElement.classList.contains('drawn')"
    with wf.view(DARK, 4, camera=CAMERA, port=0, open_browser=False, block=False) as viewer:
        page = browser.new_page(viewport=SIZE)
        page.goto(viewer.url)
        page.get_by_text("spp").wait_for(timeout=1000 * SOON)
        assert not page.evaluate(is_drawn)
        camera = viewer.camera
        drag(page, 60, 0)
        assert page.evaluate(is_drawn)
        assert eventually(lambda: viewer.camera is not camera, SOON)


def test_a_drag_changes_the_view_and_the_picture_restarts(page: Any, viewer: wf.Viewer) -> None:
    before, camera = shot(page), viewer.camera
    spp: list[int] = []
    show = viewer._page.show  # type: ignore[union-attr]
    viewer._page.show = lambda frame: (spp.append(frame.image.spp), show(frame))  # type: ignore[union-attr, method-assign, assignment]
    drag(page, 150, 40)
    assert eventually(lambda: not np.allclose(viewer.camera.origin, camera.origin), SOON)
    assert np.linalg.norm(viewer.camera.origin - (1, 0, 0)) == pytest.approx(
        np.sqrt(53), rel=0.05
    )  # an orbit
    page.wait_for_timeout(1000)  # the page's camera comes to rest
    last = viewer.wait_for_picture(SOON)
    assert spp[0] == 1
    assert spp[-1] == SPP
    assert last.rgb.tobytes() == expected(viewer).rgb.tobytes()
    page.get_by_text(f"{SPP} of {SPP} spp").wait_for(timeout=1000 * SOON)
    assert np.abs(shot(page) - before).mean() > 5


def test_the_wheel_zooms_and_the_right_button_pans(page: Any, viewer: wf.Viewer) -> None:
    distance = np.linalg.norm(viewer.camera.origin - (1, 0, 0))
    page.mouse.move(300, 450)
    page.mouse.wheel(0, -400)
    assert eventually(lambda: np.linalg.norm(viewer.camera.origin - (1, 0, 0)) < 0.95 * distance)
    page.wait_for_timeout(1000)
    camera = viewer.camera
    page.mouse.down(button="right")
    page.mouse.move(400, 450, steps=5)
    page.mouse.up(button="right")
    assert eventually(lambda: np.abs(viewer.camera.origin - camera.origin).max() > 0.1, SOON)
    page.wait_for_timeout(1000)
    assert np.abs(viewer.camera.rotation - camera.rotation).max() < 1e-3


def test_controls_change_the_lens_and_what_is_shown(page: Any, viewer: wf.Viewer) -> None:
    bright, picture = shot(page), viewer.image
    enter(page, EXPOSURE, "-2")
    page.wait_for_timeout(500)
    dark = shot(page)
    assert dark.mean() < 0.8 * bright.mean()
    page.get_by_role("combobox").nth(-2).click()  # above that of the tone
    page.get_by_role("option", name="normal").click()
    assert eventually(lambda: np.abs(shot(page) - dark).mean() > 10, SOON)
    assert viewer.image is picture
    enter(page, FIELD_OF_VIEW, "20")
    assert eventually(lambda: viewer.camera.projection.fov == 20, SOON)  # type: ignore[attr-defined]
    enter(page, APERTURE, "0.5")
    assert eventually(lambda: viewer.camera.projection.aperture == 0.5, SOON)  # type: ignore[attr-defined]
    assert viewer.wait_for_picture(SOON).rgb.tobytes() == expected(viewer).rgb.tobytes()


def test_buttons_save_the_picture_and_copy_the_camera(page: Any, viewer: wf.Viewer) -> None:
    """As a png with the codes of `to_uint8`, and as Python that makes the same camera."""
    with page.expect_download(timeout=1000 * SOON) as started:
        page.get_by_text("save picture").click()
    saved = iio.imread(started.value.path())
    assert (saved == viewer.wait_for_picture(SOON).to_uint8()).all()
    page.get_by_text("copy camera as code").click()
    page.get_by_text("copied").wait_for(timeout=1000 * SOON)
    camera = eval(page.evaluate("navigator.clipboard.readText()"), {"wf": wf})
    assert camera.resolution == viewer.camera.resolution
    for part in ("origin", "rotation"):
        assert (getattr(camera, part) == getattr(viewer.camera, part)).all()


def test_a_page_that_is_left_does_not_end_the_viewer(page: Any, viewer: wf.Viewer, browser: Any) -> None:
    page.close()
    again = browser.new_page(viewport=SIZE)
    again.goto(viewer.url)
    again.get_by_text("spp").wait_for(timeout=1000 * SOON)


def test_a_page_that_is_loaded_again_keeps_the_view(page: Any, viewer: wf.Viewer) -> None:
    """And no other view is rendered meanwhile, such as that of a page that knows none yet."""
    drag(page, 150, 40)
    page.wait_for_timeout(1000)
    moved, cameras = viewer.camera, []
    look = viewer._refiner.look
    viewer._refiner.look = lambda camera: (cameras.append(camera), look(camera))  # type: ignore[method-assign, assignment]
    page.reload()
    page.get_by_text(f"{SPP} of {SPP} spp").wait_for(timeout=1000 * SOON)
    page.wait_for_timeout(1000)
    for camera in [*cameras, viewer.camera]:
        assert np.abs(camera.origin - moved.origin).max() < 1e-3


CONNECT = """
([url, protocol]) => new Promise(done => {
    const socket = new WebSocket(url, protocol);
    let messages = 0;
    socket.onmessage = () => { messages += 1; socket.close(4000); };
    socket.onclose = event => done([event.code, messages > 0]);
})
"""


def test_pages_of_other_sites_see_nothing(page: Any, viewer: wf.Viewer, browser: Any, tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<p>elsewhere</p>")
    (tmp_path / "favicon.ico").write_bytes(b"")
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    where = [viewer.url.replace("http", "ws"), f"viser-v{viser.__version__}"]
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        elsewhere = browser.new_page()
        elsewhere.goto(f"http://127.0.0.1:{server.server_port}/")
        refused = elsewhere.evaluate(CONNECT, where)
        elsewhere.close()
        server.shutdown()
        thread.join()
    assert refused == [1006, False]  # not opened
    assert page.evaluate(CONNECT, where) == [4000, True]


RECORD = """
(() => {
    window.moves = [];
    window.shown = [];
    addEventListener("pointermove", () => moves.push(Date.now()), true);
    let before = null;
    new MutationObserver(() => {
        const state = document.documentElement.textContent.match(/(\\d+ × \\d+) · (\\d+) of \\d+ spp/);
        const camera = document.querySelector("[data-code]")?.dataset.code;
        const last = shown.at(-1) || before;
        if (state && (!last || last.text !== state[0] || last.camera !== camera))
            shown.push({time: Date.now(), text: state[0], size: state[1], spp: Number(state[2]), camera});
    }).observe(document, {subtree: true, childList: true, characterData: true});
    window.watch = () => { before = shown.at(-1) || before; moves.length = shown.length = 0; };
    window.restart = () => {  // milliseconds from a movement to a new picture
        const isNew = picture => picture.time >= moves[0] && (picture.size !== before.size
            || picture.spp < before.spp || picture.camera !== before.camera);
        const first = moves.length && shown.find(isNew);
        return first ? first.time - moves[0] : null;
    };
})()
"""
PAINTED = """
() => {
    const picture = performance.getEntriesByName(location.origin + "/first.jpg" + location.search)[0];
    const paint = performance.getEntriesByName("first-contentful-paint")[0];
    const times = [paint.startTime, picture.responseEnd].map(time => performance.timeOrigin + time);
    return [...times, shown[0].time].map(time => time / 1000);
}
"""
OPENED = """
() => {
    const picture = performance.getEntriesByName(location.origin + "/first.jpg" + location.search)[0];
    const paint = performance.getEntriesByName("first-contentful-paint")[0];
    return [0, picture.responseEnd, paint.startTime].map(time => (performance.timeOrigin + time) / 1000);
}
"""
FIRST_FRAME, RESTART, CLEAN_FRAME = 2.0, 0.2, 1.0  # seconds


def test_the_first_frame_and_a_restart_come_soon(browser: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """Seconds from `view` and from a movement to a picture in the page; the machine must be quiet.

    The first frame is there when the browser has painted for the first time after it has got a picture of the
    scene. Then it starts the scripts of the page, which show the next ones.
    """
    page = browser.new_page(viewport=SIZE)
    page.add_init_script(RECORD)
    begin, restarts = time.time(), []
    with wf.view(SCENE, 4096, camera=CAMERA, port=0, open_browser=False, block=False) as viewer:
        page.goto(viewer.url)
        page.wait_for_function("shown.length", timeout=1000 * SOON)
        painted, fetched, alive = page.evaluate(PAINTED)
        page.wait_for_function("shown.at(-1).spp > 4", timeout=1000 * SOON)
        page.mouse.move(300, 450)
        page.mouse.down()
        for k in range(1, 10):
            page.wait_for_timeout(300)  # pictures refine
            page.evaluate("watch()")
            page.mouse.move(300 + 20 * k, 450)
            page.wait_for_function("restart() !== null", timeout=1000 * SOON)
            restarts.append(page.evaluate("restart()") / 1000)
        page.mouse.up()
    with capsys.disabled():
        each = ", ".join(f"{seconds:.2f}" for seconds in restarts)
        print(f"\nfirst frame after {painted - begin:.2f} s, controls after {alive - begin:.2f} s")
        print(f"restarts after {each} s")
    assert fetched < painted < begin + FIRST_FRAME
    assert np.median(restarts) < RESTART


def test_the_first_picture_of_a_mesh_is_clean_and_comes_within_a_second(
    browser: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seconds from when the page opens to its first picture, which is denoised; the machine must be quiet."""
    denoised: list[float] = []
    denoise = wf.Image.denoise

    def noted(image: wf.Image, *given: Any) -> wf.Image:
        clean = denoise(image, *given)
        denoised.append(time.time())
        return clean

    monkeypatch.setattr(wf.Image, "denoise", noted)
    page = browser.new_page(viewport=SIZE)
    with wf.view(trimesh.creation.torus(1, 0.4), port=0, open_browser=False, block=False) as viewer:
        page.goto(viewer.url)
        page.wait_for_function("performance.getEntriesByName('first-contentful-paint').length")
        opened, fetched, painted = page.evaluate(OPENED)
    with capsys.disabled():
        print(
            f"\nfirst picture {fetched - opened:.2f} s after the page opens, painted {painted - opened:.2f} s"
        )
    assert denoised
    assert denoised[0] < fetched
    assert fetched - opened < CLEAN_FRAME


def test_the_panel_of_a_phone_is_folded(viewer: wf.Viewer, browser: Any) -> None:
    """It would hide half of the picture; a tap on its title unfolds it. That of a large page is open."""
    phone = browser.new_context(viewport={"width": 390, "height": 780}, is_mobile=True, has_touch=True)
    page = phone.new_page()
    page.goto(viewer.url)
    page.get_by_text("spp").wait_for(state="hidden", timeout=1000 * SOON)
    page.get_by_text("spp").wait_for(state="attached", timeout=1000 * SOON)
    assert eventually(lambda: page.get_by_text("wavefront").last.bounding_box()["y"] > 700, SOON)
    page.get_by_text("wavefront").last.tap()
    page.get_by_text("spp").wait_for(timeout=1000 * SOON)


def test_the_first_picture_that_scripts_show_is_not_stretched(browser: Any) -> None:
    """A ball is round on a wide page, from the first picture of its canvas on."""
    ball = wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((1, 0, 0)))], wf.Environment(1))
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(128, 128))
    shapes = []
    with wf.view(ball, 64, camera=camera, port=0, open_browser=False, block=False) as viewer:
        page = browser.new_page(viewport={"width": 1200, "height": 400})
        page.goto(viewer.url)
        for _ in range(20):
            picture = iio.imread(io.BytesIO(page.screenshot()))[:, 300:860, :3].astype(float)
            red = picture[..., 0] > 1.5 * picture[..., 1] + 10
            if red.any():
                shapes.append((red.any(0).sum(), red.any(1).sum()))
    assert len(shapes) > 5
    assert all(width == pytest.approx(height, rel=0.1) for width, height in shapes), shapes

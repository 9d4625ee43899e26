"""Notebooks: pictures that refine below the cell, and what is shown of images, scenes and materials."""

from __future__ import annotations

import base64
import io
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from inside import ball_png, in_kernel, run_shown, shows_pictures
from inside import notebook as module

import wavefront as wf

BALL = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]


def picture(html: str) -> np.ndarray:
    """Return the first picture that a piece of HTML holds."""
    found = re.search(r'<img src="data:image/png;base64,([^"]+)"', html)
    assert found is not None
    return iio.imread(io.BytesIO(base64.b64decode(found[1])))


# --- What is shown of things ------------------------------------------------------------------------


def test_an_image_shows_its_picture_and_facts() -> None:
    image = wf.render(BALL, 4, size=(24, 16), aovs=("depth", "normal"), progress=False)
    html = image._repr_html_()
    assert (picture(html) == image.to_uint8()).all()
    noise, seconds = image.metadata["noise"], image.metadata["seconds"]
    assert f"24 × 16 · 4 spp · error {noise:.2%} · {seconds:.1f} s · layers: depth, normal<" in html


def test_an_image_that_was_not_rendered_shows_what_it_has() -> None:
    image = wf.Image(np.zeros((2, 3, 3), np.float32), layers={"a<b": np.zeros((2, 3), np.float32)})
    html = image._repr_html_()
    assert "3 × 2 · 0 spp · layers: a&lt;b" in html
    assert "error" not in html


def test_a_scene_shows_counts_bounds_materials_and_lights() -> None:
    """A material that several shapes share stands there once; text is escaped."""
    red = wf.Material(wf.Diffuse((1, 0, 0)), name="<red>")
    cube = wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=red)
    shapes = [
        cube,
        wf.Instance(cube, np.eye(4)),
        wf.Sphere((0, 0, 0), 1, material=red),
        wf.Spheres(np.zeros((5, 3)), 0.5),
        wf.Sphere((3, 0, 0), 0.5, emission=2, name="lamp"),
    ]
    html = wf.Scene(shapes, [wf.PointLight((0, 5, 0), 3)])._repr_html_()
    assert "5 shapes, 1 instance, 4 triangles, 7 curved primitives, 2 lights" in html
    assert "bounds (-1, -1, -1) to (3.5, 1, 1)" in html
    assert html.count("&lt;red&gt;") == 1
    assert "3 shapes" in html
    assert "PointLight(" in html
    assert "emits 2" in html


def test_a_scene_with_many_materials_shows_the_first() -> None:
    shapes = [wf.Sphere((k, 0, 0), 0.4, material=wf.Diffuse(0.5)) for k in range(25)]
    assert "and 5 more" in wf.Scene(shapes)._repr_html_()


def test_a_material_shows_a_ball_of_it() -> None:
    for material in (wf.Diffuse((0.8, 0.1, 0.1)), wf.Material(wf.Diffuse((0.8, 0.1, 0.1)))):
        html = material._repr_html_()
        shown = picture(html)
        assert shown.shape == (96, 96, 3)
        middle = shown[40:56, 40:56].mean((0, 1))
        assert middle[0] > 1.5 * middle[1]
        assert "reflectance=(0.8, 0.1, 0.1)" in html


def test_a_ball_is_rendered_again_only_when_its_material_changed(calls_of: Any) -> None:
    calls = calls_of("wavefront.material_ball._rendered", lambda material: b"png")
    paint = wf.Diffuse(0.25)
    assert ball_png(paint) == ball_png(paint) == b"png"
    assert len(calls) == 1
    paint.reflectance = 0.75
    ball_png(paint)
    assert len(calls) == 2


def test_a_material_that_cannot_be_rendered_shows_its_text() -> None:

    class Broken(wf.Bsdf):
        def f(self, wo: Any, wi: Any) -> Any:
            raise wf.SceneError("broken")

    assert Broken()._repr_html_() == "<div><div><code>Broken()</code></div></div>"


# --- When pictures refine ---------------------------------------------------------------------------


class ZMQInteractiveShell:
    """Stands for the shell of a kernel."""

    def __init__(self) -> None:
        self.events = SimpleNamespace(register=self.register, unregister=self.unregister)
        self.callbacks: list[Any] = []

    def register(self, event: str, callback: Any) -> None:
        assert event == "post_run_cell"
        self.callbacks.append(callback)

    def unregister(self, event: str, callback: Any) -> None:
        self.callbacks.remove(callback)


class Handle:
    """Stands for a display that can be updated."""

    def __init__(self, shown: list[Any]) -> None:
        self.shown = shown

    def update(self, thing: Any) -> None:
        self.shown.append(thing)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> tuple[ZMQInteractiveShell, list[Any]]:
    """A kernel, and what it shows."""
    shell, shown = ZMQInteractiveShell(), []

    def display(thing: Any, display_id: bool) -> Handle:
        shown.append(thing)
        return Handle(shown)

    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    showing = SimpleNamespace(display=display, HTML=lambda text: text)
    monkeypatch.setitem(sys.modules, "IPython.display", showing)
    monkeypatch.setattr(module, "DELAY", 0)
    monkeypatch.setattr(module, "INTERVAL", 0)
    monkeypatch.setattr(module, "SHARE", 1e9)
    return shell, shown


def test_pictures_refine_unless_something_else_shows_progress(kernel: Any) -> None:
    assert in_kernel()
    assert shows_pictures(None)
    assert shows_pictures(True)
    assert not shows_pictures(False)
    assert not shows_pictures(lambda done, total: None)


def test_a_render_in_a_kernel_shows_better_and_better_pictures(kernel: Any) -> None:
    _, shown = kernel
    image = wf.render(BALL, 16, size=(16, 16))
    assert [each.spp for each in shown] == [1, 2, 4, 8, 16]
    assert shown[-1] is image
    assert image.rgb.tobytes() == wf.render(BALL, 16, size=(16, 16), progress=False).rgb.tobytes()
    shown.clear()
    wf.render(BALL, 16, size=(16, 16), progress=False)
    assert shown == []


def test_pictures_are_not_denoised_where_that_is_slow(kernel: Any, missing: Any) -> None:
    missing("pyoidn")
    wf.render(BALL, 16, size=(16, 16))
    assert not any("denoiser" in each.metadata for each in kernel[1])


def test_the_first_pictures_are_denoised(kernel: Any, fails: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last one is as it was rendered; large ones, and a denoiser that fails, are left out."""
    pytest.importorskip("pyoidn")
    _, shown = kernel
    wf.render(BALL, 16, size=(16, 16))
    assert ["denoiser" in each.metadata for each in shown] == [True] * 4 + [False]
    shown.clear()
    few = wf.render(BALL, 4, size=(16, 16))
    assert shown[-1] is few
    assert "denoiser" not in few.metadata
    monkeypatch.setattr(module, "MOST_CLEANED", 16 * 16)
    for width, height, cleaned in ((16, 16, True), (16, 17, False)):
        shown.clear()
        wf.render(BALL, 4, size=(width, height))
        assert any("denoiser" in each.metadata for each in shown) is cleaned
    fails("wavefront.Image.denoise", ZeroDivisionError())
    shown.clear()
    wf.render(BALL, 4, size=(16, 16))
    assert [each.spp for each in shown] == [1, 2, 4]


def test_a_quick_render_shows_nothing(kernel: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DELAY", 60)
    wf.render(BALL, 4, size=(16, 16))
    assert kernel[1] == []


@pytest.mark.parametrize("how", ["result", "error", "neither"])
def test_the_last_picture_is_not_shown_twice(kernel: Any, how: str) -> None:
    shell, shown = kernel
    image = wf.render(BALL, 2, size=(16, 16))
    (cell_ended,) = shell.callbacks
    error = wf.Interrupted("stopped", image) if how == "error" else None
    cell_ended(SimpleNamespace(result=image if how == "result" else None, error_in_exec=error))
    assert shell.callbacks == []
    assert (shown[-1] == "") == (how != "neither")


def test_an_interrupt_keeps_the_picture(kernel: Any) -> None:
    _, shown = kernel
    with wf.Session(BALL, 64, size=(16, 16), progress=False) as session:

        class Pressed:
            def __iter__(self) -> Any:
                yield next(session)
                raise wf.Interrupted("stopped", next(session))

        with pytest.raises(wf.Interrupted) as stop:
            run_shown(Pressed())  # type: ignore[arg-type]
    assert shown[-1] is stop.value.image


def test_a_long_render_ends_with_hints(kernel: Any, long_ago: None, capsys: Any) -> None:
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.5))
    wf.render(
        [ball, wf.Rectangle((-9, -1, 9), (18, 0, 0), (0, 0, -18)), wf.PointLight((0, 3, 0), 9)],
        2,
        workers=1,
        size=(16, 16),
    )
    assert "caustics=True" in capsys.readouterr().err


# --- In real kernels --------------------------------------------------------------------------------

REFINE = """
import wavefront as wf
ball = [wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((0.7, 0.3, 0.1))), wf.Environment(1)]
image = wf.render(ball, {spp}, size=(160, 120), workers=1)
image.save("last.png")
"""
INTERRUPT = """
import os, signal, threading
threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT)).start()
wf.render(ball, 60_000, size=(160, 120), workers={workers})
"""
AFTER = """
import sys
assert isinstance(sys.last_value, wf.Interrupted)
sys.last_value.image.save("interrupted.png")
"""


def executed(cells: list[str], folder: Path) -> tuple[list[list[dict]], list[list[dict]]]:
    """Execute a notebook; return the outputs of each cell, and what was shown while it ran."""
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    updates: list[list[dict]] = [[] for _ in cells]

    class Client(nbclient.NotebookClient):  # type: ignore[misc, name-defined]
        def process_message(self, msg: dict, cell: Any, cell_index: int) -> Any:
            if msg["msg_type"] in ("display_data", "update_display_data"):
                updates[cell_index].append(msg["content"]["data"])
            return super().process_message(msg, cell, cell_index)

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    Client(
        notebook,
        timeout=120,
        kernel_name="python3",
        allow_errors=True,
        resources={"metadata": {"path": str(folder)}},
    ).execute()
    return [cell.outputs for cell in notebook.cells], updates


@pytest.mark.filterwarnings("default")  # of the client that runs the notebook
@pytest.mark.slow
def test_a_notebook_shows_the_picture_refining_in_place(tmp_path: Path) -> None:
    (outputs,), (updates,) = executed([REFINE.format(spp=300)], tmp_path)
    pictures = [output for output in outputs if output["output_type"] == "display_data"]
    assert len(pictures) == 1, outputs
    assert not [output for output in outputs if output["output_type"] == "error"], outputs
    assert len(updates) >= 2
    spp = [int(re.search(r"(\d+) spp", data["text/html"])[1]) for data in updates]  # type: ignore[index]
    assert spp == sorted(set(spp))
    assert spp[-1] == 300
    assert (picture(pictures[0]["data"]["text/html"]) == iio.imread(tmp_path / "last.png")).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_notebook_keeps_the_picture_of_an_interrupted_render(tmp_path: Path, workers: int) -> None:
    cells = [REFINE.format(spp=8), INTERRUPT.format(workers=workers), AFTER]
    (_, stopped, after), _ = executed(cells, tmp_path)
    assert after == []
    shown = [
        output["data"]["text/html"]
        for output in stopped
        if output["output_type"] == "display_data" and "<img" in output["data"]["text/html"]
    ]
    assert len(shown) == 1
    assert (picture(shown[0]) == iio.imread(tmp_path / "interrupted.png")).all()
    (error,) = (output for output in stopped if output["output_type"] == "error")
    assert error["ename"] == "Interrupted"
    assert error["traceback"][1:] == ["the picture so far: import sys; sys.last_value.image"]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_result_of_a_notebook_is_shown_once(tmp_path: Path) -> None:
    """The picture that refined gives way to it; scenes and materials show themselves."""
    cells = [REFINE.format(spp=8), "wf.render(ball, 300, size=(160, 120), workers=1)", "wf.Scene(ball[0])"]
    cells += ["wf.Diffuse(0.5)", "wf.render(ball, 300, size=(160, 120), workers=1, progress=False)"]
    (_, refined, scene, material, quiet), updates = executed(cells, tmp_path)
    assert [output["output_type"] for output in refined] == ["display_data", "execute_result"]
    assert [output["data"]["text/html"][:4] for output in refined] == ["", "<div"]
    assert len(updates[1]) >= 2
    assert "Materials" in scene[0]["data"]["text/html"]
    assert "<img" in material[0]["data"]["text/html"]
    assert [output["output_type"] for output in quiet] == ["execute_result"]
    assert updates[4] == []


VIEW = """
import wavefront as wf
viewer = wf.view(wf.Sphere((0, 0, 0), 1), 4, lighting="studio", size=(32, 32), port=0)
"""
CLOSE = """
import multiprocessing, threading
viewer.wait_for_picture()
viewer.close()
names = [each.name for each in threading.enumerate()]
print([name for name in names if "wavefront" in name], multiprocessing.active_children())
"""


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_viewer_of_a_notebook_is_shown_in_a_frame(tmp_path: Path) -> None:
    """It does not wait; the kernel goes on, and nothing is left when it is closed."""
    pytest.importorskip("viser")
    (shown, closed), _ = executed([VIEW, CLOSE], tmp_path)
    assert len(shown) == 1, shown
    (frame,) = shown
    assert "<iframe" in frame["data"]["text/html"]
    assert 'src="http://127.0.0.1:' in frame["data"]["text/html"].replace("\n", "")
    assert [output["text"] for output in closed] == ["[] []\n"]

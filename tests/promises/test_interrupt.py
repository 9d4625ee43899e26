"""Ctrl-C as a terminal sends it: scripts stop, within seconds, with the picture so far, and leave nothing."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest
import scenes
from inside import AT_ONCE, STOP, InterruptHandler, SharedInt
from scripts import ENDLESS, children, end_of, runs, script, wait_for, write_mesh

import wavefront as wf

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="signals and processes of Linux")


def test_a_loop_of_renders_ends() -> None:
    """Also where warnings are errors; the next render does not begin."""
    body = """
import warnings
warnings.simplefilter("error")
for k in range(3):
    print("render", k, flush=True)
    image = wf.render(light, 100_000, progress=sampled)
    print("done", flush=True)
"""
    with script(body) as process:
        wait_for(process, "tracing")
        os.killpg(process.pid, signal.SIGINT)
        output = end_of(process)
    assert "wavefront.core.errors.Interrupted: interrupted: the picture so far has" in output
    assert "render 1" not in output
    assert "done" not in output
    assert process.returncode != 0


@pytest.mark.parametrize(
    ("executor", "presses"), [("processes", 1), ("threads", 1), ("threads", 2), ("processes", 3)]
)
@pytest.mark.first(2)
def test_endless_waves_are_left_at_once(executor: str, presses: int) -> None:
    """After one Ctrl-C, and after more of them 10 ms apart; nothing of the render is left."""
    body = f"""
import os, signal
def press(done, total):
    print("tracing", flush=True)
    sys.stdin.readline()  # until the test has seen the workers
    for _ in range({presses}):
        os.killpg(0, signal.SIGINT)
        time.sleep(0.01)
try:
    {ENDLESS.format(executor=executor, progress="press")}
except KeyboardInterrupt as stop:
    print("stopped", type(stop).__name__, getattr(stop, "image", "none at all"))
    while {presses} == 2 and left():  # nobody waits for threads any longer: they end by themselves
        time.sleep(0.01)
    print("left", left())
"""
    with script(body) as process:
        wait_for(process, "tracing")
        workers = children(process)
        output = end_of(process, "press\n")
    if presses < 3:
        assert "stopped Interrupted None\nleft []" in output
    assert len(workers) == (2 if executor == "processes" else 0)
    assert not any(map(runs, workers))


def test_workers_that_are_stopped_are_killed() -> None:
    body = f"""
try:
    {ENDLESS.format(executor="processes", progress="telling")}
except wf.Interrupted:
    print("left", left())
"""
    with script(body) as process:
        wait_for(process, "tracing")
        workers = children(process)
        assert len(workers) == 2
        for pid in workers:
            os.kill(pid, signal.SIGSTOP)
        os.kill(process.pid, signal.SIGINT)
        assert "left []" in end_of(process)
    assert not any(map(runs, workers))


def test_workers_that_are_stopped_do_not_keep_a_finished_render() -> None:
    body = """
import os, signal
def stop_one(done, total):
    if done == total:
        os.kill(multiprocessing.active_children()[0].pid, signal.SIGSTOP)
        print("stopped", flush=True)
image = wf.render(light, 4, workers=2, executor="processes", progress=stop_one)
print(image, "left", left())
"""
    with script(body) as process:
        wait_for(process, "stopped")
        assert "<Image 64x64, 4 spp> left []" in end_of(process)


def test_ctrl_c_while_a_scene_is_set_up() -> None:
    body = """
import importlib
def compile_scene(*_, **__):
    print("compiling", flush=True)
    rest()
importlib.import_module("wavefront.drive.prepared_scene").compile_scene = compile_scene
try:
    wf.render(light, 1)
except wf.Interrupted as stop:
    print(stop, stop.image)
"""
    with script(body) as process:
        wait_for(process, "compiling")
        os.kill(process.pid, signal.SIGINT)
        assert "while the scene was set up: there is no picture yet None" in end_of(process)


@pytest.mark.parametrize("module", ["xxhash", pytest.param("scipy", marks=pytest.mark.slow)])
def test_ctrl_c_while_trimesh_is_imported(tmp_path: Path, module: str) -> None:
    """It catches BaseException about imports that are optional; no half of it stays behind."""
    scene = tmp_path / "triangle.obj"
    scene.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    body = f"""
import signal
class Presses:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            print("pressed", flush=True)
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Presses())
try:
    wf.load({str(scene)!r})
    print("went on")
except KeyboardInterrupt:
    print("interrupted", "trimesh" in sys.modules)
print(len(wf.load({str(scene)!r}).shapes), signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""
    with script(body) as process:
        output, errors = process.communicate(timeout=60)
    assert output.split("\n")[:3] == ["pressed", "interrupted True", "1 True"], output + errors


def test_ctrl_c_within_a_loader_of_trimesh(tmp_path: Path) -> None:
    """That of STL goes on after any error in the text of the header."""
    scene = tmp_path / "triangle.stl"
    scene.write_bytes(bytes(80) + (1).to_bytes(4, "little") + bytes(50))
    body = f"""
import signal
import trimesh.exchange.stl as loader
def pressed(*given, **named):
    print("pressed", flush=True)
    signal.raise_signal(signal.SIGINT)
loader.util.decode_text = pressed
try:
    wf.load({str(scene)!r})
    print("went on")
except KeyboardInterrupt:
    print("interrupted")
"""
    with script(body) as process:
        output, errors = process.communicate(timeout=60)
    assert output.split() == ["pressed", "interrupted"], output + errors


def test_the_command_saves_the_picture_so_far(tmp_path: Path) -> None:
    """And ends with 130, as shells have it."""
    scene, output = tmp_path / "triangle.ply", tmp_path / "so_far.exr"
    write_mesh(scene, ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 1, 2),))
    body = f"""
import wavefront.cli
from wavefront.cli import render_command
render = render_command.render_by_command
render_command.render_by_command = lambda *given, **named: render(*given, **named | {{"progress": sampled}})
options = ["--size", "64x64", "--spp", "100000", "--output", {str(output)!r}]
sys.exit(wavefront.cli.main(["render", {str(scene)!r}, *options]))
"""
    with script(body) as process:
        wait_for(process, "tracing")
        os.killpg(process.pid, signal.SIGINT)
        text = end_of(process)
    assert process.returncode == 130, text
    assert "wavefront: interrupted: the picture so far has" in text
    assert output.exists()


# --- The handler ----------------------------------------------------------------------------------


def test_presses_are_counted() -> None:
    """The first asks, the second hurries, the third is an error anywhere."""
    stop = SharedInt()
    with suppress(KeyboardInterrupt), InterruptHandler(stop) as handler:
        assert (handler.pressed, stop.value) == (False, 0)
        signal.raise_signal(signal.SIGINT)
        assert (handler.pressed, stop.value) == (True, STOP)
        signal.raise_signal(signal.SIGINT)
        assert stop.value == AT_ONCE
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_workers_are_stopped_in_the_same_context() -> None:
    """A session that begins another picture may need other workers, which have a stop flag of their own."""
    first, second, third = SharedInt(), SharedInt(), SharedInt()
    with suppress(KeyboardInterrupt), InterruptHandler(first) as handler:
        handler.watch(second)
        signal.raise_signal(signal.SIGINT)
        handler.watch(third)
        assert (first.value, second.value, third.value, handler.pressed) == (0, STOP, STOP, True)
    handler.watch(first)
    assert (first.value, handler.pressed) == (0, False)


def test_a_press_is_not_lost() -> None:
    """When nothing is raised for it within the context, the outermost exit raises."""
    handler = InterruptHandler(SharedInt())

    def press_within() -> None:
        with handler:
            with handler:
                signal.raise_signal(signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler

    with pytest.raises(KeyboardInterrupt):
        press_within()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with handler:  # once for each press
        pass


def test_sigterm_counts_where_it_has_pythons_handler_of_ctrl_c() -> None:
    stop, before = SharedInt(), signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), InterruptHandler(stop):
            signal.raise_signal(signal.SIGTERM)
        assert stop.value == STOP
        assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_handler_of_the_programs_own_stays() -> None:
    calls: list = []
    before = signal.signal(signal.SIGINT, lambda *call: calls.append(call))
    try:
        with InterruptHandler(SharedInt()) as handler:
            signal.raise_signal(signal.SIGINT)
        assert len(calls) == 1
        assert not handler.pressed
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_render_in_another_thread_has_no_handler() -> None:
    found: list = []

    def work() -> None:
        found.append(wf.render(scenes.everything(), 1, progress=False))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found


def test_a_notebook_shows_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """IPython asks an error for its traceback; this one displays its picture, and is one line."""
    shown: list = []
    display = type(sys)("IPython.display")
    display.display = shown.append  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    stopped = wf.Interrupted("stopped", "the picture")
    for _ in range(2):  # kernels ask twice
        assert stopped._render_traceback_()[0] == "Interrupted: stopped"
    assert wf.Interrupted("early")._render_traceback_() == ["Interrupted: early"]
    assert shown == ["the picture"]

"""The bar: late, so that short renders have none, and right from when it appears."""

import os
import re
import subprocess
import sys
import threading
import time
from itertools import count
from types import SimpleNamespace

import pytest
import scenes
from inside import DELAY, Bar, load, load_mesh, phase, prepared_scene, readers
from inside import progress as module

import wavefront as wf


def wait_for(text: str, capsys) -> None:
    """Wait until something is shown, as a thread does."""
    shown, end = "", time.monotonic() + 60
    while text not in shown and time.monotonic() < end:
        time.sleep(0.01)
        shown += capsys.readouterr().err
    assert text in shown


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines appear at once, seven seconds after the beginning of their phase."""
    monkeypatch.setattr(module, "DELAY", 0.001)
    monkeypatch.setattr(module, "TICK", 0.01)
    monkeypatch.setattr("tqdm.std.time", lambda: 1000.0)
    clock = count(0, 7)  # it is asked at the beginning, and when the line appears
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(clock)))


@pytest.mark.parametrize("progress", [None, True])
def test_a_bar_appears_after_a_while(progress, capsys) -> None:
    """It counts the time before, too."""
    with Bar(progress, 1000, None) as bar:
        bar.advance(100, DELAY)
        assert capsys.readouterr().err == ""
        bar.advance(200, DELAY + 3)
        assert "30%" in capsys.readouterr().err
        bar.advance(50, DELAY + 4)
    assert re.search(rf"35%.*350/1.00k \[00:0{DELAY + 3}<", capsys.readouterr().err)


def test_a_bar_of_time_counts_seconds(capsys) -> None:
    with Bar(None, 1000, 10.0) as bar:
        bar.advance(100, 4.2)
        assert "4/10 s" in capsys.readouterr().err
        bar.advance(100, 11)
    assert "10/10 s" in capsys.readouterr().err


SHOWING = """
import time
from wavefront.core import progress
progress.DELAY = 0.0
with progress.Bar(None, 1000, None) as bar:
    bar.advance(100, 1)
    bar.wait(3, 10)
with progress.phase("loading"):
    time.sleep(0.2)
"""


def test_a_bar_may_be_disabled_by_the_environment() -> None:
    """By TQDM_DISABLE, which tqdm reads when it is imported."""
    environment = {**os.environ, "TQDM_DISABLE": "1"}
    done = subprocess.run([sys.executable, "-c", SHOWING], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("seconds", [None, 20.0])
def test_a_bar_shows_how_far_paths_are(seconds, capsys) -> None:
    with Bar(None, 1000, seconds) as bar:
        bar.wait(100, DELAY - 0.5)
        assert capsys.readouterr().err == ""
        bar.wait(200, DELAY + 0.7)
        bar.wait(300, DELAY + 0.8)
        assert "paths of 200 surfaces under way" in capsys.readouterr().err
        bar.wait(400, DELAY + 1.8)
        assert "paths of 400 surfaces under way" in capsys.readouterr().err
        bar.advance(1000, DELAY + 30)
    assert capsys.readouterr().err.rstrip().splitlines()[-1].count("surfaces") == 0


def test_there_is_no_bar_for_a_function_or_for_false(capsys) -> None:
    """A function is called in its place."""
    calls: list = []
    for progress in (False, lambda *call: calls.append(call)):
        with Bar(progress, 100, None) as bar:
            bar.advance(20, 1)
            bar.advance(30, 60)
    assert calls == [(20, 100), (50, 100)]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("progress", [None, True])
def test_a_long_phase_shows_its_title(progress, at_once, capsys) -> None:
    """The line counts from the beginning of the phase, and its thread ends with the phase."""
    before = threading.active_count()
    with phase("loading a.glb", progress):
        wait_for("loading a.glb: 00:07", capsys)
    # tqdm keeps one thread of its own
    assert threading.active_count() <= before + 1


def test_short_phases_show_nothing(capsys) -> None:
    assert module.DELAY == 2
    with phase("loading a.glb"):
        pass
    assert capsys.readouterr().err == ""


def test_silent_phases_show_nothing(at_once, capsys) -> None:
    """A function is not called either: it counts samples."""
    calls: list = []
    for progress in (False, lambda *call: calls.append(call)):
        with phase("loading a.glb", progress):
            time.sleep(0.05)
    assert capsys.readouterr().err == ""
    assert not calls


@pytest.mark.parametrize("load", [load, load_mesh])
@pytest.mark.parametrize("progress", [None, False])
def test_loading_is_a_phase(load, progress, tmp_path, at_once, calls_of, capsys) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")

    read = readers.SceneFiles.read

    def slow(files: readers.SceneFiles, path: object) -> bytes:
        if progress is None:
            wait_for("\rloading a.obj: 00:07", capsys)
        else:
            time.sleep(0.1)
        return read(files, path)

    calls_of("wavefront.io.readers.SceneFiles.read", slow)
    load(tmp_path / "a.obj", progress=progress)
    shown = capsys.readouterr().err
    assert progress is None or shown == ""
    assert str(tmp_path) not in shown


@pytest.mark.parametrize("progress", [None, False])
def test_building_a_scene_is_a_phase(progress, at_once, calls_of, capsys) -> None:
    compile_scene = prepared_scene.compile_scene

    def slow(*given, **options):
        if progress is None:
            wait_for("building the scene: 00:07", capsys)
        return compile_scene(*given, **options)

    calls_of("wavefront.drive.prepared_scene.compile_scene", slow)
    wf.render(scenes.everything(), 1, progress=progress)
    assert progress is None or capsys.readouterr().err == ""

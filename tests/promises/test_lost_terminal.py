"""A terminal that is closed, a standard error that takes nothing: the picture is there all the same."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import scenes
from inside import Bar, notebook, phase, progress, warn_caller
from scripts import write_mesh

import wavefront as wf
from wavefront import cli

LINUX = sys.platform.startswith("linux")
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def closed() -> io.StringIO:
    """Return a file that is closed."""
    file = io.StringIO()
    file.close()
    return file


def unbuffered(descriptor: int) -> io.TextIOWrapper:
    """Return a file in which nothing waits to be written."""
    raw: Any = os.fdopen(descriptor, "wb", buffering=0)
    return io.TextIOWrapper(raw, write_through=True)


def full() -> io.TextIOWrapper:
    """Return a file on a full disk."""
    if not LINUX:
        pytest.skip("/dev/full is of Linux")
    return unbuffered(os.open("/dev/full", os.O_WRONLY))


def unread() -> io.TextIOWrapper:
    """Return a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    return unbuffered(writer)


FILES: list[Callable[[], object]] = [lambda: None, closed, full, unread]


mute_files = pytest.mark.parametrize("make", FILES, ids=["none", "closed", "full", "unread"])


@contextmanager
def mute(make: Callable[[], Any]) -> Iterator[None]:
    """Let standard error show nothing, and bars appear at once."""
    file = make()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(progress, "DELAY", 0.0)
        patch.setattr(progress, "TICK", 0.01)
        patch.setattr(sys, "stderr", file)
        yield
    if file is not None:
        file.close()


@mute_files
def test_a_bar_that_cannot_be_shown_ends_no_render(make: Callable[[], object]) -> None:
    with mute(make):
        image = wf.render(scenes.everything(), 4)
        with Bar(True, 1000, None) as bar:
            for second in range(4):
                bar.advance(100, second)
                bar.wait(3, second + 0.5)
        with phase("loading"):
            time.sleep(0.05)
    assert image.spp == 4


@mute_files
def test_a_warning_that_cannot_be_shown_is_lost(make: Callable[[], object]) -> None:
    with mute(make), pytest.raises(UserWarning, match="beware"):
        warn_caller("beware")
    with mute(make), warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *_: sys.stderr.write(str(message))  # type: ignore[assignment]
        warn_caller("beware")


@mute_files
def test_the_command_writes_its_picture(make, tmp_path):
    scene, output = tmp_path / "triangle.obj", tmp_path / "out.png"
    scene.write_text(TRIANGLE)
    with mute(make), redirect_stdout(sys.stderr):
        done = cli.main(["render", str(scene), "--size", "16x16", "--spp", "1", "-o", str(output)])
        failed = cli.main(["render", str(tmp_path / "none.obj"), "-o", str(output)])
    assert (done, failed) == (0, 2)
    assert output.exists()


def test_an_error_of_the_programs_own_function_is_not_hidden() -> None:

    def report(done: float, total: float) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        wf.render(scenes.everything(), 4, progress=report)


def test_a_notebook_that_shows_nothing_ends_no_render(monkeypatch: pytest.MonkeyPatch) -> None:

    def fail(*given: object, **named: object) -> None:
        raise RuntimeError("no comm")

    shell = SimpleNamespace(events=SimpleNamespace(register=fail))
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=fail))
    shown = notebook.LivePicture()
    shown._next = 0.0
    image = wf.Image([[[1.0, 1.0, 1.0]]])
    shown.refine(image)
    shown._handle = SimpleNamespace(update=fail)
    shown._next = 0.0
    shown.refine(image)
    shown.end(wf.Image([[[1.0, 1.0, 1.0]]]))
    stopped = wf.Interrupted("stopped", image)
    assert stopped._render_traceback_()[0] == "Interrupted: stopped"


# --- SIGHUP -----------------------------------------------------------------------------------------


@pytest.mark.skipif(not LINUX, reason="terminals of Linux")
@pytest.mark.parametrize("ignored", [False, True])
@pytest.mark.first(1)
def test_a_closed_terminal_keeps_the_picture(tmp_path: Path, ignored: bool) -> None:
    """And the checkpoint. The workers are told as well, and the messages have nowhere to go.

    With `nohup` the render goes on to its end.
    """
    import pty

    scene, output, kept = tmp_path / "triangle.ply", tmp_path / "out.npy", tmp_path / "out.wfck"
    write_mesh(scene, ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 1, 2),))
    spp = "200" if ignored else "1000000"
    options = ["--size", "64x64", "--spp", spp, "--workers", "2", "--checkpoint", kept, "-o", output]
    options += ["--checkpoint-interval", "0.1"]
    main, terminal = pty.openpty()

    def begin() -> None:
        os.setsid()
        import fcntl
        import termios

        fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)

    process = subprocess.Popen(
        [sys.executable, "-m", "wavefront", "render", scene, *options],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        preexec_fn=begin,
    )
    try:
        os.close(terminal)
        while not kept.exists():
            time.sleep(0.01)
            assert process.poll() is None
        os.close(main)
        assert process.wait(timeout=60) == (0 if ignored else 129)
    finally:
        process.kill()
        process.wait()
    picture = wf.Image.load(output)
    assert picture.rgb.tobytes() == wf.Image.load(kept).rgb.tobytes()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="SIGHUP is of POSIX")
def test_sighup_counts_where_it_has_pythons_handler_of_ctrl_c() -> None:
    before = signal.signal(signal.SIGHUP, signal.default_int_handler)

    def hang_up(done: float, total: float) -> None:
        signal.raise_signal(signal.SIGHUP)

    try:
        with pytest.raises(wf.Interrupted) as stopped:
            wf.render(scenes.everything(), 64, progress=hang_up)
        assert stopped.value.image is not None
    finally:
        signal.signal(signal.SIGHUP, before)

"""Scripts of a user in processes of their own, which tests interrupt, and what they leave."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

SOON = 30.0  # seconds; about a tenth of one is usual, and waves that nobody ends take minutes

# Endless waves: no light is absorbed in the closed ball, so no path ends before 65 536 bounces.
CLOSED = """
import multiprocessing, sys, threading, time
import wavefront as wf
room = wf.Sphere((0, 0, 0), 5, material=wf.Diffuse(1.0))
light = wf.Sphere((0, 0, -3), 0.1, emission=1)
camera = wf.Camera.look_at((0, 0, 3), (0, 0, 0), size=(64, 64))
closed = wf.Scene([room, light], camera=camera)
light = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1.0)], camera)
def telling(done, total):
    print("tracing", flush=True)
def sampled(done, total):
    if done:
        telling(done, total)
def rest():
    for _ in range(6000):  # one long sleep would go on if Ctrl-C came while Python hands its lock to a thread
        time.sleep(0.01)
def left():
    return [each.name for each in threading.enumerate()[1:]] + multiprocessing.active_children()
"""
ENDLESS = "wf.render(closed, 64, workers=2, executor={executor!r}, max_bounces=65536, progress={progress})"


def write_mesh(path: Path, corners: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> None:
    """Write triangles as PLY: to read OBJ, programs import trimesh, which takes most of a second."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {name}" for name in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, row)) for row in (*corners, *((3, *face) for face in faces))]
    path.write_text("\n".join(lines) + "\n")


def start_python(*arguments: str) -> subprocess.Popen[str]:
    """Start Python in a process group of its own, connected to this one."""
    pipe = subprocess.PIPE
    command = [sys.executable, "-W", "ignore", *arguments]
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, process_group=0)


@contextmanager
def script(body: str) -> Iterator[subprocess.Popen[str]]:
    """Run a script in a process group of its own."""
    process = start_python("-c", CLOSED + body)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(process: subprocess.Popen[str], word: str) -> None:
    """Wait until the script says a word."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.strip() == word:
            return
    raise AssertionError(f"the script ended without {word!r}: {process.communicate()[1]}")


def children(process: subprocess.Popen[str]) -> list[int]:
    """Process ids of the workers."""
    found = []
    for thread in Path(f"/proc/{process.pid}/task").iterdir():
        with suppress(OSError):  # it has ended
            found += [int(pid) for pid in (thread / "children").read_text().split()]
    return found


def eventually(condition: Callable[[], object], seconds: float = SOON) -> bool:
    """Wait until a condition holds, at most so long."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return bool(condition())


def runs(pid: int) -> bool:
    """Tell whether a process is there, and not only as an entry that nobody has collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def end_of(process: subprocess.Popen[str], reply: str | None = None) -> str:
    """Return what else a script writes before it ends, which must be soon."""
    return "".join(process.communicate(reply, timeout=SOON))

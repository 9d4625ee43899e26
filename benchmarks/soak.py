"""Renders without end: is memory flat, and does nothing leak?

    python benchmarks/soak.py [--minutes 20]

Rounds of everything that takes something from the system: renders by threads and by processes, sessions
that are stopped, left or given another camera, waves that run out of memory, scene files and damaged ones,
saved pictures. After each round the memory of the process is read (PSS, from /proc), and its threads, open
files, child processes and mappings of shared memory are counted. The first fifth of the time is for warming
up: from then on the counts must not grow, and the memory of the last third must not be more than 2 % above
that of the third before. It prints the figures, and ends with 1 if something grows.
"""

from __future__ import annotations

import argparse
import gc
import os
import statistics
import sys
import tempfile
import threading
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf
from wavefront.core.memory import resident_memory
from wavefront.integrators import li_full

GROWTH = 0.02  # of memory, that is no leak
WARM_UP = 1 / 5  # of the time


@dataclass
class Reading:
    """What the process has after a round."""

    memory: int  # bytes
    threads: int
    files: int
    children: int
    shared: int  # mappings of shared memory

    @classmethod
    def now(cls) -> Reading:
        """Read the state of the process."""
        gc.collect()
        children = [
            Path(f"/proc/self/task/{each}/children").read_text() for each in os.listdir("/proc/self/task")
        ]
        maps = Path("/proc/self/maps").read_text().splitlines()
        shared = sum(line.split()[1].endswith("s") for line in maps)
        return cls(
            resident_memory(),
            threading.active_count(),
            len(os.listdir("/proc/self/fd")),
            sum(len(each.split()) for each in children),
            shared,
        )

    @property
    def counts(self) -> tuple[int, ...]:
        """All but the memory."""
        return self.threads, self.files, self.children, self.shared


def scene() -> wf.Scene:
    """Return a small scene with a mesh, a texture and several lights."""
    texture = wf.Texture(np.random.default_rng(0).random((32, 32, 3), np.float32))
    floor = wf.Rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), material=wf.Diffuse(texture))
    ball = wf.Sphere((0, 0.5, 0), 0.5, material=wf.Principled(0.6, 0.2, 0.4))
    camera = wf.Camera.look_at((0, 1.5, 4), (0, 0.5, 0), size=(96, 72))
    return wf.Scene([floor, ball], [wf.Environment(0.5), wf.PointLight((1, 3, 1), 8)], camera)


def little_memory(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
    """Trace paths as li_full does, if they are few."""
    if len(paths) > 3000:
        raise MemoryError("no room")
    return li_full(scene, paths, sampler, max_bounces)


def one_round(folder: Path) -> None:
    """Do everything once."""
    subject = scene()
    for executor in ("threads", "processes"):
        image = wf.render(subject, 8, executor=executor, workers=2, progress=False)
    image.save(folder / "a.exr")
    image.save(folder / "a.png")
    wf.Image.load(folder / "a.exr")
    wf.render(subject, 4, integrator=little_memory, workers=2, executor="processes", progress=False)
    with wf.Session(subject, 64, workers=2, executor="processes", progress=False) as session:
        next(iter(session))
        session.set_camera(wf.Camera.look_at((3, 1.5, 3), (0, 0.5, 0), size=(80, 60)))
        next(iter(session))
        session.stop()
    with wf.Session(subject, 64, workers=2, executor="threads", max_memory="2GB", progress=False) as session:
        for _ in session:
            break
    (folder / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    wf.render(wf.load(folder / "a.obj", progress=False), 2, size=(32, 32), progress=False)
    (folder / "b.obj").write_text("v 0 0 0\nf 1 2 9\n")
    for mistake in (
        lambda: wf.load(folder / "b.obj", progress=False),
        lambda: wf.render(subject, 4, max_memory="1MB"),
    ):
        try:
            mistake()
        except wf.SceneError:
            continue
        raise AssertionError("a mistake went unnoticed")


def soak(minutes: float) -> list[Reading]:
    """Do rounds for so many minutes; return the readings after the warm-up."""
    readings: list[Reading] = []
    begin, end = time.monotonic() + WARM_UP * 60 * minutes, time.monotonic() + 60 * minutes
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the picture of the file is lit
        rounds = 0
        while time.monotonic() < end:
            one_round(Path(name))
            rounds += 1
            if time.monotonic() >= begin:
                readings.append(Reading.now())
    print(f"{rounds} rounds in {minutes:g} minutes, {len(readings)} after the warm-up")
    return readings


def leaks(readings: list[Reading]) -> list[str]:
    """Return what grows, in words."""
    third = max(1, len(readings) // 3)
    before = statistics.median(each.memory for each in readings[-2 * third : -third] or readings)
    after = statistics.median(each.memory for each in readings[-third:])
    first, last = readings[0], readings[-1]
    print(f"memory {first.memory / 1e6:.1f} MB at first, {before / 1e6:.1f} then, {after / 1e6:.1f} at last")
    print(f"threads, files, children, shared memory: {first.counts} at first, {last.counts} at last")
    found = []
    if after > before * (1 + GROWTH):
        found.append(f"memory grows by {after / before - 1:.1%}")
    if any(now > then for now, then in zip(last.counts, first.counts, strict=True)):
        found.append("threads, files, children or shared memory grow")
    return found


def main() -> None:
    """Soak, and say what leaks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=20)
    found = leaks(soak(parser.parse_args().minutes))
    print("; ".join(found) or "nothing leaks")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()

"""The most memory that a render of 1920 × 1080 pixels uses, at any number of samples per pixel.

    python benchmarks/memory.py [--scene room] [--spp 4 4096] [--seconds 120] [--max-memory 1GB] [--workers 2]

Each render has a process of its own. Its memory is the sum of the proportional set sizes (PSS) of it and its
workers, read 20 times a second from /proc, so that shared pages count once. A render that is not done after
`--seconds` is stopped, and its picture is made of the samples so far: memory does not grow with their number,
so the peak is that of the whole render, if the second half of the time does not raise it. The table shows it
for each half. The scene "sky" has the shortest paths, so that all of its 8.5 billion samples are done in
about ten minutes of two cores.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import wavefront as wf

SIZE = 1920, 1080
INTERVAL = 0.05  # seconds between two readings


def memory(pid: int) -> int:
    """Return the bytes that a process and all that it started use together."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        threads = os.listdir(f"/proc/{pid}/task")
        children = [Path(f"/proc/{pid}/task/{each}/children").read_text().split() for each in threads]
    except OSError:  # it has just ended
        return 0
    own = sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return own + sum(memory(int(child)) for some in children for child in some)


def room() -> wf.Scene:
    """Return two balls in front of a wall."""
    camera = wf.Camera.look_at((0, 1, 4), (0, 0.8, 0), fov=40, size=SIZE)
    shapes = [
        wf.Rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), material=wf.Diffuse(0.7)),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0), material=wf.Diffuse((0.7, 0.2, 0.2))),
        wf.Sphere((-0.5, 0.5, 0), 0.5, material=wf.Dielectric(1.5)),
        wf.Sphere((0.7, 0.4, 0.2), 0.4, material=wf.Principled(0.6, 0.2, 0.3)),
    ]
    return wf.Scene(shapes, [wf.Environment(1.0)], camera)


def sky() -> wf.Scene:
    """Return a black ball before an even sky: no path goes on from its first surface."""
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=40, size=SIZE)
    return wf.Scene([wf.Sphere((0, 0, 0), 0.5, material=wf.Diffuse(0))], [wf.Environment(1.0)], camera)


SCENES: dict[str, tuple[Callable[[], wf.Scene], dict[str, Any]]] = {
    "room": (room, {}),
    "sky": (sky, {"integrator": "naive", "max_bounces": 0}),
}


def render(spp: int, options: argparse.Namespace) -> None:
    """Render, and stop when the time is up."""
    make, settings = SCENES[options.scene]
    limits = {"max_memory": options.max_memory, "workers": options.workers}
    with wf.Session(make(), spp, progress=False, **limits, **settings) as session:
        timer = threading.Timer(options.seconds, session.stop)
        timer.start()
        image = session.run()
        timer.cancel()
    found = image.metadata
    print(f"  {found['spp']:.4g} of {spp} samples per pixel in {found['seconds']:.0f} s", flush=True)


def peaks(spp: int, options: argparse.Namespace) -> tuple[int, int, int]:
    """Return the peak of the first half of a render's time, of the second, and of both."""
    process = multiprocessing.get_context("spawn").Process(target=render, args=(spp, options))
    readings: list[int] = []
    process.start()
    while process.is_alive():
        readings.append(memory(process.pid or 0))
        time.sleep(INTERVAL)
    if process.exitcode:
        raise SystemExit(f"the render ended with {process.exitcode}")
    half = len(readings) // 2
    return max(readings[:half]), max(readings[half:]), max(readings)


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scene", choices=SCENES, default="room")
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 4096])
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--max-memory")
    parser.add_argument("--workers", type=int)
    options = parser.parse_args()
    found = []
    for spp in options.spp:
        first, second, peak = peaks(spp, options)
        found.append(peak)
        print(
            f"{SIZE[0]}x{SIZE[1]}, {spp} spp: peak {peak / 1e6:,.0f} MB "
            f"(first half of the time {first / 1e6:,.0f}, second half {second / 1e6:,.0f})",
            flush=True,
        )
    print(f"the peaks differ by {max(found) / min(found) - 1:.1%}")


if __name__ == "__main__":
    main()

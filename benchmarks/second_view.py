"""A second view of a mesh: a render anew, a render of the same scene, and a session with another camera.

python benchmarks/second_view.py [--repeat 7] [--subdivisions 6]

The mesh is a bumpy ball of 20 · 4^subdivisions triangles in an environment, 256x256 at 4 spp. All ways run in
turn. Times are medians of the second view alone, in seconds; `built` counts accelerators that were built for
it, and `started` worker processes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import trimesh

import wavefront as wf
from wavefront.accel import cache
from wavefront.workers import processes


def bumpy_ball(subdivisions: int) -> wf.Scene:
    """Return a scene of one mesh."""
    ball = trimesh.creation.icosphere(subdivisions)
    bumps = 1 + 0.05 * np.sin(9 * ball.vertices).prod(1)
    mesh = wf.Mesh(ball.vertices * bumps[:, None], ball.faces, material=wf.Principled((0.7, 0.4, 0.2)))
    return wf.Scene([mesh], [wf.Environment(1.0)])


def camera(x: float) -> wf.Camera:
    """Return a camera beside the mesh."""
    return wf.Camera.look_at((x, 1, 3), (0, 0, 0), size=(256, 256))


class Counted:
    """Counts the accelerators that are built, and the worker processes that are started."""

    def __init__(self) -> None:
        self.built = self.started = 0
        self._build, self._start = cache.make_accelerator, processes.forked_workers
        cache.make_accelerator = self._count_build
        processes.forked_workers = self._count_start

    def _count_build(self, *given: Any) -> Any:
        self.built += 1
        return self._build(*given)

    def _count_start(self, work: Any, count: int, strict: bool) -> Any:
        self.started += count
        return self._start(work, count, strict)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--subdivisions", type=int, default=6)
    options = parser.parse_args()
    settings = {"spp": 4, "branches": 1, "accel": "numpy", "executor": "processes", "progress": False}
    counted = Counted()
    rows: dict[str, list[tuple[float, int, int]]] = {}

    def measure(name: str, second: Callable[[], object]) -> None:
        counted.built = counted.started = 0
        begin = time.perf_counter()
        second()
        rows.setdefault(name, []).append((time.perf_counter() - begin, counted.built, counted.started))

    def second_view(session: wf.Session) -> None:
        session.set_camera(camera(1))
        session.run()

    for _ in range(options.repeat):
        scene, another = bumpy_ball(options.subdivisions), bumpy_ball(options.subdivisions)
        with wf.Session(scene, camera=camera(0), **settings) as session:
            session.run()
            measure("the same session", partial(second_view, session))
        measure("render, same scene", partial(wf.render, scene, camera=camera(1), **settings))
        measure("render, new scene", partial(wf.render, another, camera=camera(1), **settings))
    print(f"{'second view by':20} {'seconds':>8} {'built':>6} {'started':>8}")
    for name, runs in rows.items():
        print(f"{name:20} {median(run[0] for run in runs):8.3f} {runs[-1][1]:6} {runs[-1][2]:8}")


if __name__ == "__main__":
    main()

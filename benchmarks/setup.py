"""Set-up of large scenes: CPU time from a scene to a session that can trace, and peak memory.

Run: python benchmarks/setup.py [--scenes triangles-numpy,...]

Each scene is set up in a process of its own. "before" is the resident memory when its arrays are there.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import wavefront as wf

MILLION = 10**6


def grid(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of rough terrain."""
    n = int((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(*[np.linspace(-1, 1, n)] * 2)
    rough = 0.01 * np.random.default_rng(0).random(x.shape)
    vertices = np.stack([x, y, 0.2 * np.sin(7 * x) * np.cos(5 * y) + rough], -1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def triangles() -> Callable[[], wf.Scene]:
    """Five million triangles under a sky."""
    vertices, faces = grid(5 * MILLION)
    return lambda: wf.Scene([wf.Mesh(vertices, faces)], wf.Environment(1))


def emitting() -> Callable[[], wf.Scene]:
    """A million triangles, each of which shines."""
    vertices, faces = grid(MILLION)
    return lambda: wf.Scene([wf.Mesh(vertices, faces, emission=1)])


def points() -> Callable[[], wf.Scene]:
    """A million point lights."""
    places = np.random.default_rng(1).random((MILLION, 3))
    return lambda: wf.Scene([wf.Sphere((0, 0, 0), 1)], wf.PointLights(places, 1))


def spheres() -> Callable[[], wf.Scene]:
    """A hundred thousand spheres under a sky."""
    centers = np.random.default_rng(1).random((100_000, 3))
    return lambda: wf.Scene([wf.Spheres(centers, 0.003)], wf.Environment(1))


SCENES = {
    "triangles-numpy": triangles,
    "triangles-embree": triangles,
    "emitting-numpy": emitting,
    "emitting-embree": emitting,
    "points-numpy": points,
    "spheres-numpy": spheres,
}


def peak() -> float:
    """Return the most memory that this process has had, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def measure(name: str) -> str:
    """Set a scene up and return a row of the table."""
    make, before = SCENES[name](), peak()
    camera = wf.Camera.look_at((0, -3, 2), (0, 0, 0), size=(64, 64))
    wall, cpu = time.perf_counter(), time.process_time()
    wf.Session(make(), 1, camera=camera, branches=1, accel=name.rpartition("-")[2], progress=False)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return f"{name:>18} {cpu:8.1f} {wall:8.1f} {before:9.2f} {peak():8.2f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(measure(options.one))
        return
    print(f"{'scene':>18} {'CPU, s':>8} {'wall, s':>8} {'before,GB':>9} {'peak, GB':>8}", flush=True)
    for name in options.scenes.split(","):
        subprocess.run([sys.executable, __file__, "--one", name], check=True)


if __name__ == "__main__":
    main()

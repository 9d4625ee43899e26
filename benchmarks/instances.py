"""Memory and time of a scene of many instances: a mesh of 20 480 triangles, placed 1 000 times.

Run: python benchmarks/instances.py [--copies 1000] [--level 5] [--size 160x120] [--spp 4]

It writes the scene as a glb file, then loads and renders it in a process of its own for each
accelerator. "peak" is the resident memory of that process at its highest, together with that of its
workers, where they are processes: what they share is counted for each. "import" is what it was before the
file was opened. Both are read from /proc, so only Linux has them. "again" is a second render
in the same process.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

READER = """
import os, resource, sys, time
import wavefront as wf

def peak():
    (line,) = (line for line in open("/proc/self/status") if line.startswith("VmHWM:"))
    worker = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return (int(line.split()[1]) + len(os.sched_getaffinity(0)) * worker) / 1024

path, accel, width, height, spp = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:])
first = peak()
begin = time.perf_counter()
scene = wf.load(path)
loaded = time.perf_counter()
scene.lights.append(wf.Environment(1))
scene.camera = scene.framing_camera(size=(width, height))
times = [wf.render(scene, spp, accel=accel, branches=1, progress=False).metadata["seconds"] for _ in range(2)]
print(f"{accel:>8} {first:9.0f} {peak():7.0f} {loaded - begin:8.2f} {times[0]:9.2f} {times[1]:8.2f}")
"""


def write(path: Path, copies: int, level: int) -> int:
    """Write a cube full of balls, turned, stretched and some mirrored; return the triangles of one."""
    import trimesh
    from trimesh.transformations import random_rotation_matrix

    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(level)
    scene = trimesh.Scene()
    scene.geometry["ball"] = ball
    reach = copies ** (1 / 3)
    for i in range(copies):
        matrix = random_rotation_matrix(rng.random(3)) @ np.diag([*rng.uniform(0.2, 0.6, 3), 1])
        matrix[:3, 0] *= rng.choice([-1, 1])
        matrix[:3, 3] = rng.uniform(-reach, reach, 3)
        scene.graph.update(f"ball{i}", "world", matrix=matrix, geometry="ball")
    scene.export(path)
    return len(ball.faces)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--copies", type=int, default=1000)
    parser.add_argument("--level", type=int, default=5, help="of the icosphere: 20 · 4^level triangles")
    parser.add_argument("--size", default="160x120")
    parser.add_argument("--spp", default="4")
    parser.add_argument("--accel", default="numpy,embree")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "balls.glb"
        faces = write(path, options.copies, options.level)
        size = path.stat().st_size / 2**20
        print(f"{options.copies} x {faces} = {options.copies * faces} triangles, {size:.1f} MiB of glb")
        print(f"{'':>8} {'import':>9} {'peak':>7} {'load':>8} {'render':>9} {'again':>8}")
        print(f"{'':>8} {'MiB':>9} {'MiB':>7} {'s':>8} {'s':>9} {'s':>8}", flush=True)
        for accel in options.accel.split(","):
            arguments = [str(path), accel, *options.size.split("x"), options.spp]
            subprocess.run([sys.executable, "-c", READER, *arguments], check=True)


if __name__ == "__main__":
    main()

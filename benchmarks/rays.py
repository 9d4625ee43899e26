"""Million rays per second: NumPy against embreex and a plain lockstep BVH, alternating in one run.

Run: python benchmarks/rays.py [--rays N] [--repeats R] [--sizes 36,1280,...] [--lockstep] [--prototype PATH]

Times are CPU time of the calling thread, so that other processes matter less; the table gives medians.
"two" is wall time with one worker process over that with two, which trace 16 parts of the rays; the
parts come back through a pipe, as in a render. --prototype names a script with build(triangles, leaf,
width) and closest(nodes, origin, direction), which knows no barycentrics, so that none are asked of NumPy
in what it is compared with.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import importlib.util
import resource
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from wavefront.accel import Accelerator, Geometry, make_accelerator
from wavefront.accel.build import build_tree
from wavefront.workers.pool import WorkerPool

f4 = np.float32
Array = NDArray[np.float32]


def cornell() -> Array:
    """A closed room with two boxes, 36 triangles."""
    room = trimesh.creation.box(extents=(2, 2, 2))
    low = trimesh.creation.box(extents=(0.6, 0.6, 0.6)).apply_translation((0.3, -0.7, 0.3))
    high = trimesh.creation.box(extents=(0.6, 1.2, 0.6)).apply_translation((-0.3, -0.4, -0.3))
    return np.concatenate([box.triangles for box in (room, low, high)]).astype(f4)


def mesh(size: int) -> Array:
    """About `size` triangles of a unit sphere, or the Cornell box for 36."""
    if size == 36:
        return cornell()
    if size == 1_000_000:
        around, along = 1000, 501
        grid = trimesh.creation.uv_sphere(count=(along, around // 2))
        return np.asarray(grid.triangles, f4)
    level = round(np.log(size / 20) / np.log(4))
    return np.asarray(trimesh.creation.icosphere(subdivisions=level).triangles, f4)


def unit(vectors: NDArray[np.float64]) -> Array:
    """Scale (3, n) to unit length."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0), f4)


def rays(kind: str, closed: bool, n: int) -> tuple[Array, Array]:
    """Rays (3, n): `coherent` from a camera; `incoherent` all over; `closed` scenes from the inside."""
    rng = np.random.default_rng(0)
    if kind == "coherent":
        side = int(n**0.5)
        x, y = (v.ravel() for v in np.meshgrid(*[np.linspace(-1, 1, side)] * 2))
        reach = 0.9 if closed else 2.5
        origin = np.tile(np.array([[0.0], [0.0], [reach]]), side * side)
        return origin.astype(f4), unit(np.stack([0.35 * x, 0.35 * y, -np.ones_like(x)]))
    if closed:
        return rng.uniform(-0.9, 0.9, (3, n)).astype(f4), unit(rng.normal(size=(3, n)))
    origin = 1.5 * unit(rng.normal(size=(3, n)))
    return origin, unit(0.9 * unit(rng.normal(size=(3, n))) - origin)


def trace(accelerator: Accelerator, kind: str, origin: Array, direction: Array) -> float:
    """CPU seconds of tracing rays (3, n)."""
    none, distance = np.full(origin.shape[1], -1), np.ones(origin.shape[1], f4)
    start = time.thread_time()
    if kind == "shadow":
        accelerator.occluded(origin, direction, distance, none)
    else:
        accelerator.closest(origin, direction, none)
    return time.thread_time() - start


class Lockstep:
    """The usual way to vectorize a BVH: one stack per ray, all rays take one step at a time."""

    def __init__(self, triangles: Array) -> None:
        low, high = (np.ascontiguousarray(v.T) for v in (triangles.min(1), triangles.max(1)))
        self.tree = build_tree(low, high, 4, 2)
        self.a = triangles[:, 0]
        self.e1, self.e2 = triangles[:, 1] - self.a, triangles[:, 2] - self.a

    def closest(self, origin: Array, direction: Array) -> Array:
        """Distances (n,), inf on a miss."""
        o, d = origin.T, direction.T
        inverse, best = 1 / d, np.full(len(o), np.inf, f4)
        stack = np.zeros((len(o), 64), np.int32)
        depth = np.ones(len(o), np.intp)
        while (ray := np.flatnonzero(depth)).size:
            depth[ray] -= 1
            code = stack[ray, depth[ray]]
            at_leaf = code < 0
            for column in range(4):
                prim = self.tree.prim[-1 - code[at_leaf], column]
                self._test(o, d, best, ray[at_leaf], prim)
            inner, code = ray[~at_leaf], code[~at_leaf]
            for side in range(2):
                t0 = (self.tree.low[code, side] - o[inner]) * inverse[inner]
                t1 = (self.tree.high[code, side] - o[inner]) * inverse[inner]
                near, far = np.minimum(t0, t1).max(1), np.maximum(t0, t1).min(1)
                empty = self.tree.low[code, side, 0] > self.tree.high[code, side, 0]
                met = (np.maximum(near, 0) <= np.minimum(far, best[inner])) & ~empty
                stack[inner[met], depth[inner[met]]] = self.tree.child[code[met], side]
                depth[inner[met]] += 1
        return best

    def _test(self, o: Array, d: Array, best: Array, ray: NDArray[np.intp], prim: NDArray[np.intp]) -> None:
        ray, prim = ray[prim >= 0], prim[prim >= 0]
        e1, e2, s = self.e1[prim], self.e2[prim], o[ray] - self.a[prim]
        p, q = np.cross(d[ray], e2), np.cross(s, e1)
        scale = 1 / (e1 * p).sum(1)
        u, v, t = (s * p).sum(1) * scale, (d[ray] * q).sum(1) * scale, (e2 * q).sum(1) * scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        best[ray[hit]] = np.minimum(best[ray[hit]], t[hit])


def lockstep_speed(triangles: Array, origin: Array, direction: Array) -> float:
    """Million rays per second of the plain lockstep BVH, on 16 384 rays."""
    bvh, n = Lockstep(triangles), 1 << 14
    start = time.thread_time()
    bvh.closest(origin[:, :n], direction[:, :n])
    return n / (time.thread_time() - start) / 1e6


def two_workers(accelerator: Accelerator, origin: Array, direction: Array) -> float:
    """Wall time of one worker process over that of two."""
    parts = np.array_split(np.arange(origin.shape[1]), 16)

    def run(part: NDArray[np.intp]) -> Array:
        some = slice(part[0], part[-1] + 1)
        return accelerator.closest(origin[:, some], direction[:, some], np.full(part.size, -1)).t

    def seconds(count: int) -> float:
        with WorkerPool(run, count, "processes") as pool:
            list(pool.run(parts))  # starts them
            start = time.perf_counter()
            list(pool.run(parts))
            return time.perf_counter() - start

    return seconds(1) / seconds(2)


def against_prototype(path: Path, triangles: Array, origin: Array, direction: Array) -> tuple[float, float]:
    """Million rays per second of NumPy without barycentrics, and of a prototype; best of 4, in turn."""
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location("prototype", path)
    assert spec is not None
    assert spec.loader is not None
    prototype: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(prototype)
    nodes = prototype.build(
        triangles, 32 if len(triangles) < 10_000 else 64 if len(triangles) < 1e5 else 128, 8
    )
    geometry = Geometry(triangles, weights=False)
    accelerator, none = make_accelerator(geometry, "numpy"), np.full(origin.shape[1], -1)
    best = [np.inf, np.inf]
    for _ in range(4):
        for side, run in enumerate(
            (
                lambda: accelerator.closest(origin, direction, none),
                lambda: prototype.closest(nodes, origin, direction),
            )
        ):
            start = time.thread_time()
            run()
            best[side] = min(best[side], time.thread_time() - start)
    return origin.shape[1] / best[0] / 1e6, origin.shape[1] / best[1] / 1e6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays", type=int, default=1 << 18)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--sizes", default="36,1280,20480,327680,1000000")
    parser.add_argument("--lockstep", action="store_true", help="slow")
    parser.add_argument("--prototype", type=Path)
    options = parser.parse_args()
    np.seterr(all="ignore")
    print(
        f"{'triangles':>9} {'rays':>10} {'numpy':>7} {'embreex':>8} {'ratio':>6} {'lockstep':>9} {'two':>5}"
    )
    for size in map(int, options.sizes.split(",")):
        triangles = mesh(size)
        geometry = Geometry(triangles)
        sides = [make_accelerator(geometry, name) for name in ("numpy", "embree")]
        for kind in ("coherent", "incoherent", "shadow"):
            origin, direction = rays(kind, size == 36, options.rays)
            times = [[trace(side, kind, origin, direction) for side in sides] for _ in range(options.repeats)]
            speed = [origin.shape[1] / median(column) / 1e6 for column in zip(*times, strict=True)]
            ratio = median(ours / theirs for ours, theirs in times)
            slow, two = "", ""
            if kind == "incoherent":
                two = f"{median(two_workers(sides[0], origin, direction) for _ in range(3)):.2f}"
            if kind == "incoherent" and options.lockstep:
                slow = f"{lockstep_speed(triangles, origin, direction):.2f}"
            row = f"{len(triangles):9} {kind:>10} {speed[0]:7.2f} {speed[1]:8.2f} {ratio:6.2f}"
            if options.prototype and kind != "shadow" and 36 < size < 1_000_000:
                ours, theirs = against_prototype(options.prototype, triangles, origin, direction)
                two += f"   without barycentrics {ours:.2f}, prototype {theirs:.2f}, {ours / theirs:.2f}x"
            print(f"{row} {slow:>9} {two:>5}", flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"million rays per second and core; ratio: time of numpy over embreex; peak memory {peak:.2f} GB")


if __name__ == "__main__":
    main()

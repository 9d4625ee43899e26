"""A render on one machine and on ten thousand: what is measured here, and what is simulated from that.

Measured: one process, and one and two worker processes of Dask, on the Cornell box; the time of a path, of
adding samples to the film, of merging two films, of loading the scene, and of Dask's own work for a job.

Simulated: a picture of 3840 × 2160 pixels at 4096 samples, for 10 to 10 000 workers, in two modes.

- samples: `render(executor=client)`. One process hands out the jobs and adds all samples to one film.
- films: each machine renders `samples=range(...)` on a film of its own; the films are merged in a tree.

Assumed, and printed: the network, the cores of a machine, stragglers and losses.

python benchmarks/scale.py [--repeat 3] [--spp 256] [--size 512]
"""

from __future__ import annotations

import argparse
import heapq
import math
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from distributed import Client, LocalCluster

import wavefront as wf
from wavefront.drive.jobs import WaveResult
from wavefront.film.film import Film
from wavefront.workers.pool import WorkerPool
from wavefront.workers.remote import pack

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from cornell_box import cornell_box

PIXELS, SPP = 3840 * 2160, 4096
WORKERS = (10, 100, 1_000, 10_000)
WAVE = 1 << 16  # paths that are traced, or added to a film, to measure what one costs
JOB = 1 << 19  # paths of a job: four waves
NETWORK = 1.25e9  # bytes per second, assumed: 10 Gbit/s
CORES = 16  # workers of a machine, assumed
SLOW, FACTOR = 0.01, 5.0  # part of the jobs that take so many times as long, assumed
LOSSES = 1 / 3.6e6  # of a worker per second, assumed: one in 1000 hours


@dataclass
class Costs:
    """CPU seconds, but for bytes."""

    path: float  # of a worker
    add: float  # of the process that adds, per sample
    merge: float  # of two films, per pixel
    film: float  # bytes per pixel
    job: float  # of the process that hands out jobs, for each
    send: float  # of the same, per path of its result
    scene: float  # until a worker has the scene


def seconds(function: Callable[[], Any], repeat: int) -> float:
    """Median CPU time of a call, which other programs disturb less, after one that is not counted."""
    function()
    times = []
    for _ in range(repeat):
        begin = time.process_time()
        function()
        times.append(time.process_time() - begin)
    return median(times)


def measured_costs(client: Client, repeat: int) -> Costs:
    """Measure what the simulation needs."""
    scene = cornell_box(256)
    options: dict[str, Any] = {"workers": 1, "executor": "threads", "wave_size": WAVE, "progress": False}
    options.update(branches=1, reuse=False)  # a path is one path
    options["branches"] = 1
    path = seconds(lambda: wf.render(scene, 16, **options), repeat) / (16 * 256**2)
    pixels, radiance = np.arange(WAVE, dtype=np.uint32), np.ones((3, 1, WAVE), np.float32)
    film, other = Film(256, 256), Film(256, 256)
    add = seconds(lambda: film.add(pixels, radiance), 20 * repeat) / WAVE
    other.add(pixels, radiance)
    merge = seconds(lambda: film.merge(other), 5 * repeat) / WAVE
    size = sum(array.nbytes for array in film.arrays().values()) / WAVE
    with tempfile.TemporaryDirectory() as folder:
        session = wf.Session(scene, 1, **options)
        data = pack(session._plan.tracer, folder)
        scene_seconds = seconds(lambda: pickle.loads(data), repeat)
    job = job_cost(client, 1)
    send = max(0.0, job_cost(client, JOB) - job) / JOB
    return Costs(path, add, merge, size, job, send, scene_seconds)


def job_cost(client: Client, paths: int) -> float:
    """CPU seconds of this process for a job with a result of so many paths. The scheduler is in it, too."""
    result = WaveResult(np.ones((3, 1, paths), np.float32), np.zeros(0, np.intp), 0, 0.0)
    pixels = np.arange(WAVE, dtype=np.uint32)
    with WorkerPool(partial(constant, [result]), 2, client) as pool:
        list(pool.run([pixels] * 4))
        begin, jobs = time.process_time(), 100
        assert len(list(pool.run([pixels] * jobs))) == jobs
        return (time.process_time() - begin) / jobs


def constant(result: Any, job: Any) -> Any:
    """Return a result without work."""
    return result


def measured_speedup(options: argparse.Namespace) -> None:
    """Print how fast one process and one and two workers of Dask are, in turn."""
    scene = cornell_box(options.size)

    def render(**how: Any) -> float:
        begin = time.perf_counter()
        wf.render(scene, options.spp, branches=1, progress=False, **how)
        return time.perf_counter() - begin

    times: dict[str, list[float]] = {"one process": [], "Dask, 1 worker": [], "Dask, 2 workers": []}
    for _ in range(options.repeat):
        times["one process"].append(render(workers=1, executor="threads"))
        for count, name in enumerate(list(times)[1:], 1):
            with cluster(count) as local, Client(local, direct_to_workers=True) as client:
                wf.render(scene, 1, executor=client, progress=False)  # imports
                times[name].append(render(executor=client))
    alone = median(times["one process"])
    print(f"\nMeasured: Cornell box, {options.size}x{options.size}, {options.spp} samples per pixel")
    for name, each in times.items():
        print(f"  {name:16} {median(each):7.2f} s  {alone / median(each):5.2f} times as fast")


def cluster(count: int) -> LocalCluster:
    """A cluster of processes of one thread."""
    return LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=":0")


def simulated_samples(costs: Costs, workers: int, paths: int) -> float:
    """Seconds of a render whose samples all go to one process, which takes them one job after the other."""
    rng = np.random.default_rng(workers)
    times = job_seconds(rng, math.ceil(PIXELS * SPP / paths), paths * costs.path)
    one = result_seconds(costs, paths)
    busy = [costs.scene] * workers  # when each worker is done
    now = 0.0
    for needed in times.tolist():
        now = max(now, heapq.heappop(busy)) + one
        heapq.heappush(busy, now + needed)
    return max(busy)


def result_seconds(costs: Costs, paths: int) -> float:
    """Seconds of the process that hands out jobs of so many paths, for each."""
    return costs.job + paths * (costs.send + costs.add + 12 / NETWORK)


def simulated_films(costs: Costs, workers: int, spp: int) -> tuple[float, float]:
    """Seconds of a render by machines that take `spp` samples of all pixels at a time; and of its merge."""
    machines = max(1, workers // CORES)
    rng = np.random.default_rng(machines)
    cores = min(workers, CORES)
    needed = job_seconds(rng, math.ceil(SPP / spp), PIXELS * spp * (costs.path / cores + costs.add / cores))
    free = [costs.scene] * machines
    for each in needed.tolist():
        heapq.heappush(free, heapq.heappop(free) + each)
    rounds = math.ceil(math.log2(min(machines, math.ceil(SPP / spp)) or 1))
    merge = rounds * PIXELS * (costs.film / NETWORK + costs.merge)
    return max(free) + merge, merge


def job_seconds(rng: np.random.Generator, jobs: int, usual: float) -> np.ndarray:
    """Times of jobs: most vary by a tenth, some are slow, and some are done again since a worker was lost."""
    times = usual * rng.lognormal(0, 0.1, jobs)
    times[rng.random(jobs) < SLOW] *= FACTOR
    lost = rng.random(jobs) < 1 - np.exp(-LOSSES * times)
    return np.where(lost, times * (1 + rng.random(jobs)), times)


def print_simulation(costs: Costs) -> None:
    """Print both modes for all numbers of workers."""
    ideal = PIXELS * SPP * costs.path
    print(f"\nSimulated: 3840x2160, {SPP} samples per pixel: {ideal / 3600:,.0f} core hours")
    print("  workers   samples to one film   films, pieces of      a tree's merge   of an ideal")
    for workers in WORKERS:
        best = min((simulated_films(costs, workers, spp), spp) for spp in (1, 2, 4, 8, 16, 32, 64, 128))
        (films, merge), spp = best
        samples = simulated_samples(costs, workers, JOB)
        print(
            f"  {workers:7,} {samples / 3600:12.2f} h {ideal / workers / samples:5.0%}"
            f" {films / 3600:12.3f} h {spp:4} spp {merge:16.1f} s {ideal / workers / films:10.0%}"
        )
    print("\n  most workers that one process keeps busy, by paths of a job:", end="")
    for paths in (1 << 13, 1 << 16, 1 << 19, 1 << 21):
        print(f"  {paths:,}: {paths * costs.path / result_seconds(costs, paths):.1f}", end="")
    print()


def main() -> None:
    """Measure, then simulate."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--size", type=int, default=512)
    options = parser.parse_args()
    with cluster(2) as local, Client(local, direct_to_workers=True) as client:
        costs = measured_costs(client, options.repeat)
    print(f"Measured: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"  a path {costs.path * 1e6:.3f} µs, adding a sample {costs.add * 1e9:.1f} ns")
    print(f"  merging two films {costs.merge * 1e9:.0f} ns and {costs.film:.0f} bytes per pixel")
    print(f"  a job costs Dask {costs.job * 1e3:.2f} ms, and {costs.send * 1e9:.1f} ns per path")
    print(f"  loading the scene {costs.scene * 1e3:.2f} ms")
    print(f"Assumed: {NETWORK * 8e-9:.0f} Gbit/s, {CORES} cores per machine, {SLOW:.0%} of jobs take")
    print(f"  {FACTOR:.0f} times as long, a worker is lost every {1 / LOSSES / 3600:,.0f} hours")
    print_simulation(costs)
    measured_speedup(options)


if __name__ == "__main__":
    main()

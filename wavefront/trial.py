"""The trial before a render: what more branches, or a guide, would bring.

Some pixels are rendered twice under seeds of their own, with two branches that are kept apart. The variance
of a picture with N branches is shared + separate / N: the covariance of the two branches is what they share,
and the rest lies between them. With the rays of both parts of the paths, counted and not timed, this gives
variance times rays for every N, which is least near the square root of (separate / shared) · (rays before /
rays of a branch). So decisions depend on the scene, the camera and the seed alone.

Sources: J. Arvo and D. Kirk, Particle Transport and Image Synthesis, 1990 (splitting); E. Veach, thesis 1997,
§10.4.2 (efficiency).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .accel import Accelerator, Intersections
from .camera import Camera
from .compile.scene import CompiledScene
from .guiding import GuideTable
from .integrators import accumulate, intersect_and_compact, prepare_shading
from .pilot import spread_pixels
from .record import record
from .sampling.sampler import Sampler
from .stages.bounce import branch
from .stages.compact import roulette, select
from .stages.generate import generate
from .stages.guidance import guide
from .stages.shade import direct
from .state import Paths
from .vec import Bools, Floats, Ints

PIXELS = 1024
SAMPLES = 16  # of each pixel in each of two blocks; stratified, as those of a picture are
OUTLIERS = 0.01  # part of the pixels, the noisiest, that do not count
FLOOR = 0.01  # of the squared mean of all pixels, added to that of each
MOST_WAYS = 4  # more gain nothing
GAIN = 0.95  # variance times rays must fall below this part, so that noise decides nothing
GUIDED_RAY = 1.35  # cost of a ray of a guided path, relative to that of a plain one


@record
class Trial:
    """What a trial has found."""

    shared: float  # relative variance of a pixel that the branches of a path share
    separate: float  # and that between branches
    before: int  # rays up to the first surface, and of light samples there
    after: float  # rays of one branch of all paths
    ray_cost: float

    def cost(self, ways: int) -> float:
        """Return variance times cost with so many branches."""
        variance = self.shared + self.separate / ways
        return variance * (self.before + self.after * ways) * self.ray_cost

    def best_ways(self) -> int:
        """Return the number of branches at which variance times rays is least; 1 if the gain is small."""
        best = min(range(1, MOST_WAYS + 1), key=self.cost)
        return best if self.cost(best) < GAIN * self.cost(1) else 1


def is_worth_it(guided: Trial, plain: Trial, ways: int | None) -> bool:
    """Return whether a guide pays, with so many branches; None: with the best number for each."""
    with_guide, without = (trial.cost(ways or trial.best_ways()) for trial in (guided, plain))
    return with_guide < GAIN * without


def run_trial(
    scene: CompiledScene,
    camera: Camera,
    samplers: tuple[Sampler, Sampler],
    max_bounces: int,
    table: GuideTable | None,
) -> Trial:
    """Render some pixels twice, with samplers whose numbers the picture does not use.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    """
    pixel = spread_pixels(camera, np.arange(min(PIXELS, camera.size[0] * camera.size[1]), dtype=np.uint64))
    sample = np.repeat(np.arange(SAMPLES, dtype=np.uint32), pixel.size)
    counter = RayCounter(scene.accelerator)
    counted = replace(scene, accelerator=counter)
    blocks, before = [], 0
    for sampler in samplers:
        paths = generate(counted, camera, sampler, np.tile(pixel, SAMPLES), sample)
        start = counter.rays
        L, first = _two_ways(counted, paths, sampler, max_bounces, table, lambda: counter.rays)
        before += first - start
        L = np.where(np.isfinite(L), L, 0)
        blocks.append(L.reshape(3, 2, SAMPLES, -1).mean(2, dtype=np.float64))  # (3, branches, pixels)
    difference = blocks[0] - blocks[1]
    mean = (blocks[0] + blocks[1]).mean(1) / 2
    scale = np.square(mean) + (FLOOR * mean.mean() ** 2 or 1.0)
    alone = (np.square(difference).mean(1) / scale).mean(0) / 2  # of each pixel, with one branch
    shared = (difference[:, 0] * difference[:, 1] / scale).mean(0) / 2
    kept = alone.argsort(kind="stable")[: alone.size - int(OUTLIERS * alone.size)]
    total, common = float(alone[kept].mean()), max(float(shared[kept].mean()), 0.0)
    after = (counter.rays - before) / 2
    return Trial(common, max(total - common, 0.0), before, after, 1.0 if table is None else GUIDED_RAY)


def _two_ways(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    max_bounces: int,
    table: GuideTable | None,
    rays: Callable[[], int],
) -> tuple[Floats, int]:
    """Return the radiance by the first and the second branches, (3, 2 n), and the rays before they part.

    Each branch counts in full, as if it were the only one.
    """
    n = len(paths)
    L = np.zeros((3, 2 * n), np.float32)
    before = 0
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=True)
        if bounce == max_bounces or not len(paths):
            break
        shade = guide(prepare_shading(scene, paths, hits), table)
        accumulate(L, paths, direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = branch(paths, shade, sampler, bounce, ways=2 if bounce == 0 else 1)
        if bounce == 0:
            before = rays()
            L[:, n:] = L[:, :n]
            paths.slot = paths.slot + np.repeat([0, n], len(paths) // 2)
            paths.throughput *= 2
        paths = select(paths, roulette(paths, sampler, bounce))
    return L, before or rays()


class RayCounter:
    """An accelerator that counts the rays which it passes on."""

    def __init__(self, accelerator: Accelerator) -> None:
        self.name = accelerator.name
        self.rays = 0
        self._accelerator = accelerator

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hits of rays (3, n)."""
        self.rays += origin.shape[1]
        return self._accelerator.closest(origin, direction, exclude_prim)

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return True for each of the rays (3, n) that something blocks."""
        self.rays += origin.shape[1]
        return self._accelerator.occluded(origin, direction, distance, exclude_prim)

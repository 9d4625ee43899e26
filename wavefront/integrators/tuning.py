"""Tuning runs: an integrator on a few tiles of a picture, as choices are made by (drive/choice.py).

Each run has the same pixels and the same random numbers, which are not those of the picture, so runs with
other settings differ by what the settings do. Errors come from blocks of samples, and costs from rays that
are counted, not timed: they depend on the scene, the camera and the settings alone.

One run tells what any number of branches costs. From its first surface on, each path goes on twice, with
other random numbers. What both twins have in common is the noise of what comes before, which branches share;
n branches have the n-th part of the rest. The same pixels and fireflies count for each number.

Sources: E. Veach, thesis 1997, §10.4.2 (efficiency); M. Pharr and G. Humphreys, "Physically Based Rendering",
1st ed. 2004, §15.1 (splitting).
"""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from ..accel.counter import RayCounter
from ..aovs.path_recorder import MetSurfaces, PathRecorder
from ..arrays.soa import soa
from ..arrays.state import Paths, Words
from ..arrays.vec import ALL, Doubles, Floats, Ints, f4
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..sampling.sampler import Sampler, SamplerMaker
from ..stages.generate import generate
from ..stages.interaction import material_rows
from .ladder import li_full
from .registry import integrator_for
from .steps import intersect_and_compact, scatter
from .training import spread

BRANCHES = (1, 2, 4)  # numbers that are tried; more gain little
BLOCKS, SAMPLES = 4, 4  # of each pixel: blocks of samples, which are stratified as those of a picture are
SAMPLES_OF_SENSOR = 16  # in a block: sensors get many samples, which leave less noise of direct light
MOST_TILES = 64  # more tell little more, and take time in large pictures
TILES_AT_ONCE = 32  # that are traced together, at most
LEAST_JOBS = 2  # so that two workers have something to do, if there are as many
BOUNCES = 6  # at most: few paths get further, and a wave of few costs as much as one of many
GROUPS = 12  # of tiles, each of which is left out in turn to tell the error of a cost
FLOOR = 0.01  # of the squared mean of all pixels, added to that of each
# Costs relative to a ray that finds the nearest surface, which is shaded then. Few bits, for exact sums.
SHADOW_RAY = 0.5  # of one that finds out only whether something is in its way
SHARED_PATH = 1.5  # of evaluating BSDFs for what the other pixels of a tile have found, besides the rays
GUIDED_RAY = 1.375  # of a ray of a guided path


def samples_per_block(camera: Camera) -> int:
    """Return how many samples a block of each pixel has."""
    return SAMPLES if camera.sensor is None else SAMPLES_OF_SENSOR


@soa
class TrialPart:
    """What the paths of some pixels have found."""

    radiance: Doubles  # (twins, 3, BLOCKS, pixels)
    first: float  # rays up to the first surfaces, weighted by what they cost
    onward: float  # those from there on, of one twin
    met: Ints  # (materials,) how many second points of paths are of each material


@soa
class TrialJob:
    """Some tiles of a run, which are traced together."""

    camera: Camera  # in the unit of the compiled scene
    seed: int
    pixels: Words  # (k,) whole tiles in turn
    max_bounces: int
    reuse: bool
    guided: bool

    def trace(self, scene: CompiledScene, make_sampler: SamplerMaker, table: GuideTable | None) -> TrialPart:
        """Trace the tiles; `make_sampler` is given a seed and the width of a picture."""
        counter, points = RayCounter(scene.accelerator), SecondPoints(scene.materials.group_of.size)
        scene, sampler = (
            replace(scene, accelerator=counter),
            make_sampler(self.seed, self.camera.resolution[0]),
        )
        block = samples_per_block(self.camera)
        count = BLOCKS * block
        sample = np.repeat(np.arange(count, dtype=np.uint32), self.pixels.size)
        paths = generate(scene, self.camera, sampler, np.tile(self.pixels, count), sample)
        paths.recorder = points
        tiles, table = self.camera.tiles if self.reuse else None, table if self.guided else None
        twins = 1 if self.reuse or self.camera.sensor is not None else 2
        integrator = (
            partial(li_twins, table=table) if twins == 2 else integrator_for(li_full, 1, tiles, table)
        )
        L = integrator(scene, paths, sampler, self.max_bounces + self.camera.scatterings)
        finite = np.where(np.isfinite(L), L, 0).reshape(3, twins, BLOCKS, block, self.pixels.size)
        weight = GUIDED_RAY if self.guided else 1
        first = weight * sample.size if twins == 2 else 0.0
        rays = (
            weight * (counter.nearest + SHADOW_RAY * counter.shadow) + SHARED_PATH * self.reuse * sample.size
        )
        radiance = np.moveaxis(finite.mean(3, dtype=np.float64), 1, 0)
        return TrialPart(radiance, first, (rays - first) / twins, points.met)

    def __str__(self) -> str:
        """Name the job in an error message."""
        return f"the trial of {self.pixels.size} pixels from {self.pixels[0]} on"


JobsRunner: TypeAlias = Callable[[list[TrialJob]], Iterable[TrialPart]]  # in the order of the jobs


def li_twins(
    scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int, table: GuideTable | None = None
) -> Floats:
    """Estimate the same as `li_full` twice, (3, 2 n), with the same first surfaces.

    The second ones, which come last, have the random numbers of the samples after all others from there on.
    """
    n, samples = len(paths), paths.sample.max(initial=0) + np.uint32(1)
    L = np.zeros((3, 2 * n), f4)
    for bounce in range(max_bounces + 1):
        paths, hits = intersect_and_compact(scene, paths, sampler, bounce, L, mis=True)
        if bounce == 0:
            L[:, n:] = L[:, :n]
        if bounce == max_bounces or not len(paths):
            break
        each = [paths]
        if bounce == 0:
            other, through = paths.sample + samples, paths.throughput.copy()
            each.append(replace(paths, slot=paths.slot + n, sample=other, throughput=through))
        paths = Paths.concatenate(
            [scatter(scene, L, some, hits, sampler, bounce, table=table) for some in each]
        )
    return L


class SecondPoints(PathRecorder):
    """Counts the second points of paths by their materials, in `met`."""

    def __init__(self, materials: int) -> None:
        self.met = np.zeros(materials, np.intp)

    def record_hits(self, scene: CompiledScene, met: MetSurfaces) -> None:
        """Count those of the first bounce that go on."""
        if met.bounce == 1:
            self.met += np.bincount(material_rows(scene, met.kept_hits, ALL), minlength=self.met.size)


@soa
class Run:
    """What a setting has brought."""

    variance: Doubles  # of blocks of samples of pixels, relative to the squared mean around each
    common: Doubles  # the part of it that branches share; all where there are no twins
    first: float  # as of `TrialPart`
    onward: float
    met: Ints
    paths: int  # from first surfaces on

    def mean_variance(self, outliers: float, branches: int = 1) -> float:
        """Return the mean variance of the pixels without this part of them, the noisiest."""
        kept = np.argsort(self.variance, kind="stable")[
            : self.variance.size - int(outliers * self.variance.size)
        ]
        of_one, common = (math.fsum(part[kept]) / kept.size for part in (self.variance, self.common))
        common = min(max(common, 0.0), of_one)
        return common + (of_one - common) / branches

    def cost(self, than: Run, outliers: float, branches: int = 1, than_branches: int = 1) -> float:
        """Return variance times rays over that of another run; 1 where that has no variance."""
        cost, least = (
            run.mean_variance(outliers, ways) * (run.first + ways * run.onward)
            for run, ways in ((self, branches), (than, than_branches))
        )
        return cost / least if least > 0 else 1.0

    def cost_error(self, than: Run, outliers: float, branches: int = 1, than_branches: int = 1) -> float:
        """Return the standard error of a cost, by the jackknife (B. Efron, 1982) over groups of tiles."""
        group = np.arange(self.variance.size) * GROUPS // self.variance.size
        costs = []
        for left_out in range(GROUPS):
            kept = group != left_out
            one, other = (
                replace(run, variance=run.variance[kept], common=run.common[kept]) for run in (self, than)
            )
            costs.append(one.cost(other, outliers, branches, than_branches))
        return math.sqrt((GROUPS - 1) * statistics.pvariance(costs))


class Trial:
    """The tiles of a tuning run, and the jobs that render them.

    Parameters
    ----------
    camera
        Of the whole picture, in the unit of the compiled scene.
    seed
        Of random numbers that the picture does not use.
    max_bounces
        Of the picture.
    run
        Does the jobs.
    tiles
        How many of sixteen pixels, as far as the picture has them; None for as many as its size asks for.
    workers
        How many have something to do, up to two; more where there are many tiles.

    Attributes
    ----------
    of_picture
        Whether it is of a picture, not of sensors.
    """

    def __init__(
        self,
        camera: Camera,
        seed: int,
        max_bounces: int,
        run: JobsRunner,
        tiles: int | None = None,
        workers: int = 1,
    ) -> None:
        self._camera, self._seed, self._bounces, self._do = camera, seed, min(max_bounces, BOUNCES), run
        self._jobs, self.of_picture = min(workers, LEAST_JOBS), camera.sensor is None
        places = camera.tiles.count
        number = np.arange(min(tiles or min(camera.tiles.tried, MOST_TILES), places), dtype=np.uint64)
        of_tiles = camera.tiles.pixels(spread(number, places).astype(np.intp))
        self._tiles = [pixels for pixels in of_tiles if pixels.size]
        self._scale: Doubles | None = None
        self._runs: dict[tuple[bool, bool], Run] = {}

    def run(self, reuse: bool, guided: bool) -> Run:
        """Return the run of a setting; the first one gives the brightness that noise is relative to."""
        if (reuse, guided) not in self._runs:
            self._runs[reuse, guided] = self._render(reuse, guided)
        return self._runs[reuse, guided]

    def _render(self, reuse: bool, guided: bool) -> Run:
        """Render the tiles with a setting."""
        parts = min(max(-(-len(self._tiles) // TILES_AT_ONCE), self._jobs), len(self._tiles))
        cuts = np.linspace(0, len(self._tiles), parts + 1).astype(int)
        jobs = [
            TrialJob(self._camera, self._seed, pixels, self._bounces, reuse, guided)
            for pixels in (np.concatenate(self._tiles[i:j]) for i, j in itertools.pairwise(cuts))
        ]
        found = list(self._do(jobs))
        radiance = np.concatenate([part.radiance for part in found], -1)
        mean = radiance.mean(2, keepdims=True)
        if self._scale is None:
            sizes = np.array([pixels.size for pixels in self._tiles])
            sums = np.add.reduceat(mean.mean(0), np.cumsum(sizes) - sizes, axis=-1)
            self._scale = np.square(sums / sizes).repeat(sizes, -1) + (FLOOR * mean.mean() ** 2 or 1.0)
        deviation = (radiance - mean) * math.sqrt(BLOCKS / (BLOCKS - 1))
        variance = (np.square(deviation) / self._scale).mean((0, 1, 2))
        common = (deviation[0] * deviation[-1] / self._scale).mean((0, 1))
        first, onward = sum(part.first for part in found), sum(part.onward for part in found)
        paths = len(radiance) * variance.size * BLOCKS * samples_per_block(self._camera)
        return Run(variance, common, first, onward, np.sum([part.met for part in found], 0), paths)

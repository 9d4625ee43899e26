"""A tuning run: plain paths in a few tiles of a picture, by which choices are made (drive/choice.py).

Its random numbers are not those of the picture. Errors come from blocks of samples, and costs from rays that
are counted, not timed: they depend on the scene, the camera and the settings alone.

One run tells the cost of any number of branches. From its first surface on, each path goes on twice, with
other random numbers. The covariance of both twins is the variance of the path before, which branches
share; n branches have the n-th part of the rest. It also tells the variance that sharing paths
(stages/reuse.py) would not reduce: that of the light before paths are shaded at their second points.

Sources: E. Veach, thesis 1997, §10.4.2 (efficiency); M. Pharr and G. Humphreys, "Physically Based Rendering",
1st ed. 2004, §15.1 (splitting).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..accel.counter import RayCounter
from ..arrays.path_recorder import PathRecorder
from ..arrays.soa import soa
from ..arrays.state import Contribution, Paths, Words
from ..arrays.vec import ALL, Doubles, Floats, Ints, f4
from ..camera import Camera
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..features.view import seen_with
from ..guiding import GuideTable
from ..sampling.sampler import Sampler
from ..stages.generate import generate
from ..stages.interaction import material_rows
from ..stages.shade import Shading
from .steps import intersect_and_compact, scatter
from .training import spread

BRANCHES = 4  # of paths that branch; two gain less, more gain little
BLOCKS, SAMPLES = 4, 4  # of each pixel: blocks of samples, which are stratified as those of a picture are
SAMPLES_OF_SENSOR = 16  # in a block: sensors get many samples, which leave less noise of direct light
MOST_TILES = 64  # more tell little more, and take time in large pictures
BOUNCES = 6  # at most: few paths get further, and a wave of few costs as much as one of many
FLOOR = 0.01  # of the squared mean of all pixels, added to that of each
OUTLIERS = 0.02  # part of the pixels, the noisiest, that do not count
NARROW = 1.0  # 1/sr: density of a direction that a narrow lobe has drawn; matte surfaces have 1/π at most
# Costs relative to a ray that finds the nearest surface, which is shaded then. Few bits, for exact sums.
SHADOW_RAY = 0.5  # of one that finds out only whether something is in its way
GUIDED_RAY = 1.375  # of a ray of a guided path


@soa
class Run:
    """The results of a tuning run."""

    scale: Doubles  # (3, pixels) squared mean around each pixel, which variances are relative to
    variance: Doubles  # (pixels,) of blocks of samples
    common: Doubles  # (pixels,) the part of it that branches share
    own: Doubles  # (pixels,) variance of the light that pixels cannot share
    first: float  # rays up to the first surfaces, weighted by their cost
    onward: float  # those from there on, of one twin
    met: Ints  # (materials,) how many second points of paths are of each material
    narrow: int  # how many paths leave these in narrow lobes
    paths: int  # from first surfaces on

    def kept(self) -> Ints:
        """Return the pixels (k,) that count: all but the noisiest."""
        return np.argsort(self.variance, kind="stable")[: self.variance.size - self.outliers]

    @property
    def outliers(self) -> int:
        """How many pixels do not count."""
        return int(OUTLIERS * self.variance.size)

    def mean_variance(self, branches: int = 1) -> float:
        """Return the mean variance of the pixels that count."""
        of_one, common = (_mean(variances[self.kept()]) for variances in (self.variance, self.common))
        common = min(max(common, 0.0), of_one)
        return common + (of_one - common) / branches

    def cost(self, branches: int, than: Run, than_branches: int = 1) -> float:
        """Return the cost, variance times rays, over that of another run; 1 if the other has no variance."""
        cost, least = (
            run.mean_variance(ways) * (run.first + ways * run.onward)
            for run, ways in ((self, branches), (than, than_branches))
        )
        return cost / least if least > 0 else 1.0

    def share_of_outliers(self) -> float:
        """Return the part of the variance of the picture that is in the pixels left out as outliers."""
        every = math.fsum(self.variance)
        return 1 - math.fsum(self.variance[self.kept()]) / every if every > 0 else 0.0

    def share_of_own(self) -> float:
        """Return the part of the variance by light that pixels cannot share; 1 where there is no variance."""
        every = _mean(self.variance[self.kept()])
        return _mean(self.own[self.kept()]) / every if every > 0 else 1.0


def _mean(values: Doubles) -> float:
    return math.fsum(values) / values.size


def tuning_run(
    scene: CompiledScene,
    camera: Camera,
    sampler: Sampler,
    max_bounces: int,
    *,
    table: GuideTable | None = None,
    tiles: int | None = None,
    like: Run | None = None,
) -> Run:
    """Trace plain paths, or those that a table guides, in some tiles of a picture.

    Parameters
    ----------
    camera
        Of the whole picture, in the unit of the compiled scene.
    sampler
        Its numbers must not be those of the picture.
    max_bounces
        Of the picture.
    tiles
        How many of sixteen pixels, as far as the picture has them; None for as many as its size asks for.
    like
        A run of the same pixels, whose brightness noise is relative to; None for that of this one.
    """
    pixels = _tiles(camera, tiles)
    block = SAMPLES if camera.sensor is None else SAMPLES_OF_SENSOR
    pixel, counter = np.concatenate(pixels), RayCounter(scene.accelerator)
    n = BLOCKS * block * pixel.size
    sample = np.repeat(np.arange(BLOCKS * block, dtype=np.uint32), pixel.size)
    scene = seen_with(replace(scene, accelerator=counter), table)
    paths = generate(scene, camera, sampler, np.tile(pixel, BLOCKS * block), sample)
    second = paths.recorder = SecondPoints(scene.materials.group_of.size)
    bounces = min(max_bounces, BOUNCES) + camera.scatterings
    L = li_twins(scene, paths, sampler, bounces)
    every, own = (_blocks(light, block, pixel.size) for light in (L, L if second.own is None else second.own))
    scale = _scale(every.mean((0, 2)), pixels) if like is None else like.scale
    deviation, of_own = (_deviation(blocks) for blocks in (every, own))
    weight = 1 if table is None else GUIDED_RAY
    first = weight * float(n) if camera.sensor is None else 0.0  # paths from sensors begin at one
    return Run(
        scale,
        (np.square(deviation) / scale[:, None]).mean((0, 1, 2)),
        (deviation[0] * deviation[1] / scale[:, None]).mean((0, 1)),
        (np.square(of_own) / scale[:, None]).mean((0, 1, 2)),
        first,
        (weight * (counter.nearest + SHADOW_RAY * counter.shadow) - first) / 2,
        second.met,
        second.narrow,
        2 * n,
    )


def _tiles(camera: Camera, count: int | None) -> list[Words]:
    """Return the pixels of each of some tiles that are spread over a picture."""
    places = camera.tiles.count
    number = np.arange(min(count or min(camera.tiles.tried, MOST_TILES), places), dtype=np.uint64)
    tiles = camera.tiles.pixels(spread(number, places).astype(np.intp))
    return [pixels for pixels in tiles if pixels.size]


def _blocks(L: Floats, block: int, pixels: int) -> Doubles:
    """Return the means of blocks of samples of both twins, (2, 3, BLOCKS, pixels); not finite ones are 0."""
    finite = np.where(np.isfinite(L), L, 0).reshape(3, 2, BLOCKS, block, pixels)
    return np.moveaxis(finite.mean(3, dtype=np.float64), 1, 0)


def _deviation(blocks: Doubles) -> Doubles:
    """Return the differences of blocks from the mean of their pixels; the mean square is the variance."""
    return (blocks - blocks.mean(2, keepdims=True)) * math.sqrt(BLOCKS / (BLOCKS - 1))


def _scale(mean: Doubles, tiles: list[Words]) -> Doubles:
    """Return the squared mean (3, pixels) around each pixel of some tiles, and a part of that of all."""
    sizes = np.array([pixels.size for pixels in tiles])
    sums = np.add.reduceat(mean, np.cumsum(sizes) - sizes, axis=-1)
    return np.square(sums / sizes).repeat(sizes, -1) + (FLOOR * mean.mean() ** 2 or 1.0)


def li_twins(scene: CompiledScene, paths: Paths, sampler: Sampler, max_bounces: int) -> Floats:
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
        twins = [paths]
        if bounce == 0:
            other, through = paths.sample + samples, paths.throughput.copy()
            twins.append(replace(paths, slot=paths.slot + n, sample=other, throughput=through))
        paths = Paths.concatenate([scatter(scene, L, twin, hits, sampler, bounce) for twin in twins])
    return L


class SecondPoints(PathRecorder):
    """Records the materials and the light at the second points of paths.

    Parameters
    ----------
    materials
        How many the scene has.

    Attributes
    ----------
    met
        How many of the points are of each material.
    own
        The light that was found before they are shaded, (3, slots); None where no path has one.
    narrow
        How many paths have left them in directions of a density above `NARROW`.
    """

    def __init__(self, materials: int) -> None:
        self.met = np.zeros(materials, np.intp)
        self.own: Floats | None = None
        self.narrow = 0
        self._picture: Floats | None = None
        self._shaded = True  # whether second points are, or there are none yet

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Keep the picture, to which all light is added."""
        self._picture = picture

    def record_hits(self, leg: Leg) -> None:
        """Count the materials of second points, and keep the light so far."""
        if leg.bounce == 1 and self._picture is not None:
            self.met += np.bincount(material_rows(leg.scene, leg.kept_hits, ALL), minlength=self.met.size)
            self.own, self._shaded = self._picture.copy(), False

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Count narrow lobes at second points."""
        if not self._shaded:
            self.narrow, self._shaded = int(np.count_nonzero(left.specular | (left.pdf > NARROW))), True

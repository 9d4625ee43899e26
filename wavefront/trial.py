"""The trial before a render: what more branches, paths that pixels share, or a guide would bring.

Pixels of some tiles (pixel_tiles.py) are rendered twice under seeds of their own, with two branches that are
kept apart. The variance of a picture with N branches is shared + separate / N: the covariance of the two
branches is what they share, and the rest lies between them. With the rays of both parts of the paths,
counted and not timed, this gives variance times rays for every N, which is least near the square root of
(separate / shared) · (rays before / rays of a branch). What the first branches find is shared among the
pixels of each tile, too, and compared with the same paths alone: in each pixel, and in means of four
neighbors of a tile, whose noise is the same in part. So decisions depend on the scene, the camera and the
settings alone.

Sources: J. Arvo and D. Kirk, Particle Transport and Image Synthesis, 1990 (splitting); E. Veach, thesis 1997,
§10.4.2 (efficiency).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .accel import Accelerator, Intersections
from .camera import Camera
from .compile.scene import CompiledScene
from .guiding import GuideTable
from .integrators import accumulate, follow, intersect_and_compact, prepare_shading
from .pilot import spread
from .pixel_tiles import MEMBERS, SIDE, STRIDE, WaveTiles
from .record import record
from .sampling.sampler import Sampler
from .stages.bounce import bounce_sample
from .stages.compact import roulette, select
from .stages.generate import generate
from .stages.guidance import guide
from .stages.reuse import add_shared, as_shared, shared_points
from .stages.shade import direct
from .state import Paths, Words
from .vec import Bools, Doubles, Floats, Ints

SAMPLES = 8  # of each pixel in each of two blocks; stratified, as those of a picture are
PIXELS_PER_TILE = 2048  # of the picture: an eighth of a path for each of its pixels
MOST_TILES = 256  # 65536 paths
BOUNCES = 6  # of the trial's paths at most: few get further, and a wave of few costs as much as one of many
WAVE = 32  # tiles that are traced together: two branches of their paths are a wave of 16384 lanes
OUTLIERS = 0.01  # part of the pixels, the noisiest, that do not count
FLOOR = 0.01  # of the squared mean of all pixels, added to that of each
MOST_WAYS = 4  # more gain nothing
ERRORS = 2  # standard errors, over tiles, by which more variance counts as shared than was found
GAIN = 0.9  # variance times rays must fall below this part: counted rays tell the cost to about a tenth
NEAR_BEST = 1.1  # the fewest branches are taken that cost no more than this times the least
GUIDED_RAY = 1.35  # cost of a ray of a guided path, relative to that of a plain one
CONNECTION = 0.6  # cost of a ray that connects pixels, likewise
RARE_LIGHT = 0.5  # relative variance of a pixel of SAMPLES samples, from where on light is hard to find
REUSE_GAIN = 0.75  # what re-use must bring beyond the best number of branches, in the mean of pixels and blur
NO_WORSE = 1.1  # and neither may cost more than this


@record
class Reused:
    """What sharing paths among pixels brings."""

    pixels: float  # variance of a pixel, relative to that of the same paths alone
    neighbors: float  # and of the mean of four neighbors in a tile
    connections: float  # rays that connect pixels


@record
class Trial:
    """What a trial has found."""

    shared: float  # relative variance of a pixel that the branches of a path share
    separate: float  # and that between branches
    before: float  # rays up to the first surface, and of light samples there
    after: float  # rays of one branch of all paths
    ray_cost: float
    reused: Reused | None = None  # None where it was not tried

    def cost(self, ways: int) -> float:
        """Return variance times cost with so many branches."""
        variance = self.shared + self.separate / ways
        return variance * (self.before + self.after * ways) * self.ray_cost

    def best_ways(self) -> int:
        """Return the number of branches at which variance times rays is about least; 1 if it gains little."""
        least = min(self.cost(ways) for ways in range(1, MOST_WAYS + 1))
        if not least < GAIN * self.cost(1):
            return 1
        return next(ways for ways in range(1, MOST_WAYS + 1) if self.cost(ways) <= NEAR_BEST * least)

    @property
    def light_is_rare(self) -> bool:
        """Whether few paths find most of the light."""
        return self.shared + self.separate > RARE_LIGHT

    def costs_of_reuse(self) -> tuple[float, float]:
        """Return variance times cost of re-use over that of plain paths: of pixels, and after a blur."""
        if self.reused is None:
            return 1.0, 1.0
        plain = self.before + self.after
        cost = (plain + CONNECTION * self.reused.connections) / plain
        return self.reused.pixels * cost, self.reused.neighbors * cost

    def reuse_pays(self) -> bool:
        """Return whether re-use costs less than the best number of branches, by pixels and after a blur."""
        pixels, neighbors = self.costs_of_reuse()
        branches = self.cost(self.best_ways()) / self.cost(1) if self.cost(1) > 0 else 1.0
        both = math.sqrt(pixels * neighbors)
        return both < REUSE_GAIN * branches and max(pixels, neighbors) < NO_WORSE


def is_worth_it(guided: Trial, plain: Trial, ways: int | None) -> bool:
    """Return whether a guide pays, with so many branches; None: with the best number for each."""
    with_guide, without = (trial.cost(ways or trial.best_ways()) for trial in (guided, plain))
    return with_guide < GAIN * without


def tiles_for(size: tuple[int, int]) -> int:
    """Return how many tiles the trial of a picture of a size (width, height) has."""
    return min(size[0] * size[1] // PIXELS_PER_TILE, MOST_TILES)


def run_trial(
    scene: CompiledScene,
    camera: Camera,
    samplers: tuple[Sampler, Sampler],
    max_bounces: int,
    table: GuideTable | None = None,
    tiles: int = MOST_TILES // 2,
    reuse: bool = False,
) -> Trial:
    """Render some pixels twice, with samplers whose numbers the picture does not use.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    max_bounces
        At least 2.
    tiles
        How many tiles of sixteen pixels.
    reuse
        Whether to try sharing paths among pixels.
    """
    pixel, max_bounces = _spread_tiles(camera, tiles), min(max_bounces, BOUNCES)
    parts = [
        _trace(scene, camera, samplers, max_bounces, table, pixel[first : first + WAVE * MEMBERS], reuse)
        for first in range(0, pixel.size, WAVE * MEMBERS)
    ]
    ways = np.concatenate([part.ways for part in parts], -1)
    difference, mean = ways[:, :, 0] - ways[:, :, 1], ways.mean((1, 2))
    of_tile = mean.reshape(3, tiles, MEMBERS).mean(-1).repeat(MEMBERS, -1)
    scale = (np.square(of_tile) + (FLOOR * mean.mean() ** 2 or 1.0))[:, None]
    alone = (np.square(difference) / scale).mean((0, 1)) / 2  # of each pixel, with one branch
    common = (difference[:, 0] * difference[:, 1] / scale[:, 0]).mean(0) / 2
    kept = _calm(alone)
    total = math.fsum(alone.take(kept)) / kept.size
    shared = min(_at_most(common, kept), total)
    before, after = sum(part.before for part in parts), sum(part.after for part in parts) / 2
    reused = None
    if reuse:
        together = np.concatenate([part.together for part in parts], -1)
        pair = together[:, :, 0] - together[:, :, 1], difference[:, :1]
        of_neighbors = (_of_neighbors(each) for each in (*pair, scale))
        connections = sum(part.connections for part in parts)
        reused = Reused(_ratio(*pair, scale), _ratio(*of_neighbors), connections)
    return Trial(
        shared,
        total - shared,
        before,
        after,
        1.0 if table is None else GUIDED_RAY,
        reused,
    )


def _spread_tiles(camera: Camera, count: int) -> Words:
    """Return the pixels (16 · count,) of tiles that are spread over a picture, those of each in turn."""
    width, height = camera.size
    reach = (SIDE - 1) * STRIDE
    across, down = max(1, width - reach), max(1, height - reach)
    place = spread(np.arange(count, dtype=np.uint64), across * down).astype(np.intp)
    row, column = np.divmod(np.arange(MEMBERS), SIDE)
    y = (place // across)[:, None] + row * STRIDE
    x = (place % across)[:, None] + column * STRIDE
    return (y % height * width + x % width).ravel().astype(np.uint32)


def _of_neighbors(values: Doubles) -> Doubles:
    """Return the means (3, ways, tiles · 4) of four neighbors of values (3, ways, pixels)."""
    by_tile = values.reshape(*values.shape[:2], -1, SIDE // 2, 2, SIDE // 2, 2)
    return by_tile.mean((-3, -1)).reshape(*values.shape[:2], -1)


def _calm(variance: Doubles) -> Ints:
    """Return the places (k,) of all variances (n,) but the greatest."""
    return variance.argsort(kind="stable")[: variance.size - int(OUTLIERS * variance.size)]


def _at_most(values: Doubles, kept: Ints) -> float:
    """Return the mean of the kept values (k,) of pixels (n,), plus `ERRORS` of its errors; at least 0."""
    which = np.zeros(values.size)
    which[kept] = 1
    of_tile = (values * which).reshape(-1, MEMBERS).sum(1)
    count, mean = of_tile.size, math.fsum(of_tile) / kept.size
    spread = math.fsum(np.square(of_tile - mean * which.reshape(-1, MEMBERS).sum(1)))
    error = math.sqrt(spread * count / max(count - 1, 1)) / kept.size
    return max(mean + ERRORS * error, 0.0)


def _ratio(difference: Doubles, other: Doubles, scale: Doubles) -> float:
    """Return the variance of one kind of picture over that of another, given differences of two of each."""
    one, base = ((np.square(each) / scale).mean((0, 1)) for each in (difference, other))
    least = math.fsum(base.take(_calm(base)))
    return math.fsum(one.take(_calm(one))) / least if least > 0 else 1.0


@record
class TrialPart:
    """What the paths of some pixels have found."""

    ways: Doubles  # (3, 2, 2, pixels) radiance by each branch, as if it were the only one, in each block
    together: Doubles  # (3, 1, 2, pixels) by the first branches, where pixels share what they find
    before: int  # rays before the branches part
    after: int  # rays of both branches
    connections: int  # rays between pixels


def _trace(
    scene: CompiledScene,
    camera: Camera,
    samplers: tuple[Sampler, Sampler],
    max_bounces: int,
    table: GuideTable | None,
    pixel: Words,
    reuse: bool,
) -> TrialPart:
    """Trace samples of pixels, whole tiles in turn, with two branches of independent random numbers."""
    counter = RayCounter(scene.accelerator)
    scene, sampler = replace(scene, accelerator=counter), samplers[0]
    paths = _both_blocks(scene, camera, samplers, pixel)
    n = len(paths)
    L = np.zeros((3, 2 * n), np.float32)
    first, hits = intersect_and_compact(scene, paths, sampler, 0, L, mis=True)
    shade = guide(prepare_shading(scene, first, hits), table)
    accumulate(L, first, direct(scene, first, shade, sampler, 0, mis=True))
    L[:, n:] = L[:, :n]
    before = counter.rays
    second = replace(first, slot=first.slot + n, pixel=_elsewhere(first.pixel, camera, 1))
    paths = Paths.concatenate([bounce_sample(each, shade, sampler, 0) for each in (first, second)])
    paths = select(paths, roulette(paths, sampler, 0))
    paths, hits = intersect_and_compact(scene, paths, sampler, 1, L, mis=True)
    if not reuse:
        follow(scene, paths, hits, sampler, max_bounces, L, 1, table)
        ways = _means(L, pixel.size)
        return TrialPart(ways, ways[:, :1], before, counter.rays - before, 0)
    lanes, points = shared_points(scene, paths, hits, 1)
    found = np.concatenate([L, np.zeros((3, lanes.size), np.float32)], 1)  # of paths, then of shared points
    follow(scene, _cut(paths, lanes, 2 * n), hits, sampler, max_bounces, found, 1, table)
    L, light, after = found[:, : 2 * n], found[:, 2 * n :], counter.rays
    together = L[:, :n].copy()
    L[:, points.slot] += points.throughput * light
    of_first = np.flatnonzero(points.slot < n)
    tile, member = np.divmod(np.arange(n), MEMBERS)
    tiles = WaveTiles(tile, member, n // MEMBERS)
    add_shared(scene, together, first, shade, points.take(of_first), light.take(of_first, 1), tiles, 1)
    ways, shared = _means(L, pixel.size), _means(together, pixel.size)
    return TrialPart(ways, shared, before, after - before, counter.rays - after)


def _cut(paths: Paths, lanes: Ints, first_slot: int) -> Paths:
    """Return paths of which some begin anew where they are, with slots of their own from `first_slot` on."""
    begun = as_shared(paths.take(lanes))
    cut = replace(
        paths,
        slot=paths.slot.copy(),
        throughput=paths.throughput.copy(),
        roulette_scale=paths.roulette_scale.copy(),
    )
    cut.slot[lanes] = begun.slot + first_slot
    cut.throughput[:, lanes] = begun.throughput
    cut.roulette_scale[lanes] = begun.roulette_scale
    return cut


def _means(L: Floats, pixels: int) -> Doubles:
    """Return means (3, ways, 2, pixels) over samples of radiance (3, ways · blocks · samples · pixels)."""
    finite = np.where(np.isfinite(L), L, 0)
    return finite.reshape(3, -1, 2, SAMPLES, pixels).mean(3, dtype=np.float64)


def _both_blocks(
    scene: CompiledScene, camera: Camera, samplers: tuple[Sampler, Sampler], pixel: Words
) -> Paths:
    """Return paths of two blocks of samples, whose random numbers are independent."""
    sample = np.repeat(np.arange(SAMPLES, dtype=np.uint32), pixel.size)
    one, other = (generate(scene, camera, each, np.tile(pixel, SAMPLES), sample) for each in samplers)
    other.slot = other.slot + len(one)
    other.pixel = _elsewhere(other.pixel, camera, 2)
    return Paths.concatenate([one, other])


def _elsewhere(pixel: Words, camera: Camera, times: int) -> Words:
    """Return addresses (n,) of random numbers for pixels (n,) that no pixel of the picture has."""
    return pixel + np.uint32(times * camera.film[0] * camera.film[1] % 2**32)


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

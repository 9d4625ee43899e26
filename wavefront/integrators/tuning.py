"""The trial before a render: what more branches, paths that pixels share, or a guide would bring.

Pixels of some tiles (sampling/tiles.py) are rendered several times under seeds of their own, with two
branches that are kept apart. The variance of a picture with N branches is shared + separate / N: the
covariance of the two branches is what they share, and the rest lies between them. With the rays of both parts
of the paths, counted and not timed, this gives variance times rays for every N, which is least near the
square root of (separate / shared) · (rays before / rays of a branch). What the first branches find is shared
among the pixels of each tile, too, and compared with the same paths alone: in each pixel, and after a blur,
which adds up what is the same in the noise of a tile. So decisions depend on the scene, the camera and the
settings alone.

Sources: J. Arvo and D. Kirk, Particle Transport and Image Synthesis, 1990 (splitting); E. Veach, thesis 1997,
§10.4.2 (efficiency).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Ints
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..sampling.tiles import MEMBERS, SIDE, STRIDE, cell_shifts
from ..stages.reuse import shared_materials
from .training import spread
from .tuning_job import TrialJob, TrialPart

JobsRunner: TypeAlias = Callable[[list[TrialJob]], Iterable[TrialPart]]  # in the order of the jobs

BLOCKS = 4  # of independent samples
PIXELS_PER_TILE = 2048  # of the picture: an eighth of a path for each of its pixels
MOST_TILES = 256  # 65536 paths
BOUNCES = 6  # of the trial's paths at most: few get further, and a wave of few costs as much as one of many
WAVE = 32  # tiles at most that are traced together: two branches of their paths are a wave of 16384 lanes
LEAST_JOBS = 2  # of a trial, so that two workers have something to do
OUTLIERS = 0.01  # part of the pixels, the noisiest, that do not count
FLOOR = 0.01  # of the squared mean of all pixels, added to that of each
MOST_WAYS = 4  # more gain nothing
ERRORS = 1  # standard errors, over tiles, by which more variance counts as shared than was found
# Variance times rays must fall below this part: rays tell the cost to about a tenth, and a trial may miss the
# few paths that find most of the light.
GAIN = 0.85
GUIDE_GAIN = 0.9  # variance times rays of guided paths must fall below this part
NEAR_BEST = 1.1  # the fewest branches are taken that cost no more than this times the least
GUIDED_RAY = 1.35  # cost of a ray of a guided path, relative to that of a plain one
CONNECTION = 0.5  # cost of a ray that connects pixels, likewise
EVALUATION = 0.3  # cost of evaluating the BSDF of a pixel for another one, relative to that of a ray
RARE_LIGHT = 1.0  # relative variance of a pixel of four samples, from where on light is hard to find
COMMON_GLOSS = 0.05  # part of the second points, from where on a trial sees enough of what a material does
NO_WORSE = 2.0  # what re-use may cost by pixels or after a blur: few tiles may tell twice the truth
BLUR = 4  # standard deviation of the blur, pixels
# of a pixel for another one so many rows or columns away: the convolution of the blur with itself
BLUR_WEIGHTS = np.array([math.exp(-((distance / (2 * BLUR)) ** 2)) for distance in range(SIDE * STRIDE)])


@soa
class Reused:
    """What sharing paths among pixels brings."""

    pixels: float  # variance of a pixel, relative to that of the same paths alone
    blurred: float  # and after a blur, which adds up noise that pixels share
    again: float  # rays of the further paths from shared points
    connections: float  # rays that connect pixels
    evaluations: float  # connections that were looked at, whether or not they needed a ray


@soa
class Trial:
    """What a trial has found."""

    shared: float  # relative variance of a pixel that the branches of a path share
    separate: float  # and that between branches
    before: float  # rays up to the first surface, and of light samples there
    after: float  # rays of one branch of all paths
    ray_cost: float  # cost of a ray, relative to that of a plain path
    least_gloss: float = 1.0  # part of the second points that are of the glossy material which is met least
    reused: Reused | None = None  # None where it was not tried

    def cost(self, ways: int) -> float:
        """Return variance times cost with so many branches."""
        variance = self.shared + self.separate / ways
        return variance * (self.before + self.after * ways) * self.ray_cost

    def best_ways(self) -> int:
        """Return the number of branches at which variance times rays is about least; 1 if it gains little."""
        costs = [self.cost(ways) for ways in range(1, MOST_WAYS + 1)]
        ways = next(ways for ways, cost in enumerate(costs, 1) if cost <= NEAR_BEST * min(costs))
        return ways if self.cost(ways) < GAIN * self.cost(1) else 1

    @property
    def light_is_rare(self) -> bool:
        """Whether few paths find most of the light."""
        return self.shared + self.separate > RARE_LIGHT

    @property
    def gloss_is_common(self) -> bool:
        """Whether paths meet all glossy materials so often that their caustics do not surprise."""
        return self.least_gloss >= COMMON_GLOSS

    def costs_of_reuse(self) -> tuple[float, float]:
        """Return variance times cost of re-use over that of plain paths: of pixels, and after a blur."""
        if self.reused is None:
            return 1.0, 1.0
        plain = self.before + self.after
        connecting = CONNECTION * self.reused.connections + EVALUATION * self.reused.evaluations
        cost = (plain + self.reused.again + connecting) / plain
        return self.reused.pixels * cost, self.reused.blurred * cost

    def reuse_pays(self) -> bool:
        """Return whether re-use costs less than the best number of branches, in the mean of both."""
        pixels, blurred = self.costs_of_reuse()
        branches = self.cost(self.best_ways()) / self.cost(1) if self.cost(1) > 0 else 1.0
        both = math.sqrt(pixels * blurred)
        return both < branches and max(pixels, blurred) < NO_WORSE


def guide_pays(guided: Trial, plain: Trial, ways: int | None) -> bool:
    """Return whether a guide pays, with so many branches; None: with the best number for each."""
    with_guide, without = (trial.cost(ways or trial.best_ways()) for trial in (guided, plain))
    return with_guide < GUIDE_GAIN * without


def tiles_for(size: tuple[int, int]) -> int:
    """Return how many tiles the trial of a picture of a size (width, height) has."""
    return min(size[0] * size[1] // PIXELS_PER_TILE, MOST_TILES)


def run_trial(
    scene: CompiledScene,
    camera: Camera,
    seeds: tuple[int, ...],
    max_bounces: int,
    run: JobsRunner,
    *,
    guided: bool = False,
    tiles: int = MOST_TILES // 2,
    reuse: bool = False,
) -> Trial:
    """Render some pixels several times, with random numbers that the picture does not use.

    Parameters
    ----------
    scene
        Whose trial it is.
    camera
        In the unit of the compiled scene.
    seeds
        Of the samplers of each block of samples, at least two.
    max_bounces
        At least 2.
    run
        Does the jobs of the trial.
    guided
        Whether paths are guided.
    tiles
        How many tiles of sixteen pixels.
    reuse
        Whether to try sharing paths among pixels.
    """
    max_bounces = min(max_bounces, BOUNCES)
    width, height = camera.size
    x, y = _spread_tiles(camera, tiles)
    pixel = (y % height * width + x % width).astype(np.uint32)
    count = max(-(-tiles // WAVE), min(LEAST_JOBS, tiles))
    places = np.array_split(pixel, count)
    jobs = [TrialJob(camera, seeds, max_bounces, each.ravel(), guided, reuse) for each in places]
    parts = list(run(jobs))
    ways = np.concatenate([part.ways for part in parts], -1)
    deviation, mean = _deviations(ways), ways.mean((1, 2))
    of_tile = mean.reshape(3, tiles, MEMBERS).mean(-1).repeat(MEMBERS, -1)
    scale = (np.square(of_tile) + (FLOOR * mean.mean() ** 2 or 1.0))[:, None, None]
    alone = (np.square(deviation) / scale).mean((0, 1, 2))  # of each pixel, with one branch
    common = (deviation[:, 0] * deviation[:, 1] / scale[:, 0]).mean((0, 1))
    kept = _calm(alone)
    total = math.fsum(alone.take(kept)) / kept.size
    shared = min(_at_most(common, kept), total)
    before, after = sum(part.before for part in parts), sum(part.after for part in parts) / 2
    reused = None
    if reuse:
        together = np.concatenate([part.together for part in parts], -1)
        reused = _reused(parts, _deviations(together), deviation[:, :1], scale, x, y)
    return Trial(
        shared,
        total - shared,
        before,
        after,
        GUIDED_RAY if guided else 1.0,
        _least_gloss(scene, np.sum([part.met for part in parts], 0)),
        reused,
    )


def _spread_tiles(camera: Camera, count: int) -> tuple[Ints, Ints]:
    """Return columns and rows (count, 16) of the pixels of tiles that are spread over a picture."""
    width, height = camera.size
    reach = SIDE * STRIDE - 1
    across, down = max(1, width - reach), max(1, height - reach)
    place = spread(np.arange(count, dtype=np.uint64), across * down).astype(np.intp)
    member = np.arange(MEMBERS)
    shift_x, shift_y = cell_shifts(place[:, None], np.zeros_like(place)[:, None], member)
    y = (place // across)[:, None] + member // SIDE * STRIDE + shift_y
    x = (place % across)[:, None] + member % SIDE * STRIDE + shift_x
    return x, y


def _deviations(blocks: Doubles) -> Doubles:
    """Return how blocks (3, ways, blocks, pixels) differ from their mean; the mean square is the variance."""
    count = blocks.shape[2]
    return (blocks - blocks.mean(2, keepdims=True)) * math.sqrt(count / (count - 1))


def _after_blur(deviation: Doubles, x: Ints, y: Ints) -> Doubles:
    """Return deviations (..., pixels) times what a blur gathers of those of their tiles; it may be negative.

    The mean over pixels is the variance after the blur, but for a factor. Two pixels count by the
    convolution of the blur with itself. Columns x and rows y of the pixels are (tiles, MEMBERS).
    """
    of_tile = deviation.reshape(*deviation.shape[:-1], *x.shape)
    gathered = np.zeros_like(of_tile)
    for member in range(MEMBERS):
        away_x, away_y = (np.abs(each - each[:, member, None]) for each in (x, y))
        gathered += BLUR_WEIGHTS[away_x] * BLUR_WEIGHTS[away_y] * of_tile[..., member, None]
    return (of_tile * gathered).reshape(deviation.shape)


def _calm(variance: Doubles) -> Ints:
    """Return the places (k,) of all variances (n,) but the greatest."""
    return variance.argsort(kind="stable")[: variance.size - int(OUTLIERS * variance.size)]


def _at_most(values: Doubles, kept: Ints) -> float:
    """Return the mean of the kept values (k,) of pixels (n,), at least 0, plus `ERRORS` of its errors."""
    which = np.zeros(values.size)
    which[kept] = 1
    of_tile = (values * which).reshape(-1, MEMBERS).sum(1)
    count, mean = of_tile.size, math.fsum(of_tile) / kept.size
    spread = math.fsum(np.square(of_tile - mean * which.reshape(-1, MEMBERS).sum(1)))
    error = math.sqrt(spread * count / max(count - 1, 1)) / kept.size
    return max(mean, 0.0) + ERRORS * error


def _reused(
    parts: list[TrialPart], together: Doubles, alone: Doubles, scale: Doubles, x: Ints, y: Ints
) -> Reused:
    """Return what sharing brings, given deviations (3, 1, blocks, pixels) with it and without it."""
    return Reused(
        _ratio(*(np.square(each) / scale for each in (together, alone))),
        _ratio(*(_by_tile(_after_blur(each, x, y) / scale) for each in (together, alone))),
        sum(part.again for part in parts),
        sum(part.connections for part in parts),
        sum(part.evaluations for part in parts),
    )


def _least_gloss(scene: CompiledScene, met: Ints) -> float:
    """Return the part of the second points that are of the material met least of those that cannot be shared.

    `met` (materials,) counts the points of each material. The part is 1 if all materials can be shared.
    """
    glossy = met[~shared_materials(scene)]
    return float(glossy.min() / max(met.sum(), 1)) if glossy.size else 1.0


def _by_tile(values: Doubles) -> Doubles:
    """Return the sums (..., tiles) of values (..., pixels)."""
    return values.reshape(*values.shape[:-1], -1, MEMBERS).sum(-1)


def _ratio(squares: Doubles, others: Doubles) -> float:
    """Return the mean of squares (3, ways, blocks, k) over that of others, without the greatest of each."""
    one, base = (each.mean((0, 1, 2)) for each in (squares, others))
    least = math.fsum(base.take(_calm(base)))
    return math.fsum(one.take(_calm(one))) / least if least > 0 else 1.0

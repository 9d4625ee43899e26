"""A job of a trial (tuning.py): pixels of some tiles, with two branches, alone and shared among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..accel import Accelerator, Intersections
from ..arrays.soa import soa
from ..arrays.state import Paths, Words
from ..arrays.vec import ALL, Bools, Doubles, Floats, Ints, f4
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..sampling.sampler import Sampler, SamplerMaker
from ..sampling.tiles import MEMBERS, WaveTiles
from ..stages.bounce import bounce_sample
from ..stages.compact import roulette, select
from ..stages.generate import generate
from ..stages.guidance import guide
from ..stages.interaction import material_rows
from ..stages.reuse import SHARED_WAYS, add_shared, as_shared, shared_points
from ..stages.shade import direct
from .shared_paths import follow
from .steps import accumulate, intersect_and_compact, prepare_shading

SAMPLES = 4  # of each pixel in each block; stratified, as those of a picture are


@soa
class TrialPart:
    """What the paths of some pixels have found."""

    ways: Doubles  # (3, 2, blocks, pixels) radiance by each branch, as if it were the only one
    together: Doubles  # (3, 1, blocks, pixels) by the first branches, where pixels share what they find
    met: Ints  # (materials,) how many second points are of each material
    before: int  # rays before the branches part
    after: int  # rays of both branches
    again: int  # rays of the further paths from shared points
    connections: int  # rays between pixels
    evaluations: int  # of BSDFs, for these


@soa
class TrialJob:
    """Some tiles of a trial, which are traced together."""

    camera: Camera  # in the unit of the compiled scene
    seeds: tuple[int, ...]  # one for each block of samples
    max_bounces: int
    pixels: Words  # (k,) whole tiles in turn
    guided: bool
    reuse: bool  # whether to try sharing paths among pixels

    def trace(self, scene: CompiledScene, make_sampler: SamplerMaker, table: GuideTable | None) -> TrialPart:
        """Trace the tiles.

        Parameters
        ----------
        make_sampler
            Makes a sampler from a seed and the width of a picture.
        table
            Guides paths if they are to be guided.
        """
        table = table if self.guided else None
        samplers = tuple(make_sampler(seed, self.camera.resolution[0]) for seed in self.seeds)
        return _trace(scene, self.camera, samplers, self.max_bounces, table, self.pixels, self.reuse)

    def __str__(self) -> str:
        """Name the job in an error message."""
        return f"the trial of {self.pixels.size} pixels from {self.pixels[0]} on"


def _trace(
    scene: CompiledScene,
    camera: Camera,
    samplers: tuple[Sampler, ...],
    max_bounces: int,
    table: GuideTable | None,
    pixel: Words,
    reuse: bool,
) -> TrialPart:
    """Trace samples of pixels, whole tiles in turn, with two branches of independent random numbers."""
    counter = RayCounter(scene.accelerator)
    scene, sampler = replace(scene, accelerator=counter), samplers[0]
    paths = _blocks(scene, camera, samplers, pixel)
    n = len(paths)
    L = np.zeros((3, 2 * n), np.float32)
    first, hits = intersect_and_compact(scene, paths, sampler, 0, L, mis=True)
    shade = guide(prepare_shading(scene, first, hits), table)
    accumulate(L, first, direct(scene, first, shade, sampler, 0, mis=True))
    L[:, n:] = L[:, :n]
    before = counter.rays
    second = replace(first, slot=first.slot + n, pixel=_elsewhere(first.pixel, camera, 1))
    paths = Paths.concatenate([bounce_sample(each, shade, sampler, 0) for each in (first, second)])
    paths = select(paths, roulette(scene, paths, sampler, 0))
    paths, hits = intersect_and_compact(scene, paths, sampler, 1, L, mis=True)
    met = np.bincount(material_rows(scene, hits, ALL), minlength=scene.materials.group_of.size)
    if not reuse:
        follow(scene, [(paths, hits)], sampler, max_bounces, L, 1, table)
        ways = _means(L, len(samplers), pixel.size)
        return TrialPart(ways, ways[:, :1], met, before, counter.rays - before, 0, 0, 0)
    lanes, points = shared_points(scene, paths, hits, 1)
    found = np.concatenate([L, np.zeros((3, lanes.size), np.float32)], 1)  # of paths, then of shared points
    follow(scene, [(_cut(paths, lanes, 2 * n), hits)], sampler, max_bounces, found, 1, table)
    L, light, after = found[:, : 2 * n], found[:, 2 * n :], counter.rays
    together = L[:, :n].copy()
    L[:, points.slot] += points.throughput * light
    of_first = np.flatnonzero(points.slot < n)
    lanes, points, light = lanes.take(of_first), points.take(of_first), light.take(of_first, 1)
    begun, hits = as_shared(paths.take(lanes)), hits.take(lanes)
    for way in range(1, SHARED_WAYS):
        other = replace(begun, pixel=_elsewhere(begun.pixel, camera, 2 * len(samplers) * way))
        follow(scene, [(other, hits)], sampler, max_bounces, light, 1, table)
    light *= f4(1 / SHARED_WAYS)
    again = counter.rays - after
    tile, member = np.divmod(np.arange(n), MEMBERS)
    tiles = WaveTiles(tile, member, n // MEMBERS)
    add_shared(scene, [(together, light)], first, shade, points, tiles, 1)
    ways, shared = _means(L, len(samplers), pixel.size), _means(together, len(samplers), pixel.size)
    connections, evaluations = counter.rays - after - again, MEMBERS * len(shade.lit().surface)
    return TrialPart(ways, shared, met, before, after - before, again, connections, evaluations)


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


def _means(L: Floats, blocks: int, pixels: int) -> Doubles:
    """Return means (3, ways, blocks, pixels) of radiance (3, ways · blocks · samples · pixels)."""
    finite = np.where(np.isfinite(L), L, 0)
    return finite.reshape(3, -1, blocks, SAMPLES, pixels).mean(3, dtype=np.float64)


def _blocks(scene: CompiledScene, camera: Camera, samplers: tuple[Sampler, ...], pixel: Words) -> Paths:
    """Return paths of a block of samples for each sampler, whose random numbers are independent."""
    sample, pixel = np.repeat(np.arange(SAMPLES, dtype=np.uint32), pixel.size), np.tile(pixel, SAMPLES)
    blocks = [generate(scene, camera, sampler, pixel, sample) for sampler in samplers]
    for number, paths in enumerate(blocks):
        paths.slot = paths.slot + number * pixel.size
        paths.pixel = _elsewhere(paths.pixel, camera, 2 * number)
    return Paths.concatenate(blocks)


def _elsewhere(pixel: Words, camera: Camera, times: int) -> Words:
    """Return addresses (n,) of random numbers for pixels (n,) that no pixel of the picture has."""
    return pixel + np.uint32(times * camera.resolution[0] * camera.resolution[1] % 2**32)


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

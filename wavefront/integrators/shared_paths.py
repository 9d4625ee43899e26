"""The full estimator with paths that pixels share (stages/reuse.py)."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Paths
from ..arrays.vec import Floats, add_to_slots, f4, highest
from ..compile.scene import CompiledScene
from ..sampling.sampler import Sampler
from ..sampling.tiles import Tiles, WaveTiles
from ..stages.bounce import bounce_sample, branch, copies
from ..stages.compact import alive, roulette, select
from ..stages.glossy_points import SECTIONS, GlossyPoints
from ..stages.reuse import SHARED_WAYS, add_shared, as_shared, can_reuse, shared_points
from ..stages.shade import Shading, direct
from .ladder import li_full
from .steps import accumulate, intersect_and_compact, prepare_shading, scatter


def li_reuse(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    max_bounces: int,
    *,
    tiles: Tiles,
) -> Floats:
    """Estimate the same as `li_full`, with paths that pixels share from their second points on.

    Direct light at the first points, and emission that paths meet at their second points, are not shared.
    """
    if not can_reuse(scene):
        return li_full(scene, paths, sampler, max_bounces)
    L = np.zeros((3, len(paths)), f4)
    in_wave = WaveTiles.of(paths.pixel, paths.sample, tiles)
    first, hits = intersect_and_compact(scene, paths, sampler, 0, L, mis=True)
    if max_bounces == 0 or not len(first):
        return L
    shade = prepare_shading(scene, first, hits)
    accumulate(L, first, direct(scene, first, shade, sampler, 0, mis=True))
    sharing = Sharing(scene, sampler, max_bounces)
    sharing.share(L, first, shade, branch(first, shade, sampler, 0, scene.program.branches), in_wave)
    return L


Ways: TypeAlias = list[tuple[Paths, Hits]]


@soa
class Sharing:
    """How paths go on from the first rough surfaces."""

    scene: CompiledScene
    sampler: Sampler
    max_bounces: int

    def share(self, L: Floats, first: Paths, shade: Shading, paths: Paths, tiles: WaveTiles) -> None:
        """Add to L, (3, n) of all slots, the light of first surfaces from all but light samples.

        Parameters
        ----------
        first, shade
            Paths at these surfaces.
        paths
            Those that have left them.
        """
        paths = select(paths, roulette(self.scene, paths, self.sampler, 0))
        paths, hits = self._onward(paths, 0, L)
        if self.max_bounces == 1 or not len(paths):
            return
        lanes, points, matte = shared_points(self.scene, paths, hits, self.scene.program.branches)
        g = lanes.size - matte
        unshared = np.setdiff1d(np.arange(len(paths)), lanes, assume_unique=True)
        self._follow([(paths.take(unshared), hits.take(unshared))], 1, L)
        light = np.zeros((3, matte + SECTIONS * g), f4)
        begun, hits = as_shared(paths.take(lanes), light.shape[1]), hits.take(lanes)
        ways = [(way, hits.take(slice(0, matte))) for way in copies(begun.take(slice(0, matte)), SHARED_WAYS)]
        ways = self._step(ways, 1, light)
        rest, glossy = slice(matte, lanes.size), None
        if g:
            glossy, more = self._glossy(begun.take(rest), hits.take(rest), light)
            ways += more
        self._follow(ways, 2, light)
        sums = [(L, light), *first.recorder.parts_of_shared()]
        for to, shared in sums:
            shared[:, :matte] *= f4(1 / SHARED_WAYS)
            add_to_slots(to, points.slot[rest], points.throughput[:, rest] * shared[:, lanes.size :][:, :g])
        add_shared(self.scene, sums, first, shade, points, tiles, self.scene.program.branches, glossy)

    def _glossy(self, paths: Paths, hits: Hits, light: Floats) -> tuple[GlossyPoints, Ways]:
        """Follow paths from g glossy points to their next surfaces, and return both.

        The light that arrives there is added to the first and the last section of `light`, and that which
        pixels do not share, by delta lobes or by emission, to that between them.
        """
        g = len(paths)
        shade = prepare_shading(self.scene, paths, hits)
        left = bounce_sample(paths, shade, self.sampler, 1)
        glossy, contribution = GlossyPoints.of(self.scene, paths, shade, self.sampler, left.direction)
        accumulate(light, paths, contribution)
        left = replace(left, slot=left.slot + g)
        left, hits = self._onward(select(left, np.flatnonzero(alive(left))), 1, light)
        specular, shared = np.flatnonzero(left.specular), np.flatnonzero(~left.specular)
        begun = left.take(shared)
        begun.slot, begun.roulette_scale = begun.slot + g, begun.roulette_scale * highest(begun.throughput)
        begun.throughput = np.ones_like(begun.throughput)
        return glossy, [(left.take(specular), hits.take(specular)), (begun, hits.take(shared))]

    def _follow(self, ways: Ways, bounce: int, L: Floats) -> None:
        """Follow paths from surfaces on that are not shaded yet, and add the light that they find to L."""
        for at in range(bounce, self.max_bounces):
            ways = self._step(ways, at, L)

    def _step(self, ways: Ways, bounce: int, L: Floats) -> Ways:
        """Follow paths from the surfaces of a bounce to the next ones, and add the light that they find to L.

        From there on all ways are one: the order in which points get light is the same in any wave.
        """
        leaving = [self._scatter(*way, bounce, L) for way in ways if len(way[0])]
        return [self._onward(Paths.concatenate(leaving), bounce, L)] if leaving else []

    def _scatter(self, paths: Paths, hits: Hits, bounce: int, L: Floats) -> Paths:
        """Add direct light to L, and return the paths that go on in new directions."""
        return scatter(self.scene, L, paths, hits, self.sampler, bounce)

    def _onward(self, paths: Paths, bounce: int, L: Floats) -> tuple[Paths, Hits]:
        """Return paths that have left the surfaces of a bounce, at their next ones."""
        return intersect_and_compact(self.scene, paths, self.sampler, bounce + 1, L, mis=True)

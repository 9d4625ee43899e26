"""Media that need to know what rays are inside of: they scatter, emit, or are around other things."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Contribution, Paths
from ..arrays.vec import Bools, Floats, Ints, highest, take
from ..compile.program import Facts, Feature, Leg, Passage
from ..compile.scene import CompiledScene
from ..stages.accumulate import accumulate
from ..stages.inside import stacks_at
from ..stages.intersect import ShadowRays
from ..stages.medium import cross, dim, fly


@soa
class Media(Feature):
    """Scatters and weakens rays within media, and notes what they are inside of."""

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with a `MediaTable`."""
        return None if facts.compiled.media is None else cls()

    def begin(self, scene: CompiledScene, paths: Paths) -> None:
        """Find out what paths begin inside of."""
        paths.media = stacks_at(scene, paths.origin)

    def walk(self, leg: Leg, lanes: Ints, segment: int) -> Ints:
        """Let paths fly through their media, which may scatter them on the way."""
        return fly(leg, lanes, segment)

    def dim(self, part: Floats, scene: CompiledScene, rays: ShadowRays, length: Floats, end: Bools) -> None:
        """Weaken shadow rays by what is in their media."""
        dim(part, scene, rays, length, end)

    def cross(self, passage: Passage) -> None:
        """Note what rays are inside of behind surfaces."""
        passage.rays.media = cross(passage.scene, passage.rays.media, passage.surface)


@soa
class Glow(Feature):
    """Adds what media have sent along paths."""

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a medium emits."""
        media = facts.compiled.media
        return cls() if media is not None and media.glows else None

    def fly(self, leg: Leg) -> None:
        """Add the light, and take it off the paths."""
        paths, glow = leg.paths, leg.paths.glow
        assert glow is not None
        lanes = np.flatnonzero(highest(glow) != 0)
        glowing = replace(paths, throughput=np.ones_like(glow), glow=None)
        accumulate(leg.L, glowing, Contribution(lanes, take(glow, lanes), np.full(lanes.size, -1)))
        leg.paths = replace(paths, glow=None)

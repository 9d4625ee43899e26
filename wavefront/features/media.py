"""Media that need the stacks of rays: they scatter, emit, or are around other shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Contribution, Paths, Rays, SurfaceInteraction
from ..arrays.vec import Bools, Floats, Ints, highest, take
from ..compile.media import stacks_leaving
from ..compile.program import Facts, Feature, Leg, Passage
from ..compile.scene import CompiledScene
from ..stages.accumulate import accumulate
from ..stages.inside import stacks_at
from ..stages.interaction import Surfaces
from ..stages.intersect import ShadowRays
from ..stages.medium import begin_in_media, cross, crossings, dim, fly
from ..stages.shade import LightRays, Shading


class ShadingInMedia(Shading):
    """Surfaces and points within media: where there is no surface there is no cosine."""

    __slots__ = ()

    def prepare(self, scene: CompiledScene) -> None:
        """Find the points within media, and the changes of stacks at the surfaces."""
        super().prepare(scene)
        self.volume = np.flatnonzero(self.surface.prim < 0)
        self.crossing = crossings(scene, self.surface)

    def cosines(self, local: Floats, world: Floats) -> tuple[Floats, Floats]:
        """Return the cosines, 1 within media."""
        cos, cos_g = super().cosines(local, world)
        if self.volume is not None and self.volume.size:
            cos_g = cos_g.copy()
            cos[self.volume] = cos_g[self.volume] = 1
        return cos, cos_g

    def enter(self, rays: ShadowRays, of: LightRays) -> None:
        """Note the media around the origins of shadow rays."""
        super().enter(rays, of)
        stack = of.paths.media[:, : of.cos_g.size]
        if self.crossing is not None:
            stack = stacks_leaving(stack, self.crossing, of.cos_g)
        begin_in_media(of.scene, rays, of.paths, stack, of.lanes, of.light, of.sampler, of.bounce)

    def leave(self, paths: Paths, left: Paths, cos_g: Floats, bounce: int) -> None:
        """Note the media that paths have entered and left."""
        super().leave(paths, left, cos_g, bounce)
        if self.crossing is not None:
            left.media = stacks_leaving(paths.media, self.crossing, cos_g)


class SurfacesAndEvents(Surfaces):
    """Surfaces that rays have hit, and places where media have scattered them.

    There the normal is the direction that the light leaves in, and there is no primitive.
    """

    __slots__ = ()

    def interaction(self) -> SurfaceInteraction:
        """Return the geometry of both."""
        rays, hits = self.rays, self.hits
        self.hits = replace(hits, prim=np.maximum(hits.prim, 0))
        surface = super().interaction()
        lanes = np.flatnonzero(hits.prim < 0)
        if lanes.size:
            wo = take(surface.wo, lanes)
            surface.point[:, lanes] = take(rays.origin, lanes) - wo * hits.t.take(lanes)
            surface.error[lanes], surface.back_facing[lanes] = 0, False
            surface.ng[:, lanes] = surface.ns[:, lanes] = wo
            surface.prim[lanes], surface.material[lanes] = -1, self.material_rows(self.scene, hits, lanes)
        return surface


@soa
class Media(Feature):
    """Scatters and weakens rays within media, and notes the media around them."""

    shading = ShadingInMedia
    surfaces = SurfacesAndEvents

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with a `MediaTable`."""
        return None if facts.compiled.media is None else cls()

    def begin(self, scene: CompiledScene, paths: Paths) -> None:
        """Find the media around the origins of paths."""
        paths.media = stacks_at(scene, paths.origin, paths.time)

    def walk(self, leg: Leg, lanes: Ints, segment: int) -> Ints:
        """Let paths fly through their media, which may scatter them on the way."""
        return fly(leg, lanes, segment)

    def dim(self, part: Floats, scene: CompiledScene, rays: ShadowRays, length: Floats, end: Bools) -> None:
        """Weaken shadow rays by their media."""
        dim(part, scene, rays, length, end)

    def cross(self, passage: Passage) -> None:
        """Note the media around rays behind surfaces."""
        passage.rays.media = cross(passage.scene, passage.rays.media, passage.surface)

    def tilt(self, scene: CompiledScene, rays: Rays, surface: SurfaceInteraction) -> None:
        """Find the index of refraction that is around surfaces."""
        assert scene.media is not None
        surface.index_around = scene.media.index_around(rays.media, surface)


@soa
class Glow(Feature):
    """Adds the light that media have emitted along paths."""

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

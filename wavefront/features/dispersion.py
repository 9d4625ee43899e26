"""Dispersion: glass whose index of refraction differs between channels follows one of them for each path."""

from __future__ import annotations

from typing import Self

from ..arrays.state import Paths, Rays, SurfaceInteraction
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene


class Dispersion(Feature):
    """Tells surfaces the throughput of paths, by which a channel is chosen."""

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a material is dispersive."""
        return cls() if facts.compiled.materials.dispersive else None

    def tilt(self, scene: CompiledScene, rays: Rays, surface: SurfaceInteraction) -> None:
        """Note the throughput."""
        if isinstance(rays, Paths):
            surface.throughput = rays.throughput

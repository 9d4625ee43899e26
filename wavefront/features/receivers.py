"""Receivers of light: image lights are sampled by the directions that surfaces face."""

from __future__ import annotations

from typing import Self

from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..lights.product import bins_of
from ..stages.shade import Shading, receiver_of


class ReceivingShading(Shading):
    """Surfaces that give lights their normals."""

    __slots__ = ()

    def prepare(self, scene: CompiledScene) -> None:
        """Note the receivers of lights, once for all samples, and for rays that they could replace."""
        super().prepare(scene)
        self.receiver = receiver_of(self.surface, self.groups)
        if scene.lights.texels is not None:
            self.receiver.bins = bins_of(self.receiver)


class Receivers(Feature):
    """Samples lights for the directions that surfaces face."""

    shading = ReceivingShading

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a light is sampled so."""
        return cls() if facts.compiled.lights.takes_receiver else None

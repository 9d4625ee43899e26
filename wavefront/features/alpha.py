"""Alpha: surfaces whose opacity is below 1."""

from __future__ import annotations

from typing import Self

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays
from ..arrays.vec import Bools, Floats, Lanes, take
from ..compile.materials import Opacities, opacity_table
from ..compile.program import Facts, Feature, Passage
from ..compile.scene import CompiledScene


@soa
class Alpha(Feature):
    """Lets a part of the light pass surfaces with an alpha."""

    dims_shadows = True
    spares_opaque = True
    opacities: Opacities

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a surface is not opaque."""
        opacities = opacity_table(facts.materials, facts.has_alpha)
        return None if opacities is None else cls(opacities)

    def passable(self, scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes) -> Bools:
        """Return which of some lanes (k,) hit primitives with an alpha."""
        return self.opacities.has_alpha.take(take(hits.prim, lanes))  # a miss, -1, takes the last entry

    def thin(self, opacity: Floats, passage: Passage) -> None:
        """Multiply the opacities by those of the materials."""
        opacity *= self.opacities.at(passage.surface)

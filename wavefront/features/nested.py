"""Nested priority: where shapes overlap, that of the highest priority hides the surfaces of the others."""

from __future__ import annotations

from typing import Self

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays
from ..arrays.vec import Bools, Floats, Lanes, take
from ..compile.program import Facts, Feature, Passage
from ..compile.scene import CompiledScene
from ..stages.interaction import material_rows
from ..stages.medium import hidden


@soa
class Nested(Feature):
    """Lets rays pass surfaces within something of a higher priority."""

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a material has a priority."""
        media = facts.compiled.media
        return cls() if media is not None and media.nested.any() else None

    def passable(self, scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes) -> Bools:
        """Return which of some lanes (k,) hit such surfaces."""
        covered = hidden(scene, take(rays.media, lanes), material_rows(scene, hits, lanes))
        return covered & (take(hits.prim, lanes) >= 0)

    def thin(self, opacity: Floats, passage: Passage) -> None:
        """Make them clear."""
        opacity[hidden(passage.scene, passage.rays.media, passage.surface.material)] = 0

"""Surfaces that the camera does not see, though they cast shadows and mirrors show them."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays
from ..arrays.vec import Bools, Floats, Lanes, take
from ..compile.program import Facts, Feature, Passage
from ..compile.scene import CompiledScene
from ..stages.interaction import material_rows


@soa
class Unseen(Feature):
    """Lets camera rays pass surfaces that the camera does not see."""

    camera_only = True
    absent: Bools  # (materials,)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a material is not visible to the camera."""
        absent = np.array([not material.visible_to_camera for material in facts.materials], np.bool_)
        return cls(absent) if absent.any() else None

    def passable(self, scene: CompiledScene, rays: Rays, hits: Hits, lanes: Lanes) -> Bools:
        """Return which of some lanes (k,) hit such surfaces."""
        return self.absent.take(material_rows(scene, hits, lanes)) & (take(hits.prim, lanes) >= 0)

    def thin(self, opacity: Floats, passage: Passage) -> None:
        """Make them clear."""
        opacity[self.absent.take(passage.surface.material)] = 0

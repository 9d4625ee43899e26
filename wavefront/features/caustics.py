"""Caustics: light that paths from the camera leave to paths from lights (integrators/light_tracing.py)."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Paths
from ..arrays.vec import Floats, broadcast, take
from ..compile.program import Facts, Feature, Leg
from ..compile.scene import CompiledScene
from ..compile.specular_surfaces import SpecularSurfaces
from ..stages.shade import Shading


class FirstSurfaces(Shading):
    """Surfaces that note whether paths from lights reach them."""

    __slots__ = ()

    def leave(self, paths: Paths, left: Paths, cos_g: Floats, bounce: int) -> None:
        """Note which paths leave their first surface by a lobe that is not a delta lobe.

        Paths from lights know of no directions that go below a triangle (shadow_terminator.py).
        """
        super().leave(paths, left, cos_g, bounce)
        if paths.light_traced is not None:
            left.light_traced = paths.light_traced & (left.exclude_prim == self.surface.prim)
            if bounce == 0:
                left.light_traced &= ~left.specular


@soa
class Caustics(Feature):
    """Leaves out light that paths from lights find."""

    compared = False  # the surfaces follow from the rest, and the setting is compared by itself
    shading = FirstSurfaces
    specular: SpecularSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where light is traced."""
        surfaces = facts.compiled.specular_surfaces
        return None if surfaces is None else cls(surfaces)

    def begin(self, scene: CompiledScene, paths: Paths) -> None:
        """Begin with paths on whose way nothing has stopped paths from lights."""
        paths.light_traced = broadcast(np.True_, len(paths))

    def meet(self, leg: Leg) -> None:
        """Leave out light that specular surfaces send on to first surfaces that are not."""
        emission, traced = leg.emission, leg.paths.light_traced
        assert traced is not None
        lanes = emission.lanes
        left_out = take(traced, lanes) & take(leg.paths.specular, lanes)
        left_out &= self.specular.includes(take(leg.left, lanes)) & (leg.hits.prim.take(lanes) >= 0)
        left_out &= leg.scene.lights.chosen_from.take(emission.light)
        if left_out.any():
            leg.emission = emission.take(np.flatnonzero(~left_out))

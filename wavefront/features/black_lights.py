"""Lights whose surface scatters nothing."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools
from ..compile.program import Facts, Feature, Leg


@soa
class BlackLights(Feature):
    """Ends paths on lights that scatter nothing."""

    compared = False  # they follow from the materials
    black: Bools  # (lights,)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a surface shines and is black."""
        return None if facts.nonscattering_lights is None else cls(facts.nonscattering_lights)

    def meet(self, leg: Leg) -> None:
        """End paths that have met such lights."""
        ends = np.zeros(len(leg.paths), np.bool_)
        ends[leg.emission.lanes.compress(self.black.take(leg.emission.light))] = True
        leg.lanes = leg.lanes.compress(~ends.take(leg.lanes))

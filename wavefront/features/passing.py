"""The way of paths behind surfaces that they pass, and through media: see stages/passing.py."""

from __future__ import annotations

from typing import Self

from ..arrays.soa import soa
from ..compile.program import Facts, Feature, Leg, acts
from ..stages.passing import pass_through


@soa
class Passing(Feature):
    """Moves paths on to the first surface that they hit, or to where a medium scatters them."""

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with surfaces that rays may pass, or with media."""
        features = [*facts.features, *facts.user_features]
        needed = any(acts(feature, point) for feature in features for point in ("passable", "walk"))
        return cls() if needed else None

    def fly(self, leg: Leg) -> None:
        """Move paths on."""
        pass_through(leg)

"""Pixels whose rays miss everything: they show a background, or the backdrop of an environment."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Floats, take
from ..compile.lights import find_backdrop
from ..compile.program import Facts, Feature, Leg
from ..lights import InfiniteLight


@soa
class Backdrop(Feature):
    """Shows the backdrop of an environment in place of its light."""

    camera_only = True
    shown: InfiniteLight

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the backdrop of the lights at infinity; None with a background, which hides it."""
        compiled = facts.compiled
        shown = find_backdrop(facts.scene, compiled.scale, compiled.center, compiled.motion)
        return None if shown is None or facts.asked.get("background") is not None else cls(shown)

    def meet(self, leg: Leg) -> None:
        """Replace the light of camera rays that have missed."""
        lanes = leg.emission.lanes
        missed = np.flatnonzero(take(leg.hits.prim, lanes) < 0)
        radiance = np.array(leg.emission.radiance)
        at, time = lanes.take(missed), leg.paths.time
        radiance[:, missed] = self.shown.le_at(
            take(leg.paths.direction, at), None if time is None else time.take(at)
        )
        leg.emission = replace(leg.emission, radiance=radiance)


@soa
class Background(Feature):
    """Shows a background in place of the light at infinity.

    It is no light: it belongs to no group of lights, and no other path meets it. Media on the way weaken
    it.
    """

    camera_only = True
    color: Floats  # (3, 1)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the background that is asked for."""
        color = facts.asked.get("background")
        return None if color is None else cls(color)

    def meet(self, leg: Leg) -> None:
        """Add the background to the picture, and leave out the environment."""
        missed = np.flatnonzero(leg.hits.prim == -1)
        slot = take(leg.paths.slot, missed)
        arriving = take(leg.paths.throughput, missed) * self.color
        leg.L[:, slot] += arriving
        leg.paths.recorder.record_background(slot, arriving)
        leg.emission = leg.emission.take(np.flatnonzero(take(leg.hits.prim, leg.emission.lanes) >= 0))

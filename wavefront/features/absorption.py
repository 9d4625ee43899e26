"""Absorption by media behind surfaces, where nothing else is within these (compile/absorption.py)."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.elementary import exp
from ..arrays.soa import soa
from ..arrays.state import Hits, SurfaceInteraction
from ..arrays.vec import Floats
from ..compile.materials import absorption_table
from ..compile.program import Facts, Feature


@soa
class Absorption(Feature):
    """Weakens rays that have crossed the medium behind the surface that they hit (Beer and Lambert).

    A ray that meets a surface from its back side has crossed its medium: over a length t the throughput falls
    by exp(−absorption·t).
    """

    per_length: Floats  # (3, materials)

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where media absorb, and need no `MediaTable`."""
        table = absorption_table(facts.materials) if facts.compiled.media is None else None
        return None if table is None else cls(table)

    def weaken(self, throughput: Floats, hits: Hits, surface: SurfaceInteraction) -> None:
        """Weaken those that come from behind their surfaces."""
        lanes = np.flatnonzero(surface.back_facing)
        depth = self.per_length.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
        throughput[:, lanes] *= exp(-depth)

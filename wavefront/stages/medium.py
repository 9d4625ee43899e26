"""Absorption along rays through media."""

from __future__ import annotations

import numpy as np

from ..arrays.elementary import exp
from ..arrays.state import Hits, SurfaceInteraction
from ..arrays.vec import Floats
from ..compile.scene import CompiledScene


def absorb(scene: CompiledScene, throughput: Floats, hits: Hits, surface: SurfaceInteraction) -> None:
    """Attenuate, in place, the throughput of rays that crossed the medium behind the surface that they hit.

    A ray that meets a surface from its back side has crossed its medium: over a length t the
    throughput (3, n) falls by exp(−absorption·t) (Beer and Lambert).
    """
    if scene.absorption is None:
        return
    lanes = np.flatnonzero(surface.back_facing)
    depth = scene.absorption.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
    throughput[:, lanes] *= exp(-depth)

"""What is lost on the way through absorbing matter."""

from __future__ import annotations

import numpy as np

from ..elementary import exp
from ..scene import CompiledScene
from ..state import Hits, Surface
from ..vec import Floats


def absorb(scene: CompiledScene, throughput: Floats, hits: Hits, surface: Surface) -> None:
    """Weaken, in place, what came through the matter behind the surface it hit.

    A ray that meets a surface from its back side has travelled inside it: over a length t the
    throughput (3, n) falls by exp(−absorption·t) (Beer and Lambert).
    """
    if scene.absorption is None:
        return
    lanes = np.flatnonzero(surface.inside)
    depth = scene.absorption.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
    throughput[:, lanes] *= exp(-depth)

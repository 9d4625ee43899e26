"""What is lost on the way through absorbing matter."""

from __future__ import annotations

import numpy as np

from ..compile.scene import CompiledScene
from ..elementary import exp
from ..state import Hits, SurfaceInteraction
from ..vec import Floats


def absorb(scene: CompiledScene, throughput: Floats, hits: Hits, surface: SurfaceInteraction) -> None:
    """Weaken, in place, what came through the matter behind the surface it hit.

    A ray that meets a surface from its back side has traveled inside it: over a length t the
    throughput (3, n) falls by exp(−absorption·t) (Beer and Lambert).
    """
    if scene.absorption is None:
        return
    lanes = np.flatnonzero(surface.back_facing)
    depth = scene.absorption.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
    throughput[:, lanes] *= exp(-depth)

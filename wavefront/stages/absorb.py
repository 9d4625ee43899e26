"""What is lost on the way through absorbing matter."""

from __future__ import annotations

import numpy as np

from ..scene import CompiledScene
from ..state import Hits, Paths, Surface


def absorb(scene: CompiledScene, paths: Paths, hits: Hits, surface: Surface) -> None:
    """Weaken, in place, paths that came through the matter behind the surface they hit.

    A ray that meets a surface from its back side has travelled inside it: over a length t the
    throughput falls by exp(−absorption·t) (Beer and Lambert).
    """
    if scene.absorption is None:
        return
    lanes = np.flatnonzero(surface.inside)
    depth = scene.absorption.take(surface.material.take(lanes), 1) * hits.t.take(lanes)
    paths.throughput[:, lanes] *= np.exp(-depth)

"""The background of a picture in place of what the camera sees of the environment."""

from __future__ import annotations

import numpy as np

from ..compile.scene import CompiledScene
from ..state import Contribution, Hits, Paths
from ..vec import Floats, take


def show_background(
    scene: CompiledScene, L: Floats, paths: Paths, hits: Hits, emission: Contribution
) -> Contribution:
    """Add the background to L in place of the environment, and return the other light that camera rays meet.

    The background is no light: it belongs to no group of lights, and no other path meets it.
    """
    if scene.background is None:
        return emission
    missed = np.flatnonzero(hits.prim < 0)
    slot = take(paths.slot, missed)
    L[:, slot] += scene.background
    if paths.recorder is not None:
        paths.recorder.record_background(slot, scene.background)
    on_surfaces = np.flatnonzero(take(hits.prim, emission.lanes) >= 0)
    return emission.take(on_surfaces)

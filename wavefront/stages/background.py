"""The background of a picture in place of what the camera sees of the environment, and its backdrop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays.state import Contribution, Hits, Paths
from ..arrays.vec import Floats, take
from ..compile.scene import CompiledScene
from ..lights import InfiniteLight


def show_background(
    scene: CompiledScene, L: Floats, paths: Paths, hits: Hits, emission: Contribution
) -> Contribution:
    """Add the background to L in place of the environment, and return the other light that camera rays meet.

    The background is no light: it belongs to no group of lights, and no other path meets it. Of it arrives
    what media on the way have left. The backdrop of an environment is light in place of the environment's.
    """
    if scene.background is None:
        return emission if scene.backdrop is None else _before(scene.backdrop, paths, hits, emission)
    missed = np.flatnonzero(hits.prim == -1)
    slot = take(paths.slot, missed)
    arriving = take(paths.throughput, missed) * scene.background
    L[:, slot] += arriving
    if paths.recorder is not None:
        paths.recorder.record_background(slot, arriving)
    on_surfaces = np.flatnonzero(take(hits.prim, emission.lanes) >= 0)
    return emission.take(on_surfaces)


def _before(backdrop: InfiniteLight, paths: Paths, hits: Hits, emission: Contribution) -> Contribution:
    """Return emission with that of a backdrop where camera rays have missed."""
    missed = np.flatnonzero(take(hits.prim, emission.lanes) < 0)
    radiance = np.array(emission.radiance)
    radiance[:, missed] = backdrop.le(take(paths.direction, emission.lanes.take(missed)))
    return replace(emission, radiance=radiance)

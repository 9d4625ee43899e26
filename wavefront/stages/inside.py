"""The media around the origins of paths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.state import Rays
from ..arrays.vec import Doubles, Floats, f4, take
from ..compile.media import DEPTH, ENTRY
from ..compile.scene import CompiledScene
from .interaction import interaction
from .intersect import intersect
from .medium import crossings
from .transmittance import continue_behind

OUTWARD = np.array([[0.5337], [0.6129], [0.5827]], f4)  # any direction along which nothing is aligned
MOST_SURFACES = 1 << 12  # on the way out of a scene


def stacks_at(scene: CompiledScene, origin: Floats, time: Doubles | None = None) -> Any:
    """Return the stacks (4, n) of points (3, n) at times (n,); None where the scene needs no stacks.

    A ray leads out of the scene from each: shapes that it leaves without having entered them are around the
    point, the innermost first.
    """
    media = scene.media
    if media is None:
        return None
    n = origin.shape[1]
    stack = np.zeros((DEPTH, n), ENTRY)
    low, high = media.bounds[:, :, None].astype(f4)
    lanes = np.flatnonzero(((origin >= low) & (origin <= high)).all(0))
    if not lanes.size:
        return stack
    start = take(origin, lanes)
    alike = time is None and bool((start == start[:, :1]).all())  # such as those of a pinhole camera
    stacks = _enclosing(scene, start[:, :1] if alike else start, None if time is None else time.take(lanes))
    stack[:, lanes] = stacks
    return stack


def _enclosing(scene: CompiledScene, origin: Floats, time: Doubles | None) -> NDArray[Any]:
    """Return the stacks (4, n) of points (3, n) at times (n,), by rays out of the scene."""
    media, n = scene.media, origin.shape[1]
    assert media is not None
    stack, depth = np.zeros((DEPTH + 1, n), ENTRY), np.zeros(n, np.intp)
    open_ = np.zeros((media.priority.size, n), np.int32)  # entered on the way, and not left yet
    outward = np.repeat(OUTWARD / np.sqrt((OUTWARD**2).sum()), n, 1)
    rays = Rays(origin, outward, np.full(n, -1, np.intp), time=time)
    lanes = np.arange(n)
    for _ in range(MOST_SURFACES):
        hits = intersect(scene, rays)
        met = hits.found
        lanes, rays, hits = lanes.take(met), rays.take(met), hits.take(met)
        if not lanes.size:
            break
        surface = interaction(scene, rays, hits)
        for crossing in crossings(scene, surface):
            entry, leaves = np.abs(crossing), crossing < 0
            around = np.flatnonzero(leaves & (open_[entry, lanes] == 0))
            open_[entry, lanes] -= leaves & (open_[entry, lanes] > 0)
            open_[entry, lanes] += crossing > 0
            at = lanes.take(around)
            stack[np.minimum(depth.take(at), DEPTH), at] = entry.take(around)
            depth[at] += 1
        rays = continue_behind(rays, surface)
    return stack[:DEPTH]

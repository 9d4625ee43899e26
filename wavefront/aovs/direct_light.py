"""Direct and indirect light: how deep paths are, for the AOVs "direct" and "indirect"."""

from __future__ import annotations

import numpy as np

from ..arrays.state import BounceDepth, Contribution, Paths
from ..arrays.vec import Bools, Bytes, Floats, Ints, add_to_slots, broadcast, f4, take

# (3, 2) the depth after a scattering, by the depth before it and by whether it is specular
DEPTH_AFTER = np.array(
    [
        [BounceDepth.DIRECT, BounceDepth.CAMERA],
        [BounceDepth.INDIRECT, BounceDepth.INDIRECT],
        [BounceDepth.INDIRECT, BounceDepth.INDIRECT],
    ],
    np.uint8,
)


class DirectLight:
    """The direct light of n samples, (3, n); the rest is indirect."""

    def __init__(self, n: int) -> None:
        self.light = np.zeros((3, n), f4)

    def record(self, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats) -> None:
        """Record light (3, k) that has been added to slots (k,)."""
        assert paths.depth is not None
        if not (paths.depth != BounceDepth.INDIRECT).any():
            return
        lanes = np.flatnonzero(is_direct(paths.depth, contribution))
        if lanes.size == slot.size:
            add_to_slots(self.light, slot, arriving)
        elif lanes.size:
            add_to_slots(self.light, slot.take(lanes), take(arriving, lanes))

    def record_background(self, slot: Ints, color: Floats) -> None:
        """Record light (3, k) of a background that has been added to slots (k,)."""
        self.light[:, slot] += color


def is_direct(depth: Bytes, contribution: Contribution) -> Bools:
    """Return a mask (k,) of the contributions that count for the AOV "direct"."""
    at = take(depth, contribution.lanes)
    return at == BounceDepth.CAMERA if contribution.sampled else at <= BounceDepth.DIRECT


def depth_after(depth: Bytes, specular: Bools) -> Bytes:
    """Return `Paths.depth` (n,) after another scattering, which is specular (n,) or not."""
    n = depth.size
    if n and not (depth.strides[0] or specular.strides[0]):  # alike on all lanes
        return broadcast(depth_after(depth[:1].copy(), specular[:1].copy())[0], n)
    return DEPTH_AFTER[depth, specular.view(np.uint8)]

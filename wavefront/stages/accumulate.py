"""The stage that adds light to the picture."""

from __future__ import annotations

from ..arrays.state import Contribution, Paths
from ..arrays.vec import Floats, add_to_slots, take


def accumulate(L: Floats, paths: Paths, contribution: Contribution) -> None:
    """Add a contribution, times the throughput of its paths, to the slots of L."""
    slot = take(paths.slot, contribution.lanes)
    arriving: Floats = take(paths.throughput, contribution.lanes) * contribution.radiance
    arriving = paths.recorder.clamped(paths, contribution, slot, arriving)
    add_to_slots(L, slot, arriving)
    paths.recorder.record_light(L, paths, contribution, slot, arriving)

"""The light of each group of lights, for the AOV "light_groups" and for lux."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..arrays.state import Contribution, Paths
from ..arrays.vec import Floats, Ints, add_to_slots, f4, take
from ..compile.light_groups import PATCHED, LightGroups


class LightByGroup:
    """The light of each group, (3, n) for n samples.

    Parameters
    ----------
    groups
        The groups.
    n
        Samples of the wave.
    """

    def __init__(self, groups: LightGroups[Any], n: int) -> None:
        self.groups, self.light = groups, np.zeros((len(groups.names), 3, n), f4)

    def items(self) -> Iterator[tuple[Any, Floats]]:
        """Return the names of the groups, and their light (3, n)."""
        return zip(self.groups.names, self.light, strict=True)

    def record(self, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats) -> None:
        """Record light (3, k) of slots (k,); that of a mixed environment is divided among its groups."""
        groups = self.groups
        group = groups.of_light.take(contribution.light)
        toward = contribution.wi
        if toward is None and groups.need_directions:
            toward = take(paths.direction, contribution.lanes)
        if groups.patches is not None:
            assert toward is not None
            group = np.where(group == PATCHED, groups.patches.number(toward), group)
        known = np.flatnonzero(group >= 0)
        if known.size == slot.size:
            self._add(group, slot, arriving)
        elif known.size:
            self._add(group.take(known), slot.take(known), take(arriving, known))
        mixed = np.flatnonzero(group < 0)
        if mixed.size:
            assert toward is not None
            time = None if paths.time is None else paths.time.take(contribution.lanes.take(mixed))
            for name, share in groups.parts_of_environment(take(toward, mixed), time):
                light = self.light[groups.names.index(name)]
                add_to_slots(light, slot.take(mixed), take(arriving, mixed) * share)

    def _add(self, group: Ints, slot: Ints, arriving: Floats) -> None:
        count, channels, n = self.light.shape
        sums = self.light.reshape(count * channels * n)
        for channel, values in enumerate(arriving):
            np.add.at(sums, (group * channels + channel) * n + slot, values)

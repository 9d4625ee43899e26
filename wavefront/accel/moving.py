"""Ray queries where instances move: each ray meets them in their places at its time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints
from ..motion.steps import Motions
from .base import Accelerator, Intersections
from .instances import InstanceAccelerator, Placements


class MovingInstances(InstanceAccelerator):
    """Instances, some of which move, or whose meshes deform; rays have times.

    Parameters
    ----------
    single, meshes
        As of `InstanceAccelerator`. Accelerators of meshes that deform have a method `at`, which binds them
        to the times of rays.
    placements
        Of the instances; the boxes hold all places that they take while the shutter is open.
    motions, mover
        The motions, and which of these each instance (k,) has, -1 for none.
    """

    def __init__(
        self,
        single: Accelerator,
        meshes: Sequence[Any],
        placements: Placements,
        motions: Motions,
        mover: Ints,
    ) -> None:
        super().__init__(single, meshes, placements)
        self._motions, self._mover = motions, mover
        self._deforms = [hasattr(mesh, "at") for mesh in meshes]
        self._time = np.zeros(0)  # of the rays of a query

    def closest(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> Intersections:
        """Return the nearest hits of rays (3, n) at times (n,); by default the middle of the shutter's."""
        return InstanceAccelerator.closest(self._at(exclude_prim, *moment), origin, direction, exclude_prim)

    def occluded(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints, *moment: Doubles
    ) -> Bools:
        """Return a mask (n,): which rays, at times (n,), hit anything at 0 < t < `distance` (n,)."""
        query = self._at(exclude_prim, *moment)
        return InstanceAccelerator.occluded(query, origin, direction, distance, exclude_prim)

    def _at(self, exclude_prim: Ints, time: Doubles | None = None) -> Self:
        """Return the accelerator for rays at times (n,)."""
        query = object.__new__(type(self))  # as `copy` does, which takes ten times as long
        query.__dict__.update(self.__dict__)
        query._time = np.full(exclude_prim.size, self._motions.middle) if time is None else time
        return query

    def _mesh(self, number: int, lanes: Ints) -> Accelerator:
        mesh: Any = self._meshes[number]
        accelerator: Accelerator = mesh.at(self._time.take(lanes)) if self._deforms[number] else mesh
        return accelerator

    def _matrices(self, lane: Ints, instance: Ints) -> Iterable[Doubles | np.float64]:
        mover = self._mover.take(instance)
        moves = np.flatnonzero(mover >= 0)
        if moves.size == lane.size:
            return self._motions.entries(mover, self._time.take(lane))
        matrices = self._still(instance)
        matrices[:, moves] = self._motions.at(mover.take(moves), self._time.take(lane.take(moves)))
        return matrices

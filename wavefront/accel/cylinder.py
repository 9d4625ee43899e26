"""Cylinders as primitives, closed by caps or open."""

from __future__ import annotations

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, length
from ..shapes import Cylinders
from .primitives import first_hit
from .segment import Cut, SegmentPrimitives


@soa
class CylinderPrimitives(SegmentPrimitives):
    """k cylinders."""

    shapes = (Cylinders,)
    round_ends = False

    def distance(self, prim: Ints, origin: Doubles, direction: Doubles, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays (3, n) hit cylinders, inf on a miss.

        A closed cylinder is the intersection of the endless one and the slab between its ends.
        """
        cut = self.cut(prim, origin, direction)
        low, high = self.slab(prim, cut)
        t = first_hit(np.maximum(cut.enter, low), np.minimum(cut.leave, high), leaves)
        open_ = np.flatnonzero(~self.caps.take(prim))
        if open_.size:
            t[open_] = self._open_distance(prim.take(open_), cut.take(open_), leaves.take(open_))
        return t

    def _open_distance(self, prim: Ints, cut: Cut, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays hit the sides of cylinders, from outside or inside."""
        size = self.length.take(prim)

        def on_side(t: Doubles) -> Doubles:
            height = cut.along_origin + t * cut.along_direction
            return np.where((t > 0) & (height >= 0) & (height <= size), t, np.inf)

        outward = leaves & ~(cut.enter + cut.leave > 0)
        near = np.where(leaves, np.inf, on_side(cut.enter))
        return np.where(outward, np.inf, np.minimum(near, on_side(cut.leave)))

    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the outward unit normals (3, n), and move the points onto the side or the cap nearby."""
        from_start, along = self.local(prim, point)
        axis, size, radius = self.axis.take(prim, 1), self.length.take(prim), self.radius.take(prim)
        outward = from_start - along * axis
        away = length(outward)
        side = outward / np.where(away > 0, away, 1)
        upper = along > size / 2
        end = np.where(upper, size, 0)
        on_cap = self.caps.take(prim) & (np.abs(along - end) < np.abs(away - radius))
        normal = np.where(on_cap, np.where(upper, axis, -axis), side)
        height = np.where(on_cap, end, np.clip(along, 0, size))
        self.put_points(prim, height * axis + np.where(on_cap, outward, side * radius), point, error)
        return normal.astype(f4)

"""Capsules as primitives: cylinders with half spheres at their ends."""

from __future__ import annotations

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, length
from ..shapes import Capsules
from .primitives import first_hit
from .segment import SegmentPrimitives
from .sphere import sphere_roots


@soa
class CapsulePrimitives(SegmentPrimitives):
    """k capsules: all points that are within the radius of a segment."""

    shapes = (Capsules,)
    round_ends = True

    def distance(self, prim: Ints, origin: Doubles, direction: Doubles, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays (3, n) hit capsules, inf on a miss.

        A capsule is a cylinder and two whole spheres together, and convex. So a line is inside from where
        it first enters one of the three to where it last leaves one, and there is no seam between them.
        """
        cut = self.cut(prim, origin, direction)
        low, high = self.slab(prim, cut)
        enter, leave = np.maximum(cut.enter, low), np.minimum(cut.leave, high)
        missed = ~(enter <= leave)
        enter[missed] = leave[missed] = np.nan
        start, radius = self.start.take(prim, 1), self.radius.take(prim)
        for middle in (start, start + self.axis.take(prim, 1) * self.length.take(prim)):
            first, second, _ = sphere_roots(middle, radius, origin, direction)
            enter, leave = np.fmin(enter, first), np.fmax(leave, second)
        return first_hit(enter, leave, leaves)

    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the outward unit normals (3, n), and move the points onto the capsules."""
        from_start, along = self.local(prim, point)
        middle = self.axis.take(prim, 1) * np.clip(along, 0, self.length.take(prim))
        outward = from_start - middle
        away = length(outward)
        normal = outward / np.where(away > 0, away, 1)
        self.put_points(prim, middle + normal * self.radius.take(prim), point, error)
        return normal.astype(f4)

"""The contract of an accelerator: the one place where ray queries plug in."""

from __future__ import annotations

from typing import Protocol

from ..record import record
from ..vec import Bools, Floats, Ints


@record
class Geometry:
    """What rays can hit, in float32 relative to the scene's center.

    Primitive ids count the triangles first, then the spheres.
    """

    triangles: Floats  # (m, 3, 3) vertices: triangle, corner, xyz
    centers: Floats  # (3, k) sphere centers
    radii: Floats  # (k,) sphere radii
    weights: bool = True  # whether barycentric weights are needed; without them b1 and b2 are 0
    # (m,) whether a triangle and the next look the same all over, so that a hit of a flat quadrilateral of
    # both may name either; without it none do
    interchangeable: Bools | None = None


@record
class Intersections:
    """The nearest surface along each ray."""

    t: Floats  # (n,) distance along the direction, inf on a miss
    prim: Ints  # (n,) primitive id, -1 on a miss
    b1: Floats  # (n,) barycentric weight of the second vertex; 0 on spheres
    b2: Floats  # (n,) barycentric weight of the third vertex; 0 on spheres


class Accelerator(Protocol):
    """Answers ray queries. Results are the same bits for any batch size or order of rays."""

    name: str

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n); ties go to the lowest id.

        `exclude_prim` (n,) names the primitive each ray starts on, -1 for none: a triangle is not hit
        again by the ray that leaves it, and of a sphere only the far side can be. Two triangles that
        make one flat quadrilateral may count as one there.
        """

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""

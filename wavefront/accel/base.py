"""The interface of accelerators: all ray queries of a render go through it."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol

from ..arrays.soa import soa
from ..arrays.vec import Bools, Floats, Ints
from .primitives import CurvedPrimitives


@soa
class Geometry:
    """The geometry that rays can hit, in float32 relative to the scene's center.

    Primitive ids number the triangles first, then the curved primitives of each kind.

    Examples
    --------
    >>> triangle = np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]], np.float32)
    >>> wf.Geometry(triangle).count
    1
    """

    triangles: Floats  # (m, 3, 3) vertices: triangle, corner, xyz
    curved: tuple[CurvedPrimitives, ...] = ()  # spheres and others, one element per kind
    weights: bool = True  # whether barycentric weights are needed; without them b1 and b2 are 0
    # (m,) whether a triangle and the next one have the same material, light and attributes everywhere, so
    # that either id may be reported for a hit of their flat quadrilateral; None: no triangles
    interchangeable: Bools | None = None

    @property
    def count(self) -> int:
        """Number of primitives."""
        return len(self.triangles) + sum(map(len, self.curved))


@soa
class Intersections:
    """The nearest hit of each ray.

    Examples
    --------
    >>> f4 = np.float32
    >>> miss = wf.Intersections(np.full(2, np.inf, f4), np.full(2, -1), np.zeros(2, f4), np.zeros(2, f4))
    >>> miss.prim
    array([-1, -1])
    """

    t: Floats  # (n,) distance along the direction, inf on a miss
    prim: Ints  # (n,) primitive id, -1 on a miss
    b1: Floats  # (n,) barycentric weight of the second vertex; 0 on curved primitives
    b2: Floats  # (n,) barycentric weight of the third vertex; 0 on curved primitives


class Accelerator(Protocol):
    """The interface of ray queries. Results do not depend on the size of a batch or the order of its rays.

    Examples
    --------
    >>> from wavefront.accel.numpy_accel import NumpyAccelerator
    >>> triangle = np.array([[(-1, -1, 0), (1, -1, 0), (0, 1, 0)]], np.float32)
    >>> accelerator = NumpyAccelerator(wf.Geometry(triangle))
    >>> origin, direction = np.float32([[0], [0], [3]]), np.float32([[0], [0], [-1]])
    >>> accelerator.closest(origin, direction, np.array([-1])).t
    array([3.], dtype=float32)
    """

    name: str  # in the metadata of pictures

    @abstractmethod
    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0; at equal t the lowest primitive id.

        `exclude_prim` (n,) is the primitive that each ray starts on, -1 for none. A ray does not hit the
        triangle that it starts on, and hits a sphere or another curved primitive that it starts on only on
        the far side. Two triangles that form one flat quadrilateral may be excluded together.
        """

    @abstractmethod
    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""

"""A plate beside everything else: its plane by arithmetic, and a ball that spares rays the search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, column, dot, f4, take
from ..shapes.plate import EDGES, FACES, PATCHES
from .base import Accelerator, Geometry, Intersections
from .triangle import ROUNDOFF

MARGIN = f4(64 * ROUNDOFF)  # of squared lengths, more than all rounding errors together
EVEN = 16 * ROUNDOFF  # deviation of corners from those of a plate, relative to coordinates


@soa
class Plate:
    """A square of patches, as `shapes.plate` makes it."""

    center: Doubles  # (3,)
    normal: Doubles  # (3,) unit
    axes: Doubles  # (2, 3) along the sides, over half of their length squared: from the center to [-1, 1]

    @classmethod
    def of(cls, triangles: Floats) -> Self | None:
        """Return the plate that triangles (m, 3, 3) form, which are its patches in order; None for others."""
        if len(triangles) != FACES:
            return None
        corners = triangles.astype(np.float64)
        low, right, top = (
            corners[0, 0],
            corners[2 * PATCHES - 2, 1],
            corners[2 * PATCHES * (PATCHES - 1) + 1, 2],
        )
        u, v = (right - low) / 2, (top - low) / 2
        center, length2, slack = low + u + v, u @ u, EVEN * np.abs(corners).max()
        ideal = center + _places() @ np.stack([u, v])
        uneven = max(np.abs(corners - ideal).max(), abs(u @ v) / np.sqrt(length2 or 1))
        if not (length2 > 0 and uneven <= slack and abs(length2 - v @ v) <= slack * np.sqrt(length2)):
            return None
        normal = np.cross(u, v)
        return cls(center, normal / np.linalg.norm(normal), np.stack([u, v]) / length2)


def _places() -> Doubles:
    """Return where the corners of a plate's triangles are, (FACES, 3, 2), from -1 to 1."""
    patch, second = np.arange(FACES) // 2, np.arange(FACES) % 2
    i, j = patch % PATCHES, patch // PATCHES
    across = np.stack([i, i + 1, i + 1 - second], 1)
    down = np.stack([j, j + second, j + 1], 1)
    return np.array(EDGES)[np.stack([across, down], 2)]


class PlateAccelerator:
    """Traces a plate by arithmetic, and passes on those rays that come near everything else.

    Parameters
    ----------
    rest
        Of all primitives but those of the plate, which are the last: `triangles` (m, 3, 3).
    opaque
        Whether all of those are opaque.
    """

    def __init__(self, rest: Accelerator, triangles: Floats, plate: Plate, opaque: bool) -> None:
        self.name, self.rest, self.plate, self.opaque = rest.name, rest, plate, opaque
        self.first = len(triangles)  # primitive of the plate
        corners = triangles.reshape(-1, 3).astype(np.float64)
        middle = (corners.min(0) + corners.max(0)) / 2
        self._middle = column(middle)
        radius2 = ((corners - middle) ** 2).sum(1).max()
        self._radius2 = f4(radius2 * (1 + 1e-5))  # more, by the rounding of the middle
        self._normal, self._height = plate.normal.astype(f4), f4(plate.center @ plate.normal)
        self._axes, self._at = plate.axes.astype(f4), (plate.axes @ plate.center).astype(f4)

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of rays (3, n) with t > 0."""
        hits = self._closest_of_rest(origin, direction, exclude_prim)
        t = self._distance(origin, direction, exclude_prim)
        lanes = np.flatnonzero(t < hits.t)
        t = t.take(lanes)
        a, b = self._place(take(origin, lanes), take(direction, lanes), t)
        inside = np.flatnonzero(_within(a, b))
        if inside.size < lanes.size:
            lanes = lanes.take(inside)
            t, a, b = (x.take(inside) for x in (t, a, b))
        hits.t[lanes] = t
        face, hits.b1[lanes], hits.b2[lanes] = _face(a, b)
        hits.prim[lanes] = face + self.first
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        blocked, plate = self._blockers(origin, direction, distance, exclude_prim)
        blocked[plate] = True
        return blocked

    def surely_occluded(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints
    ) -> tuple[Bools, Bools]:
        """Return which rays hit something opaque, (n,), and which others may be blocked, (n,)."""
        blocked, plate = self._blockers(origin, direction, distance, exclude_prim)
        met = np.zeros_like(blocked) if self.opaque else blocked.copy()
        met[plate] = True
        return blocked & ~met, met

    def _blockers(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints
    ) -> tuple[Bools, Ints]:
        """Return which rays hit the rest (n,), and the lanes (k,) of others that hit the plate."""
        blocked = np.zeros(distance.size, np.bool_)
        near = self._near(origin, direction)
        if near.size:
            rays = take(origin, near), take(direction, near), take(distance, near)
            blocked[near] = self.rest.occluded(*rays, self._left(exclude_prim, near))
        t = self._distance(origin, direction, exclude_prim)
        lanes = np.flatnonzero((t < distance) & ~blocked)
        a, b = self._place(take(origin, lanes), take(direction, lanes), t.take(lanes))
        return blocked, lanes.compress(_within(a, b))

    def _closest_of_rest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        n, near = origin.shape[1], self._near(origin, direction)
        hits = Intersections(np.full(n, np.inf, f4), np.full(n, -1), np.zeros(n, f4), np.zeros(n, f4))
        if near.size:
            rest_hits = self.rest.closest(
                take(origin, near), take(direction, near), self._left(exclude_prim, near)
            )
            hits.t[near], hits.prim[near], hits.b1[near], hits.b2[near] = (
                rest_hits.t,
                rest_hits.prim,
                rest_hits.b1,
                rest_hits.b2,
            )
        return hits

    def _left(self, exclude_prim: Ints, lanes: Ints) -> Ints:
        """Return the primitives of the rest that rays start on, -1 for none."""
        left = take(exclude_prim, lanes)
        return np.where(left < self.first, left, -1)

    def _near(self, origin: Floats, direction: Floats) -> Ints:
        """Return the lanes (k,) of rays (3, n) that may hit the rest: those that meet its ball."""
        away = origin - self._middle
        distance2, along = dot(away, away), dot(away, direction)
        slack = MARGIN * distance2
        outside = distance2 - slack - self._radius2  # above 0: the ray starts outside
        with np.errstate(all="ignore"):  # lanes with NaN are kept
            misses = outside * dot(direction, direction) > along * along * f4(1 + 2**-18)
            misses |= (outside > 0) & (along > 0)
        return np.flatnonzero(~misses)

    def _distance(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Floats:
        """Return the distances (n,) of rays (3, n) to the plane; inf where they leave it or miss it."""
        with np.errstate(all="ignore"):
            t = (self._height - _along(self._normal, origin)) / _along(self._normal, direction)
            t[~(t > 0) | (exclude_prim >= self.first)] = np.inf
        return t

    def _place(self, origin: Floats, direction: Floats, t: Floats) -> tuple[Floats, Floats]:
        """Return where rays (3, k) cross the plane, (k,) along each side, on the plate from -1 to 1."""
        point = origin + direction * t
        a, b = (_along(axis, point) - at for axis, at in zip(self._axes, self._at, strict=True))
        return a, b


def _along(axis: Floats, v: Floats) -> Floats:
    """Return axis·v (n,); along an axis of space it is one component, times its length."""
    parts = [axis[k] * v[k] for k in range(3) if axis[k]]
    return sum(parts[1:], parts[0])


def _within(a: Floats, b: Floats) -> Bools:
    return np.maximum(np.abs(a), np.abs(b)) <= 1


def _face(a: Floats, b: Floats) -> tuple[Ints, Floats, Floats]:
    """Return the triangle of a plate at places a, b (k,), and the weights of its second and third corner."""
    edges = np.array(EDGES, f4)
    i, j = (np.add(x > edges[1], x > edges[2], dtype=np.intp) for x in (a, b))
    per_patch = f4(1) / np.diff(edges)
    x, y = (a - edges.take(i)) * per_patch.take(i), (b - edges.take(j)) * per_patch.take(j)
    second = y > x
    return 2 * (j * PATCHES + i) + second, np.where(second, x, x - y), np.where(second, y - x, y)


def beside_plate(
    make: Callable[[Geometry], Accelerator], geometry: Geometry, has_alpha: Bools
) -> Accelerator:
    """Build an accelerator; where the last triangles form a plate beside others, arithmetic traces it.

    There are no curved primitives beside it: the ball is of triangles. `has_alpha` (m,) says which triangles
    are not opaque.
    """
    m = len(geometry.triangles) - FACES
    plate = None if m <= 0 or any(map(len, geometry.curved)) else Plate.of(geometry.triangles[m:])
    if plate is None:
        return make(geometry)
    same = geometry.interchangeable
    rest = replace(
        geometry, triangles=geometry.triangles[:m], interchangeable=None if same is None else same[:m]
    )
    return PlateAccelerator(make(rest), rest.triangles, plate, not has_alpha[:m].any())


def surely_occluded(
    accelerator: Accelerator,
    origin: Floats,
    direction: Floats,
    distance: Floats,
    exclude_prim: Ints,
    *moment: Doubles,
) -> tuple[Bools, Bools]:
    """Return which rays (3, n) hit something opaque, (n,), and which others may be blocked, (n,).

    Accelerators that do not know opaque primitives leave all rays that hit anything.
    """
    rays: tuple[Any, ...] = (origin, direction, distance, exclude_prim, *moment)
    ask = getattr(accelerator, "surely_occluded", None)
    if ask is None:
        met = accelerator.occluded(*rays)
        return np.zeros_like(met), met
    blocked, met = ask(*rays)
    return blocked, met

"""The curved primitives of a scene: spheres and others, kind by kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..accel import KINDS, CurvedPrimitives, kind_of
from ..arrays.soa import soa
from ..arrays.vec import ALL, Doubles, Floats, Ints, Lanes, f4, put, take
from ..shapes import CurvedShape


def order_by_kind(shapes: Sequence[CurvedShape], moves: Sequence[bool]) -> list[int]:
    """Return the indices of shapes in the order of the table of kinds, and of one kind in their own order.

    Those that move come last.
    """
    kinds = [(moving, KINDS.index(kind_of(shape))) for shape, moving in zip(shapes, moves, strict=True)]
    return sorted(range(len(shapes)), key=kinds.__getitem__)


@soa
class CurvedTable:
    """All curved primitives, numbered from 0 on."""

    kinds: tuple[CurvedPrimitives, ...]
    first: tuple[int, ...]  # number of the first primitive of each kind
    colors: Floats | None  # (4, k) linear RGB and opacity; None if all are opaque white

    @classmethod
    def of(cls, shapes: Sequence[CurvedShape], center: Doubles, moving: int = 0) -> CurvedTable:
        """Return the primitives of shapes, which `order_by_kind` has ordered, relative to `center` (3,).

        Each of the last `moving` shapes is a kind by itself.
        """
        members: dict[type[CurvedPrimitives], list[CurvedShape]] = {}
        still = len(shapes) - moving
        for shape in shapes[:still]:
            members.setdefault(kind_of(shape), []).append(shape)
        groups = [*members.items(), *((kind_of(shape), [shape]) for shape in shapes[still:])]
        kinds = tuple(kind.from_shapes(group, center) for kind, group in groups)
        ends = np.cumsum([len(kind) for kind in kinds], dtype=np.intp)
        colors = None
        if any(shape.colors is not None for shape in shapes):
            rows = [np.ones((s.count, 4)) if s.colors is None else s.colors for s in shapes]
            colors = np.ascontiguousarray(np.concatenate(rows).T, f4)
        return cls(kinds, tuple(ends - [len(kind) for kind in kinds]), colors)

    def __len__(self) -> int:
        """Return the number of primitives."""
        return sum(map(len, self.kinds))

    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the outward unit normals (3, n) at hit points (3, n) of primitives (n,).

        Points are moved onto the surface, and their error bounds (n,) corrected, in place.
        """
        if len(self.kinds) == 1:
            return self.kinds[0].surface(prim, point, error)
        normal = np.empty_like(point)
        for kind, lanes, number in self._by_kind(prim):
            points, bound = take(point, lanes), take(error, lanes)
            put(normal, lanes, kind.surface(number, points, bound))
            put(point, lanes, points)
            error[lanes] = bound
        return normal

    @property
    def shading_normals(self) -> bool:
        """Whether any shading normals may differ from the normals of the surface."""
        return any(kind.shading_normals for kind in self.kinds)

    def shading(self, prim: Ints, point: Floats, normal: Floats) -> Floats:
        """Return shading normals (3, n), given those of the surface (3, n)."""
        values = np.empty_like(normal)
        for kind, lanes, number in self._by_kind(prim):
            values[:, lanes] = kind.shading(number, take(point, lanes), take(normal, lanes))
        return values

    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return texture coordinates, (2, n)."""
        values = np.empty((2, prim.size), f4)
        for kind, lanes, number in self._by_kind(prim):
            values[:, lanes] = kind.uv(number, take(point, lanes))
        return values

    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return the derivatives of the point by `uv`, (6, n)."""
        values = np.empty((6, prim.size), f4)
        for kind, lanes, number in self._by_kind(prim):
            values[:, lanes] = kind.dpduv(number, take(point, lanes))
        return values

    def color(self, prim: Ints, point: Floats) -> Floats:
        """Return linear RGB and opacity, (4, n)."""
        return np.ones((4, prim.size), f4) if self.colors is None else self.colors.take(prim, 1)

    def _by_kind(self, prim: Ints) -> Iterator[tuple[CurvedPrimitives, Lanes, Ints]]:
        """Yield the kinds, with their lanes and numbers within the kind."""
        for kind, first in zip(self.kinds, self.first, strict=True):
            if len(self.kinds) == 1:
                yield kind, ALL, prim
                continue
            lanes = np.flatnonzero((prim >= first) & (prim < first + len(kind)))
            if lanes.size:
                yield kind, lanes, prim.take(lanes) - first

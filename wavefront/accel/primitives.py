"""The contract of primitives: what rays can hit, triangles and curved surfaces alike.

The primitives of one kind are tested together. A kind says where its primitives are (`bounds`, `hull`),
rules out most pairs of ray and primitive by one matrix product in float32 (`filter_rows`, `features`,
`values`), and decides the rest in float64 (`tests`). A curved kind also gives the surface data at hits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from ..arrays.state import SoA
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, length
from ..shapes import CurvedShape
from .bvh import Ball, RayBatch
from .hits import HitAccumulator


class PrimitiveTests(Protocol):
    """Tests of one batch of rays against primitives of one kind."""

    def add(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Test pairs that the filter has not ruled out: primitives (k,), lanes (k,), and its values (k,)."""

    def finish(self) -> None:
        """Test the remaining candidates."""


class Primitives(SoA, ABC):
    """k primitives of one kind, in float32 relative to the scene's center."""

    rows: ClassVar[int] = 1  # rows of the filter for each primitive

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of primitives."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners of the primitives' boxes, (3, k) each."""

    def hull(self) -> Floats:
        """Return points (corners, 3, k) whose convex hull holds each primitive: by default, its box."""
        low, high = self.bounds
        upper = np.stack(np.meshgrid(*[[False, True]] * 3), -1).reshape(8, 3, 1)
        return np.where(upper, high, low)

    @abstractmethod
    def filter_rows(self, ball: Ball) -> Floats:
        """Return the rows (rows, k, columns) that the features of lines are multiplied by."""

    @abstractmethod
    def features(self, line: Floats, ball: Ball) -> Floats:
        """Return numbers (columns, n) of lines, given by Plücker coordinates (6, n) about the ball's center.

        They are NaN where a line is.
        """

    def values(self, products: Floats, out: Floats) -> Floats:
        """Reduce products (b, rows, k, n) to values (b, k, n): below -1 only where a line misses."""
        return products[:, 0]

    @abstractmethod
    def tests(self, batch: RayBatch, accumulator: HitAccumulator, first: int) -> PrimitiveTests:
        """Return the exact tests of a batch; hits are added to `accumulator`, with ids from `first` on."""


class CurvedPrimitives(Primitives):
    """k primitives of one kind that are not triangles."""

    shapes: ClassVar[tuple[type[CurvedShape], ...]]  # the shapes that are made of such primitives
    shading_normals: ClassVar[bool] = False  # whether these may differ from the normals of the surface

    @property
    def balls(self) -> tuple[Floats, Floats]:
        """Centers (3, k) and radii (k,) of balls around the primitives: by default, around their boxes."""
        low, high = self.bounds
        center = (low + high) / 2
        return center, length(np.maximum(high - center, center - low)) * f4(1 + 2.0**-20)

    @classmethod
    @abstractmethod
    def from_shapes(cls, shapes: Sequence[Any], center: Doubles) -> Self:
        """Return the primitives of shapes, one after the other, relative to `center` (3,)."""

    @abstractmethod
    def distance(self, prim: Ints, origin: Doubles, direction: Doubles, leaves: Bools) -> Doubles:
        """Return the least t > 0 (n,) at which rays (3, n) hit primitives `prim` (n,), inf on a miss.

        A ray that starts on its primitive (`leaves`) has one hit at about 0, which does not count.
        """

    @abstractmethod
    def surface(self, prim: Ints, point: Floats, error: Floats) -> Floats:
        """Return the outward unit normals (3, n) at hit points (3, n).

        Points are moved onto the surface, and their error bounds (n,) corrected, in place.
        """

    def shading(self, prim: Ints, point: Floats, normal: Floats) -> Floats:
        """Return unit shading normals (3, n) at points of the surface, given its normals (3, n)."""
        return normal

    @abstractmethod
    def uv(self, prim: Ints, point: Floats) -> Floats:
        """Return texture coordinates (2, n) at points of the surface."""

    @abstractmethod
    def dpduv(self, prim: Ints, point: Floats) -> Floats:
        """Return the derivatives of the point by `uv`, (6, n); 0 where there are none."""

    def tests(self, batch: RayBatch, accumulator: HitAccumulator, first: int) -> CurvedTests:
        """Return tests by `distance`."""
        return CurvedTests(self, batch, accumulator, first)


class CurvedTests:
    """Tests of one batch of rays by the `distance` of their primitives."""

    def __init__(
        self, primitives: CurvedPrimitives, batch: RayBatch, accumulator: HitAccumulator, first: int
    ) -> None:
        self.primitives, self.batch, self.accumulator, self.first = primitives, batch, accumulator, first

    def add(self, prim: Ints, lane: Ints, value: Floats) -> None:
        """Test primitives (k,) and lanes (k,)."""
        origin = self.batch.origin.take(lane, 1).astype(np.float64)
        direction = self.batch.direction.take(lane, 1).astype(np.float64)
        ids = prim + self.first
        leaves = self.batch.exclude_prim.take(lane) == ids
        self.accumulator.add(lane, ids, self.primitives.distance(prim, origin, direction, leaves))

    def finish(self) -> None:
        """Everything has been tested."""


def first_hit(first: Doubles, second: Doubles, leaves: Bools) -> Doubles:
    """Return the hit that counts (n,), inf for none, of lines that are inside from `first` to `second` (n,).

    A ray that leaves the surface starts at one of the two, up to rounding; the other one counts. NaN is a
    miss.
    """
    t = np.where(leaves | ~(first > 0), second, first)
    counts = (first <= second) & (t > 0) & ~(leaves & ~(first + second > 0))
    return np.where(counts, t, np.inf)

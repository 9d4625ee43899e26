"""Rays as lines: Plücker coordinates about the middle of the scene, in float32."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vec import Floats, Ints, f4
from .scratch import scratch
from .triangle import Doubles


@dataclass(slots=True)
class Ball:
    """A ball around everything that can be hit."""

    center: Floats  # (3,) float32
    radius: float


def bounding_ball(low: Floats, high: Floats) -> Ball:
    """Return a ball around boxes `low`, `high` (3, m)."""
    lowest, highest = low.min(1).astype(np.float64), high.max(1).astype(np.float64)
    center = ((lowest + highest) / 2).astype(f4)
    reach = np.maximum(highest - center, center - lowest)
    return Ball(center, max(float(np.sqrt((reach * reach).sum())) * (1 + 1e-6), 1e-37))


@dataclass
class Lanes:
    """A batch of n rays, as given."""

    origin: Floats  # (3, n)
    direction: Floats  # (3, n)
    leaving: Ints  # (n,)
    ball: Ball
    distance: Floats | None = None  # (n,) where they end

    @property
    def count(self) -> int:
        """Number of rays."""
        return self.origin.shape[1]

    def part(self, which: slice) -> Lanes:
        """Return some of the rays."""
        distance = None if self.distance is None else self.distance[which]
        return Lanes(
            self.origin[:, which], self.direction[:, which], self.leaving[which], self.ball, distance
        )

    @cached_property
    def lines(self) -> Lines:
        """Their lines, in work space that the lines of other rays will overwrite."""
        return _lines(self)


@dataclass
class Lines:
    """The lines of n rays, relative to the centre of a ball."""

    plucker: Floats  # (6, n + 1) unit direction d, then (o - center) × d; the last is NaN
    speed: Floats  # (n,) length of the direction as given
    local: Floats | Doubles  # (3, n) o - center
    start: Floats | None  # (4, n) o - center, 1; None if some origin is far away
    end: Floats | None  # (4, n) the same of where rays end; None if they have no end, or start is None

    @cached_property
    def begin(self) -> Floats | Doubles:
        """Where rays start (n,), as a distance from the point next to the centre."""
        x, y, z = self.local
        ux, uy, uz = self.plucker[:3, :-1]
        return x * ux + y * uy + z * uz


def _lines(rays: Lanes) -> Lines:
    """Compute the lines of rays.

    They are float32 while all origins are within two radii. Beyond, o - center loses what matters, and
    they are computed in float64.
    """
    n, ball, direction = rays.count, rays.ball, rays.direction
    start = scratch("start", (4, n))
    start[3] = 1
    local = np.subtract(rays.origin, ball.center[:, None], out=start[:3])
    furthest = np.maximum(local.max(initial=0), -local.min(initial=0))
    work = np.multiply(direction, direction, out=scratch("work", (3, n)))
    speed = np.add(work[0], work[1], out=scratch("speed", (n,)))
    speed += work[2]
    np.sqrt(speed, out=speed)
    line = scratch("line", (6, n + 1))
    line[:, -1] = np.nan
    unit, moment = line[:3, :-1], line[3:, :-1]
    np.divide(direction, speed, out=unit)
    if not float(furthest) * 3**0.5 <= 2 * ball.radius:
        wide = scratch("wide", (6, n), np.float64)
        far = np.subtract(rays.origin, ball.center[:, None], out=wide[:3], dtype=np.float64)
        _cross(far, direction, moment, wide[3:])
        moment /= speed
        np.multiply(moment, moment, out=work)
        # A line that passes the ball by meets nothing, and the filters do not allow for its rounding.
        line[:, np.flatnonzero(work[0] + work[1] + work[2] > (1.01 * ball.radius) ** 2)] = np.nan
        return Lines(line, speed, far, None, None)
    _cross(local, unit, moment, work)
    return Lines(line, speed, local, start, _ends(rays, local, speed))


def _ends(rays: Lanes, local: Floats, speed: Floats) -> Floats | None:
    """Where rays end, (4, n): o - center and 1; None if they have no end, or where it cannot be told."""
    if rays.distance is None:
        return None
    length = np.divide(f4(3.01 * rays.ball.radius), speed, out=scratch("length", speed.shape))
    np.minimum(rays.distance, length, out=length)
    np.maximum(length, f4(0), out=length)
    end = scratch("end", (4, speed.size))
    end[3] = 1
    np.multiply(rays.direction, length, out=end[:3])
    end[:3] += local
    return end if np.isfinite(end.max(initial=0) + speed.max(initial=0)) else None


def _cross(a: NDArray[Any], b: NDArray[Any], out: Floats, work: NDArray[Any]) -> None:
    """Cross products of vectors (3, n), in work space (2, n) or more."""
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=work[0])
        np.multiply(a[j], b[i], out=work[1])
        np.subtract(work[0], work[1], out=out[axis], casting="same_kind")

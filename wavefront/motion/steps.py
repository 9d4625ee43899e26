"""Motions while a shutter is open: matrices at evenly spaced times, and between these by linear steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints

Matrices = Callable[[Doubles], Doubles]  # from times (n,) to matrices (n, 4, 4)

ERROR = 2.0**-20  # of places, relative to the size of what is placed: what linear steps may leave out
LEAST_SCALE = 1e-9  # of what a motion flattens, relative to its greatest
MOST_STEPS = 1 << 12
MOST_MATRICES = 1 << 17  # of all motions; many motions have fewer steps
# parts of a step after which it is tested: uneven, so that whole turns are not taken for rest
PARTS = np.array([0.2113, 0.5309, 0.7927])
UNEVEN = 64  # further times at which all steps are tested, by the golden ratio
GOLDEN = (5**0.5 - 1) / 2
NO_KEYS = np.zeros(0)


@soa
class Motions:
    """m motions while a shutter is open, as matrices from the scene to what moves.

    Between two of the evenly spaced times each matrix goes over to the next one linearly. A translation of
    constant velocity is exact so, with one step.
    """

    begin: float  # when the shutter opens, s
    seconds: float  # how long it is open
    steps: int
    to_local: Doubles  # (12, m * (steps + 1)) the (3, 4) matrices, row by row

    @classmethod
    def of(
        cls, motions: Sequence[Matrices], begin: float, end: float, reach: Doubles, keys: Doubles = NO_KEYS
    ) -> Self:
        """Return motions as tables of as many steps as they need.

        Parameters
        ----------
        motions
            For each of m, a function from times (n,) to matrices (n, 4, 4) to the scene.
        reach
            (m,) how far from the origin of its own coordinates each reaches.
        keys
            (k,) times at which they may go another way, s.
        """
        most = min(MOST_STEPS, max(MOST_MATRICES // len(motions), 1))
        bends, steps = _bends(keys, begin, end, 4 * most), 1
        while True:
            to_local = _inverse(_placed(motions, np.linspace(begin, end, steps + 1)))
            found = cls(begin, end - begin, steps, np.ascontiguousarray(to_local.reshape(-1, 12).T))
            if steps >= most:
                return found
            between = begin + (end - begin) * ((np.arange(steps)[:, None] + PARTS) / steps).ravel()
            tests = np.concatenate([between, bends])
            if found._error(tests, _placed(motions, tests), reach) <= ERROR:
                return found
            steps *= 2

    def _error(self, times: Doubles, placed: Doubles, reach: Doubles) -> float:
        """Return the error of places at times (k,), relative to the size of what is placed.

        It is of places at most `reach` (m,) from the origins of their coordinates: where the matrices take
        them that `placed` (m, k, 4, 4) has put into the scene.
        """
        rows, there = np.arange(len(placed)).repeat(times.size), placed[:, :, :3]
        back = self.at(rows, np.tile(times, len(placed))).T.reshape(there.shape)
        turned, shifted = back[..., :3] @ there[..., :3] - np.eye(3), back[..., :3] @ there[..., 3:]
        off = np.sqrt(((shifted[..., 0] + back[..., 3]) ** 2).sum(-1))
        worst = (np.sqrt((turned**2).sum((-1, -2))) * reach[:, None] + off).max(1)
        scale = np.sqrt((there[..., :3] ** 2).sum((-1, -2)) / 3).max(1)
        size = reach + np.ptp(there[..., 3], axis=1).max(1) / scale
        return float((worst / np.where(size > 0, size, 1)).max())

    def at(self, number: Ints, time: Doubles) -> Doubles:
        """Return the (3, 4) matrices of some motions (n,) at times (n,), row by row, (12, n)."""
        place = np.clip((time - self.begin) * (self.steps / self.seconds), 0, self.steps)
        step = np.minimum(place.astype(np.intp), self.steps - 1)
        part = place - step
        row = number * (self.steps + 1) + step
        before = self.to_local.take(row, 1)
        after = self.to_local.take(row + 1, 1)
        after -= before
        after *= part
        return np.add(before, after, out=after)

    @property
    def middle(self) -> float:
        """The middle of the time for which the shutter is open."""
        return self.begin + self.seconds / 2

    def times(self, count: int) -> list[float]:
        """Return times evenly spaced while the shutter is open, with both ends."""
        found: list[float] = np.linspace(self.begin, self.begin + self.seconds, count).tolist()
        return found


def _bends(keys: Doubles, begin: float, end: float, most: int) -> Doubles:
    """Return keys between two times, the middles between them, and uneven times; at most so many of each."""
    inside = np.unique(keys[(keys > begin) & (keys < end)])
    inside = inside[:: max(-(-inside.size // most), 1)]
    ends = np.concatenate([[begin], inside, [end]])
    uneven = begin + (end - begin) * (np.arange(1, min(UNEVEN, most) + 1) * GOLDEN % 1)
    return np.concatenate([inside, (ends[1:] + ends[:-1]) / 2, uneven])


def _placed(motions: Sequence[Matrices], times: Doubles) -> Doubles:
    """Return the matrices (m, k, 4, 4) of motions at times (k,), such that they can be inverted."""
    placed = np.stack([motion(times) for motion in motions])
    placed[:, :, :3, :3] = _thickened(placed[:, :, :3, :3])
    return placed


def _inverse(placed: Doubles) -> Doubles:
    """Return the inverses (m, k, 3, 4) of affine matrices (m, k, 4, 4)."""
    return np.asarray(np.linalg.inv(placed)[:, :, :3], np.float64)


def _thickened(linear: Doubles) -> Doubles:
    """Return linear parts (m, k, 3, 3) that can be inverted: what is flattened stays very thin."""
    u, scales, v = np.linalg.svd(linear)
    thin = np.maximum(scales, LEAST_SCALE * scales.max((1, 2), keepdims=True))
    flat = (thin > scales).any(2)
    found = linear.copy()
    found[flat] = (u[flat] * thin[flat][:, None]) @ v[flat]
    return found


def applied(matrix: Doubles, points: Floats | Doubles) -> Doubles:
    """Return points (3, n), each transformed by a (3, 4) matrix, given row by row, (12, n)."""
    x, y, z = points
    m = matrix
    return np.stack([m[i] * x + m[i + 1] * y + m[i + 2] * z + m[i + 3] for i in (0, 4, 8)])


def turned(matrix: Doubles, vectors: Floats | Doubles) -> Doubles:
    """Return vectors (3, n), each transformed by the linear part of a (3, 4) matrix, (12, n)."""
    x, y, z = vectors
    m = matrix
    return np.stack([m[i] * x + m[i + 1] * y + m[i + 2] * z for i in (0, 4, 8)])


def transposed_turned(matrix: Doubles, vectors: Floats | Doubles) -> Doubles:
    """Return vectors (3, n), each by the transposed linear part of a (3, 4) matrix, (12, n)."""
    x, y, z = vectors
    m = matrix
    return np.stack([m[i] * x + m[i + 4] * y + m[i + 8] * z for i in (0, 1, 2)])


def transposed_times(linear: Doubles, vectors: Floats | Doubles) -> Doubles:
    """Return vectors (3, n), each by a transposed (3, 3) matrix, given row by row, (9, n)."""
    x, y, z = vectors
    return np.stack([linear[i] * x + linear[i + 3] * y + linear[i + 6] * z for i in (0, 1, 2)])


def moved_back(matrix: Doubles, points: Floats | Doubles) -> Doubles:
    """Return points (3, n), each by the inverse of a (3, 4) matrix, given row by row, (12, n)."""
    away, inverse = points - matrix[3::4], inverse_linear(matrix)
    return np.stack([(inverse[i : i + 3] * away).sum(0) for i in (0, 3, 6)])


def inverse_linear(matrix: Doubles) -> Doubles:
    """Return the inverses (9, n), row by row, of the linear parts of (3, 4) matrices (12, n)."""
    a, b, c, _, d, e, f, _, g, h, i, _ = matrix
    cofactors = np.stack(
        [
            e * i - f * h,
            c * h - b * i,
            b * f - c * e,
            f * g - d * i,
            a * i - c * g,
            c * d - a * f,
            d * h - e * g,
            b * g - a * h,
            a * e - b * d,
        ]
    )
    return cofactors / (a * cofactors[0] + b * cofactors[3] + c * cofactors[6])


def step_at(times: Doubles, time: Doubles) -> tuple[Ints, Doubles]:
    """Return in which of the steps between `times` (k + 1,) others (n,) are, and after what part of these."""
    step = np.clip(np.searchsorted(times, time, "right") - 1, 0, times.size - 2)
    begin = times.take(step)
    return step, np.clip((time - begin) / (times.take(step + 1) - begin), 0, 1)

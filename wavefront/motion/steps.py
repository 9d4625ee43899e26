"""Motions while a shutter is open: matrices that go along lines or parabolas between some times.

The steps between these times are halved where a motion needs that: where it is fast, and at the keys of
keyframes, where it has bends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints, cross
from ..core.errors import warn_caller

Matrices = Callable[[Doubles], Doubles]  # from times (n,) to matrices (n, 4, 4)

ERROR = 2.0**-20  # of places, relative to the size of what is placed: what steps may leave out
TOLERATED = 2.0**-12  # the same where steps are not enough; more is warned of
LEAST_SCALE = 1e-9  # of what a motion flattens, relative to its greatest
FIRST_STEPS = 16  # that are tried first, if not fewer are allowed
SHORTEST = 2.0**-20  # step, relative to the whole time: a jump takes this long
MOST_LINES = 1 << 9  # steps along lines of all motions; of parabolas fewer are enough, but they take longer
MOST_STEPS = 1 << 16
MOST_MATRICES = 1 << 17  # of all motions; many motions have fewer steps
NODES = np.array([0, 0.5, 1])  # of a step, where its parabolas have the numbers of the motion
BETWEEN = np.array([0.2113, 0.7887])  # where they are farthest from it
UNEVEN = 64  # further times at which one step is tested, by the golden ratio
GOLDEN = (5**0.5 - 1) / 2
STRAIGHT = 2.0**-44  # relative differences by which numbers that change evenly are off in float64
BINS = 1024  # of the time, to find the steps of times


@soa
class Motions:
    """m motions while a shutter is open, as matrices from the scene to what moves.

    Within a step each of the numbers of a matrix is a polynomial of the part of the step that is over. A
    translation of constant velocity is exact so, with one step.
    """

    begin: float  # when the shutter opens, s
    seconds: float  # how long it is open
    steps: int
    start: Doubles  # (steps + 1,) where steps begin, and the last one ends, as parts of the time
    first_of: Ints  # (BINS + 1,) the step at the beginning of each bin
    # (12, m * steps) for each step of each motion: the (3, 4) matrix at its beginning, row by row
    to_local: Doubles
    # 12 × (m * steps,) its change by a part of the step, and by the square of that part; None where it is 0
    slope: list[Doubles | None]
    bend: list[Doubles | None]
    error: Doubles  # (m,) of places that steps leave out, relative to the size of what moves; jumps aside

    @classmethod
    def of(
        cls,
        motions: Sequence[Matrices],
        begin: float,
        end: float,
        reach: Doubles,
        keys: Doubles,
        names: Sequence[str],
    ) -> Self:
        """Return motions as tables of as many steps as they need, and warn of those that need too many.

        Parameters
        ----------
        motions
            For each of m, a function from times (n,) to matrices (n, 4, 4) to the scene.
        reach
            (m,) how far from the origin of its own coordinates each reaches.
        keys
            (k,) times at which they may go another way, s.
        names
            Of what moves, m of them.
        """
        table = cls._of(motions, begin, end, reach, keys)
        fast = np.flatnonzero(table.error > TOLERATED)
        if fast.size:
            worst, more = int(fast[table.error[fast].argmax()]), fast.size - 1
            warn_caller(
                f"{names[worst]}: moves too fast while the shutter is open for {table.steps} steps: "
                f"places are off by up to {table.error[worst]:.2g} of the size of what moves; "
                f"{TOLERATED:.2g} is tolerated" + (f" (and {more} more like it)" if more else "")
            )
        return table

    @classmethod
    def _of(
        cls, motions: Sequence[Matrices], begin: float, end: float, reach: Doubles, keys: Doubles
    ) -> Self:
        """Return the table: of lines where these do not need many steps, or else of parabolas."""
        room = max(1, min(MOST_STEPS, MOST_MATRICES // len(motions)))
        between = (_tested_times(keys, begin, end, 4 * room) - begin) / (end - begin)
        whole = _steps_at(motions, begin, end, np.array([0.0, 1.0]), np.append(BETWEEN, between))
        size = _sizes(whole.placed, reach)
        scale = reach, size
        for straight in (True, False):
            whole.error = _errors(whole, *scale, straight)
            if whole.error.max() <= ERROR or (room < FIRST_STEPS and not straight):
                return cls._joined([whole], begin, end, straight)
        first = np.unique(np.append((keys - begin) / (end - begin), np.arange(FIRST_STEPS + 1) / FIRST_STEPS))
        first = first[(first >= 0) & (first <= 1)]
        if first.size > room:
            first = np.arange(FIRST_STEPS + 1) / FIRST_STEPS
        few = MOST_LINES // len(motions)
        if first.size <= few:
            lines = _divided(motions, begin, end, first, scale, few, True)
            if np.concatenate([part.error for part in lines], 1).max() <= ERROR:
                return cls._joined(lines, begin, end, True)
        return cls._joined(_divided(motions, begin, end, first, scale, room, False), begin, end, False)

    @classmethod
    def _joined(cls, parts: Sequence[_Steps], begin: float, end: float, straight: bool) -> Self:
        """Return the table of some steps."""
        start = np.concatenate([part.start for part in parts])
        order = np.argsort(start)
        start = np.append(start[order], 1.0)
        local = np.concatenate([part.to_local for part in parts], 1)[:, order]
        error = np.concatenate([part.error for part in parts], 1).max(1)
        before, middle, after = local[:, :, :3].reshape(-1, 3, 12).transpose(1, 2, 0)
        bend, change = 2 * (before + after - 2 * middle) * (not straight), after - before
        scale = STRAIGHT * np.maximum(np.abs(before), np.abs(after)).max(1)
        curved, moves = ((np.abs(each).max(1) > scale).tolist() for each in (bend, change))
        rows = range(12)
        return cls(
            begin,
            end - begin,
            start.size - 1,
            start,
            np.minimum(np.searchsorted(start, np.arange(BINS + 1) / BINS, "right") - 1, start.size - 2),
            np.ascontiguousarray(before),
            [change[i] - bend[i] if curved[i] else change[i] if moves[i] else None for i in rows],
            [bend[i].copy() if curved[i] else None for i in rows],
            error,
        )

    def at(self, number: Ints, time: Doubles) -> Doubles:
        """Return the (3, 4) matrices of some motions (n,) at times (n,), row by row, (12, n)."""
        matrix = np.empty((12, time.size))
        for out, values in zip(matrix, self.entries(number, time), strict=True):
            out[:] = values
        return matrix

    def entries(self, number: Ints, time: Doubles) -> Iterator[Doubles | np.float64]:
        """Yield the 12 numbers of these matrices, each (n,), or one where it is the same for all."""
        step, part = self._step_at(np.clip((time - self.begin) / self.seconds, 0, 1))
        alone = self.error.size == 1
        row = step if alone else number * self.steps + step
        for values, slopes, bends in zip(self.to_local, self.slope, self.bend, strict=True):
            if slopes is None:
                yield values[0] if alone else values.take(row)
                continue
            change = slopes.take(row)
            if bends is not None:
                change += bends.take(row) * part
            change *= part
            change += values.take(row)
            yield change

    def _step_at(self, place: Doubles) -> tuple[Ints, Doubles]:
        """Return in which steps parts of the time (n,) are, and after what part of these."""
        if self.steps == 1:
            return np.zeros(place.size, np.intp), place
        step = self.first_of.take((place * BINS).astype(np.intp))
        later = np.flatnonzero(place >= self.start.take(step + 1))  # most bins are in one step
        step[later] = np.searchsorted(self.start, place.take(later), "right") - 1
        np.minimum(step, self.steps - 1, out=step)
        begin = self.start.take(step)
        return step, (place - begin) / (self.start.take(step + 1) - begin)

    @property
    def middle(self) -> float:
        """The middle of the time for which the shutter is open."""
        return self.begin + self.seconds / 2

    def times(self, count: int) -> list[float]:
        """Return times evenly spaced while the shutter is open, with both ends."""
        found: list[float] = np.linspace(self.begin, self.begin + self.seconds, count).tolist()
        return found

    def times_in(self, step: Ints, count: int) -> Doubles:
        """Return times (k, count), s, evenly spaced over some steps (k,), with both ends."""
        begin, end = self.start.take(step)[:, None], self.start.take(step + 1)[:, None]
        return self.begin + self.seconds * (begin + (end - begin) * np.linspace(0, 1, count))


@soa
class _Steps:
    """Steps of m motions while their table is built."""

    start: Doubles  # (k,) as parts of the time
    parts: Doubles  # (p,) of each step: `NODES`, and others
    placed: Doubles  # (m, k, p, 3, 4) to the scene then
    to_local: Doubles  # (m, k, p, 3, 4) the inverses
    error: Doubles  # (m, k) see `_errors`

    def take(self, index: Ints) -> _Steps:
        """Return some of the steps."""
        arrays = (each[:, index] for each in (self.placed, self.to_local, self.error))
        return _Steps(self.start[index], self.parts, *arrays)


def _divided(
    motions: Sequence[Matrices],
    begin: float,
    end: float,
    first: Doubles,
    scale: tuple[Doubles, Doubles],
    room: int,
    straight: bool,
) -> list[_Steps]:
    """Return steps, halved until they are short enough, but not many more than `room`.

    Parameters
    ----------
    first
        (k + 1,) the parts of the time between which the longest steps lie.
    scale
        As of `_errors`.
    """
    done, ends = list[_Steps](), np.stack([first[:-1], first[1:]])
    while ends.size:
        steps = _steps_at(motions, begin, end, ends, BETWEEN)
        width = ends[1] - ends[0]
        steps.error = _errors(steps, *scale, straight)
        worst = steps.error.max(0)
        long = np.flatnonzero((worst > ERROR) & (width > SHORTEST))
        room -= width.size
        if long.size > room:
            long = np.sort(long[np.argsort(-worst[long], kind="stable")[: max(room, 0)]])
        steps.error[:, width <= SHORTEST] = 0  # of a jump
        done.append(steps.take(np.setdiff1d(np.arange(width.size), long)))
        room += long.size
        middle = ends[:, long].mean(0)
        ends = np.stack([np.append(ends[0, long], middle), np.append(middle, ends[1, long])])
    return done


def _steps_at(
    motions: Sequence[Matrices], begin: float, end: float, ends: Doubles, between: Doubles
) -> _Steps:
    """Return steps between parts `ends` (2, k) of the time, with matrices at `NODES` and `between`."""
    parts, (start, stop) = np.append(NODES, between), ends.reshape(2, -1)
    places = start[:, None] + (stop - start)[:, None] * parts
    placed = np.stack([motion(begin + (end - begin) * places.ravel()) for motion in motions])[:, :, :3]
    placed[..., :3] = _thickened(placed[..., :3])
    inverse = inverse_linear(placed.reshape(-1, 12).T).T.reshape(*placed.shape[:2], 3, 3)
    to_local = np.concatenate([inverse, -inverse @ placed[..., 3:]], 3)
    shape = len(motions), start.size, parts.size, 3, 4
    return _Steps(start, parts, placed.reshape(shape), to_local.reshape(shape), np.zeros(shape[:2]))


def _tested_times(keys: Doubles, begin: float, end: float, most: int) -> Doubles:
    """Return keys between two times, the middles between them, and uneven times; at most so many of each."""
    inside = np.unique(keys[(keys > begin) & (keys < end)])
    inside = inside[:: max(-(-inside.size // most), 1)]
    ends = np.concatenate([[begin], inside, [end]])
    uneven = begin + (end - begin) * (np.arange(1, min(UNEVEN, most) + 1) * GOLDEN % 1)
    return np.concatenate([inside, (ends[1:] + ends[:-1]) / 2, uneven])


def _thickened(linear: Doubles) -> Doubles:
    """Return linear parts (m, k, 3, 3) that can be inverted: what is flattened stays very thin."""
    largest = np.sqrt((linear**2).sum((2, 3))).max(1)
    volume = (np.cross(linear[..., 0], linear[..., 1]) * linear[..., 2]).sum(-1)
    if (np.abs(volume) > LEAST_SCALE * (largest**3)[:, None]).all():  # a bound that needs no decomposition
        return linear
    u, scales, v = np.linalg.svd(linear)
    thin = np.maximum(scales, LEAST_SCALE * scales.max((1, 2), keepdims=True))
    flat = (thin > scales).any(2)
    found = linear.copy()
    found[flat] = (u[flat] * thin[flat][:, None]) @ v[flat]
    return found


def _sizes(placed: Doubles, reach: Doubles) -> Doubles:
    """Return the sizes (m,) of what moves together with its way, in its own units."""
    where = placed[..., 3].reshape(len(placed), -1, 3)
    scale = np.sqrt((placed[..., :3] ** 2).sum((-1, -2)) / 3).max((1, 2))
    return np.asarray(reach + np.ptp(where, axis=1).max(1) / scale)


def _errors(steps: _Steps, reach: Doubles, size: Doubles, straight: bool) -> Doubles:
    """Return the errors (m, k) of steps, relative to the sizes (m,) of what moves.

    They are of places at most `reach` (m,) from the origins of their coordinates: where lines or parabolas
    take them that the motion has put into the scene.
    """
    before, middle, after = (steps.to_local[:, :, node] for node in range(3))
    worst = np.zeros(steps.error.shape)
    for number, part in enumerate(steps.parts[3:].tolist(), 3):
        there = steps.placed[:, :, number]
        back = before + part * (after - before)
        if not straight:
            back += 2 * part * (part - 1) * (before + after - 2 * middle)
        turned, shifted = back[..., :3] @ there[..., :3] - np.eye(3), back[..., :3] @ there[..., 3:]
        off = np.sqrt(((shifted[..., 0] + back[..., 3]) ** 2).sum(-1))
        worst = np.maximum(worst, np.sqrt((turned**2).sum((-1, -2))) * reach[:, None] + off)
    return worst / np.where(size > 0, size, 1)[:, None]


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


def linear_times(linear: Doubles, vectors: Floats | Doubles) -> Doubles:
    """Return vectors (3, n), each by a (3, 3) matrix, given row by row, (9, n)."""
    return np.stack([(linear[i : i + 3] * vectors).sum(0) for i in (0, 3, 6)])


def growth_of(linear: Doubles) -> Doubles:
    """Return by what areas grow in the mean of all directions, (n,), of (3, 3) matrices (9, n)."""
    a, b, c = linear.reshape(3, 3, -1)
    return np.asarray(np.abs((a * cross(b, c)).sum(0)) ** (2 / 3), np.float64)


def step_at(times: Doubles, time: Doubles) -> tuple[Ints, Doubles]:
    """Return in which of the steps between `times` (k + 1,) others (n,) are, and after what part of these."""
    step = np.clip(np.searchsorted(times, time, "right") - 1, 0, times.size - 2)
    begin = times.take(step)
    return step, np.clip((time - begin) / (times.take(step + 1) - begin), 0, 1)

"""Many motions at one time, without a loop over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.vec import Doubles, Ints
from .keyframes import Trs, composed
from .motion import Motion
from .product import Product
from .quaternions import times
from .track import Bundle, Track


class Together:
    """Motions that are evaluated together; those that occur several times, as parents do, once.

    Parameters
    ----------
    motions
        n of them; or matrices (4, 4), which stay.
    """

    def __init__(self, motions: Sequence[Motion | Doubles]) -> None:
        self._rows: dict[int, int] = {}  # row of each distinct motion or matrix, by its id
        self._parts: list[Motion | Doubles] = []  # and each of them, parents and children before products
        self._pairs: list[tuple[int, int, int]] = []  # rows of a product, its parent and its child
        for motion in motions:
            self._add(motion)
        self._wanted = np.array([self._rows[id(motion)] for motion in motions], np.intp)
        self._fixed = np.tile(np.eye(4), (len(self._parts), 1, 1))
        trs, self._others = list[int](), list[tuple[int, Motion]]()
        for row, part in enumerate(self._parts):
            if isinstance(part, Trs):
                trs.append(row)
            elif isinstance(part, Motion):
                self._others += [(row, part)] if not isinstance(part, Product) else []
            else:
                self._fixed[row] = part
        self._trs = _grouped([(row, self._parts[row]) for row in trs])  # type: ignore[misc]
        self._levels = _levels(self._pairs)
        once = np.array_equal(self._wanted, np.arange(len(self._parts)))
        self._uniform = once and len(self._trs) == 1 and len(trs) == len(motions)

    def _add(self, motion: Motion | Doubles) -> None:
        """Note a motion and the motions that it is a product of, without recursion into long chains."""
        stack = [motion]
        while stack:
            part = stack[-1]
            below = [part.parent, part.child] if isinstance(part, Product) else []
            missing = [each for each in below if id(each) not in self._rows]
            if missing:
                stack += missing
                continue
            stack.pop()
            if id(part) not in self._rows:
                row = self._rows[id(part)] = len(self._parts)
                self._parts.append(part)
                if isinstance(part, Product):
                    self._pairs.append((row, self._rows[id(part.parent)], self._rows[id(part.child)]))

    def at(self, time: float) -> Doubles:
        """Return the matrices (n, 4, 4) at a time."""
        if self._uniform:
            return composed(*(each.at(time) for each in self._trs[0][1]))
        out = self._fixed.copy()
        for rows, bundles in self._trs:
            out[rows] = composed(*(each.at(time) for each in bundles))
        for row, motion in self._others:
            out[row] = motion.at(time)
        for rows, parents, children in self._levels:
            out[rows] = times(out[parents], out[children])
        return out[self._wanted]

    def at_starts(self) -> Doubles:
        """Return the matrices (n, 4, 4), each at the start of its own motion."""
        parts = [part for part in self._parts if isinstance(part, Motion)]
        starts = {id(part): part.start for part in parts}
        ids = np.array(list(self._rows))[self._wanted]
        own = np.array([starts[each] for each in ids.tolist()])
        out = np.empty((len(own), 4, 4))
        for start in np.unique(own):
            out[own == start] = self.at(float(start))[own == start]
        return out


def _grouped(motions: Sequence[tuple[int, Trs]]) -> list[tuple[Ints, list[Bundle]]]:
    """Return the rows of motions whose tracks are alike, and these tracks."""
    groups: dict[tuple[object, ...], list[tuple[int, Trs]]] = {}
    for row, motion in motions:
        groups.setdefault(tuple(map(_kind, motion.tracks)), []).append((row, motion))
    return [
        (
            np.array([row for row, _ in members], np.intp),
            [Bundle(tracks) for tracks in zip(*(motion.tracks for _, motion in members), strict=True)],
        )
        for members in groups.values()
    ]


def _kind(track: Track) -> tuple[str, int]:
    return track.way, track.values.ndim


def _levels(pairs: Sequence[tuple[int, int, int]]) -> list[tuple[Ints, Ints, Ints]]:
    """Return rows of products, parents and children, so that all that one level needs is known before it."""
    depth: dict[int, int] = {}
    for row, parent, child in pairs:
        depth[row] = 1 + max(depth.get(parent, 0), depth.get(child, 0))
    levels: dict[int, list[tuple[int, int, int]]] = {}
    for pair in pairs:
        levels.setdefault(depth[pair[0]], []).append(pair)
    tables = [np.array(levels[level], np.intp).T for level in sorted(levels)]
    return [(table[0], table[1], table[2]) for table in tables]

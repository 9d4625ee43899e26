"""Products of motions, as of the nodes of a file from the root to a leaf."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles
from .motion import Motion
from .quaternions import times as matrix_times


class Product(Motion):
    """One motion within another: at each time the product of both matrices, exactly.

    Parameters
    ----------
    parent, child
        Motions, or matrices (4, 4) that stay; one of them moves. Products that share a parent compute it
        once, where many are computed together.
    """

    def __init__(self, parent: Motion | Doubles, child: Motion | Doubles) -> None:
        self.parent, self.child = parent, child
        self.start, self.end = (
            min(each.start for each in self.moving),
            max(each.end for each in self.moving),
        )

    @property
    def moving(self) -> list[Motion]:
        """Those of both that move."""
        return [each for each in (self.parent, self.child) if isinstance(each, Motion)]

    @property
    def keys(self) -> Doubles:
        """The times of the keys of both."""
        return np.unique(np.concatenate([each.keys for each in self.moving]))

    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrices (n, 4, 4) at times (n,)."""
        first, second = (
            each.at_times(times) if isinstance(each, Motion) else each[None]
            for each in (self.parent, self.child)
        )
        return np.broadcast_to(matrix_times(first, second), (len(times), 4, 4))


class Inverse(Motion):
    """A motion the other way: at each time the inverse matrix, as of a camera by its extrinsics.

    Parameters
    ----------
    motion
        Whose matrices can be inverted.
    """

    def __init__(self, motion: Motion) -> None:
        self._motion, self.start, self.end = motion, motion.start, motion.end

    @property
    def keys(self) -> Doubles:
        """Those of the motion."""
        return self._motion.keys

    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrices (n, 4, 4) at times (n,)."""
        return np.asarray(np.linalg.inv(self._motion.at_times(times)), np.float64)


class Still(Motion):
    """A place that stays, for as long as what is placed there deforms.

    Parameters
    ----------
    matrix
        (4, 4).
    start, end
        Seconds.
    """

    def __init__(self, matrix: Doubles, start: float, end: float) -> None:
        self.matrix, self.start, self.end = matrix, start, end

    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrix for each of times (n,)."""
        return np.broadcast_to(self.matrix, (len(times), 4, 4))


def product(parent: Motion | Doubles, child: Motion | Doubles) -> Motion | Doubles:
    """Return the product of motions or matrices: a matrix if neither moves."""
    if isinstance(parent, Motion) or isinstance(child, Motion):
        return Product(parent, child)
    return matrix_times(parent[None], child[None])[0]

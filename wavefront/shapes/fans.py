"""Pairs of consecutive triangles that make a quadrilateral, as `Rectangle` and files lay them out.

A quadrilateral (a, b, c, d) is a fan of the triangles (a, b, c) and (a, c, d).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bools, Ints


def are_fans(triangles: NDArray[np.floating[Any]]) -> Bools:
    """Return True for each of m triangles (m, 3, 3) but the last that is a fan with the next, (m - 1,)."""
    same_first = (triangles[1:, 0] == triangles[:-1, 0]).all(1)
    return same_first & (triangles[1:, 1] == triangles[:-1, 2]).all(1)


def disjoint_pairs(first: Ints) -> Ints:
    """Choose pairs of consecutive triangles so that no triangle is in two of them.

    Parameters
    ----------
    first
        (k,) first triangle of each pair, rising. Of pairs that overlap, every other one is chosen.

    Returns
    -------
    The first triangles of the chosen pairs.
    """
    place = np.arange(first.size)
    starts = np.append(True, np.diff(first) > 1)[: first.size]
    return first[(place - np.maximum.accumulate(np.where(starts, place, 0))) % 2 == 0]

"""Triangles that occur several times: the first of them is hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bools, Floats, Ints, spans
from .triangle import has_area

AT_ONCE = 1 << 14  # triangles per batch: their keys fit the cache
FACTORS = tuple(map(np.uint64, (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)))  # odd

Keys = NDArray[np.uint64]


def that_can_be_hit(triangles: Floats) -> Ints:
    """Return the ids of triangles (m, 3, 3) with an area and not the corners of an earlier one."""
    return np.flatnonzero(has_area(triangles) & first_of_equals(triangles))


def first_of_equals(triangles: Floats) -> Bools:
    """Return a mask (m,), False for triangles (m, 3, 3) with the corners of an earlier one in any order."""
    keep = np.ones(len(triangles), np.bool_)
    # few: compare the corners themselves
    seen: set[bytes] = set()
    for index in np.sort(repeated(_keys(triangles))[0]).tolist():
        corners = triangles[index] + np.float32(0)  # without negative zeros
        name = b"".join(sorted(corner.tobytes() for corner in corners))
        keep[index] = name not in seen
        seen.add(name)
    return keep


def repeated(keys: Keys) -> tuple[Ints, Ints]:
    """Return the places (r,) of repeated keys (k,), ordered by key, and where each key begins.

    Keys may differ in their lowest bits, as many as the places need.
    """
    bits = np.uint64(max(1, (keys.size - 1).bit_length()))
    low = (np.uint64(1) << bits) - np.uint64(1)
    # sorting numbers is several times as fast as finding their order
    ordered = np.sort((keys & ~low) | np.arange(keys.size, dtype=np.uint64))
    key = ordered >> bits
    same = key[1:] == key[:-1]
    several, first = np.zeros(keys.size, np.bool_), np.ones(keys.size, np.bool_)
    several[1:] = same
    several[:-1] |= same
    first[1:] = ~same
    place = (ordered.compress(several) & low).astype(np.intp)
    return place, np.flatnonzero(first.compress(several))


def _keys(triangles: Floats) -> Keys:
    """Return a number for each triangle that does not depend on the order of its corners."""
    keys = np.empty(len(triangles), np.uint64)
    for span in spans(keys.size, AT_ONCE):
        rows = np.ascontiguousarray((triangles[span] + np.float32(0)).transpose(2, 1, 0))
        x, y, z = rows.view(np.uint32).astype(np.uint64)
        corners = x * FACTORS[0] + y * FACTORS[1] + z * FACTORS[2]
        corners ^= corners >> np.uint64(29)
        corners *= FACTORS[0]
        corners ^= corners >> np.uint64(32)
        keys[span] = corners[0] + corners[1] + corners[2]
    return keys

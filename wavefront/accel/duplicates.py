"""Triangles that are there several times, so that the first of them is hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..vec import Bools, Floats

FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)  # odd


def first_of_equals(triangles: Floats) -> Bools:
    """Return a mask (m,), False for triangles (m, 3, 3) with the corners of an earlier one in any order."""
    keep = np.ones(len(triangles), np.bool_)
    keys = _keys(triangles)
    order = np.argsort(keys, kind="stable")
    ordered = keys.take(order)
    same = ordered[1:] == ordered[:-1]
    if not same.any():
        return keep
    # few: compare the corners themselves
    doubtful = np.zeros(len(triangles), np.bool_)
    doubtful[1:] = same
    doubtful[:-1] |= same
    seen: set[bytes] = set()
    for index in np.sort(order.compress(doubtful)).tolist():
        corners = triangles[index] + np.float32(0)  # without negative zeros
        name = b"".join(sorted(corner.tobytes() for corner in corners))
        keep[index] = name not in seen
        seen.add(name)
    return keep


def _keys(triangles: Floats) -> NDArray[np.uint64]:
    """Return a number for each triangle that does not depend on the order of its corners."""
    bits = (triangles + np.float32(0)).view(np.uint32).astype(np.uint64)
    corners = (bits * FACTORS).sum(-1, dtype=np.uint64)
    corners ^= corners >> np.uint64(29)
    corners *= FACTORS[0]
    corners ^= corners >> np.uint64(32)
    return np.asarray(corners.sum(-1, dtype=np.uint64))

"""Masks of objects: boxes and run lengths."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Bools

Mask = Bools


def mask_box(mask: Mask) -> list[int] | None:
    """Return the box [x, y, width, height] of a mask (height, width) in pixels; None if it is empty."""
    columns, rows = np.flatnonzero(mask.any(0)), np.flatnonzero(mask.any(1))
    if not columns.size:
        return None
    x, y = int(columns[0]), int(rows[0])
    return [x, y, int(columns[-1]) + 1 - x, int(rows[-1]) + 1 - y]


def run_lengths(mask: Mask) -> list[int]:
    """Return the lengths of runs of pixels outside and inside a mask, in turn, column by column.

    The first run is outside, and may be empty. It is COCO's uncompressed run-length encoding.
    """
    flat = mask.ravel(order="F")
    ends = np.append(np.flatnonzero(flat[1:] != flat[:-1]) + 1, flat.size)
    lengths: list[int] = np.diff(ends, prepend=0).tolist()
    return [0, *lengths] if flat[0] else lengths


def touches_edge(mask: Mask) -> bool:
    """Return whether a mask reaches the edge of its picture."""
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())

"""Outlines: lines along the edges that the AOVs of a picture show."""

from __future__ import annotations

import math

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints

Edges = tuple[Bools, Bools]  # between columns (H, W − 1) and between rows (H − 1, W)


def outline_coverage(
    shape_id: Ints, normal: Floats, depth: Floats, width: float, crease: float, jump: float
) -> Floats:
    """Return the part of each pixel (H, W) that lines of a width in pixels cover.

    Lines run where the shape changes, where the normal turns by more than `crease` degrees from a pixel to
    the next, and where the depth jumps by more than the part `jump` of itself, beyond its slope on both
    sides.

    Parameters
    ----------
    shape_id, normal, depth
        AOVs of a picture, (H, W), (H, W, 3) and (H, W); -1 and NaN where there is nothing.
    width, crease, jump
        As for `Image.outlined`.
    """
    edges = _edges(shape_id, normal.astype(np.float64), depth.astype(np.float64), crease, jump)
    covered = np.clip(width / 2 + 0.5 - _distance(edges, math.ceil(width / 2 + 1)), 0, 1)
    return _smoothed(covered).astype(np.float32)


def _edges(ids: Ints, normal: Doubles, depth: Doubles, crease: float, jump: float) -> Edges:
    columns = _between_columns(ids, normal, depth, crease, jump)
    rows = _between_columns(ids.T, normal.swapaxes(0, 1), depth.T, crease, jump)
    return columns, rows.T


def _between_columns(ids: Ints, normal: Doubles, depth: Doubles, crease: float, jump: float) -> Bools:
    """Return a mask (H, W − 1) of the pixels with an edge between them and the next in their row."""
    changes = ids[:, 1:] != ids[:, :-1]
    cosine = (normal[:, 1:] * normal[:, :-1]).sum(-1)
    turns = cosine < math.cos(math.radians(crease))  # False for NaN, which has another id
    # Of a plane, 1/depth is linear over the picture of a perspective camera.
    with np.errstate(all="ignore"):
        inverse = 1 / depth
        step = np.diff(inverse, axis=1)
        size = np.minimum(np.abs(inverse[:, 1:]), np.abs(inverse[:, :-1]))
        before = np.pad(step[:, :-1], ((0, 0), (1, 0)), constant_values=np.nan)
        after = np.pad(step[:, 1:], ((0, 0), (0, 1)), constant_values=np.nan)
        # NaN where there is no neighbor to take a slope from, which then counts for nothing
        excess = np.fmin(np.abs(step), np.fmin(np.abs(step - before), np.abs(step - after)))
        jumps = excess > jump * size
    return changes | turns | jumps


def _distance(edges: Edges, reach: int) -> Doubles:
    """Return the distances (H, W) of pixel centers from the nearest edge, in pixels, up to `reach`."""
    between_columns, between_rows = edges
    nearest = np.full((between_columns.shape[0], between_rows.shape[1]), float(reach))
    for dx in range(-reach, reach):
        for dy in range(-reach, reach + 1):
            # The edges are half a pixel beyond the center of column x + dx, and as long as a pixel.
            away = math.hypot(dx + 0.5, max(abs(dy) - 0.5, 0))
            if away < reach:
                _lower(nearest, between_columns, dy, dx, away)
                _lower(nearest.T, between_rows.T, dy, dx, away)
    return nearest


def _lower(nearest: Doubles, mask: Bools, dy: int, dx: int, away: float) -> None:
    """Lower `nearest`[y, x] to `away` where `mask`[y + dy, x + dx], in place."""
    rows, columns = nearest.shape[0], mask.shape[1]
    y = slice(max(0, -dy), min(rows, rows - dy))
    x = slice(max(0, -dx), min(nearest.shape[1], columns - dx))
    if y.start >= y.stop or x.start >= x.stop:
        return
    target = nearest[y, x]
    shifted = mask[y.start + dy : y.stop + dy, x.start + dx : x.stop + dx]
    np.minimum(target, np.where(shifted, away, np.inf), out=target)


def _smoothed(values: Doubles) -> Doubles:
    """Return values (H, W) averaged over 3 × 3 pixels, which takes the steps out of slanting lines."""
    for axis in (0, 1):
        padded = np.pad(values, [(1, 1) if axis == other else (0, 0) for other in (0, 1)], mode="edge")
        first, last = (slice(None, -2), slice(2, None))
        ends = (padded[first], padded[last]) if axis == 0 else (padded[:, first], padded[:, last])
        values = 0.25 * ends[0] + 0.5 * values + 0.25 * ends[1]
    return values

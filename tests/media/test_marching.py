"""Rays through the cells of grids, against quadrature."""

import numpy as np
from inside import March, MediumRays, StepNumbers

CELLS = np.array([[5, 2], [4, 3], [3, 7]])  # along x, y and z, of two grids
VALUES = np.random.default_rng(1).random(5 * 4 * 3 + 2 * 3 * 7).astype(np.float32)
FIRST = np.array([0, 60])


def marched(n: int, length: float, axis_aligned: bool = False):
    rng = np.random.default_rng(2)
    number = rng.integers(0, 2, n)
    origin = rng.uniform(-0.5, 1.5, (3, n)).astype(np.float32)
    direction = rng.normal(size=(3, n)).astype(np.float32)
    if axis_aligned:
        direction[:2] = 0
    direction /= np.sqrt((direction**2).sum(0))
    steps = StepNumbers(np.zeros(n, np.uint64))
    far, never = np.full(n, length, np.float32), np.full(n, np.inf, np.float32)
    rays = MediumRays(number, origin, direction, far, steps)
    march, control = March.of(rays, CELLS, FIRST, never), np.zeros(n)
    while len(march):
        cell = march.cell
        lanes, inside = march.advance(np.zeros(len(march), np.float32), VALUES.take(cell, mode="wrap"))
        assert not lanes.size
        control[march.row[~inside]] = march.control[~inside]
        march = march.take(np.flatnonzero(inside))
    t = (np.arange(20_000) + 0.5) / 20_000 * 4
    due = np.zeros(n)
    for k in range(n):
        at = origin[:, k, None] + direction[:, k, None] * t
        x, y, z = np.clip((at * CELLS[:, number[k], None]).astype(int), 0, CELLS[:, number[k], None] - 1)
        w, h, _ = CELLS[:, number[k]]
        inside = ((at > 0) & (at < 1)).all(0) & (t < length)
        due[k] = (VALUES[FIRST[number[k]] + x + w * (y + h * z)] * inside).mean() * 4
    return control, due


def test_lengths_within_cells() -> None:
    """∫ of values that are constant in each cell, from anywhere to anywhere."""
    for length in (0.4, np.inf):
        for axis_aligned in (False, True):
            found, due = marched(200, length, axis_aligned)
            assert (due > 0).sum() > 10
            np.testing.assert_allclose(found, due, atol=1e-3)

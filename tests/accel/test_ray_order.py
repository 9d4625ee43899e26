"""Paths of large scenes are ordered by place: rays that start near each other are traced together."""

from typing import Any

import numpy as np
import pytest
from inside import BITS, MortonGrid
from inside import scene as compilation
from scenes import everything

import wavefront as wf


def test_codes_interleave_the_bits_of_cells() -> None:
    grid = MortonGrid.over(np.array([1.0, 1.0, 1.0]))
    cells = np.random.default_rng(0).integers(0, 1 << BITS, (3, 200))
    points = ((cells + 0.5) / (1 << BITS) * 2 - 1).astype(np.float32)
    expected = [
        sum((int(c) >> b & 1) << (3 * b + axis) for axis, c in enumerate(cell) for b in range(BITS))
        for cell in cells.T
    ]
    assert grid.codes(points).tolist() == expected
    outside = np.array([[-9, 9], [-9, 9], [-9, 9]], np.float32)
    assert grid.codes(outside).tolist() == [0, (1 << 3 * BITS) - 1]


@pytest.mark.parametrize("accel", ["numpy", "auto"])
def test_the_order_changes_no_bit(monkeypatch: pytest.MonkeyPatch, calls_of: Any, accel: str) -> None:
    plain = wf.render(everything(), 4, accel=accel, progress=False)
    monkeypatch.setattr(compilation, "LARGE", 0)
    orders = calls_of("wavefront.compile.morton.MortonGrid.codes")
    ordered = wf.render(everything(), 4, accel=accel, executor="threads", progress=False)
    assert np.array_equal(plain.rgb, ordered.rgb)
    assert len(orders) > 1

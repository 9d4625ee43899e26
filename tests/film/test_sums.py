"""Sums: what classes that only declare their fields keep, merge and take."""

from __future__ import annotations

import numpy as np
import pytest
from inside import Sums, aov_sums, bytes_per_pixel, empty_sums, picture_memory

import wavefront as wf


class Counts(Sums):
    """One array."""

    counts: np.ndarray

    def __init__(self, pixels: int) -> None:
        self.pixels = pixels  # no field
        self.counts = np.zeros(pixels, np.int32)


class Many(Counts):
    """Fields of every kind, and those of the base."""

    weights: np.ndarray
    part: Counts
    named: dict[str, Counts]
    absent: Counts | None

    def __init__(self, pixels: int) -> None:
        super().__init__(pixels)
        self.weights, self.part, self.absent = np.zeros(0), Counts(pixels), None
        self.named = {"a": Counts(pixels), "b": Counts(pixels)}


def filled(value: int, weights: int = 0) -> Many:
    """Return sums of three pixels."""
    sums = Many(3)
    sums.weights = np.full(weights, float(value))
    for number, array in enumerate(each for each in sums.arrays().values() if each.dtype == np.int32):
        array[:] = value * 10**number
    return sums


def test_fields_are_arrays_by_name() -> None:
    """Those of parts after the name of the part; what is not declared is not kept."""
    assert list(Many(3).arrays()) == ["counts", "weights", "part.counts", "a.counts", "b.counts"]


def test_all_fields_add_up() -> None:
    """Arrays without elements are zeros; no array of the other sums is kept."""
    for weights, others in ((0, 0), (0, 3), (3, 0), (3, 3)):
        sums, other = filled(1, weights), filled(2, others)
        sums.merge(other)
        assert [array[0] for array in sums.arrays().values() if array.dtype == np.int32] == [3, 30, 300, 3000]
        assert sums.weights.tolist() == [(weights > 0) + 2 * (others > 0)] * max(weights, others)
        assert not any(map(np.shares_memory, sums.arrays().values(), other.arrays().values()))


def test_sums_are_restored_from_their_arrays() -> None:
    sums, arrays = Many(3), filled(7).arrays()
    sums.restore({f"x.{name}": array for name, array in arrays.items()}, "x.")
    assert all(array is arrays[name] for name, array in sums.arrays().items())
    for name, wrong, message in [
        ("part.counts", None, r"'part.counts' is missing"),
        ("weights", np.zeros(0, np.float32), r"'weights' is missing or of another type"),
        ("b.counts", np.zeros(3), r"'b.counts' is missing or of another type"),
        ("a.counts", np.zeros(4, np.int64), r"'a.counts' have shape \(4,\); it must be \(3,\)"),
    ]:
        changed = {key: wrong if key == name else array for key, array in arrays.items()}
        with pytest.raises(wf.SceneError, match=message):
            sums.restore({key: array for key, array in changed.items() if array is not None})


@pytest.mark.parametrize(
    ("layers", "light_tracing", "size"),
    [
        ((), False, 0),
        ((), True, 192),
        (("alpha",), False, 2 * 4),
        (("albedo",), False, 3 * 8),
        (("direct", "indirect"), False, 60 + 12),
        (("indirect",), False, 60 + 12),  # its sums are those of the picture without "direct"
        (("alpha", "light_groups.sun"), True, 2 * 4 + 60 + 192),
    ],
)
def test_the_memory_of_a_pixel_is_that_of_the_arrays(
    layers: tuple[str, ...], light_tracing: bool, size: int
) -> None:
    """Which render budgets count, with what the picture and its AOVs take."""
    assert bytes_per_pixel(lambda pixels: empty_sums((pixels, 1), layers, light_tracing)) == 176 + size
    channels = sum(1 if name == "alpha" else 3 for name in layers)
    more = picture_memory((20, 10), layers, light_tracing) - picture_memory((20, 10))
    assert more == (size + 8 * channels) * 200
    sums = empty_sums((20, 10), layers, light_tracing)
    assert sum(array.nbytes for array in sums.arrays().values()) == pytest.approx((176 + size) * 200, abs=96)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.4, 0.9])
def test_zeros_that_are_left_out_change_no_bit(share: float, monkeypatch) -> None:
    rng = np.random.default_rng(1)
    parts = []
    for _ in range(3):
        lit = rng.random((1, 32, 20)) < share
        parts.append((lit * np.exp(8 * rng.normal(size=(3, 32, 20)))).astype(np.float32))
    found = []
    for keep in (False, True):
        if keep:
            monkeypatch.setattr(aov_sums, "without_zeros", lambda radiance: radiance)
        sums = aov_sums.RadianceSums(20)
        for lanes, part in zip((slice(0, 20), slice(0, 20), np.arange(20)), parts, strict=True):
            sums.add(lanes, part.copy())
        found.append([sums.sums.high.tobytes(), sums.sums.low.tobytes(), sums.squares.tobytes()])
    assert found[0] == found[1]
    if share == 0.05:
        monkeypatch.undo()
        assert aov_sums.without_zeros(parts[0]).shape[1] < 16

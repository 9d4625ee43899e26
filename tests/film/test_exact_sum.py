"""Exact sums: the same bits in any order and any grouping, and close to the true sum."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from inside import WIDTH, ExactSums, f4

ALL = slice(None)
numbers = st.floats(width=32, allow_nan=False, allow_infinity=False)
lists = st.lists(numbers, min_size=1, max_size=40)


def summed(terms: np.ndarray) -> ExactSums:
    """Sums of terms (c, m, k)."""
    sums = ExactSums((terms.shape[0], terms.shape[2]))
    sums.add(ALL, terms.astype(np.float64))
    return sums


def column(values: list[float]) -> np.ndarray:
    return np.array(values, f4).reshape(1, -1, 1)


def bits(sums: ExactSums) -> tuple[bytes, ...]:
    return sums.high.tobytes(), sums.low.tobytes()


@given(lists, st.randoms(use_true_random=False))
def test_order_changes_no_bit(values: list[float], random) -> None:
    """From the largest float32 numbers to the smallest, of both signs."""
    shuffled = list(values)
    random.shuffle(shuffled)
    one_by_one = ExactSums((1, 1))
    for value in shuffled:
        one_by_one.add(ALL, column([value]).astype(np.float64))
    assert bits(summed(column(values))) == bits(one_by_one)


@given(lists, lists)
def test_merged_sums_are_the_sum_of_all(first: list[float], second: list[float]) -> None:
    whole = summed(column(first + second))
    for a, b in ((first, second), (second, first)):
        merged = summed(column(a))
        merged.merge(summed(column(b)))
        assert bits(merged) == bits(whole)


@given(lists)
def test_each_term_is_rounded_once(values: list[float]) -> None:
    """By at most 2^-27 of the largest term; the sum itself loses nothing."""
    terms = column(values)
    exact = math.fsum(terms.ravel().tolist())
    bound = len(values) * 2.0 ** (-WIDTH - 1) * float(np.abs(terms).max())
    assert abs(summed(terms).value()[0, 0] - exact) <= bound


def test_terms_near_the_largest_are_exact() -> None:
    """Float32 numbers within a factor of four of the largest have no bit below the unit."""
    terms = np.random.default_rng(0).uniform(0.25, 1, (3, 1000, 7)).astype(f4)
    assert (summed(terms).value() == terms.sum(1, dtype=np.float64)).all()


def test_columns_do_not_mix() -> None:
    """Added by index, each sum is what it would be alone, whatever bins its neighbors need."""
    rng = np.random.default_rng(1)
    terms = (rng.lognormal(0, 1, (3, 9, 6)) * 10.0 ** rng.integers(-30, 30, (3, 1, 6))).astype(f4)
    sums = ExactSums((3, 8))
    lanes = np.array([7, 0, 3, 4, 1, 5])
    sums.add(lanes, terms[:, :4].astype(np.float64))
    sums.add(lanes, terms[:, 4:].astype(np.float64))
    for k, lane in enumerate(lanes):
        assert (sums.value()[:, lane] == summed(terms[:, :, k : k + 1]).value()[:, 0]).all()
    assert not sums.value()[:, [2, 6]].any()

"""Weights of multiple importance sampling: exact values, extremes, and that they sum to one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import power_heuristic

densities = st.one_of(
    st.just(0.0),
    st.just(float("inf")),
    st.floats(2.0**-100, 2.0**100, width=32),
    st.floats(2.0**-126, 2.0**127, width=32),
)


def weight(pdf, other):
    return power_heuristic(np.array([pdf], np.float32), np.array([other], np.float32))[0]


@pytest.mark.parametrize(
    ("pdf", "other", "power"),
    [
        (1, 1, 0.5),
        (1, 2, 0.2),
        (3, 1, 0.9),
        (1, 0, 1),
        (0, 1, 0),
        (0, 0, 0),
        (np.inf, 1, 1),
        (1, np.inf, 0),
        (np.inf, np.inf, 0.5),
        (0, np.inf, 0),
        (np.inf, 0, 1),
        (1e30, 1e30, 0.5),
        (1e-30, 1e-30, 0.5),
        (3e-30, 1e-30, 0.9),
        (1e30, 3e30, 0.1),
        (1e30, 1e-30, 1),
        (1e-30, 1e30, 0),
    ],
)
def test_exact_values(pdf, other, power):
    assert weight(pdf, other) == pytest.approx(power, abs=1e-6)


@given(a=densities, b=densities)
def test_the_two_weights_sum_to_one(a, b):
    first, second = weight(a, b), weight(b, a)
    assert 0 <= first <= 1
    if a == b == 0:
        assert first == second == 0
    else:
        assert first + second == pytest.approx(1, abs=1e-6)


def test_a_scalar_stands_for_all_lanes():
    assert power_heuristic(np.float32([1, 2]), np.float32(0)).tolist() == [1, 1]


def test_the_estimator_is_unbiased():
    """∫₀¹ 3x² dx = 1 from a uniform and a linear technique together, midpoints in place of u."""
    u = (np.arange(100_000, dtype=np.float32) + np.float32(0.5)) / np.float32(100_000)
    total = 0.0
    for x, own in ((u, lambda x: np.ones_like(x)), (np.sqrt(u), lambda x: 2 * x)):
        pdf = own(x)
        other = 2 * x if own(x)[0] == 1 else np.ones_like(x)
        total += float(np.mean(power_heuristic(pdf, other) * 3 * x * x / pdf, dtype=np.float64))
    assert total == pytest.approx(1, abs=1e-5)

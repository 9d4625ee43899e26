"""Confidence limits of few samples: formulas against SciPy, and how often they hold the mean."""

import numpy as np
import pytest
from inside import EVENTS, UNSEEN, event_of, light_limits, moderated_variance, rule_of_three
from scipy import stats


def array(*values):
    return np.array(values, float)


def test_the_variance_is_that_of_smyth_and_one_more_sample():
    """Written out for 16 samples, four batches."""
    n, mean, alone, scatter = 16.0, 2.0, 0.3, 0.5
    variance, freedom = moderated_variance(*(array(x) for x in (n, mean, alone, scatter, 3.0)))
    parts = (4 / 7 * n / (n + 1) * alone, 3 / 7 * n / (n + 1) * scatter, (UNSEEN * mean) ** 2 / (n * (n + 1)))
    assert variance[0] == pytest.approx(sum(parts))
    spread = parts[0] ** 2 / 15 + parts[1] ** 2 / 3 + parts[2] ** 2 / 15
    assert freedom[0] == pytest.approx(sum(parts) ** 2 / spread)
    # of many samples nearly all is of batches
    many, _ = moderated_variance(array(4096.0), array(0.0), array(1.0), array(0.5), array(7.0))
    assert many[0] == pytest.approx(0.5, rel=0.01)


def test_limits_are_quantiles_of_gamma_distributions():
    mean, variance, event = 3.0, 0.4, 0.1
    low, high = light_limits(*(array(x) for x in (mean, variance, 1e9, event)), 0.95)
    more, wide = mean + EVENTS * event, variance + (EVENTS * event) ** 2
    assert low[0] == pytest.approx(
        stats.gamma.ppf(0.025, mean**2 / variance, scale=variance / mean), rel=1e-3
    )
    assert high[0] == pytest.approx(stats.gamma.ppf(0.975, more**2 / wide, scale=wide / more), rel=1e-3)


def test_limits_of_small_errors_are_students():
    """As those of the mean of normal numbers."""
    low, high = light_limits(array(100.0), array(1e-6), array(7.0), array(1e-12), 0.9)
    away = stats.t.ppf(0.95, 7) * 1e-3
    assert (low[0], high[0]) == pytest.approx((100 - away, 100 + away), rel=1e-9)


def test_many_limits_are_interpolated():
    freedom = np.geomspace(1, 1e4, 3000)
    ones = np.ones_like(freedom)
    _, many = light_limits(ones, 1e-20 * ones, freedom, 0 * ones, 0.95)
    _, few = light_limits(ones[:9], 1e-20 * ones[:9], freedom[::331][:9], 0 * ones[:9], 0.95)
    assert (many[::331][:9] - 1) / 1e-10 == pytest.approx((few - 1) / 1e-10, rel=1e-4)


def test_black_has_no_events_and_no_width():
    zero = array(0.0)
    assert event_of(zero, array(1.0)) == 0
    assert light_limits(zero, zero, array(3.0), zero, 0.95) == (0, 0)


def test_the_rule_of_three():
    """A chance above it would have shown in 95 of 100 cases."""
    chance = rule_of_three(0.95, array(100.0))[0]
    assert chance == pytest.approx(0.03, rel=2e-3)
    assert (1 - chance) ** 100 == pytest.approx(0.05, rel=0.05)


def test_events_that_others_met_raise_the_upper_limit_alone():
    mean, variance, freedom = array(1.0, 1.0), array(1e-4, 1e-4), array(15.0, 15.0)
    low, high = light_limits(mean, variance, freedom, array(1e-4, 0.1), 0.95)
    assert low[0] == low[1]
    assert high[0] == pytest.approx(1.0213, abs=1e-3)
    assert high[1] > 1 + EVENTS * 0.1

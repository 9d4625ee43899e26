"""Numbers for steps without end."""

import numpy as np
from inside import Dimension, StepNumbers
from scipy import stats

N = 1 << 14


def numbers(seed: int = 0, bounce: int = 1) -> StepNumbers:
    pixel = np.arange(N, dtype=np.uint32)
    return StepNumbers.of(seed, pixel, pixel % np.uint32(7), bounce, Dimension.MEDIUM)


def test_numbers_are_uniform_and_independent() -> None:
    steps = numbers()
    drawn = [steps.draw(0), steps.draw(0, 1), steps.draw(1), steps.draw(10**6), steps.again().draw(0)]
    drawn += [numbers(1).draw(0), numbers(0, 2).draw(0)]
    for i, u in enumerate(drawn):
        assert u.dtype == np.float32
        assert u.min() >= 0
        assert u.max() < 1
        assert stats.kstest(u, "uniform").pvalue > 1e-4
        for v in drawn[:i]:
            table = np.histogram2d(u, v, 16)[0]
            assert stats.chisquare(table.ravel()).pvalue > 1e-4


def test_numbers_belong_to_the_address() -> None:
    steps, some = numbers(), np.array([3, 77, 3])
    np.testing.assert_array_equal(steps.take(some).draw(5), steps.draw(5)[some])

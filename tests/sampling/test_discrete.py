"""Distributions from tables: frequencies, monotone inversion, zero weights, errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from inside import Discrete, Distribution2D, SceneError
from scipy import stats

BELOW_ONE = np.float32(1 - 2.0**-24)

tables = st.lists(
    st.one_of(st.just(0.0), st.floats(1e-3, 1e3), st.floats(1e-30, 1e30)), min_size=1, max_size=40
).filter(any)
numbers = st.floats(0, float(BELOW_ONE), width=32)


def even(n: int) -> np.ndarray:
    """Midpoints of n equal parts of [0, 1), float32."""
    return ((np.arange(n) + 0.5) / n).astype(np.float32)


@given(weights=tables, u=st.lists(numbers, min_size=1, max_size=50))
def test_items_have_weight_and_follow_u(weights, u):
    u = np.sort(np.float32([0, *u, BELOW_ONE]))
    index, pmf, rest = Discrete(weights).sample(u)
    assert index.dtype == np.intp
    assert pmf.dtype == rest.dtype == np.float32
    assert (np.asarray(weights)[index] > 0).all()
    assert (np.diff(index) >= 0).all()
    assert (rest >= 0).all()
    assert (rest < 1).all()


@given(weights=tables)
def test_probabilities_are_the_weights_over_their_sum(weights):
    items = Discrete(weights)
    expected = np.asarray(weights) / max(weights) / (np.asarray(weights) / max(weights)).sum()
    pmf = items.pmf(np.arange(len(weights)))
    assert pmf == pytest.approx(expected, rel=1e-6, abs=1e-37)
    assert pmf.sum(dtype=np.float64) == pytest.approx(1, abs=1e-6)
    index, sampled, _ = items.sample(even(64))
    assert (sampled == pmf[index]).all()


def test_frequencies():
    weights = np.float64([1, 0, 2, 3, 0, 0, 0.5, 1e-9])
    u = np.random.default_rng(1).random(1_000_000, np.float32)
    counts = np.bincount(Discrete(weights).sample(u)[0], minlength=8)
    assert counts[weights == 0].sum() == 0
    expected = weights / weights.sum() * 1e6
    big = expected > 5
    assert stats.chisquare(counts[big], expected[big] * counts[big].sum() / expected[big].sum()).pvalue > 1e-3


@pytest.mark.parametrize("weights", [[0, 1, 0], [0, 0, 1e-300], [1e300, 0, 0], [5]])
def test_a_lone_weight_takes_all(weights):
    index, pmf, rest = Discrete(weights).sample(np.float32([0, 0.5, BELOW_ONE]))
    assert (index == np.argmax(weights)).all()
    assert (pmf == 1).all()
    assert rest == pytest.approx([0, 0.5, 1], abs=1e-6)


def test_no_number_passes_the_last_item_with_weight():
    """Ten times 0.1 sums to less than 1 in float64; the items after it have no weight."""
    assert Discrete([0.1] * 10 + [0, 0]).sample(np.float32([BELOW_ONE]))[0][0] == 9


@given(weights=tables, u=st.lists(numbers, min_size=1, max_size=50))
def test_items_are_those_of_a_plain_search(weights, u):
    """The guide table and the rounded edges change nothing against float64 inversion."""
    items = Discrete(weights)
    u = np.float32(u)
    upto = np.cumsum(items.probability)
    upto /= upto[-1]
    expected = np.searchsorted(upto, u.astype(np.float64), side="right") if len(items) > 1 else 0 * u
    safe = upto.max(initial=0, where=upto < 1) < 1 - 1e-7  # beyond this float32 cannot tell edges from 1
    assert (items.sample(u)[0] == expected).all() or not safe


def test_the_rest_stays_below_one():
    """Both distances from the start of the item, halves of a step of float32, round to the same number."""
    start, end = 2.0**-25, 0.5 + 3 * 2.0**-24
    u = np.float32([0.5 + 2.0**-23])
    index, _, rest = Discrete([start, end - start, 1 - end]).sample(u)
    assert index[0] == 1
    assert u - np.float32(start) == np.float32(end) - np.float32(start)
    assert rest[0] == BELOW_ONE


def test_sums_of_huge_and_tiny_weights():
    assert (Discrete([1e308] * 10).pmf(np.arange(10)) == np.float32(0.1)).all()
    assert (Discrete([5e-324] * 10).pmf(np.arange(10)) == np.float32(0.1)).all()
    assert Distribution2D(np.full((3, 4), 1e308)).pdf(np.float32([0.5]), np.float32([0.5]))[0] == 1


def test_many_items():
    """Among a million equal items, each can be reached and the cumulative sum does not drift."""
    k = 1_000_000
    items = Discrete(np.ones(k))
    assert len(items) == k
    index = items.sample(even(1 << 18))[0]
    assert np.abs(index - (np.arange(1 << 18) + 0.5) / (1 << 18) * k).max() < 1.5
    assert items.sample(np.float32([0]))[0][0] == 0


@pytest.mark.parametrize(
    ("kind", "weights", "message"),
    [
        (Discrete, [0, 0], r"weights are all 0"),
        (Discrete, [1, -2], r"weights\[1\] is -2\.0"),
        (Discrete, [1, float("nan")], r"weights\[1\] is nan"),
        (Discrete, [float("inf")], r"weights\[0\] is inf"),
        (Discrete, [], r"weights must have 1 dimension .* got shape \(0,\)"),
        (Discrete, [[1]], r"weights must have 1 dimension .* got shape \(1, 1\)"),
        (Distribution2D, np.zeros((2, 3)), r"weights are all 0"),
        (Distribution2D, [[1, 2], [3, -1]], r"weights\[1\]\[1\] is -1\.0"),
        (Distribution2D, [[1, float("nan")]], r"weights\[0\]\[1\] is nan"),
        (Distribution2D, [1, 2], r"weights must have 2 dimensions .* got shape \(2,\)"),
        (Distribution2D, np.zeros((0, 4)), r"weights must have 2 dimensions .* got shape \(0, 4\)"),
    ],
)
def test_bad_weights_are_refused(kind, weights, message):
    with pytest.raises(SceneError, match=message):
        kind(weights)


# Two dimensions


def square(n: int) -> np.ndarray:
    """Midpoints (2, n²) of a grid over the unit square, float32."""
    return np.stack([part.ravel() for part in np.meshgrid(even(n), even(n))])


grids = arrays(
    np.float64,
    st.tuples(st.integers(1, 7), st.integers(1, 7)),
    elements=st.one_of(st.just(0.0), st.floats(1e-2, 10)),
    fill=st.nothing(),
).filter(np.any)


@given(weights=grids, u=st.lists(st.tuples(numbers, numbers), min_size=1, max_size=30))
def test_points_lie_in_cells_with_weight(weights, u):
    u = np.float32([*u, (0, 0), (BELOW_ONE, BELOW_ONE), (0, BELOW_ONE), (BELOW_ONE, 0)]).T
    x, y, pdf = Distribution2D(weights).sample(u)
    for part in (x, y, pdf):
        assert part.dtype == np.float32
    for part in (x, y):
        assert (part >= 0).all()
        assert (part < 1).all()
    assert (pdf > 0).all()
    assert Distribution2D(weights).pdf(x, y) == pytest.approx(pdf)


def test_frequencies_of_cells():
    weights = np.random.default_rng(2).random((20, 40)) ** 4
    weights[3:5] = 0
    weights[:, 7] = 0
    u = np.random.default_rng(3).random((2, 1_000_000), np.float32)
    x, y, _ = Distribution2D(weights).sample(u)
    counts = np.bincount((y * 20).astype(int) * 40 + (x * 40).astype(int), minlength=800)
    expected = weights.ravel() / weights.sum() * 1e6
    kept = expected > 5
    assert counts[expected == 0].sum() == 0
    assert (
        stats.chisquare(counts[kept], expected[kept] * counts[kept].sum() / expected[kept].sum()).pvalue
        > 1e-3
    )


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (4, 8)])
def test_even_weights_leave_the_point_where_it_is(shape):
    u = square(50)
    x, y, pdf = Distribution2D(np.full(shape, 3.0)).sample(u)
    assert x == pytest.approx(u[0], abs=1e-6)
    assert y == pytest.approx(u[1], abs=1e-6)
    assert pdf == pytest.approx(1)


def test_an_environment_sized_grid():
    """A sun of one cell in a dim sky of 1024 × 2048 cells gets its share of the samples."""
    weights = np.full((1024, 2048), 1e-3)
    weights[300, 1999] = weights.size * 1e-3
    x, y, pdf = Distribution2D(weights).sample(square(256))
    sun = ((y * 1024).astype(int) == 300) & ((x * 2048).astype(int) == 1999)
    assert sun.mean() == pytest.approx(0.5, abs=0.01)
    assert pdf[sun] == pytest.approx(weights[300, 1999] / weights.mean())


@pytest.mark.parametrize("width", [3, 49, 1000, 2047, 8191])
def test_points_never_round_into_a_neighbor(width):
    """Between columns of no weight, at the very edges of each column, the density stays positive."""
    weights = np.tile(np.arange(width) % 2 == 0, (1, 1))
    share = 1 / np.count_nonzero(weights)
    edges = (np.arange(0, 1, share)[:, None] + share * np.array([0, 1e-7, 0.5, 1 - 1e-7])).ravel()
    u = np.clip(edges, 0, BELOW_ONE).astype(np.float32)
    for plane, first, second in ((weights, 0, 1), (weights.T, 1, 0)):
        pair = np.empty((2, len(u)), np.float32)
        pair[first], pair[second] = u, 0.3
        x, y, pdf = Distribution2D(plane).sample(pair)
        assert (Distribution2D(plane).pdf(x, y) == pdf).all()

"""Discrete tables, densities over a square, guides, and the choice of a light: probabilities at any u."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from inside import (
    LIGHT_SAMPLERS,
    Discrete,
    Distribution2D,
    Emitters,
    Guidance,
    GuideCells,
    GuideTable,
    HalvedLightSampler,
    IrradianceOf,
    LightSampler,
    LightTreeSampler,
    PointLightRecord,
    Receiver,
    SubsetLightSampler,
    TriangleLights,
    WeightedLightSampler,
    grid,
    samplers,
)
from jacobians import (
    assert_density,
    columns,
    doubles,
    few,
    inner,
    places,
    points_of_the_square,
    some,
    surfaces,
    width_of_choice,
)

f4 = np.float32
some_weights = st.floats(0, 1).map(lambda x: 0.0 if x < 0.1 else x)  # some are 0


def check_choice(choose, pmf, u: float, items: int) -> None:
    """The interval of an item is as long as its probability, which is returned with it; their sum is 1."""
    with doubles():
        chosen, chance = choose(np.array([u]))
        width = width_of_choice(lambda v: choose(v)[0], u)
    assume(width > 1e-3)  # float32 tables have an error of 1e-7
    assert chance[0] == pytest.approx(width, rel=1e-3)
    single, returned = choose(f4([u]))
    assert returned[0] == pytest.approx(pmf(single)[0], rel=1e-5)
    assume(single[0] == chosen[0])  # not at an end of the interval
    assert pmf(np.asarray(chosen))[0] == pytest.approx(width, rel=1e-3)
    assert pmf(np.arange(items)).sum(dtype=float) == pytest.approx(1, abs=1e-4)


@some
@given(weights=arrays(float, st.integers(2, 40), elements=some_weights), u=inner)
def test_discrete_tables(weights: np.ndarray, u: float) -> None:
    assume(weights.any())
    table = Discrete(weights)
    check_choice(lambda v: table.sample(v)[:2], table.pmf, u, len(weights))
    with doubles():
        assert_density(lambda v: table.sample(v[0])[2][None], (u,), table.sample(np.array([u]))[1][0])


@some
@given(
    weights=arrays(float, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=some_weights),
    u=points_of_the_square,
)
def test_densities_over_a_square(weights: np.ndarray, u: tuple[float, float]) -> None:
    assume(weights.any())
    table = Distribution2D(weights)
    with doubles():
        x, y, density = table.sample(columns(*u))
        assert_density(lambda v: np.stack(table.sample(v)[:2]), u, density[0])
        assert table.pdf(x, y)[0] == density[0]
    assert table.weights().mean() == pytest.approx(1, rel=1e-6)
    x, y, density = table.sample(columns(*u).astype(f4))
    assert table.pdf(x, y)[0] == density[0]


def guide_of(contents: np.ndarray) -> GuideTable:
    """Two cells, both with rows of 8 × 8 bins."""
    rows = contents + 1e-3 * contents.max()
    cells = GuideCells(np.full(3, -1, f4), f4(1), 0)
    row_of = np.arange(6) % 2
    return GuideTable.of_bins(cells, row_of, rows / rows.sum(1, keepdims=True), np.array([0.3, 0.6]))


guides = arrays(float, (2, 64), elements=some_weights).filter(np.any).map(guide_of)


@some
@given(table=guides, row=st.integers(0, 1), u=points_of_the_square)
def test_guides(table: GuideTable, row: int, u: tuple[float, float]) -> None:
    with doubles():
        rows = lambda v: np.full(v.shape[1], row)  # noqa: E731
        w = table.sample(rows(columns(*u)), columns(*u))
        density = table.pdf(np.array([row]), w)[0]
        assume(density > 1e-2)  # float32 sums of less probable bins have few digits
        assert_density(lambda v: table.sample(rows(v), v), u, density, 1e-3)


@some
@given(table=guides, row=st.integers(0, 1), pdf=st.floats(0, 5, width=32), u=points_of_the_square)
def test_mixtures_of_guides_and_materials(table: GuideTable, row: int, pdf: float, u) -> None:
    """share · table + (1 − share) · BSDF."""
    at = np.array([row])
    w = table.sample(at, columns(*u).astype(f4))
    guidance = Guidance(table, at, table.share.take(at))
    share = (0.3, 0.6)[row]
    due = share * float(table.pdf(at, w)[0]) + (1 - share) * pdf
    assert guidance.mixed(slice(0, 1), w, f4([pdf]))[0] == pytest.approx(due, rel=1e-5)


@few
@given(table=guides)
def test_guides_integrate_to_one(table: GuideTable) -> None:
    z, phi = np.meshgrid((np.arange(150) + 0.5) / 75 - 1, 2 * np.pi * (np.arange(300) + 0.5) / 300)
    r = np.sqrt(1 - z * z)
    w = np.stack([r * np.cos(phi), r * np.sin(phi), z]).reshape(3, -1).astype(f4)
    for row in (0, 1):
        density = table.pdf(np.full(w.shape[1], row), w)
        # at the edges of bins the rule is of first order
        assert 4 * np.pi * density.mean(dtype=float) == pytest.approx(1, abs=0.02)


# --- Choice of lights ------------------------------------------------------------------------------


def lights_of(count: int, seed: int) -> list:
    """Points and triangles around the origin."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-2, 2, (count, 3, 3))
    radiance = rng.uniform(0.1, 2, (3, count)).astype(f4)
    points = rng.uniform(-2, 2, (3, count)).astype(f4)
    return [TriangleLights.from_triangles(corners, radiance), PointLightRecord(points, radiance)]


def tree_of(kinds: list) -> tuple[Emitters, np.ndarray]:
    return Emitters.concatenate([kind.emitters() for kind in kinds]), np.concatenate(
        [kind.power(3.0) for kind in kinds]
    )


counts, number = st.integers(1, 12), st.integers(0, 2**32)


@pytest.mark.parametrize("name", sorted(LIGHT_SAMPLERS))
@some
@given(count=counts, seed=number, surface=surfaces, place=places, u=inner)
def test_light_samplers(name: str, count: int, seed: int, surface, place, u: float) -> None:
    kinds = lights_of(count, seed)
    power = tree_of(kinds)[1]
    with patch.object(grid, "MOST_CELLS", 27):
        choice = LIGHT_SAMPLERS.find(name)(power, np.full(3, 2.0), IrradianceOf(kinds, 3.0))
    check_light_sampler(choice, place, u, 2 * count, surface)


@some
@given(count=counts, seed=number, surface=surfaces, place=places, u=inner)
def test_light_trees(count: int, seed: int, surface, place, u: float) -> None:
    emitters, power = tree_of(lights_of(count, seed))
    check_light_sampler(LightTreeSampler(emitters, power, 3.0), place, u, 2 * count, surface)


@some
@given(
    first=arrays(float, 3, elements=st.floats(0.1, 1)),
    second=arrays(float, 4, elements=st.floats(0.1, 1)),
    u=inner,
)
def test_halved_light_samplers(first: np.ndarray, second: np.ndarray, u: float) -> None:
    parts = [
        SubsetLightSampler(WeightedLightSampler(weights), np.array(chosen), 7)
        for weights, chosen in ((first, (0, 2, 3)), (second, (1, 4, 5, 6)))
    ]
    check_light_sampler(HalvedLightSampler(*parts), (0, 0, 0), u, 7)


def check_light_sampler(choice, place, u: float, lights: int, surface: Receiver | None = None) -> None:
    point = columns(*place).astype(f4)

    def at(n: int) -> tuple[LightSampler, np.ndarray]:
        lit = choice if surface is None else choice.lighting(surface.take(np.zeros(n, int)))
        return lit, np.repeat(point, n, 1)

    def sample(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lit, where = at(v.size)
        return lit.sample(where, v)

    def pmf(light: np.ndarray) -> np.ndarray:
        lit, where = at(light.size)
        return lit.pmf(light, where)

    check_choice(sample, pmf, u, lights)


@some
@given(place=places, u=inner)
def test_the_only_light_is_always_chosen(place, u: float) -> None:
    check_light_sampler(samplers.SingleLightSampler(), place, u, 1)

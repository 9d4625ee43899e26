"""Warps: round trips, densities by quadrature and chi-square, moments, and solid angles."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import SphericalRectangle, warp
from near import assert_near
from scipy import stats

BELOW_ONE = float(np.float32(1 - 2.0**-24))
TURN = 2 * np.pi

numbers = st.floats(0, BELOW_ONE, width=32)
inner = st.floats(2.0**-10, 1 - 2.0**-10, width=32)


def f4(*values: object) -> np.ndarray:
    return np.array(values, np.float32)


def square(n: int) -> np.ndarray:
    """Midpoints (2, n²) of a grid over the unit square, float32."""
    even = ((np.arange(n) + 0.5) / n).astype(np.float32)
    return np.stack([part.ravel() for part in np.meshgrid(even, even)])


def random_square(seed: int, n: int = 1_000_000) -> np.ndarray:
    return np.random.default_rng(seed).random((2, n), np.float32)


@dataclass
class Case:
    """A warp of the sphere with its density as a function of direction."""

    sample: Callable
    pdf: Callable
    inverse: Callable
    bottom: float  # lowest z that it reaches


CONE = np.float32(0.3)
SPHERICAL = {
    "cosine_hemisphere": Case(
        warp.cosine_hemisphere, warp.cosine_hemisphere_pdf, warp.cosine_hemisphere_inverse, 0
    ),
    "uniform_hemisphere": Case(
        warp.uniform_hemisphere, warp.uniform_hemisphere_pdf, warp.uniform_hemisphere_inverse, 0
    ),
    "uniform_sphere": Case(warp.uniform_sphere, warp.uniform_sphere_pdf, warp.uniform_sphere_inverse, -1),
    "uniform_cone": Case(
        lambda u: warp.uniform_cone(u, CONE),
        lambda w: np.where(w[2] >= 1 - CONE, warp.uniform_cone_pdf(CONE), 0),
        lambda w: warp.uniform_cone_inverse(w, CONE),
        1 - float(CONE),
    ),
}
spherical = pytest.mark.parametrize("name", SPHERICAL)


# Directions


@spherical
def test_corners_of_the_square_give_unit_directions(name):
    case = SPHERICAL[name]
    w = case.sample(f4([0, 0, BELOW_ONE, BELOW_ONE], [0, BELOW_ONE, 0, BELOW_ONE]))
    assert np.linalg.norm(w.astype(float), axis=0) == pytest.approx(1, abs=5e-7)
    assert (w[2] >= case.bottom - 1e-7).all()
    back = case.inverse(w)
    assert (back >= 0).all()
    assert (back[0] < 1).all()


def check_counts(observed: np.ndarray, expected: np.ndarray) -> None:
    """Chi-square test; cells that expect fewer than 5 are pooled."""
    assert expected.sum() == pytest.approx(observed.sum(), rel=1e-4)
    small = expected < 5
    observed, expected = observed.astype(float), expected * (observed.sum() / expected.sum())
    if small.any():
        observed = np.append(observed[~small], observed[small].sum())
        expected = np.append(expected[~small], expected[small].sum())
    assert stats.chisquare(observed, expected).pvalue > 1e-3


def mean(values: np.ndarray) -> float:
    return float(np.mean(values, dtype=np.float64))


def test_moments():
    """Reference values 17: cosine 2/3 and 1/2, hemisphere 1/2, sphere 1/3, disk 1/2."""
    u = square(1000)
    z = warp.cosine_hemisphere(u)[2]
    assert mean(z) == pytest.approx(2 / 3, abs=1e-5)
    assert mean(z * z) == pytest.approx(1 / 2, abs=1e-5)
    assert mean(warp.uniform_hemisphere(u)[2]) == pytest.approx(1 / 2, abs=1e-5)
    assert mean(warp.uniform_sphere(u)[2] ** 2) == pytest.approx(1 / 3, abs=1e-5)
    assert mean((warp.uniform_disk(u) ** 2).sum(axis=0)) == pytest.approx(1 / 2, abs=1e-5)


def test_cosine_hemisphere_is_the_closed_form():
    u = random_square(5, 1000)
    r1, r2 = u.astype(np.float64)
    expected = [np.cos(TURN * r1) * np.sqrt(1 - r2), np.sin(TURN * r1) * np.sqrt(1 - r2), np.sqrt(r2)]
    assert warp.cosine_hemisphere(u) == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("name", ["cosine_hemisphere", "uniform_hemisphere"])
def test_hemispheres_have_no_density_below(name):
    assert (SPHERICAL[name].pdf(f4([0, 0.6], [0, 0], [-1, -0.8])) == 0).all()


@given(exponent=st.floats(-12, 0), a=numbers, b=inner)
def test_tiny_cones_keep_their_digits(exponent, a, b):
    size = np.float32(10.0**exponent)
    w = warp.uniform_cone(f4([a], [b]), size)
    sine = np.hypot(*w[:2].astype(np.float64))
    depth = b * float(size)
    assert sine == pytest.approx(np.sqrt(depth * (2 - depth)), rel=1e-5)
    assert warp.uniform_cone_inverse(w, size)[1] == pytest.approx(b, rel=1e-4)
    assert float(warp.uniform_cone_pdf(size)) * TURN * float(size) == pytest.approx(1, rel=1e-6)


def test_cones_per_lane_and_the_empty_cone():
    size = f4(0, 1, 2)
    assert warp.uniform_cone(square(3)[:, :3], size).shape == (3, 3)
    assert warp.uniform_cone_pdf(size) == pytest.approx([0, 1 / TURN, 0.5 / TURN])


# Flat shapes


def test_the_centre_and_the_diagonals_of_the_disk():
    """Where the concentric map changes its formula, and where it would divide 0 by 0."""
    u = f4([0.5, 0, 1, 0, 0.5, 0], [0.5, 0, 0, 0.5, 0, 1])
    h = np.sqrt(0.5)
    expected = f4([0, -h, h, -1, 0, -h], [0, -h, -h, 0, -1, h])
    assert warp.uniform_disk(u) == pytest.approx(expected, abs=1e-6)


def test_densities_vanish_outside():
    assert (warp.uniform_disk_pdf(f4([1.1, -0.8], [0, 0.8])) == 0).all()
    assert (warp.uniform_triangle_pdf(f4([-0.1, 0.2, 0.6], [0.2, -0.1, 0.6])) == 0).all()


# Pixel filters


FILTERS = {
    "tent": (warp.tent, warp.tent_pdf, warp.tent_inverse, {"radius": 1.5}, 1.5**2 / 6),
    "gaussian": (
        warp.gaussian,
        warp.gaussian_pdf,
        warp.gaussian_inverse,
        {"sigma": 0.5, "radius": 1.0},
        float(stats.truncnorm(-2, 2, scale=0.5).var()),
    ),
    "windowed gaussian": (
        warp.windowed_gaussian,
        warp.windowed_gaussian_pdf,
        warp.windowed_gaussian_inverse,
        {"sigma": 0.5, "radius": 1.0},
        0.15252612,
    ),
}
filters = pytest.mark.parametrize("name", FILTERS)


@filters
def test_filters_integrate_to_one_and_have_their_variance(name):
    sample, pdf, _, shape, variance = FILTERS[name]
    x = ((np.arange(100_000) + 0.5) / 25_000 - 2).astype(np.float32)
    assert 4 * mean(pdf(x, **shape)) == pytest.approx(1, abs=1e-4)
    offsets = sample(((np.arange(100_000) + 0.5) / 100_000).astype(np.float32), **shape)
    assert mean(offsets) == pytest.approx(0, abs=1e-5)
    assert mean(offsets**2) == pytest.approx(variance, rel=1e-4)


@filters
def test_filters_follow_their_density(name):
    sample, pdf, _, shape, _ = FILTERS[name]
    radius = shape["radius"]
    x = sample(random_square(7)[0], **shape)
    observed = np.histogram(x, 800, (-radius, radius))[0]
    fine = (((np.arange(800 * 16) + 0.5) / (800 * 16)) * 2 - 1).astype(np.float32) * np.float32(radius)
    expected = pdf(fine, **shape).astype(np.float64).reshape(800, 16).mean(axis=1) * 2 * radius / 800 * 1e6
    check_counts(observed, expected)


@pytest.mark.parametrize("sigma", [0.1, 0.3, 0.5, 0.7, 1, 3])
@pytest.mark.parametrize("radius", [0.5, 0.7, 1, 1.5, 2])
def test_gaussian_offsets_stay_within_the_radius(sigma, radius):
    assert np.abs(warp.gaussian(f4(0, BELOW_ONE), sigma, radius)).max() <= np.float32(radius)


def test_error_functions_against_scipy():
    from scipy.special import erf, erfinv

    x = np.linspace(-4, 4, 2001, dtype=np.float32)
    assert warp._erf(x) == pytest.approx(erf(x.astype(np.float64)), abs=3e-7)
    y = np.concatenate([np.linspace(-0.9999, 0.9999, 2001), [0.99999, 0.999999]]).astype(np.float32)
    assert warp._erfinv(y) == pytest.approx(erfinv(y.astype(np.float64)), rel=1e-5, abs=1e-7)


# Solid angles


def test_solid_angle_of_reference():
    """A 2 × 2 rectangle at height 1 covers 2.094395."""
    rectangle = [f4(*row).reshape(3, 1) for row in ((-1, -1, 1), (2, 0, 0), (0, 2, 0))]
    assert SphericalRectangle.of(*rectangle).solid_angle[0] == pytest.approx(2.094395, abs=1e-6)


RECTANGLES = {
    "facing": ((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
    "behind": ((-1, -1, -1), (0, 2, 0), (2, 0, 0)),
    "aside": ((1, 0.5, 0.7), (0.8, 0, 0.6), (0, 2, 0)),
    "grazing": ((0.1, -3, 0.05), (5, 0, 0), (0, 6, 0)),
    "far": ((10, -40, 90), (1, 0, 0), (0, 0, 2)),
}
rectangles = pytest.mark.parametrize("name", RECTANGLES)


def rectangle_of(name: str) -> SphericalRectangle:
    return SphericalRectangle.of(*(f4(*row).reshape(3, 1) for row in RECTANGLES[name]))


@rectangles
def test_points_lie_in_the_rectangle(name):
    corner, edge_u, edge_v = (np.array(row, float)[:, None] for row in RECTANGLES[name])
    p = (
        rectangle_of(name).sample(np.concatenate([square(40), f4([0, BELOW_ONE], [0, BELOW_ONE])], axis=1))
        - corner
    )
    reach = np.linalg.norm(corner) * 1e-6
    for edge in (edge_u, edge_v):
        along = (p * edge).sum(axis=0) / np.linalg.norm(edge)
        assert along.min() > -reach
        assert along.max() < np.linalg.norm(edge) + reach
    assert np.abs((p * np.cross(edge_u, edge_v, axis=0)).sum(axis=0)).max() < 10 * reach


@rectangles
def test_points_of_rectangles_are_uniform_in_solid_angle(name):
    corner, edge_u, edge_v = (np.array(row, float) for row in RECTANGLES[name])
    p = rectangle_of(name).sample(random_square(12)).astype(np.float64) - corner[:, None]
    row = np.clip((edge_u @ p / (edge_u @ edge_u) * 20).astype(int), 0, 19)
    column = np.clip((edge_v @ p / (edge_v @ edge_v) * 40).astype(int), 0, 39)
    observed = np.bincount(row * 40 + column, minlength=800)
    s, t = ((np.arange(k * 32) + 0.5) / (k * 32) for k in (20, 40))
    s, t = np.meshgrid(s, t, indexing="ij")
    q = corner[:, None, None] + edge_u[:, None, None] * s + edge_v[:, None, None] * t
    density = np.abs(corner @ np.cross(edge_u, edge_v)) * np.linalg.norm(q, axis=0) ** -3
    expected = density.reshape(20, 32, 40, 32).mean(axis=(1, 3)) / 800
    assert expected.sum() == pytest.approx(float(rectangle_of(name).solid_angle[0]), rel=1e-3)
    check_counts(observed, (expected / expected.sum() * 1e6).ravel())


def test_shapes_that_cover_nothing_have_no_density():
    edge_on = SphericalRectangle.of(*(f4(*row).reshape(3, 1) for row in ((1, 1, 0), (1, 0, 0), (0, 1, 0))))
    assert edge_on.pdf()[0] == 0
    assert np.isfinite(edge_on.sample(square(2)[:, :1])).all()
    within = SphericalRectangle.of(*(f4(*row).reshape(3, 1) for row in ((-1, -1, 0), (2, 0, 0), (0, 2, 0))))
    assert within.pdf()[0] == 0


@pytest.mark.parametrize("aspect", [1, 10, 100])
def test_float32_is_enough_for_rectangles_that_are_not_seen_edge_on(aspect: float) -> None:
    """From a quarter of its width off its plane on, densities and directions are those of float64."""
    rng = np.random.default_rng(aspect)
    u, v = aspect**0.5, aspect**-0.5
    place = rng.uniform((-1.4, -1.4, 0.25), (1.4, 1.4, 1.4), (20_000, 3)).T
    corner = (place - np.array([[u / 2], [v / 2], [0]])).astype(np.float32)
    edges = f4(u, 0, 0).reshape(3, 1), f4(0, v, 0).reshape(3, 1)
    fine, coarse = (SphericalRectangle.of(corner, *edges, dtype) for dtype in (np.float64, np.float32))
    numbers = rng.random((2, corner.shape[1])).astype(np.float32)
    assert_near(coarse.pdf(), fine.pdf(), rel=2e-4)
    assert coarse.sample(numbers).dtype == np.float32
    assert_near(coarse.sample(numbers), fine.sample(numbers), abs=5e-4 * u)


def test_points_stay_in_a_rectangle_that_touches_the_plane_of_sight():
    """At 1e-12 above the plane the tangent amplifies rounding without bound."""
    rectangle = SphericalRectangle.of(
        *(f4(*row).reshape(3, 1) for row in ((1, -1, 1e-12), (2, 0, 0), (0, 2, 0)))
    )
    x, y, _ = rectangle.sample(square(40))
    assert ((x >= 1) & (x <= 3)).all()
    assert ((y >= -1) & (y <= 1)).all()


def test_a_shape_per_lane():
    """Lanes are independent: many shapes at once give the bits of one at a time."""
    u = random_square(9, 5)
    stacked = [f4(*column).T.copy() for column in zip(*RECTANGLES.values(), strict=True)]
    together = SphericalRectangle.of(*stacked).sample(u)
    for i, name in enumerate(RECTANGLES):
        assert (rectangle_of(name).sample(u[:, i : i + 1])[:, 0] == together[:, i]).all()

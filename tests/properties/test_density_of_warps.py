"""The densities of warps, by differentiation at any u; inverses; integrals."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from inside import SphericalRectangle, filters, warp
from jacobians import assert_density, columns, doubles, inner, points_of_the_square, some

EMPTY = st.just(())
# name: further arguments
SQUARE = {
    "cosine_hemisphere": EMPTY,
    "uniform_hemisphere": EMPTY,
    "uniform_sphere": EMPTY,
    "uniform_cone": st.tuples(st.floats(-6, 0.3).map(lambda x: float(np.float32(min(10.0**x, 2.0))))),
    "uniform_disk": EMPTY,
    "uniform_triangle": EMPTY,
    "linear": st.tuples(st.tuples(*[st.floats(-0.96875, 0.96875, width=32)] * 2).map(lambda s: columns(*s))),
}
BELL = st.tuples(st.floats(0.2, 2), st.floats(0.5, 3))  # σ and radius
LINE = {"tent": st.tuples(st.floats(0.25, 4)), "gaussian": BELL, "windowed_gaussian": BELL}
WITHOUT_POINT = ("uniform_cone_pdf",)  # constant densities, which take no point


def of(name: str):
    """A warp, its density at points, and its inverse."""
    sample, pdf, inverse = (getattr(warp, name + part) for part in ("", "_pdf", "_inverse"))
    if name + "_pdf" in WITHOUT_POINT:
        return sample, lambda w, *more: np.broadcast_to(pdf(*more), w.shape[1:]), inverse
    return sample, pdf, inverse


def test_every_warp_is_here() -> None:
    named = {name.removesuffix("_pdf") for name in vars(warp) if name.endswith("_pdf")}
    assert named == {*SQUARE, *LINE}


@pytest.mark.parametrize("name", SQUARE)
@some
@given(data=st.data(), u=points_of_the_square)
def test_density_of_points(name: str, data: st.DataObject, u: tuple[float, float]) -> None:
    more = data.draw(SQUARE[name])
    sample, pdf, inverse = of(name)
    with doubles():
        w = sample(columns(*u), *more)
        assert_density(lambda v: sample(v, *more), u, pdf(w, *more)[0])
        if name == "linear":
            np.testing.assert_allclose(warp.linear_with_density(columns(*u), *more)[1], pdf(w, *more))
        np.testing.assert_allclose(inverse(w, *more)[:, 0], u, atol=1e-6)
    single = sample(columns(*u).astype(np.float32), *map(np.float32, more))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, w, atol=1e-5)  # float32 code computes the same
    np.testing.assert_allclose(pdf(single, *map(np.float32, more)), pdf(w, *more), rtol=2e-2, atol=1e-6)


@pytest.mark.parametrize("name", LINE)
@some
@given(data=st.data(), u=inner)
def test_density_of_offsets(name: str, data: st.DataObject, u: float) -> None:
    more = data.draw(LINE[name])
    if len(more) == 2:
        assume(0.4 < more[1] / more[0] < 5)
    sample, pdf, inverse = of(name)
    # the inverse error function is a fit with an error of 3e-7, which differences do not see; the windowed
    # density is constant in cells, at whose edges the slopes on both sides differ
    rounding = {"gaussian": 1e-4, "windowed_gaussian": 5e-3}.get(name, 2e-6)
    with doubles():
        x = sample(np.array([u]), *more)
        assume(abs(x[0]) < 0.999 * more[-1])  # not clipped
        assert_density(lambda v: sample(v[0], *more)[None], (u,), pdf(x, *more)[0], rounding)
        np.testing.assert_allclose(inverse(x, *more), u, atol=1e-6)
    single = sample(np.float32([u]), *more)
    np.testing.assert_allclose(single, x, rtol=3e-6, atol=3e-7 / float(pdf(x, *more)[0]))  # rounding of u


@pytest.mark.parametrize("name", SQUARE)
@some
@given(data=st.data())
def test_densities_integrate_to_one(name: str, data: st.DataObject) -> None:
    """The midpoint rule, over z and the azimuth, or over a square of the plane."""
    more = data.draw(SQUARE[name])
    _, pdf, _ = of(name)
    if name == "linear":  # over the unit square alone
        p = ((np.indices((50, 50)).reshape(2, -1) + 0.5) / 50).astype(np.float32)
        assert pdf(p, *more).mean(dtype=float) == pytest.approx(1, abs=1e-5)
        return
    if name in ("uniform_disk", "uniform_triangle"):
        a, b = ((np.arange(400) + 0.5) / 200 - 1 for _ in range(2))
        p = np.array(np.meshgrid(a, b)).reshape(2, -1).astype(np.float32)
        total = 4 * pdf(p, *more).mean(dtype=float)
        assert total == pytest.approx(1, abs=5e-3)  # cells on the edge: 4 × 400 of 160 000, half of them
        return
    low = 1 - more[0] if more else -1 if name == "uniform_sphere" else 0
    z = low + (1 - low) * (np.arange(2000) + 0.5) / 2000
    w = np.stack([np.sqrt((1 - z) * (1 + z)), np.zeros_like(z), z]).astype(np.float32)
    total = 2 * np.pi * (1 - low) * pdf(w, *map(np.float32, more)).mean(dtype=float)
    assert total == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("name", LINE)
@some
@given(data=st.data())
def test_densities_of_offsets_integrate_to_one(name: str, data: st.DataObject) -> None:
    more = data.draw(LINE[name])
    _, pdf, _ = of(name)
    x = more[-1] * ((np.arange(4000) + 0.5) / 2000 - 1).astype(np.float32)
    assert 2 * more[-1] * pdf(x, *more).mean(dtype=float) == pytest.approx(1, abs=1e-4)


edge = st.floats(0.05, 5)


@some
@given(
    corner=st.tuples(*[st.floats(-4, 4)] * 3), a=edge, b=edge, turn=st.floats(0, 6.2), u=points_of_the_square
)
def test_density_of_spherical_rectangles(corner, a, b, turn, u) -> None:
    """Directions to any rectangle: perpendicular edges, seen from anywhere but its own plane."""
    tilt = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    tilt = tilt @ np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    edges = [np.ascontiguousarray((tilt[:, k] * size).reshape(3, 1)) for k, size in enumerate((a, b))]
    at = columns(*corner)
    with doubles():
        seen = SphericalRectangle.of(at, *edges)
        assume(abs(seen.height[0]) > 0.02 * max(a, b))
        assume(seen.pdf()[0] < 1e5)

        def direction(v):
            w = seen.sample(v)
            return w / np.linalg.norm(w, axis=0)

        assert_density(direction, u, seen.pdf()[0], 1e-5)
        np.testing.assert_allclose(seen.inverse(seen.sample(columns(*u)))[:, 0], u, atol=1e-5)


DENSITIES = {  # of one coordinate
    "box": lambda x: 1.0,
    "tent": lambda x: warp.tent_pdf(x, 1.0),
    "gaussian": lambda x: warp.gaussian_pdf(x, 0.5, 1.5),
    "wide box": lambda x: 0.25,
    "wide tent": lambda x: warp.tent_pdf(x, 2.0),
    "wide gaussian": lambda x: warp.gaussian_pdf(x, 0.75, 2.0),
}
OWN = {
    "wide box": filters.BoxFilter(2.0),
    "wide tent": filters.TentFilter(2.0),
    "wide gaussian": filters.GaussianFilter(2.0, 0.75),
}


def test_every_filter_is_here() -> None:
    assert {*filters.FILTERS, *OWN} == set(DENSITIES)


@pytest.mark.parametrize("name", DENSITIES)
@some
@given(u=points_of_the_square)
def test_density_of_filters(name: str, u: tuple[float, float]) -> None:
    """Positions in a pixel: the product of the densities of both coordinates."""
    density = DENSITIES[name]
    with doubles():
        place = OWN.get(name) or filters.FILTERS.find(name)
        x, y = place(columns(*u))[:, 0] - 0.5
        assert_density(place, u, density(x) * density(y), 2e-4)

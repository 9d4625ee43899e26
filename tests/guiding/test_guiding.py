"""Path guiding: tables of directions, their mixture with BSDFs, and pictures that stay unbiased."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import GUIDING_SHARES as SHARES
from inside import GUIDING_SIDE as SIDE
from inside import (
    Dimension,
    Frame,
    Guidance,
    GuideCells,
    GuideTable,
    Paths,
    Records,
    Shading,
    SurfaceInteraction,
    _best_shares,
    bins_of,
    broadcast,
    build_table,
    directions_at,
    f4,
    mix_with_guide,
    neighbors,
    solid_angles,
    train,
)
from scenes import DIRECT_CASES, room
from significance import assert_mean, measure
from threadpoolctl import threadpool_info

import wavefront as wf

LARGE = GuideCells(np.zeros(3, f4), f4(1), 0)


def directions(n: int, seed: int = 0) -> np.ndarray:
    w = np.random.default_rng(seed).normal(size=(3, n))
    return (w / np.linalg.norm(w, axis=0)).astype(f4)


def random_table(seed: int = 0, side: int = 8, share: float = 0.5) -> GuideTable:
    """Three rows of densities with empty bins."""
    rng = np.random.default_rng(seed)
    contents = rng.exponential(size=(3, side * side)) * (rng.random((3, side * side)) < 0.7)
    contents /= contents.sum(1, keepdims=True)
    return GuideTable.of_bins(LARGE, np.arange(6) // 2, contents, np.full(3, share))


# --- Tables ---------------------------------------------------------------------------------------


def test_bins_cover_the_sphere() -> None:
    """As many uniform directions lie in each bin as its solid angle says, on average."""
    n = 400_000
    counts = np.bincount(bins_of(directions(n), 8)[0], minlength=64)
    expected = n * solid_angles(8) / (4 * np.pi)
    assert solid_angles(8).sum() == pytest.approx(4 * np.pi)
    assert np.abs(counts - expected).max() < 5 * np.sqrt(expected.max())


@given(st.integers(0, 2**32 - 1))
def test_directions_return_to_their_bin(seed: int) -> None:
    x, y = np.random.default_rng(seed).uniform(-1, 1, (2, 50)).astype(f4)
    w = directions_at(x, y)
    assert np.allclose((w**2).sum(0), 1, atol=1e-6)
    column, row = (np.clip((v + 1) * 4, 0, 7).astype(int) for v in (x, y))
    inside = (np.abs((x + 1) * 4 % 1 - 0.5) < 0.49) & (np.abs((y + 1) * 4 % 1 - 0.5) < 0.49)
    assert (bins_of(w, 8)[0] == row * 8 + column)[inside].all()


def test_neighbors_touch() -> None:
    """Bins around a bin are near to it on the sphere, also across the edges, and so is it to them."""
    side = 16
    at = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = np.meshgrid(at, at)
    w = directions_at(x.ravel().astype(f4), y.ravel().astype(f4))
    near = neighbors(side)
    assert min((w[:, bins] * w).sum(0).min() for bins in near) > np.cos(np.radians(30))
    pairs = {(a, b) for bins in near for a, b in enumerate(bins.tolist())}
    assert all((b, a) in pairs for a, b in pairs)


def triangle_solid_angle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """A. van Oosterom and J. Strackee, The Solid Angle of a Plane Triangle, 1983."""
    triple = abs(float(a @ np.cross(b, c)))
    return 2 * float(np.arctan2(triple, 1 + a @ b + b @ c + c @ a))


def test_solid_angles_of_bins_are_those_of_their_triangles() -> None:
    """Lines on the octahedron are arcs of great circles, so a bin is two spherical triangles.

    They meet in a diagonal of the bin that is parallel to the edge of the octahedron in its quadrant.
    """
    side = 8
    found = solid_angles(side).reshape(side, side)
    for row, column in np.ndindex(side, side):
        x, y = np.array([column, column + 1]) * 2 / side - 1, np.array([row, row + 1]) * 2 / side - 1
        corners = [
            directions_at(np.array([x[i]]), np.array([y[j]]))[:, 0].astype(float)
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        if (x[0] < 0) == (y[0] < 0):
            corners = corners[1:] + corners[:1]
        a, b, c, d = corners
        exact = triangle_solid_angle(a, b, c) + triangle_solid_angle(a, c, d)
        assert found[row, column] == pytest.approx(exact, rel=4e-3)
    assert found == pytest.approx(found.T, rel=1e-12)
    assert found == pytest.approx(found[::-1], rel=1e-12)


@pytest.mark.parametrize("row", [0, 1, 2])
def test_tables_sample_their_pdf(row: int) -> None:
    """By a chi-squared test, and the density integrates to 1."""
    table = random_table()

    def sample(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        w = table.sample(np.full(u.shape[1], row), u)
        return w, table.pdf(np.full(u.shape[1], row), w)

    u = np.random.default_rng(row).random((2, 200_000)).astype(f4)
    w, pdf = sample(u)
    bins, _ = bins_of(w, 8)
    expected = table.density.reshape(3, 64)[row] / 64 * u.shape[1]
    counts = np.bincount(bins, minlength=64)
    assert not counts[expected == 0].any()
    full = expected > 0
    chi2 = ((counts - expected)[full] ** 2 / expected[full]).sum()
    assert chi2 < full.sum() + 5 * np.sqrt(2 * full.sum())
    uniform = directions(400_000, seed=row)
    density = table.pdf(np.full(uniform.shape[1], row), uniform) * 4 * np.pi
    assert density.mean() == pytest.approx(1, abs=5 * density.std() / np.sqrt(density.size))
    assert (pdf > 0).all()


def test_cells_tell_points_and_normals_apart() -> None:
    cells = GuideCells.around(np.random.default_rng(0).uniform(-1, 1, (3, 1000)).astype(f4), 3)
    point = np.array([[-0.9, 0.9, 0.9], [0, 0, 0], [0, 0, 0]], f4)
    normal = np.array([[0, 0, 1], [1, 1, 0], [0, 0, 0]], f4)
    assert len(set(cells.of(point, normal).tolist())) == 3
    far = np.full((3, 1), 1e9, f4)
    assert 0 <= cells.of(far, normal[:, :1])[0] < len(cells)
    assert (cells.coarser(cells.of(point, normal), 0) == [2, 2, 0]).all()


def test_cells_are_those_of_a_grid_for_each_axis() -> None:
    """A cubic grid around all but 0.2 % of the points on each side, and a margin of 1 %."""
    point, normal = np.random.default_rng(1).uniform(-1, 1, (3, 1000)).astype(f4), directions(1000)
    cells = GuideCells.around(point, 3)
    low, high = np.quantile(point, (0.002, 0.998), axis=1)
    extent = (high - low).max()
    point[:, :50] *= 3  # points outside belong to the nearest cell
    at = (point - (low - 0.01 * extent)[:, None]) / (extent * 1.02 / 8)
    inside = (np.abs(at - np.round(at)) > 1e-4).all(0)
    x, y, z = at.clip(0, 7.5).astype(int)
    axis = np.abs(normal).argmax(0)
    number = 2 * axis + (np.take_along_axis(normal, axis[None], 0)[0] < 0)
    found = cells.of(point, normal)
    assert inside.sum() > 990
    assert (found == ((number * 8 + x) * 8 + y) * 8 + z)[inside].all()
    for level, side in enumerate((1, 2, 4, 8)):
        step = 8 // side
        expected = ((number * side + x // step) * side + y // step) * side + z // step
        assert (cells.coarser(found, level) == expected)[inside].all()


# --- Training -------------------------------------------------------------------------------------


def records_of(row: int, density: np.ndarray, share: float, n: int, rng: np.random.Generator) -> Records:
    """What n directions find of light that is proportional to a mixture of this share."""
    drawn = 0.5 / density.size + 0.5 * density
    bins = rng.choice(density.size, n, p=drawn)
    angles, even = solid_angles(SIDE)[bins], 1 / (4 * np.pi)
    light = (1 - share) * even + share * density[bins] / angles
    return Records(np.full(n, row), bins, light, light, drawn[bins] / angles, np.full(n, even))


def test_tables_learn_the_light_that_arrives() -> None:
    """In each cell by itself, from directions that were drawn by another density."""
    rng = np.random.default_rng(0)
    at = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    x, y = (v.ravel().astype(f4) for v in np.meshgrid(at, at))
    axes = np.repeat(np.eye(3), 2, axis=0) * np.array([1, -1] * 3)[:, None]
    light = (axes @ directions_at(x, y)).clip(0) ** 2 * solid_angles(SIDE)  # smooth, so that bins agree
    light /= light.sum(1, keepdims=True)
    found = [records_of(axis, light[axis], 1, 100_000, rng) for axis in range(6)]
    table = build_table(Records.concatenate(found), LARGE)
    learned = table.density.reshape(6, -1)[table.row_of] / SIDE**2
    assert np.abs(learned - light).sum(1) == pytest.approx(0, abs=0.04)
    few = build_table(records_of(0, light[0], 1, 500, rng), LARGE)
    assert few.density.reshape(-1, SIDE**2)[few.row_of] / SIDE**2 == pytest.approx(
        np.tile(solid_angles(SIDE) / (4 * np.pi), (6, 1)), rel=1e-4
    )


def test_the_share_of_a_guide_is_that_of_least_variance() -> None:
    """Each row has the share that leaves no variance, and one with few records that of most others."""
    rng = np.random.default_rng(0)
    contents = rng.exponential(size=(6, SIDE**2)) ** 2
    contents /= contents.sum(1, keepdims=True)
    table = GuideTable.of_bins(LARGE, np.arange(6), contents, np.full(6, 0.5))
    found = [records_of(row, contents[row], share, 20_000, rng) for row, share in enumerate(SHARES)]
    assert _best_shares(table, Records.concatenate(found)) == pytest.approx(SHARES)
    most = [records_of(row, contents[row], 0.75, 20_000, rng) for row in range(5)]
    few = records_of(5, contents[5], 0.0, 5, rng)
    assert _best_shares(table, Records.concatenate([*most, few])) == pytest.approx(0.75)


# --- The mixture ----------------------------------------------------------------------------------


class Given:
    """A sampler that returns given numbers for the decisions of a guide."""

    def __init__(self, u: np.ndarray) -> None:
        self.u = u

    def draw_1d(self, pixel: np.ndarray, sample: np.ndarray, bounce: int, dimension: int) -> np.ndarray:
        assert dimension == Dimension.GUIDE
        return self.u[2]

    def draw_2d(self, pixel: np.ndarray, sample: np.ndarray, bounce: int, dimension: int) -> np.ndarray:
        assert dimension == Dimension.GUIDE_DIRECTION
        return self.u[:2].take(pixel, 1)


class Guided(wf.Bsdf):
    """A BSDF whose samples are those of the mixture with a table; normals are z."""

    dimensions = 6

    def __init__(self, inner: wf.Bsdf, table: GuideTable) -> None:
        self.inner, self.table = inner, table

    def f(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        return self.inner.f(wo, wi)

    def pdf(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        return self._guidance(wi.shape[1]).mixed(slice(None), wi, self.inner.pdf(wo, wi))

    def sample_f(self, wo: np.ndarray, u: np.ndarray) -> wf.BsdfSample:
        n = u.shape[1]
        zero, z = np.zeros((3, n), f4), np.repeat(np.array([[0], [0], [1]], f4), n, 1)
        surface = SurfaceInteraction(
            zero, zero[0], z, z, wo, np.zeros(n, int), np.zeros(n, int), np.zeros(n, np.bool_)
        )
        group = [(slice(0, n), self.inner)]
        shade = Shading(surface, Frame.from_normal(z), wo, zero, group, self._guidance(n))
        number = np.arange(n, dtype=np.uint32)
        paths = Paths(
            zero,
            zero,
            np.zeros(n, int),
            np.arange(n),
            number,
            number,
            *(np.ones((3, n), f4), broadcast(f4(1), n), broadcast(np.True_, n), broadcast(f4(1), n)),
        )
        sample = self.inner.sample_f(wo, u[:3])
        mixed, direction, _ = mix_with_guide(shade, paths, sample, sample.wi, Given(u[3:]), 0)
        assert np.allclose(direction, mixed.wi, atol=1e-6)
        return mixed

    def _guidance(self, n: int) -> Guidance:
        return Guidance(self.table, np.ones(n, int), np.broadcast_to(self.table.share[1], n))


mixtures = pytest.mark.parametrize(
    "bsdf",
    [
        wf.Diffuse(0.7),
        wf.Principled(0.5, roughness=0.3),
        wf.Mix(wf.Diffuse(0.7), wf.Mirror(0.9), 0.4),
    ],
    ids=repr,
)


@mixtures
@pytest.mark.first(1)
def test_the_mixture_has_its_pdf(bsdf: wf.Bsdf) -> None:
    """By the public checks of a BSDF: pdf against samples, weight = f·cos/pdf, and albedo."""
    wf.testing.check_bsdf(Guided(bsdf, random_table(share=0.4)), samples=25_000, angles=(60,))


@mixtures
def test_the_mixture_keeps_the_albedo(bsdf: wf.Bsdf) -> None:
    """Delta lobes, too, which the table never draws, have the weight of all their light."""
    n = 100_000
    wo = np.repeat(np.array([[0.6], [0], [0.8]], f4), n, 1)
    u = np.random.default_rng(0).random((6, n)).astype(f4)
    guided = Guided(bsdf, random_table(share=0.4)).sample_f(wo, u).weight[0]
    plain = bsdf.sample_f(wo, u[:3]).weight[0]
    error = np.hypot(guided.std(), plain.std()) / np.sqrt(n)
    assert error < 0.01
    assert abs(guided.mean(dtype=float) - plain.mean(dtype=float)) < 4 * error


# --- Pictures -------------------------------------------------------------------------------------


def lamp_at_the_ceiling(size: tuple[int, int] = (16, 16)) -> wf.Scene:
    """A closed room whose only lamp shines at the ceiling."""
    inside = wf.Mesh(
        [(x, y, z) for x in (0, 4) for y in (0, 3) for z in (0, 5)],
        [
            (0, 1, 3),
            (0, 3, 2),
            (4, 6, 7),
            (4, 7, 5),
            (0, 4, 5),
            (0, 5, 1),
            (2, 3, 7),
            (2, 7, 6),
            (0, 2, 6),
            (0, 6, 4),
            (1, 5, 7),
            (1, 7, 3),
        ],
        material=wf.Diffuse(0.75),
    )
    lamp = wf.Rectangle(
        (0.5, 2.0, 0.5), (0, 0, 0.6), (0.6, 0, 0), material=wf.Material(wf.Diffuse(0), emission=40)
    )
    ball = wf.Sphere((2.4, 0.6, 2), 0.6, material=wf.Principled((0.6, 0.3, 0.2), roughness=0.2))
    camera = wf.Camera.look_at((2, 1.5, 4.9), (2, 1.2, 0), fov=60, size=size)
    return wf.Scene([inside, lamp, ball], camera=camera)


@pytest.mark.slow
def test_guided_pictures_agree_with_plain_ones_and_have_less_noise() -> None:
    plain = wf.render(lamp_at_the_ceiling(), 256, progress=False)
    guided = wf.render(lamp_at_the_ceiling(), 256, guide=True, seed=1, progress=False)
    means = [image.rgb.mean(dtype=float) for image in (plain, guided)]
    errors = [
        np.sqrt((image.standard_error.astype(float) ** 2).sum()) / image.rgb.size for image in (plain, guided)
    ]
    assert abs(means[0] - means[1]) < 4 * np.hypot(*errors)
    assert guided.metadata["noise"] < 0.7 * plain.metadata["noise"]


@pytest.mark.usefixtures("short_training")
def test_light_samples_are_weighted_by_what_a_table_draws(short_training: None) -> None:
    """By densities of BSDFs alone the floor would be 1.4 times as bright."""
    (case,) = (case for case in DIRECT_CASES if case.name == "half-hidden rectangle")
    found = measure(case.build(), 64, guide=True, max_bounces=4)
    assert_mean(found, case.expected, 0.005)


def test_guided_pictures_do_not_depend_on_workers_or_waves(short_training: None) -> None:
    scene = lamp_at_the_ceiling((8, 8))
    one = wf.render(scene, 4, guide=True, workers=1, progress=False)
    for options in ({"workers": 2, "executor": "threads"}, {"wave_size": 100}):
        assert np.array_equal(wf.render(scene, 4, guide=True, progress=False, **options).rgb, one.rgb)


@pytest.mark.slow
@pytest.mark.usefixtures("short_training")
def test_another_view_is_what_a_render_of_it_is() -> None:
    scene = lamp_at_the_ceiling()
    other = wf.Camera.look_at((1, 1, 4.5), (2, 1.2, 0), fov=50, size=(16, 16))
    with wf.Session(scene, 4, guide=True, progress=False) as session:
        session.run()
        session.set_camera(other)
        assert np.array_equal(
            session.run().rgb, wf.render(scene, 4, camera=other, guide=True, progress=False).rgb
        )


@pytest.mark.slow
@pytest.mark.usefixtures("short_training")
def test_branches_can_be_guided() -> None:
    plain = wf.render(room(), 256, branches=2, progress=False)
    guided = wf.render(room(), 256, branches=2, guide=True, seed=1, progress=False)
    error = np.hypot(
        *(np.sqrt((i.standard_error.astype(float) ** 2).sum()) / i.rgb.size for i in (plain, guided))
    )
    assert abs(plain.rgb.mean(dtype=float) - guided.rgb.mean(dtype=float)) < 4 * error


def test_training_holds_blas_to_one_thread(calls_of: Callable[..., Any]) -> None:
    """With more they wait for each other: on a busy machine the training took five times as long."""
    threads = []

    def spy(*arguments: object) -> GuideTable | None:
        libraries = threadpool_info()
        threads.extend(each["num_threads"] for each in libraries if each["user_api"] == "blas")
        return train(*arguments)

    calls_of("wavefront.drive.choice.train", spy)
    wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], 1, size=(8, 8), guide=True, progress=False)
    assert set(threads) == {1}


def test_nothing_to_guide() -> None:
    scene = [wf.Sphere((0, 0, 0), 1, material=wf.Mirror()), wf.Environment(1)]
    one, other = (wf.render(scene, 4, size=(16, 16), guide=guide, progress=False) for guide in (True, False))
    assert np.array_equal(one.rgb, other.rgb)

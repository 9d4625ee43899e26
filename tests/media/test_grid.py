"""Media on grids: against closed forms, and against homogeneous media."""

import numpy as np
import pytest
from inside import MediumRays, StepNumbers, Voxels, blackbody_colors, bounds_in_cells, survivors
from scenes import probe
from scipy import stats
from scipy.ndimage import map_coordinates
from significance import ALPHA, assert_mean, assert_same_images, channels, render, repeat

import wavefront as wf

BOX = ((-1, -1, -1), (1, 1, 1))
FAR = wf.Sphere((0, 0, -1e4), 1, material=wf.Diffuse(0.0))


def noise(shape=(7, 6, 5), seed: int = 1) -> np.ndarray:
    """A cloud with holes: uneven, and 0 in a third of the voxels."""
    return np.maximum(0, np.random.default_rng(seed).random(shape) - 0.33) * 6


def ramp(count: int = 8) -> np.ndarray:
    """A density that rises along x."""
    return np.broadcast_to(np.linspace(0.2, 3, count), (3, 4, count)).astype(np.float32)


def density_at(grid: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The density at points (3, n) of the unit cube, by SciPy."""
    at = point[::-1] * np.array(grid.shape)[:, None] - 0.5
    return map_coordinates(grid.astype(float), at, order=1, mode="nearest")


def in_box(medium: wf.GridMedium, *lights, camera=None, **more) -> wf.Scene:
    """The box of a medium, in white light unless there is another one."""
    return wf.Scene(
        [wf.GridBox(medium, **more)], lights or [wf.Environment(1)], camera or probe((0, 0, 0), (1, 2, 4))
    )


# --- The grid --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(7, 6, 5), (1, 4, 2), (1, 1, 1), (2, 1, 1)])
def test_interpolation(shape) -> None:
    """Of two grids in one record, beside SciPy."""
    both = [noise(shape).astype(np.float32), noise((3, 2, 4), 2).astype(np.float32)]
    voxels = Voxels.concatenate([Voxels.of(each) for each in both])
    point = np.random.default_rng(3).random((3, 500)).astype(np.float32)
    number = np.arange(500) % 2
    due = np.where(number, density_at(both[1], point), density_at(both[0], point))
    np.testing.assert_allclose(voxels.at(number, point)[0], due, atol=1e-5)


@pytest.mark.parametrize("cells", [(1, 1, 1), (3, 2, 4), (7, 6, 5)])
def test_bounds_hold(cells) -> None:
    """At random points, and they are the extremes of the cells' voxels."""
    grid, point = noise(), np.random.default_rng(4).random((3, 20_000))
    z, y, x = (point[::-1] * np.array(cells)[:, None]).astype(int)
    value = density_at(grid, point)
    low, high = (bounds_in_cells(grid, cells, each)[z, y, x] for each in (np.minimum, np.maximum))
    assert (low <= value + 1e-12).all()
    assert (value <= high + 1e-12).all()
    assert (high - value).min() < 0.15


# --- Beer and Lambert ------------------------------------------------------------------------------------

SIGMA = np.array([0.1, 0.4, 1.0])


@pytest.mark.parametrize("cells", [1, 5, None])
@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_light_falls_along_a_ray(cells, slope: float) -> None:
    """Through a density that is linear along x: along it, and across."""
    grid = ramp()
    medium = wf.GridMedium(grid, BOX, absorption=SIGMA, majorant_cells=cells)
    along = np.array([1, slope, -slope])
    t = np.linspace(-1, 1, 20_001)
    depth = density_at(grid, (along[:, None] * t + 1) / 2).mean() * 2 * np.linalg.norm(along)
    scene = in_box(medium, camera=probe((0, 0, 0), -3 * along))
    for mean, sigma in zip(channels(scene, 256), SIGMA, strict=True):
        assert_mean(mean, np.exp(-sigma * depth), 0.03)


@pytest.mark.parametrize("cells", [1, 7])
def test_light_falls_through_noise_that_scatters(cells) -> None:
    """What is neither absorbed nor scattered: paths by delta tracking, shadow rays by ratio tracking."""
    grid, along = noise() / 2, np.array([0.3, -0.2, 1.0])
    t = np.linspace(-1, 1, 20_001)
    depth = density_at(grid, (along[:, None] * t + 1) / 2).mean() * 2 * np.linalg.norm(along)
    medium = wf.GridMedium(grid, BOX, SIGMA / 2, SIGMA[::-1], majorant_cells=cells)
    scene = in_box(medium, camera=probe((0, 0, 0), -3 * along))
    for mean, sigma in zip(channels(scene, 512, max_bounces=0), SIGMA / 2 + SIGMA[::-1], strict=True):
        assert_mean(mean, np.exp(-sigma * depth), 0.03)
    floor = wf.Rectangle(3 * along + (-1, 1, 0), (2, 0, 0), (0, -2, 0), material=wf.Diffuse(1.0))
    lamp = wf.DirectionalLight(along, np.pi)
    scene = wf.Scene([wf.GridBox(medium), floor], lamp, probe(3 * along, 3 * along - (0.5, 0.5, 0.5)))
    cos = 1 / np.linalg.norm(along)
    for mean, sigma in zip(
        channels(scene, 128, integrator="direct_mis"), SIGMA / 2 + SIGMA[::-1], strict=True
    ):
        assert_mean(mean, cos * np.exp(-sigma * depth), 0.03)


@pytest.mark.parametrize("most", [0.5, 0.04, 1e-5])
def test_faint_weights_keep_their_mean(most: float) -> None:
    u = ((np.arange(1 << 20) + 0.5) / (1 << 20)).astype(np.float32)
    part = np.broadcast_to(np.float32([[most], [most / 3], [0]]), (3, u.size))
    mean = survivors(part, u).mean(1, dtype=float)
    assert mean == pytest.approx([most, most / 3, 0], rel=0.02)


def test_densities_of_channels() -> None:
    """Each channel is as in a gray grid: of light that gets through, absorbed, and scattered once."""
    grid, along = np.stack([noise() / 2, noise(seed=2) / 4, 0 * noise()], -1), np.array([0.3, -0.2, 1.0])
    t = (along[:, None] * np.linspace(-1, 1, 100_001) + 1) / 2
    depth = [density_at(grid[..., c], t).mean() * 2 * np.linalg.norm(along) for c in range(3)]
    for more in ({"absorption": 0.8}, {"albedo": 0.5, "scale": 0.8}):
        scene = in_box(wf.GridMedium(grid, BOX, **more), camera=probe((0, 0, 0), -3 * along))
        for mean, each in zip(channels(scene, 256, max_bounces=0), depth, strict=True):
            assert_mean(mean, np.exp(-0.8 * each), 0.03)


# --- A uniform grid is a homogeneous medium --------------------------------------------------------------


def box_of(medium) -> wf.Mesh:
    return wf.Box((0, 0, 0), 2, material=wf.Material(wf.NullSurface(), interior=medium))


UNIFORM = {"scattering": (0.5, 1, 2), "phase": wf.HenyeyGreenstein(0.5)}
LAMP = wf.DirectionalLight((-1, -2, -0.5), 3)
VIEW = wf.Camera.look_at((0, 1, 4), (0, 0, 0), fov=38, size=(8, 8))


def uniform(**more) -> wf.GridMedium:
    return wf.GridMedium(np.full((4, 4, 4), 2.0), BOX, absorption=(0.3, 0.2, 0.1), **UNIFORM, **more)


def test_uniform_grids_let_as_much_light_through() -> None:
    one = wf.GridMedium(np.full((4, 3, 2), 0.5), BOX, absorption=(0.4, 2, 6))
    two = wf.Medium((0.2, 1, 3), emission=1e-9)
    seen = [render(wf.Scene([box_of(each)], wf.Environment(1), VIEW), 1).rgb for each in (one, two)]
    np.testing.assert_allclose(*seen, rtol=2e-5)


@pytest.mark.parametrize(
    "options",
    [
        {"integrator": "direct_mis"},
        {"integrator": "naive", "max_bounces": 4},
        pytest.param({"max_bounces": 20}, marks=pytest.mark.slow),
    ],
    ids=["single", "naive", "multiple"],
)
def test_uniform_grids_are_homogeneous(options) -> None:
    homogeneous = wf.Medium((0.6, 0.4, 0.2), (1, 2, 4), phase=UNIFORM["phase"])
    lights = [wf.Environment(0.5)] if options.get("integrator") == "naive" else [wf.Environment(0.5), LAMP]
    one, two = (
        repeat(wf.Scene([box_of(each)], lights, VIEW), 16, runs=8, first_seed=first, **options)
        for first, each in ((0, uniform(majorant_cells=3)), (50, homogeneous))
    )
    assert_same_images(one, two, 0.03)


def test_a_grid_of_albedos_is_a_color() -> None:
    colors = (0.9, 0.5, 0.1)
    one, two = (
        render(in_box(wf.GridMedium(noise(), BOX, albedo=each), LAMP), 8).rgb
        for each in (colors, np.broadcast_to(colors, (2, 3, 4, 3)))
    )
    np.testing.assert_allclose(one, two, rtol=1e-5)


# --- White furnace ---------------------------------------------------------------------------------------

WHITE = {
    "gray": lambda: wf.GridMedium(noise(), BOX, albedo=1),
    "of channels": lambda: wf.GridMedium(np.stack([noise(seed=k) for k in range(3)], -1), BOX, albedo=1),
    "colored": lambda: wf.GridMedium(noise(), BOX, scattering=(0.5, 1, 1.5), phase=wf.HenyeyGreenstein(0.7)),
}


@pytest.mark.parametrize("medium", WHITE)
def test_white_furnace(medium: str) -> None:
    for mean in channels(in_box(WHITE[medium]()), 64, max_bounces=500):
        assert_mean(mean, 1.0, 0.02, rounding=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("medium", WHITE)
def test_white_furnace_within_a_thousandth(medium: str) -> None:
    ball = wf.Sphere((0, 0, 0), 0.9, material=wf.Material(wf.Dielectric(1.2), interior=WHITE[medium]()))
    for shape in (wf.GridBox(WHITE[medium]()), ball):
        scene = wf.Scene([shape], wf.Environment(1), probe((0, 0, 0), (1, 2, 4)))
        for mean in channels(scene, 20480, max_bounces=500):
            assert_mean(mean, 1.0, 0.001, sigmas=3.5, rounding=2e-5)


def flights(medium: wf.GridMedium, n: int, throughput=(1, 1, 1), **more):
    """Sample n rays along x through a medium of the box."""
    rows = np.zeros((3, n), np.float32)
    origin, direction = rows + np.float32([[-2], [0.1], [0.2]]), rows + np.float32([[1], [0], [0]])
    rng = np.random.default_rng(5)
    u = rng.random((2, n)).astype(np.float32)
    steps = StepNumbers(rng.integers(0, 2**63, n).astype(np.uint64))
    media = medium.record(np.zeros(3))
    length = np.full(n, np.inf, np.float32)
    throughput = np.repeat(np.float32(throughput)[:, None], n, 1)
    rays = MediumRays(np.zeros(n, np.intp), origin, direction, length, steps)
    return media.sample(rays, throughput, u), throughput


@pytest.mark.parametrize("seed", [1, 2])
def test_the_noise_of_colors_does_not_grow(seed: int) -> None:
    """No scattering raises the sum of the channels of the throughput."""
    medium = wf.GridMedium(noise(seed=seed), BOX, (0.1, 0, 0.3), (0.1, 1, 5))
    flight, throughput = flights(medium, 20_000, (0.2, 1, 0.01))
    after = (throughput * flight.weight).sum(0)
    assert after.max() <= throughput.sum(0).max() * (1 + 1e-5)


# --- Distances -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [1, 3, 8])
def test_distances_follow_their_density(cells: int) -> None:
    """χ² of where light is scattered in a linear density, against exp(−τ(t))."""
    grid, n = ramp(), 200_000
    flight, _ = flights(wf.GridMedium(grid, BOX, albedo=1, majorant_cells=cells), n)
    x = np.linspace(0, 1, 20_001)
    value = density_at(grid, np.stack([x, np.full_like(x, 0.55), np.full_like(x, 0.6)]))
    depth = np.concatenate([[0], np.cumsum((value[1:] + value[:-1]) / 2 * (2 / 20_000))])
    edges = np.linspace(0, 1, 41)
    through = np.exp(-np.interp(edges, x, depth))
    due = np.append(-np.diff(through), through[-1]) * n
    at = np.where(np.isfinite(flight.t), (flight.t - 1) / 2, 2)
    found = np.append(np.histogram(at, edges)[0], (at > 1.5).sum())
    assert found.sum() == n
    assert stats.chisquare(found, due).pvalue > ALPHA
    np.testing.assert_allclose(flight.weight, 1, rtol=1e-5)


@pytest.mark.slow
def test_the_mean_does_not_depend_on_majorants() -> None:
    one, two = (
        repeat(
            in_box(
                wf.GridMedium(noise(), BOX, (0.1, 0.2, 0.3), (1, 2, 3), majorant_cells=cells),
                LAMP,
                wf.Environment(0.3),
                camera=VIEW,
            ),
            32,
            first_seed=first,
            max_bounces=8,
        )
        for first, cells in ((0, 1), (50, 7))
    )
    assert_same_images(one, two, 0.01)


def test_same_bits_whatever_workers_and_waves() -> None:
    scene = in_box(wf.GridMedium(noise(), BOX, (0.1, 0.2, 0.3), (1, 2, 3), emission=0.1), LAMP, camera=VIEW)
    one = render(scene, 4, max_bounces=4).rgb
    for settings in ({"workers": 2, "executor": "threads"}, {"wave_size": 100}):
        np.testing.assert_array_equal(render(scene, 4, max_bounces=4, **settings).rgb, one)


# --- Emission --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scattering", [0, 1e-12])
def test_smoke_of_one_temperature(scattering: float) -> None:
    """B(T)(1 − exp(−τ)), by paths that collect light on the way and by those that may be scattered."""
    grid, along, absorbed = noise(), np.array([0.3, -0.2, 1.0]), np.array([0.2, 0.5, 1.0])
    t = np.linspace(-1, 1, 20_001)
    depth = density_at(grid, (along[:, None] * t + 1) / 2).mean() * 2 * np.linalg.norm(along)
    medium = wf.GridMedium(grid, BOX, absorbed, scattering, temperature=np.full(grid.shape, 1800.0))
    scene = wf.Scene([wf.GridBox(medium)], camera=probe((0, 0, 0), -3 * along))
    black = blackbody_colors(np.array(1800.0))
    due = black * -np.expm1(-absorbed * depth)
    for mean, each in zip(channels(scene, 512, lighting=None), due, strict=True):
        assert_mean(mean, each, 0.03, rounding=1e-4)  # blackbody colors are read from a table


def test_light_without_density() -> None:
    """∫ε dt, of grids of another resolution, where there is nothing else."""
    rng = np.random.default_rng(6)
    glow, along = rng.random((3, 4, 2, 3)), np.array([0.3, -0.2, 1.0])
    t = (along[:, None] * np.linspace(-1, 1, 100_001) + 1) / 2
    due = [density_at(glow[..., c], t).mean() * 2 * np.linalg.norm(along) for c in range(3)]
    medium = wf.GridMedium(np.zeros((5, 5, 5)), BOX, emission=glow, scale=0.5)
    scene = wf.Scene([wf.GridBox(medium)], camera=probe((0, 0, 0), -3 * along))
    for mean, each in zip(channels(scene, 256, lighting=None), due, strict=True):
        assert_mean(mean, each / 2, 0.02)


def test_blackbody_colors() -> None:
    """At the melting point of platinum it is 60 cd/cm², which was the definition of the candela in 1948."""
    color = blackbody_colors(np.array([0.0, 200.0, 2042.0]))
    assert not color[:2].any()
    assert wf.to_photometric(color[2]) == pytest.approx(6e5, rel=0.02)
    assert color[2, 0] > color[2, 1] > color[2, 2] >= 0


# --- Where it is -----------------------------------------------------------------------------------------


def placing() -> np.ndarray:
    """A rotation, a reflection and three scales."""
    matrix = np.eye(4)
    turn, _ = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))
    matrix[:3, :3] = turn * (1.0, 2.0, -1.5)
    matrix[:3, 3] = 5, -3, 2
    return matrix


def test_a_transformed_grid_and_a_camera_inside() -> None:
    grid, matrix = noise(), placing()
    middle = matrix[:3, :3] @ (0.5, 0.5, 0.5) + matrix[:3, 3]
    along = np.array([0.5, -0.3, 0.8]) / np.linalg.norm([0.5, -0.3, 0.8])
    scene = in_box(wf.GridMedium(grid, matrix, absorption=SIGMA), camera=probe(middle + along, middle))
    t = np.linspace(0, 3, 100_001)
    local = np.linalg.inv(matrix[:3, :3]) @ (middle[:, None] + along[:, None] * t - matrix[:3, 3:])
    inside = ((local >= 0) & (local <= 1)).all(0)
    depth = np.where(inside, density_at(grid, local), 0).mean() * 3
    for mean, sigma in zip(channels(scene, 256), SIGMA, strict=True):
        assert_mean(mean, np.exp(-sigma * depth), 0.03, rounding=1e-4)


def test_grids_scale_with_the_scene() -> None:
    small, large = (
        render(
            in_box(
                wf.GridMedium(noise(), np.array(BOX) * size, (0.5 / size), 1 / size),
                camera=wf.Camera.look_at((0, 0, 5 * size), (0, 0, 0), fov=25, size=(8, 8)),
            ),
            16,
        ).rgb
        for size in (1.0, 2.0**60)
    )
    np.testing.assert_allclose(small, large, rtol=1e-4)


def test_two_grids_in_one_scene() -> None:
    one = wf.GridMedium(np.ones((2, 2, 2)), BOX, absorption=0.5)
    two = wf.GridMedium(np.ones((3, 3, 3)), ((-1, -1, 1), (1, 1, 4)), absorption=0.25)
    scene = wf.Scene([wf.GridBox(one), wf.GridBox(two)], wf.Environment(1), probe((0, 0, 0), (0.1, 0.2, 9)))
    seen = render(scene, 1).rgb
    assert seen == pytest.approx(np.exp(-(0.5 * 2 + 0.25 * 3) * np.sqrt(81.05) / 9), rel=1e-4)


def test_overlapping_grids_are_refused() -> None:
    one, two = (wf.GridMedium(np.ones((2, 2, 2)), np.array(BOX) + at, absorption=1) for at in (0.0, 0.5))
    scene = wf.Scene([wf.GridBox(one, name="a"), wf.GridBox(two, name="b")], wf.Environment(1), VIEW)
    with pytest.raises(wf.SceneError, match="a and b: the grids of their media overlap"):
        render(scene, 1)
    scene = wf.Scene([wf.GridBox(one), wf.GridBox(two, priority=1)], wf.Environment(1), VIEW)
    assert render(scene, 1).rgb.min() < 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"density": np.ones((2, 2))}, r"density must be a grid of shape \(z, y, x\), got \(2, 2\)"),
        ({"density": np.ones((0, 2, 2))}, "density must be a grid"),
        ({"density": -np.ones((2, 2, 2))}, r"density\[0\]\[0\]\[0\] is -1.0; it must be at least 0"),
        ({"density": np.full((2, 2, 2), np.nan)}, "is nan; it must be at least 0"),
        ({"density": np.full((2, 2, 2), "x")}, "must be numeric"),
        ({"transform": np.zeros((4, 4))}, "transform must be an affine matrix"),
        ({"transform": [(1, 0, 0), (0, 1, 1)]}, "transform has the corners"),
        ({"albedo": 0.5, "absorption": 1}, "albedo stands in place of"),
        (
            {"albedo": np.full((1, 1, 1, 3), 1.5)},
            r"albedo\[0\]\[0\]\[0\]\[0\] is 1.5; it must be in \[0, 1\]",
        ),
        ({"temperature": np.ones((1, 1, 1))}, "temperature has shape"),
        ({"temperature": np.full((2, 2, 2), 1e6)}, "temperature is 1e.06 kelvin"),
        ({"temperature": np.ones((2, 2, 2)), "emission": np.ones((2, 2, 2, 3))}, "must be a color"),
        ({"majorant_cells": 0}, "majorant_cells is 0; it must be a whole number"),
        ({"scale": -1}, "GridMedium scale is -1"),
    ],
)
def test_mistakes_are_named(arguments, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.GridMedium(**{"density": np.ones((2, 2, 2)), **arguments})


def test_grid_box_takes_grids_alone() -> None:
    with pytest.raises(wf.SceneError, match="medium must be a GridMedium"):
        wf.GridBox(wf.Medium(1))

"""measure(): exact values, errors that hold, and the settings of renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import SENSORS, cosine_hemisphere, uniform_sphere
from significance import Mean, assert_mean

import wavefront as wf

QUIET: dict[str, Any] = {"progress": False, "workers": 1}
BLACK = wf.Diffuse(0)
SKY = wf.Scene([wf.Sphere((0, 0, -9), 1, material=BLACK)], wf.Environment((1.0, 2.0, 3.0)))
INTEGRATOR_NAMES = ("full", "direct_mis", "direct_simple", "naive")


def mean(scene: Any, point: Any, normal: Any, spp: int, **settings: Any) -> Mean:
    """Measure with 64 sensors at one place, which are independent of each other."""
    settings = {**QUIET, "reuse": False, **settings}
    found = wf.measure(scene, np.tile(point, (64, 1)), normal, spp=spp, **settings)
    return Mean.of(found.value.mean(1, dtype=np.float64))


# --- Exact values -------------------------------------------------------------------------------------


def test_a_cosine_meter_under_an_even_sky_reads_pi() -> None:
    found = wf.measure(SKY, [(0, 0, 0), (5, 5, 5)], [(0, 0, 1), (0, 1, 1)], spp=64, **QUIET)
    np.testing.assert_allclose(found.value[0], np.pi * np.array([1, 2, 3]), rtol=1e-6)


def test_fluence_in_an_even_environment_is_four_pi() -> None:
    points = np.random.default_rng(0).normal((0, 0, 1e5), size=(5, 3))
    found = wf.measure(SKY, points, kind="fluence", spp=64, **QUIET)
    np.testing.assert_allclose(
        found.value, np.broadcast_to(4 * np.pi * np.array([1, 2, 3]), (5, 3)), rtol=1e-6
    )


@pytest.mark.parametrize("integrator", INTEGRATOR_NAMES)
def test_a_panel_brings_what_lambert_says(integrator: str) -> None:
    panel = scenes.panel((0.2, -0.3), (1.0, 0.9), 1.5)
    corners = [(0.2, 1.5, -0.3), (1.0, 1.5, -0.3), (1.0, 1.5, 0.9), (0.2, 1.5, 0.9)]
    found = mean(panel, (0, 0, 0), (0, 1, 0), 256, integrator=integrator)
    assert_mean(found, scenes.polygon_irradiance(corners), 0.02 if integrator == "naive" else 1e-4)


@pytest.mark.parametrize("integrator", INTEGRATOR_NAMES)
def test_a_sphere_brings_fluence_by_its_solid_angle(integrator: str) -> None:
    ball = wf.Sphere((3, 0, 0), 1.5, material=BLACK, emission=2)
    solid_angle = 2 * np.pi * (1 - np.sqrt(1 - 0.5**2))
    found = mean(ball, (0, 0, 0), None, 256, kind="fluence", integrator=integrator)
    assert_mean(found, 2 * solid_angle, 0.02 if integrator == "naive" else 1e-3)


@pytest.mark.parametrize("kind", ["irradiance", "fluence"])
def test_a_point_light_brings_the_inverse_square(kind: str) -> None:
    scene = wf.Scene(wf.Sphere((9, 9, 9), 0.1, material=BLACK), wf.PointLight((0, 0, 2), 8))
    found = wf.measure(
        scene, [(1, 0, 0)], (0, 0, 1) if kind == "irradiance" else None, kind=kind, spp=4, **QUIET
    )
    expected = 8 / 5 * (2 / np.sqrt(5) if kind == "irradiance" else 1)
    np.testing.assert_allclose(found.value, expected, rtol=1e-5)


@pytest.mark.parametrize(("kind", "factor"), [("irradiance", np.pi), ("fluence", 4 * np.pi), ("radiance", 1)])
def test_a_furnace_is_as_bright_everywhere(kind: str, factor: float) -> None:
    """In a closed sphere of albedo 0.6 that emits 1 the radiance is 1 / (1 - 0.6)."""
    wall = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Diffuse(0.6), emission=1))
    direction = None if kind == "fluence" else (1, 2, 3)
    found = mean(wall, (0.3, 0.2, 0.1), direction, 64, kind=kind, max_bounces=64)
    assert_mean(found, factor / 0.4, 0.01)


@pytest.mark.parametrize("integrator", INTEGRATOR_NAMES)
@pytest.mark.parametrize(("kind", "factor"), [("irradiance", np.pi), ("fluence", 4 * np.pi)])
def test_media_absorb_on_the_way_to_sensors(kind: str, factor: float, integrator: str) -> None:
    wall = wf.Sphere((0, 0, 0), 2, material=BLACK, emission=1)
    scene = wf.Scene([wall], medium=wf.Medium(absorption=0.5))
    normal = (0, 0, 1) if kind == "irradiance" else None
    found = mean(scene, (0, 0, 0), normal, 64, kind=kind, integrator=integrator)
    assert_mean(found, factor * np.exp(-1), 1e-3)


@pytest.mark.parametrize("integrator", ["full", "naive"])
def test_fog_that_absorbs_nothing_leaves_a_furnace_as_it_is(integrator: str) -> None:
    wall = wf.Sphere((0, 0, 0), 2, material=BLACK, emission=1)
    scene = wf.Scene([wall], medium=wf.Medium(scattering=1.0))
    found = mean(scene, (0.5, 0, 0), None, 64, kind="fluence", integrator=integrator, max_bounces=100)
    assert_mean(found, 4 * np.pi, 0.01)


def test_radiance_is_that_of_a_camera() -> None:
    box = scenes.cornell_box()
    found = mean(box, (0, 0, 3.9), (-0.2, -0.3, -3.9), 256, kind="radiance")
    image = wf.render(
        box, 256, camera=scenes.probe((-0.2, -0.3, 0), (0, 0, 3.9)), progress=False, branches=1, reuse=False
    )
    seen = Mean.of(image.rgb.reshape(-1, 3).mean(1, dtype=np.float64))
    assert abs(found.value - seen.value) < 4 * np.hypot(found.error, seen.error)


@pytest.mark.parametrize("bounces", [0, 1, 2])
def test_bounces_are_those_in_the_scene(bounces: int) -> None:
    """Between two infinite planes, of which one shines, each bounce adds a term of a series."""
    albedo = 0.5
    floor, lamp = scenes.floor(wf.Diffuse(albedo), 2000), scenes.panel((-2000, -2000), (2000, 2000), 1)
    lamp.material = wf.Material(wf.Diffuse(albedo), emission=1)
    found = mean([floor, lamp], (0, 0.5, 0), (0, 1, 0), 64, max_bounces=bounces)
    terms = sum((albedo**2) ** k for k in range(bounces // 2 + 1))
    assert_mean(found, np.pi * terms, 0.01, rounding=2e-3)  # the planes end


def test_integrators_agree_in_the_cornell_box() -> None:
    box = scenes.cornell_box()
    found = [
        mean(box, (0, -0.99, 0.8), (0, 1, 0), spp, integrator=name)
        for name, spp in (("full", 256), ("naive", 4096))
    ]
    assert found[0].error < 0.01 * found[0].value
    assert abs(found[0].value - found[1].value) < 4 * np.hypot(found[0].error, found[1].error)


@pytest.mark.parametrize(
    "settings",
    [
        {"branches": 4},
        pytest.param({"guide": True}, marks=pytest.mark.slow),
        pytest.param({"guide": "auto"}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_branches_and_guides_change_no_mean(settings: dict[str, Any]) -> None:
    box = scenes.cornell_box()
    plain, other = (mean(box, (0, -0.99, 0.8), (0, 1, 0), 128, **each) for each in ({}, settings))
    assert abs(plain.value - other.value) < 4 * np.hypot(plain.error, other.error)


# --- Receivers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "warp"), [("irradiance", cosine_hemisphere), ("fluence", uniform_sphere)])
def test_receivers_weigh_what_they_draw_by_their_density(kind: str, warp: Any) -> None:
    bsdf, u = SENSORS[kind], np.random.default_rng(1).random((2, 4096), np.float32)
    wo = np.repeat(np.array([[0], [0], [1]], np.float32), 4096, 1)
    sample = bsdf.sample_f(wo, u)
    assert (sample.wi == warp(u)).all()
    f, pdf = bsdf.evaluate(wo, sample.wi)
    np.testing.assert_allclose(sample.pdf, pdf, rtol=1e-6)
    cos = np.abs(sample.wi[2]) if kind == "irradiance" else 1
    np.testing.assert_allclose(sample.weight, f * cos / pdf, rtol=1e-5)
    np.testing.assert_allclose(sample.weight, bsdf.total, rtol=1e-6)
    assert (bsdf.f(wo, -sample.wi) == (kind == "fluence")).all()


# --- Points on surfaces -------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [0.0, 1000.0, 123456.7])
@pytest.mark.parametrize("accel", ["numpy", "auto"])
def test_points_on_a_surface_see_the_side_of_their_normals(offset: float, accel: str) -> None:
    """A desk of many triangles, tilted, far from the origin; both of its sides are lit."""
    rng, side = np.random.default_rng(2), np.arange(9) / 4 - 1
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    grid = np.stack([*np.meshgrid(side, side), np.zeros((9, 9))], -1).reshape(-1, 3) @ turn.T + offset
    k = np.arange(80)[np.arange(80) % 9 != 8][:64]
    faces = np.concatenate([np.stack([k, k + 1, k + 10], 1), np.stack([k, k + 10, k + 9], 1)])
    scene = wf.Scene(wf.Mesh(grid, faces, material=BLACK), wf.Environment(1))
    flat = np.concatenate([rng.uniform(-0.9, 0.9, (40, 2)), np.zeros((40, 1))], 1)
    for normal in (turn[:, 2], -turn[:, 2]):
        found = wf.measure(scene, flat @ turn.T + offset, normal, spp=16, accel=accel, **QUIET)
        np.testing.assert_allclose(found.value, np.pi, rtol=1e-6)


@pytest.mark.parametrize("accel", ["numpy", "auto"])
@pytest.mark.first(1)
def test_points_in_the_middle_of_a_large_surface_are_above_it(accel: str) -> None:
    """There the corners of the surface are rounded by more than the points."""
    rng = np.random.default_rng(7)
    for turn in np.linalg.qr(rng.normal(size=(12, 3, 3)))[0]:
        corner, edge_u, edge_v = turn @ (-1, -1, 0), 2 * turn[:, 0], 2 * turn[:, 1]
        scene = wf.Scene(wf.Rectangle(corner, edge_u, edge_v, material=BLACK), wf.Environment(1))
        points = np.concatenate([rng.uniform(-1e-3, 1e-3, (20, 2)), np.zeros((20, 1))], 1) @ turn.T
        for side in (1, -1):
            found = wf.measure(scene, points, side * turn[:, 2], spp=4, accel=accel, **QUIET)
            np.testing.assert_allclose(found.value, np.pi, rtol=1e-6)


def test_points_on_a_sphere_are_not_in_its_shadow() -> None:
    normals = np.random.default_rng(3).normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    scene = wf.Scene(wf.Sphere((5, 0, 0), 2, material=BLACK), wf.Environment(1))
    found = wf.measure(scene, normals * 2 + (5, 0, 0), normals, spp=16, **QUIET)
    np.testing.assert_allclose(found.value, np.pi, rtol=1e-6)


def test_a_point_inside_a_closed_box_sees_nothing_of_the_sky() -> None:
    scene = wf.Scene(scenes.box((-1, -1, -1), (1, 1, 1), wf.Diffuse(0.5)), wf.Environment(1))
    assert not wf.measure(scene, [(0.2, 0, 0)], (0, 1, 0), spp=16, **QUIET).value.any()


# --- Errors -------------------------------------------------------------------------------------------


def coverage(points: int, seeds: int, **settings: Any) -> float:
    """Part of the 95 % intervals, of points in the Cornell box, that hold the mean of the other seeds."""
    rng = np.random.default_rng(0)
    at, normals = rng.uniform(-0.95, 0.95, (points, 3)), rng.normal(size=(points, 3))
    found = [wf.measure(scenes.cornell_box(), at, normals, seed=k, **settings, **QUIET) for k in range(seeds)]
    value = np.array([each.value for each in found], float)
    truth, lit = (value.sum(0) - value) / (seeds - 1), value.any(0)  # points in the boxes are dark
    inside = [
        (low <= exact) & (exact <= high)
        for exact, (low, high) in zip(truth, (f.interval() for f in found), strict=True)
    ]
    return float(np.mean([each[lit] for each in inside]))


@pytest.mark.slow
def test_intervals_hold_what_they_say() -> None:
    """And a little more: they allow for what few samples may have missed."""
    assert 0.95 <= coverage(60, 8, spp=32) <= 0.995


@pytest.mark.slow
def test_intervals_of_default_settings_hold_what_they_say(capsys: pytest.CaptureFixture[str]) -> None:
    found = coverage(400, 50)
    with capsys.disabled():
        print(f"\n95 % intervals hold the mean in {found:.2%}")
    assert 0.95 <= found <= 0.995


def test_noise_is_reached_at_every_point() -> None:
    points = np.random.default_rng(4).uniform((-0.9, -0.9, 0.7), (0.9, 0.9, 0.95), (60, 3))
    found = wf.measure(scenes.cornell_box(), points, (0, 1, 0), noise=0.03, reuse=False, **QUIET)
    floor = 0.01 * found.value.mean() ** 2
    relative = np.sqrt((found.standard_error**2 / (found.value**2 + floor)).mean(1))
    assert relative.max() <= 0.03
    assert found.samples.min() < found.samples.max()
    assert found.metadata["noise"] == pytest.approx(relative.max(), rel=1e-4)


def test_noise_that_is_not_reached_is_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"noise=0\.001 was not reached: it is 0\.\d+ after 64 samples"):
        wf.measure(scenes.cornell_box(), [(0, 0, 0), (0, 0.9, 0)], (0, 1, 0), noise=0.001, spp=64, **QUIET)


def test_a_confidence_is_checked() -> None:
    found = wf.measure(scenes.cornell_box(), [(0, 0, 0)], (0, 1, 0), spp=64, **QUIET)
    with pytest.raises(wf.SceneError, match="interval: confidence is 1"):
        found.interval(1)


# --- Parts --------------------------------------------------------------------------------------------


def test_parts_add_up() -> None:
    scene = scenes.cornell_box()
    scene.shapes[5].material.group = "lamp"
    scene.lights = [wf.PointLight((0.5, 0.5, 0.5), 1.0, group="bulb")]
    aovs = ("direct", "indirect", "light_groups")
    found = wf.measure(scene, [(0, -0.9, 0.8), (0.7, 0, 0)], (0, 1, 0), spp=64, aovs=aovs, **QUIET)
    np.testing.assert_allclose(found.direct + found.indirect, found.value, rtol=1e-5)
    groups = [found.part(f"light_groups.{name}")[0] for name in ("lamp", "bulb")]
    np.testing.assert_allclose(sum(groups), found.value, rtol=1e-5)
    alone = wf.measure(scene, found.points, found.normals, spp=64, max_bounces=0, **QUIET)
    np.testing.assert_allclose(found.direct, alone.value, rtol=1e-5)
    assert (found.part("indirect")[1] > 0).all()
    with pytest.raises(wf.SceneError, match="'direct' was not measured; there is no part"):
        alone.direct  # noqa: B018


def test_only_the_light_of_the_scene_counts() -> None:
    dark = wf.Sphere((0, 0, 0), 1)
    assert not wf.measure(dark, [(0, 0, 2)], (0, 0, 1), spp=4, **QUIET).value.any()
    assert wf.measure(dark, [(0, 0, 2)], (0, 0, 1), spp=4, lighting="even", **QUIET).value.all()


# --- Many points --------------------------------------------------------------------------------------


def test_more_points_than_a_row_has_pixels() -> None:
    """The last pixel of the last row stands for no point."""
    n = 2**16 + 1
    points = np.random.default_rng(5).uniform(-0.9, 0.9, (n, 3))
    sky = wf.Scene([wf.Sphere((0, 0, -9), 1)], [wf.Environment((1, 2, 3))])
    found = wf.measure(sky, points, (0, 0, 1), spp=1, **QUIET)
    assert found.image.shape[:2] == (2, n // 2 + 1)
    assert found.value.shape == (n, 3)
    assert (found.points == points).all()
    assert found.value == pytest.approx(np.tile(found.value[:1], (n, 1)))


def test_large_units_and_places_change_nothing() -> None:
    box, points = scenes.cornell_box(), np.random.default_rng(6).uniform(-0.9, 0.9, (9, 3))
    plain = wf.measure(box, points, (0, 1, 1), spp=32, **QUIET)
    scaled = wf.Scene([shape.scaled(2.0**40) for shape in box.shapes])
    found = wf.measure(scaled, points * 2.0**40, (0, 1, 1), spp=32, **QUIET)
    np.testing.assert_allclose(found.value, plain.value, rtol=1e-5)


# --- Files --------------------------------------------------------------------------------------------


def test_files_hold_the_measurement(tmp_path: Path) -> None:
    box, points = scenes.cornell_box(), [(0, 0, 0), (0, -0.5, 0.9)]
    parts = [
        wf.measure(box, points, (0, 1, 0), samples=each, aovs="direct", **QUIET)
        for each in (range(16), range(16, 32))
    ]
    whole = wf.measure(box, points, (0, 1, 0), spp=32, aovs="direct", **QUIET)
    for number, part in enumerate(parts):
        part.save(tmp_path / f"{number}.npz")
    first, second = (wf.Measurement.load(tmp_path / f"{number}.npz") for number in range(2))
    merged = first.merge(second)
    for name, column in whole.columns().items():
        if "error" not in name:  # sums of errors may be rounded in another order
            assert merged.columns()[name].tobytes() == column.tobytes(), name
    whole.save(tmp_path / "all.csv")
    table = np.genfromtxt(tmp_path / "all.csv", delimiter=",", names=True)
    assert table.dtype.names[:9] == ("x", "y", "z", "nx", "ny", "nz", "r", "g", "b")
    assert (table["g"].astype(np.float32) == whole.value[:, 1]).all()
    assert (table["samples"] == 32).all()
    assert (np.stack([table[axis] for axis in "xyz"], 1) == whole.points).all()
    with pytest.raises(wf.SaveError, match="a measurement is saved as npz or csv"):
        whole.save(tmp_path / "all.txt")
    wf.render(box, 1, size=(4, 4), progress=False).save(tmp_path / "picture.npz")
    with pytest.raises(wf.SceneError, match=r"picture\.npz: is no measurement"):
        wf.Measurement.load(tmp_path / "picture.npz")


def test_a_stop_keeps_what_was_measured() -> None:
    def press(done: float, total: float) -> None:
        if done > 100:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted) as stop:
        wf.measure(scenes.cornell_box(), [(0, 0, 0)] * 50, (0, 1, 0), progress=press, wave_size=64, workers=1)
    assert wf.Measurement(stop.value.image).samples.max() > 0


@pytest.mark.parametrize(
    ("text", "points", "directions"),
    [
        ("x,y,z\n1,2,3\n4,5,6\n", [(1, 2, 3), (4, 5, 6)], None),
        ("1 2 3 0 0 1\n\n# more\n4 5 6\t0 1 0", [(1, 2, 3), (4, 5, 6)], [(0, 0, 1), (0, 1, 0)]),
        ("\ufeff1;2;3", [(1, 2, 3)], None),
    ],
)
def test_tables_of_points(tmp_path: Path, text: str, points: Any, directions: Any) -> None:
    (tmp_path / "points.csv").write_text(text, "utf-8")
    found, normals = wf.load_points(tmp_path / "points.csv")
    assert found.tolist() == np.asarray(points).tolist()
    assert (normals is None) == (directions is None)
    if normals is not None:
        assert normals.tolist() == np.asarray(directions).tolist()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no point"),
        ("x,y,z\n", "has no point"),
        ("1 2 3\n1 2\n", "line 2 has 2 numbers; all lines must have 3, or all 6"),
        ("1 2 3\n1 2 3 4 5 6\n", "line 2 has 6 numbers"),
        ("1 2 3\n1 nan 3\n", "line 2 is '1 nan 3'; its numbers must be finite"),
        ("1 2 inf\n", "line 1 is '1 2 inf'; its numbers must be finite"),
        ("1 2 3\n1 2 x\n", "line 2 is '1 2 x'; it must be numbers"),
    ],
)
def test_wrong_tables_are_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(wf.SceneError, match=rf"points\.csv: {message}"):
        wf.load_points(tmp_path / "points.csv")


def test_a_plot_has_isolines_over_the_plane_of_the_points() -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    points, normals = wf.grid_points((-1, -1, -0.99), (2, 0, 0), (0, 2, 0), (6, 5))
    found = wf.measure(scenes.panel((-0.3, -0.3), (0.3, 0.3), 0.9), points, normals, spp=4, **QUIET)
    axes = found.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x", "y")
    assert axes.figure.axes[1].get_ylabel() == "irradiance, W·m⁻²"
    assert found.plot(axes=axes) is axes
    assert found.plot(label="daylight factor, %").figure.axes[1].get_ylabel() == "daylight factor, %"
    pyplot.close("all")
    line = wf.measure(SKY, [(0, 0, 0), (1, 1, 1), (2, 2, 2)], (0, 0, 1), spp=1, **QUIET)
    with pytest.raises(wf.SceneError, match="plot: the points are on one line"):
        line.plot()


# --- Arguments ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "normals", "settings", "message"),
    [
        ([], (0, 0, 1), {}, "points"),
        ([(0, 0)], (0, 0, 1), {}, "points"),
        ([(0, 0, np.nan)], (0, 0, 1), {}, "points"),
        ([(0, 0, 0)], None, {}, r"irradiance needs normals: \(n, 3\), or \(3,\) for all points"),
        ([(0, 0, 0)], None, {"kind": "radiance"}, "radiance needs directions"),
        ([(0, 0, 0)], (0, 0, 1), {"kind": "fluence"}, "normals are given; fluence counts all directions"),
        ([(0, 0, 0)] * 2, [(0, 0, 1), (0, 0, 0)], {}, r"normals\[1\] is zero; it must have a direction"),
        ([(0, 0, 0)] * 3, [(0, 0, 1)] * 2, {}, "normals"),
        ([(0, 0, 0)], (0, 0, 1), {"kind": "illuminance"}, "kind is 'illuminance'"),
        ([(0, 0, 0)], (0, 0, 1), {"caustics": True}, "caustics is True; paths from lights reach no point"),
        ([(0, 0, 0)], (0, 0, 1), {"size": (4, 4)}, r"size is \(4, 4\); sensors are at the points"),
        ([(0, 0, 0)], (0, 0, 1), {"background": "white"}, "background is 'white'; each sensor"),
        ([(0, 0, 0)], (0, 0, 1), {"denoise": True}, "denoise is True; each sensor"),
        ([(0, 0, 0)], (0, 0, 1), {"aovs": "depth"}, "aovs has 'depth'; sensors have direct, indirect"),
        ([(1e30, 0, 0)], (0, 0, 1), {}, "from the center of the scene"),
    ],
)
def test_wrong_arguments_are_named(points: Any, normals: Any, settings: Any, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.measure(SKY, points, normals, **settings)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ((0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 2)),
            r"edges \[1.0, 0.0, 0.0\] and \[2.0, 0.0, 0.0\] must not",
        ),
        (((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 2)), "grid_points: counts is 0"),
        (((0, 0), (1, 0, 0), (0, 1, 0), (2, 2)), "grid_points: corner"),
    ],
)
def test_wrong_grids_are_named(arguments: Any, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.grid_points(*arguments)


def test_grids_are_in_the_middle_of_cells() -> None:
    points, normals = wf.grid_points((1, 1, 1), (2, 0, 0), (0, 0, 4), (2, 4))
    assert points[:3].tolist() == [[1.5, 1, 1.5], [2.5, 1, 1.5], [1.5, 1, 2.5]]
    assert (normals == (0, -1, 0)).all()


def test_a_sensor_of_radiance_may_be_on_a_surface_at_the_origin() -> None:
    """There the coordinates have no rounding by which a ray could be moved off the surface."""
    floor = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=wf.Diffuse(0))
    found = wf.measure(
        [floor, wf.Environment(1)], [(0, 0, 0)], (0, 0, 1), kind="radiance", spp=4, progress=False
    )
    assert found.value.tolist() == [[1, 1, 1]]

"""Intervals of sensors: how often they hold the truth, where they can be trusted, and what they rest on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import BRIGHTEST, NARROW, brightest_emitter, compile_scene

import wavefront as wf

QUIET: dict[str, Any] = {"progress": False, "workers": 1}
BLACK = wf.Diffuse(0)
UP = (0, 1, 0)


def room(*more: wf.Shape) -> wf.Scene:
    """A floor and a wall, a panel lamp, and a box that shades some of the floor."""
    return wf.Scene(
        [
            wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.6)),
            wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 2.5, 0), material=wf.Diffuse((0.7, 0.4, 0.3))),
            wf.Rectangle((-0.3, 2.4, -0.3), (0.6, 0, 0), (0, 0, 0.6), material=BLACK, emission=20),
            wf.Box((-1.2, 0.7, -1), (0.7, 1.4, 0.7)),
            *more,
        ],
        [wf.Environment(0.05)],
    )


def floor_points() -> np.ndarray:
    places = (-1.8, -0.6, 0.6, 1.8)
    return np.array([(x, 0.001, z) for x in places for z in places])


def glassy() -> wf.Scene:
    return room(wf.Sphere((-0.7, 0.4, 0.5), 0.4, material=wf.Dielectric(1.5)))


def narrow_of(found: wf.Measurement) -> np.ndarray:
    return found.image.layers[NARROW].ravel()[: len(found.points)]


# --- Coverage and trust -------------------------------------------------------------------------------


def test_intervals_of_few_samples_hold_the_truth() -> None:
    """Sixteen samples; Student's intervals from batches held .89, and .55 at the worst point."""
    points, runs = floor_points(), 12
    truth = wf.measure(room(), np.tile(points, (16, 1)), UP, spp=512, seed=9, reuse=False, **QUIET)
    exact = truth.value[:, 1].reshape(16, 16).mean(0)
    held, trusted = np.zeros(16), 0.0
    for seed in range(runs):
        found = wf.measure(room(), points, UP, spp=16, seed=seed, reuse=False, **QUIET)
        low, high = (limit[:, 1] for limit in found.interval())
        held += (low <= exact) & (exact <= high)
        trusted += found.reliable.mean() / runs
    assert held.mean() / runs >= 0.95
    assert held.min() / runs >= 0.8
    assert trusted >= 0.9


def test_points_beside_glass_are_not_reliable() -> None:
    """The lamp shines through the ball onto the floor, where one path of a thousand finds it."""
    points = np.concatenate([[(-0.7, 0.001, 1.15)], floor_points()])
    found = wf.measure(glassy(), points, UP, spp=64, **QUIET)
    assert not found.reliable[0]
    low, high = found.interval()
    plain = wf.measure(room(), points, UP, spp=64, **QUIET)
    assert (high - low)[0, 1] > 3 * np.subtract(*plain.interval()[::-1])[0, 1]
    assert plain.reliable.mean() >= 0.9


def test_events_that_other_points_met_raise_the_upper_limit() -> None:
    """A point without noise, by itself and beside fifteen that a lamp half lights."""
    lamp = wf.Sphere((20, 1, 0), 1, emission=50, material=BLACK)
    block = wf.Rectangle((18, 1, -3), (0, 2, 0), (0, 0, 6), material=BLACK)
    shade = wf.Rectangle((2, 0, -9), (0, 9, 0), (0, 0, 18), material=BLACK)
    scene = wf.Scene([lamp, block, shade], [wf.Environment(0.2)])
    calm, others = (0, 9.5, 0), [(10 + x, 0, 0) for x in range(15)]
    alone = wf.measure(scene, [calm], UP, spp=16, reuse=False, **QUIET)
    beside = wf.measure(scene, [calm, *others], UP, spp=16, reuse=False, **QUIET)
    assert beside.value[0].tolist() == alone.value[0].tolist()
    (low, high), (first, last) = alone.interval(), beside.interval()
    assert first[0] == pytest.approx(low[0], rel=1e-9)
    event = np.mean(
        [v**2 / m for v, m in zip(beside.standard_error[1:, 1], beside.value[1:, 1], strict=True)]
    )
    assert last[0, 1] - high[0, 1] > event


def test_few_samples_and_darkness_are_not_reliable() -> None:
    lamp = wf.Sphere((0, 3, 0), 0.5, emission=2, material=BLACK)
    scene = wf.Scene([lamp, scenes.box((9, 9, 9), (10, 10, 10), wf.Diffuse(0.5))])
    found = wf.measure(scene, [(0, 0, 0), (9.5, 9.5, 9.5)], UP, spp=16, **QUIET)
    assert found.reliable.tolist() == [True, False]
    assert [limit[1].tolist() for limit in found.interval()] == [[0, 0, 0]] * 2
    once = wf.measure(scene, [(0, 0, 0)], UP, spp=1, **QUIET)
    assert not once.reliable.any()
    assert np.isnan(once.interval()).all()


def test_intervals_of_lux_are_made_likewise() -> None:
    found = wf.measure(glassy(), floor_points(), UP, spp=64, **QUIET)
    low, high = found.lux_interval()
    assert ((low < found.lux) & (found.lux < high)).all()
    gray = wf.measure(room(), floor_points(), UP, spp=64, max_bounces=0, **QUIET)
    for one, other in zip(gray.lux_interval(), gray.interval(), strict=True):
        np.testing.assert_allclose(one, 683 * other[:, 1], rtol=1e-4)
    sky = wf.measure(glassy(), [(0, 3, 0)], UP, spp=4, **QUIET)
    unseen = -np.log(0.05) / 4 * narrow_of(sky)[0] * 20 * 683
    assert sky.lux_interval()[1][0] >= unseen


def test_a_channel_without_light_does_not_count() -> None:
    lamp = wf.Sphere((0, 3, 0), 0.5, emission=(2, 0, 0), material=BLACK)
    found = wf.measure([lamp], [(0, 0, 0)], UP, spp=16, **QUIET)
    assert found.reliable.all()


def test_intervals_of_power_are_scaled() -> None:
    ball = wf.Sphere((0, 0, 0), 0.5, emission=3, material=BLACK)
    panel = wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=BLACK)
    found = wf.measure_flux([ball, panel], panel, side="front", spp=64, **QUIET)
    low, high = found.interval()
    assert (low <= found.value).all()
    assert (found.value <= high).all()
    assert (high - low == pytest.approx(4 * found.standard_error, rel=0.5)) or not found.value.any()


# --- The record of narrow lobes -----------------------------------------------------------------------


def test_the_record_of_a_mirror_is_its_reflectance_times_pi() -> None:
    """Every path of a sensor that faces an endless mirror has that throughput."""
    scene = [wf.Plane((0, 1, 0), (0, -1, 0), material=wf.Mirror(0.9)), wf.Sphere((0, -5, 0), 1, emission=1)]
    found = wf.measure(scene, [(0, 0, 0)], UP, spp=16, max_bounces=2, **QUIET)
    assert narrow_of(found) == pytest.approx(0.9 * np.pi, rel=1e-5)
    assert found.metadata[BRIGHTEST] == [1, 1, 1]
    unseen = -np.log(0.05) / 16 * 0.9 * np.pi
    assert found.interval()[1][0, 1] >= (1 - 1e-6) * unseen
    assert not found.reliable.any()


@pytest.mark.parametrize(("roughness", "narrow"), [(0.1, True), (0.9, False)])
def test_reflections_are_narrow_by_their_density(roughness: float, narrow: bool) -> None:
    above = wf.Plane((0, 1, 0), (0, -1, 0), material=wf.Conductor("gold", roughness=roughness))
    found = wf.measure([above, wf.Sphere((0, -5, 0), 1, emission=1)], [(0, 0, 0)], UP, spp=64, **QUIET)
    assert (narrow_of(found)[0] > 1) == narrow


def test_only_scenes_with_narrow_lobes_have_the_record() -> None:
    lamp = wf.PointLight((0, 2, 0), 5)
    assert NARROW not in wf.measure(room(), [(0, 0.5, 0)], UP, spp=2, **QUIET).image.layers
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Mirror(0.9))
    assert NARROW not in wf.measure(wf.Scene([ball], [lamp]), [(0, 2, 0)], UP, spp=2, **QUIET).image.layers
    assert NARROW not in wf.render(glassy(), 1, size=(4, 4), progress=False).layers
    found = wf.measure(glassy(), [(0, 0.5, 0)], UP, spp=2, aovs="direct", **QUIET)
    assert NARROW in found.image.layers
    assert [*found.image.errors] == ["direct"]  # it is no part of the light


def test_points_that_met_no_narrow_lobe_have_that_of_the_others() -> None:
    mirror = wf.Rectangle((-1, 2, 1), (2, 0, 0), (0, 0, -2), material=wf.Mirror(1))
    wall = wf.Rectangle((-9, 9, -9), (18, 0, 0), (0, 0, 18), material=BLACK, emission=1)
    far = (0, 1, 8)
    found = wf.measure([mirror, wall], [far, (0, 1.9, 0)], UP, spp=8, **QUIET)
    other, near = narrow_of(found)
    assert near > 0.9 * np.pi
    assert other == 0
    alone = wf.measure([mirror, wall], [far], UP, spp=8, **QUIET)
    more = found.interval()[1][0] - alone.interval()[1][0]
    assert more == pytest.approx(-np.log(0.05) / 8 * near / 2, rel=0.3)
    assert alone.reliable.tolist() == [True]
    assert found.reliable.tolist() == [False, False]


def test_a_sensor_that_looks_into_a_mirror_sees_it_surely() -> None:
    """A path that has met no rough surface misses no lamp that it points at."""
    mirror = wf.Rectangle((-1, 0, -1), (2, 0, 0), (0, 0, 2), material=wf.Mirror(1))
    lamp = wf.Sphere((0, 6, 0), 1, emission=1, material=BLACK)
    seen = wf.measure([mirror, lamp], [(0, 1, 0)], (0, -1, 0), kind="radiance", spp=4, **QUIET)
    assert narrow_of(seen) == 0
    floor = wf.Rectangle((-1, -3, -1), (2, 0, 0), (0, 0, 2), material=wf.Diffuse(1))
    above = wf.Rectangle((-9, 5, 9), (18, 0, 0), (0, 0, -18), material=wf.Mirror(1))
    seen = wf.measure([floor, above, lamp], [(0, -2, 0)], (0, -1, 0), kind="radiance", spp=4, **QUIET)
    assert narrow_of(seen) == pytest.approx(1, rel=1e-5)


def test_workers_and_waves_change_no_bit_of_it() -> None:
    points = floor_points()[:6]
    found = [
        wf.measure(glassy(), points, UP, spp=16, progress=False, **cut)
        for cut in ({"workers": 1}, {"workers": 2, "wave_size": 37})
    ]
    assert narrow_of(found[0]).any()
    assert narrow_of(found[0]).tobytes() == narrow_of(found[1]).tobytes()


@pytest.mark.parametrize("aovs", [(), ("light_groups",)])
def test_shared_paths_have_about_the_same_record(aovs: Any) -> None:
    points = np.tile([(0, 0.001, 1), (-1.2, 0.001, 1.5)], (32, 1))
    plain, shared = (
        wf.measure(glassy(), points, UP, spp=32, reuse=reuse, aovs=aovs, **QUIET) for reuse in (False, True)
    )
    for point in range(2):
        one, other = (narrow_of(found)[point::2].mean() for found in (plain, shared))
        assert other == pytest.approx(one, rel=0.3)


# --- Files --------------------------------------------------------------------------------------------


def test_files_and_merged_parts_hold_the_record(tmp_path: Path) -> None:
    points = floor_points()[:4]
    whole = wf.measure(glassy(), points, UP, spp=32, **QUIET)
    parts = [wf.measure(glassy(), points, UP, samples=each, **QUIET) for each in (range(16), range(16, 32))]
    parts[0].save(tmp_path / "first.npz")
    merged = wf.Measurement.load(tmp_path / "first.npz").merge(parts[1])
    for one, other in ((merged, whole), (wf.Measurement(merged.image), whole)):
        assert narrow_of(one) == pytest.approx(narrow_of(other), rel=1e-5)
        np.testing.assert_allclose(one.interval(), other.interval(), rtol=1e-4)
        assert (one.reliable == other.reliable).all()
    whole.image.save(tmp_path / "whole.exr")
    again = wf.Measurement(wf.Image.load(tmp_path / "whole.exr"))
    np.testing.assert_array_equal(again.interval(), whole.interval())


def test_files_of_earlier_versions_are_not_reliable() -> None:
    """They tell nothing of narrow lobes; their intervals are those without."""
    image = wf.measure(room(), floor_points(), UP, spp=64, **QUIET).image
    now = wf.Measurement(image)
    assert now.reliable.any()
    del image.metadata[BRIGHTEST]
    old = wf.Measurement(image)
    assert not old.reliable.any()
    np.testing.assert_array_equal(old.interval(), now.interval())


def test_a_checkpoint_without_the_record_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, points = tmp_path / "desk.npz", floor_points()[:4]
    with monkeypatch.context() as patch:
        patch.setattr("wavefront.drive.plan.narrow_aovs", lambda _: ())
        wf.measure(glassy(), points, UP, spp=8, checkpoint=path, **QUIET)
    with pytest.raises(wf.SceneError, match=r"aovs was \['lux'\] and is \['lux', 'narrow_lobes'\]"):
        wf.measure(glassy(), points, UP, spp=16, checkpoint=path, **QUIET)
    path.unlink()
    wf.measure(glassy(), points, UP, spp=8, checkpoint=path, **QUIET)
    more = wf.measure(glassy(), points, UP, spp=16, checkpoint=path, **QUIET)
    whole = wf.measure(glassy(), points, UP, spp=16, **QUIET)
    assert narrow_of(more).tobytes() == narrow_of(whole).tobytes()


# --- The brightest emitter ----------------------------------------------------------------------------


def brightest(*parts: Any) -> list[float]:
    shapes = [part for part in parts if isinstance(part, wf.Shape)] or [wf.Sphere((0, 0, 0), 1)]
    scene = wf.Scene(shapes, [part for part in parts if isinstance(part, wf.Light)])
    from wavefront.accel.numpy_accel import NumpyAccelerator

    return brightest_emitter(compile_scene(scene, NumpyAccelerator, mis=True)).tolist()


def hot_spot() -> np.ndarray:
    pixels = np.full((16, 32, 3), 0.1)
    pixels[3, 5] = 500, 400, 300
    return pixels


@pytest.mark.parametrize(
    ("parts", "due"),
    [
        ([wf.Sphere((0, 0, 0), 1)], (0, 0, 0)),
        ([wf.PointLight((0, 2, 0), 99)], (0, 0, 0)),
        ([wf.Sphere((0, 0, 0), 1, emission=(1, 2, 3)), wf.Environment((2, 1, 0.5))], (2, 2, 3)),
        ([wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), emission=7)], (7, 7, 7)),
        ([wf.Environment(hot_spot(), filter="nearest")], (500, 400, 300)),
        ([wf.DirectionalLight((0, -1, 0), 1, angle=2)], np.full(3, 1 / (np.pi * np.sin(np.radians(1)) ** 2))),
    ],
)
def test_the_brightest_emitter(parts: Any, due: Any) -> None:
    assert brightest(*parts) == pytest.approx(due, rel=1e-3)


def test_the_brightest_texel_of_a_lamp_counts() -> None:
    texture = wf.Texture(np.array([[[1.0, 2, 3], [40, 5, 6]]]))
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    lamp = wf.Mesh(corners, [(0, 1, 2)], uvs=[(0, 0), (1, 0), (0, 1)], emission=texture)
    assert max(brightest(lamp)) == 40

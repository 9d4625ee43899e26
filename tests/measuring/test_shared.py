"""Sensors that share paths, and the promises of renders, which hold for measurements with and without it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import MEMBERS, PointTiles, nearby_ranks
from scipy import stats
from significance import ALPHA, Mean, assert_mean

import wavefront as wf

QUIET: dict[str, Any] = {"progress": False, "workers": 1}
POINTS, UP = wf.grid_points((-0.9, -0.95, 0.1), (0, 0, 0.8), (1.8, 0, 0), (8, 8))
MANY, MANY_UP = wf.grid_points((-0.9, -0.95, 0.1), (0, 0, 0.8), (1.8, 0, 0), (32, 32))
BOX = scenes.cornell_box()


def of_tiles(scene: Any, kind: str, **settings: Any) -> np.ndarray:
    """Measure the means (64,) over tiles of points, which are independent."""
    rank = nearby_ranks(MANY, MANY_UP if kind != "fluence" else np.broadcast_to((0.0, 0, 1), MANY.shape))
    normals = None if kind == "fluence" else MANY_UP
    found = wf.measure(scene, MANY, normals, kind=kind, **QUIET, **settings)
    return found.value.mean(1, dtype=np.float64)[np.argsort(rank)].reshape(-1, MEMBERS).mean(1)


# --- Tiles --------------------------------------------------------------------------------------------


def test_tiles_are_of_near_points_that_face_one_way() -> None:
    rng = np.random.default_rng(0)
    points, up = wf.grid_points((0, 0, 0), (1, 0, 0), (0, 1, 0), (16, 16))
    both, normals = np.concatenate([points, points]), np.concatenate([up, -up])
    order = rng.permutation(len(both))
    rank = nearby_ranks(both[order], normals[order])
    assert np.unique(rank).size == len(both)
    tile, member = PointTiles(rank).place(np.arange(len(both), dtype=np.uint32))
    assert (np.unique(tile, return_counts=True)[1] == MEMBERS).all()
    assert np.unique(tile * MEMBERS + member).size == len(both)
    for number, pixels in enumerate(PointTiles(rank).pixels(np.arange(PointTiles(rank).count))):
        assert (tile[pixels] == number).all()
        assert (member[pixels] == np.arange(MEMBERS)).all()
        assert np.ptp(both[order][pixels], axis=0).max() < 0.2  # four cells of 1/16
        assert np.ptp(normals[order][pixels], axis=0).max() == 0


def test_tiles_of_one_place_and_of_few_points() -> None:
    rank = nearby_ranks(np.ones((5, 3)), np.tile((0.0, 1, 0), (5, 1)))
    assert rank.tolist() == [0, 1, 2, 3, 4]
    tiles = PointTiles(rank)
    assert tiles.count == 1
    assert tiles.pixels(np.arange(1))[0].tolist() == [0, 1, 2, 3, 4]


# --- Values and errors --------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "factor"), [("irradiance", np.pi), ("fluence", 4 * np.pi), ("radiance", 1)])
def test_a_furnace_is_as_bright_with_shared_paths(kind: str, factor: float) -> None:
    wall = wf.Sphere((0, 0, 0), 3, material=wf.Material(wf.Diffuse(0.6), emission=1))
    found = Mean.of(of_tiles(wall, kind, spp=32, max_bounces=40, reuse=True))
    assert_mean(found, factor / 0.4, 0.002)


@pytest.mark.parametrize(
    "settings", [{}, {"branches": 2}, pytest.param({"guide": True}, marks=pytest.mark.slow)], ids=str
)
@pytest.mark.parametrize("kind", ["irradiance", "fluence"])
@pytest.mark.first(1)
def test_sharing_changes_no_mean(kind: str, settings: dict[str, Any]) -> None:
    scene = scenes.cornell_box()
    scene.shapes[0].material = wf.Diffuse((0.9, 0.5, 0.1))
    plain, shared = (of_tiles(scene, kind, spp=4, reuse=each, **settings) for each in (False, True))
    assert_mean(Mean.of(1 + (shared - plain) / plain.mean()), 1, 0.02)


@pytest.mark.slow
def test_sharing_leaves_less_than_a_fifth_of_the_variance() -> None:
    pairs = [[of_points(seed, reuse) for seed in (0, 1)] for reuse in (False, True)]
    plain, shared = (np.median(np.square(one - other)) for one, other in pairs)
    assert shared < plain / 5


def of_points(seed: int, reuse: bool) -> np.ndarray:
    """Measure many points of the Cornell box."""
    return wf.measure(BOX, MANY, MANY_UP, spp=8, seed=seed, reuse=reuse, **QUIET).value


@pytest.mark.slow
def test_intervals_hold_with_shared_paths() -> None:
    """Errors of near points depend on each other, so that fewer of them tell as much."""
    exact = wf.measure(BOX, MANY, MANY_UP, spp=2048, seed=99, reuse=True, **QUIET).value
    found = [wf.measure(BOX, MANY, MANY_UP, spp=32, seed=k, reuse=True, **QUIET) for k in range(8)]
    inside = [((low <= exact) & (exact <= high)).mean() for low, high in (each.interval() for each in found)]
    assert 0.93 <= np.mean(inside) <= 0.99


def test_parts_add_up_with_shared_paths() -> None:
    scene = scenes.cornell_box()
    scene.shapes[5].material.group = "lamp"
    scene.lights = [wf.PointLight((0.5, 0.5, 0.5), 1.0, group="bulb")]
    aovs = ("direct", "indirect", "light_groups")
    plain, found = (
        wf.measure(scene, POINTS, UP, spp=16, aovs=aovs, reuse=each, **QUIET) for each in (False, True)
    )
    assert found.metadata["reuse"]
    np.testing.assert_allclose(found.direct + found.indirect, found.value, rtol=1e-5)
    groups = [found.part(f"light_groups.{name}")[0] for name in ("lamp", "bulb")]
    np.testing.assert_allclose(sum(groups), found.value, rtol=1e-5)
    np.testing.assert_allclose(found.direct, plain.direct, rtol=1e-5)
    for name in ("indirect", "light_groups.bulb"):
        difference = (found.part(name)[0] - plain.part(name)[0]).mean(1)
        chance = stats.ttest_1samp(difference.reshape(-1, 4).mean(1), 0).pvalue
        assert chance > ALPHA


# --- Where paths are shared ---------------------------------------------------------------------------


def test_a_tuning_run_decides() -> None:
    open_air = [scenes.floor(wf.Diffuse(0.3), 20), wf.Environment(1)]
    settings: dict[str, Any] = {"spp": 4, **QUIET}
    above = POINTS + np.array((0.0, 1, 0))
    assert wf.measure(BOX, POINTS, UP, **settings).metadata["reuse"]
    assert not wf.measure(BOX, POINTS[:15], UP[:15], **settings).metadata["reuse"]
    assert not wf.measure(BOX, POINTS, UP, max_bounces=0, **settings).metadata["reuse"]
    assert not wf.measure(open_air, above, UP, **settings).metadata["reuse"]
    plain, tried = (wf.measure(open_air, above, UP, **settings, **each) for each in ({"reuse": False}, {}))
    assert plain.value.tobytes() == tried.value.tobytes()


def test_sharing_that_is_not_possible_is_refused() -> None:
    with pytest.raises(wf.SceneError, match="reuse is True; power on shapes is measured without it"):
        wf.measure_flux(BOX, BOX.shapes[0], reuse=True)
    fog = wf.Scene(BOX.shapes, medium=wf.Medium(scattering=0.1))
    with pytest.raises(wf.SceneError, match="reuse=True does not go with media that scatter"):
        wf.measure(fog, POINTS, UP, spp=1, reuse=True, **QUIET)


# --- Promises -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("reuse", [False, True])
def test_the_same_bits_whatever_does_the_work(reuse: bool) -> None:
    some: dict[str, Any] = {"spp": 8, "reuse": reuse, "aovs": "indirect", "progress": False}
    due = wf.measure(BOX, POINTS, UP, workers=1, **some)
    ways: tuple[dict[str, Any], ...] = (
        {"workers": 2, "wave_size": 100},
        {"workers": 2, "executor": "processes"},
    )
    for way in ways:
        found = wf.measure(BOX, POINTS, UP, **some, **way)
        for name, column in due.columns().items():
            assert found.columns()[name].tobytes() == column.tobytes(), (way, name)


@pytest.mark.parametrize(
    ("reuse", "settings"),
    [
        (True, {"spp": 48}),
        (False, {"noise": 0.2}),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in ((False, {"spp": 48}), (True, {"noise": 0.2}))
        ),
    ],
    ids=str,
)
def test_a_stop_and_a_checkpoint_cost_no_bit(reuse: bool, settings: dict[str, Any], tmp_path: Path) -> None:
    some: dict[str, Any] = {**QUIET, **settings, "reuse": reuse, "wave_size": 256}
    due = wf.measure(BOX, POINTS, UP, **{**some, "wave_size": 4096})

    def press(done: float, total: float) -> None:
        if done > 40 * 64:
            raise KeyboardInterrupt

    path = tmp_path / "a.wfck"
    with pytest.raises(wf.Interrupted):
        wf.measure(BOX, POINTS, UP, checkpoint=path, **{**some, "progress": press})
    assert 0 < wf.Image.load(path).counts.max() < due.samples.max()
    found = wf.measure(BOX, POINTS, UP, checkpoint=path, **some)
    for name, column in due.columns().items():
        assert found.columns()[name].tobytes() == column.tobytes(), name


@pytest.mark.parametrize("reuse", [False, True])
@pytest.mark.first(1)
def test_merged_parts_are_the_whole(reuse: bool) -> None:
    parts = [
        wf.measure(BOX, POINTS, UP, samples=each, reuse=reuse, **QUIET)
        for each in (range(8), range(8, 12), range(12, 16))
    ]
    whole = wf.measure(BOX, POINTS, UP, spp=16, reuse=reuse, **QUIET)
    merged = parts[0].merge(parts[1]).merge(parts[2])
    assert merged.value.tobytes() == whole.value.tobytes()
    assert merged.samples.tolist() == [16] * len(POINTS)
    np.testing.assert_allclose(merged.standard_error, whole.standard_error, rtol=1e-5)

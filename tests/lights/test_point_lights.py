"""`PointLights`: many points as one light."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import wavefront as wf

POSITIONS = np.array([[-1, 2, 0], [1, 2, 0.5], [0, 1.5, 1]])
COLORS = np.array([[3, 2, 1], [1, 2, 3], [2, 2, 2]])


def scene(*lights: wf.Light, size: float = 1) -> wf.Scene:
    """A floor under lights."""
    corner, edge = np.array([-3, 0, -3]) * size, 6 * size
    floor = wf.Rectangle(corner, (0, 0, edge), (edge, 0, 0), material=wf.Diffuse((0.7, 0.6, 0.5)))
    camera = wf.Camera.look_at((0, 2 * size, 5 * size), (0, 0, 0), fov=50, size=(16, 12))
    return wf.Scene([floor], lights, camera)


@pytest.mark.parametrize("sampler", ["spatial", "power", "uniform"])
def test_they_are_the_same_as_single_lights(sampler: str) -> None:
    single = [wf.PointLight(p, i) for p, i in zip(POSITIONS, COLORS, strict=True)]
    others = [wf.PointLight((0, 3, 0), 1, group="lamp"), wf.Environment(0.1)]
    many = wf.PointLights(POSITIONS, COLORS)
    a, b = (
        wf.render(scene(*lights, *others), 4, light_sampler=sampler, aovs="light_groups")
        for lights in (single, [many])
    )
    assert np.array_equal(a.rgb, b.rgb)
    for name, layer in a.light_groups.items():
        assert np.array_equal(b.light_groups[name], layer)


@pytest.mark.parametrize("intensities", [2, (2, 2, 2), [[2], [2], [2]], np.full((3, 3), 2)])
def test_intensities_can_be_shared(intensities: Any) -> None:
    expected = wf.render(scene(*(wf.PointLight(p, 2) for p in POSITIONS)), 2)
    assert np.array_equal(wf.render(scene(wf.PointLights(POSITIONS, intensities)), 2).rgb, expected.rgb)


def test_scenes_of_extreme_size() -> None:
    size = 2.0**40
    near = wf.render(scene(wf.PointLights(POSITIONS, COLORS)), 2)
    far = wf.render(scene(wf.PointLights(POSITIONS * size, COLORS * size**2), size=size), 2)
    np.testing.assert_allclose(far.rgb, near.rgb, rtol=1e-5)
    assert wf.PointLights(POSITIONS, 1).bounds.tolist() == [[-1, 1.5, 0], [1, 2, 1]]


@pytest.mark.parametrize(
    ("positions", "intensities", "message"),
    [
        ([0, 1, 2], 1, r"PointLights positions must have shape \(n, 3\), got \(3,\)"),
        (np.zeros((0, 3)), 1, r"PointLights positions must have one row at least, got \(0, 3\)"),
        ([[0, np.nan, 0]], 1, r"PointLights positions\[0\]\[1\] is nan; it must be finite"),
        (
            POSITIONS,
            [[1], [2]],
            r"must have shape \(\), \(3,\), \(3, 1\) or \(3, 3\) for 3 positions, got \(2, 1\)",
        ),
        (POSITIONS, [[1], [-2], [1]], r"PointLights intensities\[1\]\[0\] is -2; it must be at least 0"),
        (POSITIONS, np.inf, r"PointLights intensities is inf; it must be finite"),
        ([[1e30, 0, 0]], 1, "PointLights position is .* it must be at most"),
    ],
)
def test_malformed_arguments_are_errors(positions: Any, intensities: Any, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.render(scene(wf.PointLights(positions, intensities)), 1)


@pytest.mark.slow
def test_a_million_is_set_up_quickly() -> None:
    places = np.random.default_rng(0).uniform((-3, 1, -3), (3, 7, 3), (10**6, 3))
    begin = time.process_time()
    image = wf.render(scene(wf.PointLights(places, 1e-5)), 1, workers=1, executor="threads")
    assert time.process_time() - begin < 5
    assert image.rgb.mean() > 0.01

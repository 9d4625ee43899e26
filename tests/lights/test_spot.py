"""Spot lights: the cone of glTF, and what a floor gets of it."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import f4
from scenes import ALBEDO, EYE, floor, probe
from significance import SIDE, measure, render

import wavefront as wf
from wavefront import testing

ORIGIN = np.zeros(3)


def gltf_cone(degrees: float, outer: float, inner: float) -> float:
    """The angular attenuation that KHR_lights_punctual suggests, angles in degrees from the axis."""
    scale = 1 / (np.cos(np.radians(inner)) - np.cos(np.radians(outer)))
    ramp = np.clip((np.cos(np.radians(degrees)) - np.cos(np.radians(outer))) * scale, 0, 1)
    return float(ramp**2)


def intensity(light: wf.SpotLight, degrees: float) -> float:
    """What leaves the light, shining along -y, in a direction off its axis: E·d² at distance 2."""
    theta = np.radians(degrees)
    point = light.position + 2 * np.array([np.sin(theta), -np.cos(theta), 0])
    sample = light.record(ORIGIN).sample_li(point.astype(f4).reshape(3, 1), np.zeros((2, 1), f4))
    assert sample.distance == pytest.approx(2)
    return float(sample.radiance[0, 0] * sample.pdf[0]) * 4


@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("offset", [0.0, 0.5, 0.8])
def test_floor(integrator: str, offset: float) -> None:
    """I·falloff·h/d³, on the axis, in the soft part and beyond the cone."""
    light = wf.SpotLight((0, 2, 0), 10.0, target=(0, 0, 0), angle=40, blend=0.5)
    scene = wf.Scene([floor()], [light], probe((offset, 0, 0), np.add((offset, 0, 0), EYE)))
    degrees = np.degrees(np.arctan2(offset, 2))
    expected = 10 * gltf_cone(degrees, 20, 10) * 2 / np.hypot(2, offset) ** 3
    assert (expected > 0) == (offset < 0.7)
    assert measure(scene, 4, integrator=integrator, max_bounces=1).value == pytest.approx(
        expected * ALBEDO / np.pi, rel=1e-4
    )


@given(st.floats(0, 89), st.floats(1, 89), st.floats(0.05, 1))
def test_falloff_is_that_of_gltf(degrees: float, outer: float, blend: float) -> None:
    """angle = 2·outer, blend = 1 − inner/outer."""
    light = wf.SpotLight((1, 2, 3), 1.0, direction=(0, -5, 0), angle=2 * outer, blend=blend)
    expected = gltf_cone(degrees, outer, outer * (1 - blend))
    assert intensity(light, degrees) == pytest.approx(expected, abs=2e-3)


def test_narrow_cones_are_full_on_the_axis() -> None:
    for angle in (1e-3, 0.1, 180):
        light = wf.SpotLight((0, 0, 0), 3.0, direction=(0, -1, 0), angle=angle, blend=1)
        assert intensity(light, 0) == pytest.approx(3)
        assert intensity(light, angle / 4) == pytest.approx(3 * gltf_cone(angle / 4, angle / 2, 0), rel=2e-2)
        assert intensity(light, angle * 0.502) == 0


def test_a_hard_edge() -> None:
    light = wf.SpotLight((0, 0, 0), 1.0, direction=(0, -1, 0), angle=60, blend=0)
    assert [intensity(light, a) for a in (0, 29.99, 30.01)] == pytest.approx([1, 1, 0], abs=1e-6)


@pytest.mark.parametrize("degrees", [5.0, 20.0, 27.0, 38.0, 45.0])
def test_a_smooth_step_is_that_of_pbrt(degrees: float) -> None:
    """SmoothStep(cos θ, cos of the end, cos of the start), in lights.cpp of pbrt-v4."""
    light = wf.SpotLight((0, 0, 0), 3, direction=(0, -1, 0), angle=80, blend=0.5, falloff="smoothstep")
    begin, end, cos = np.cos(np.radians([20, 40, degrees]))
    t = np.clip((cos - end) / (begin - end), 0, 1)
    assert intensity(light, degrees) == pytest.approx(3 * t * t * (3 - 2 * t), abs=1e-5)
    away = np.sin(np.radians(degrees)), -np.cos(np.radians(degrees)), 0.0
    bound = light.record(ORIGIN).irradiance(np.reshape(away, (3, 1)), 1e-6, 9.0)[0, 0]
    assert bound == pytest.approx(intensity(light, degrees), abs=1e-4)


@pytest.mark.parametrize("falloff", ["smooth", "smoothstep"])
@pytest.mark.parametrize("blend", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("angle", [10.0, 90.0, 180.0])
def test_power_is_the_integral_of_the_intensity(angle: float, blend: float, falloff: Any) -> None:
    cone = {"angle": angle, "blend": blend, "falloff": falloff}
    light = wf.SpotLight((0, 0, 0), (1.0, 2.0, 6.0), direction=(0, -1, 0), **cone)
    n = 4000
    theta = np.radians(angle / 2) * (np.arange(n) + 0.5) / n
    points = 2 * np.stack([np.sin(theta), -np.cos(theta), 0 * theta]).astype(f4)
    sample = light.record(ORIGIN).sample_li(points, np.zeros((2, n), f4))
    intensity = sample.radiance.mean(0, dtype=float) * sample.pdf * 4
    power = (intensity * np.sin(theta)).mean() * 2 * np.pi * np.radians(angle / 2)
    assert light.record(ORIGIN).power(1.0) == pytest.approx(power, rel=2e-3)


@given(st.floats(1, 180), st.floats(0, 1), st.integers(0, 1000))
def test_no_place_is_thought_darker_than_it_is(angle: float, blend: float, seed: int) -> None:
    """The estimate that guides the choice of a light bounds what reaches a ball of space outside it."""
    rng = np.random.default_rng(seed)
    light = wf.SpotLight((0, 0, 0), 5.0, direction=(0, -1, 0), angle=angle, blend=blend).record(ORIGIN)
    center, radius = rng.normal(size=(3, 1)) * 2, 0.4
    offsets = rng.normal(size=(3, 200))
    points = center + radius * offsets / np.maximum(np.linalg.norm(offsets, axis=0), 1)
    sample = light.sample_li(points.astype(f4), np.zeros((2, 200), f4))
    d = np.maximum(np.linalg.norm(points, axis=0), np.linalg.norm(center) + 1e-9)  # as from the middle
    intensity = sample.radiance[0] * sample.pdf * sample.distance**2
    assert (intensity / d**2 <= light.irradiance(center, radius, 9.0)[0, 0] * (1 + 1e-3) + 1e-6).all() or (
        np.linalg.norm(center) < radius
    )


@pytest.mark.parametrize("falloff", ["smooth", "linear"])
@pytest.mark.parametrize(("angle", "blend"), [(40.0, 0.5), (170.0, 1.0)])
def test_what_is_thought_of_a_small_ball_is_what_arrives(angle: float, blend: float, falloff: Any) -> None:
    """By both falloffs, also where they take more than a radian; a ball around the light gets I/r²."""
    light = wf.SpotLight((0, 0, 0), 3.0, direction=(0, -1, 0), angle=angle, blend=blend, falloff=falloff)
    outer, inner = angle / 2, angle / 2 * (1 - blend)
    shape = {
        "smooth": partial(gltf_cone, outer=outer, inner=inner),
        "linear": lambda degrees: float(np.clip((outer - degrees) / (outer - inner), 0, 1)),
    }[falloff]
    record = light.record(ORIGIN)
    for degrees in np.array([0, 0.3, 0.6, 0.9, 1.1]) * outer:
        assert intensity(light, degrees) == pytest.approx(3 * shape(degrees), abs=1e-4)
        theta = np.radians(degrees)
        center = 2 * np.array([[np.sin(theta)], [-np.cos(theta)], [0]])
        assert record.irradiance(center, 1e-7, 9.0) == pytest.approx(0.75 * shape(degrees), abs=1e-4)
    assert record.irradiance(np.array([[0.1], [0.2], [0]]), 0.5, 9.0) == pytest.approx(3 / 0.5**2)
    theta = np.radians(outer) * (np.arange(4000) + 0.5) / 4000
    solid_angle = 2 * np.pi * np.sin(theta) * [shape(each) for each in np.degrees(theta)]
    assert record.power(1.0) == pytest.approx(3 * solid_angle.mean() * np.radians(outer), rel=1e-4)


def test_defaults() -> None:
    spot = wf.SpotLight((0, 1, 0), 1, target=(0, 0, 0))
    assert (spot.angle, spot.blend, spot.falloff, spot.up.tolist()) == (45, 0.15, "smooth", [0, 1, 0])


@pytest.mark.parametrize("make", [wf.SpotLight, partial(wf.Projector, picture=np.ones((2, 2, 3)))])
def test_a_target_gives_the_direction_once(make: Callable[..., Any]) -> None:
    light = make(position=(0, 4, 0), intensity=1, target=(0, 0, 0))
    light.position = (3, 4, 0)
    assert light.direction.tolist() == [0, -1, 0]
    light.direction = (2, 0, 0)
    assert light.direction.tolist() == [1, 0, 0]
    with pytest.raises(wf.SceneError, match="needs a target or a direction, and not both"):
        light.target = (0, 1, 0)
    assert light.direction.tolist() == [1, 0, 0]


def test_many_lights_of_all_kinds() -> None:
    lights = [
        wf.PointLight((0, 2, 0), 4.0),
        wf.SpotLight((0, 2, 0), 4.0, direction=(0, -1, 0)),
        wf.DirectionalLight((0, -1, 0), 1.0),
        wf.SpotLight((0, 2, 0), 8.0, target=(0, 1, 0), angle=90),
        wf.DirectionalLight((0, -1, 0), 0.5, angle=2),
        wf.PointLight((0, 2, 0), 2.0),
    ]
    scene = wf.Scene([floor(half=1)], lights, probe((0, 0, 0), EYE))
    mean = measure(scene, 2048, integrator="direct_mis", max_bounces=1)
    assert abs(mean.value - (1 + 1 + 1 + 2 + 0.5 + 0.5) * ALBEDO / np.pi) < 4 * mean.error + 1e-5
    assert mean.error < 0.002 * mean.value


def test_a_spot_is_a_round_patch() -> None:
    """Seen from above: a disk of radius tan(outer) in the middle of the floor."""
    camera = wf.Camera.orthographic((0, 5, 0), (0, 0, 0), (0, 0, -1), height=2, size=(SIDE * 8, SIDE * 8))
    light = wf.SpotLight((0, 1, 0), 1.0, target=(0, 0, 0), angle=60, blend=0)
    lit = render(wf.Scene([floor()], [light], camera), 1, max_bounces=1).rgb[..., 0] > 0
    assert lit.mean() * 4 == pytest.approx(np.pi * np.tan(np.radians(30)) ** 2, rel=0.03)
    assert (lit == lit.T).mean() > 0.97


def test_sampling_keeps_the_contract() -> None:
    light = wf.SpotLight((0.1, 5, 0.2), (1.0, 2.0, 3.0), target=(0, 0, 0), angle=50)
    testing.check_light(light, samples=1000)


BAD = {
    "neither": ({"target": None}, "SpotLight needs a target or a direction, and not both"),
    "both": ({"direction": (0, 0, 1)}, "SpotLight needs a target or a direction, and not both"),
    "at its target": ({"target": (0, 1, 0)}, r"position and target are both \[0.0, 1.0, 0.0\]"),
    "no direction": (
        {"target": None, "direction": (0, 0, 0)},
        r"SpotLight direction is \[0.0, 0.0, 0.0\]; it must not be zero",
    ),
    "position": ({"position": (0, np.inf, 0)}, r"SpotLight position\[1\] is inf; it must be finite"),
    "intensity": ({"intensity": (1, -1, 1)}, r"SpotLight intensity\[1\] is -1; it must be at least 0"),
    "angle 0": ({"angle": 0}, "SpotLight angle is 0; it must be above 0 and at most 180 degrees"),
    "angle large": ({"angle": 181}, "SpotLight angle is 181"),
    "falloff": (
        {"falloff": "cubic"},
        "falloff is 'cubic'; it must be one of smooth, linear, smoothstep",
    ),
    "blend": ({"blend": 1.5}, r"SpotLight blend is 1.5; it must be in \[0, 1\]"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    change, message = BAD[name]
    arguments = {"position": (0, 1, 0), "intensity": 1.0, "target": (0, 0, 0), **change}
    with pytest.raises(wf.SceneError, match=message):
        wf.SpotLight(**arguments)

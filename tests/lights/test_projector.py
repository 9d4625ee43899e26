"""Projectors and spots with a picture: what arrives on a screen, and what is thought of it."""

import numpy as np
import pytest
from inside import f4
from scenes import EYE, floor, probe
from significance import measure

import wavefront as wf
from wavefront import testing

ORIGIN = np.zeros(3)
QUARTERS = wf.Texture(
    [[[1.0, 0, 0], [0, 1, 0]], [[0, 0, 1], [0.5, 0.5, 0.5]]], filter="nearest"
)  # red and green above blue and gray


def arriving(light: wf.Light, points) -> np.ndarray:
    """I/d² (3, n) at points (n, 3)."""
    points = np.asarray(points, float).T.astype(f4)
    sample = light.record(ORIGIN).sample_li(points, np.zeros((2, points.shape[1]), f4))
    return sample.radiance.astype(float) * sample.pdf


def test_a_screen_is_lit_evenly_and_the_right_way_up() -> None:
    """Along -z, up is y: red is at the upper left, and cosθ·I/d² is that of the middle."""
    slide = wf.Texture(
        np.repeat(QUARTERS.lookup(f4([[0.2, 0.8], [0.8, 0.2]])).T[:, None], 4, 1), filter="nearest"
    )
    assert slide.size == (4, 2)
    light = wf.Projector((0, 0, 0), slide, (6, 6, 3), direction=(0, 0, -2), fov=60)
    high, wide = np.tan(np.radians(30)), 2 * np.tan(np.radians(30))
    x, y = np.array([-0.99, 0.99, -0.99, 0.99]) * wide, np.array([0.99, 0.99, -0.99, -0.99]) * high
    points = 3 * np.stack([x, y, -np.ones(4)], 1)
    cos = 3 / np.linalg.norm(points, axis=1)
    seen = arriving(light, points) * cos
    first, second = slide.lookup(f4([[0.1, 0.1], [0.9, 0.1]])).T
    expected = np.stack([first, first, second, second], 1) * np.reshape([6, 6, 3], (3, 1)) / 9
    assert seen == pytest.approx(expected, rel=1e-4)
    outside = np.array([[1.01 * wide, 0, -1], [0, -1.01 * high, -1], [0, 0, 1], [0.3, 0.2, 2]])
    assert not arriving(light, outside).any()


def test_a_spot_shows_its_picture_in_the_square_around_its_cone() -> None:
    for falloff in ("smooth", "linear"):
        arguments = {"direction": (0, -1, 0), "angle": 80, "blend": 0.5, "falloff": falloff}
        light = wf.SpotLight((0, 0, 0), 5, picture=QUARTERS, up=(0, 0, -1), **arguments)
        plain = wf.SpotLight((0, 0, 0), 5, **arguments)
        side = 0.6 * np.tan(np.radians(40))
        points = [[-side, -1, -side], [side, -1, -side], [-side, -1, side], [side, -1, side], [2, -1, 0]]
        colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0.5], [1, 1, 1]]).T
        assert arriving(light, points) == pytest.approx(arriving(plain, points) * colors, rel=1e-5)
        assert arriving(plain, points)[0, 0] > 0


def test_half_of_the_sky_has_a_picture_without_edges() -> None:
    """Red and green are at the left and right above, however far away from the middle."""
    light = wf.SpotLight((0, 0, 0), 5, picture=QUARTERS, up=(0, 0, -1), direction=(0, -1, 0), angle=180)
    for far in (0.1, 10):
        points = [[-far, -1, -far], [far, -1, -far], [-far, -1, far]]
        assert (arriving(light, points) > 0).tolist() == np.eye(3, dtype=bool).tolist()


def test_up_along_the_axis_is_any_direction() -> None:
    """The picture is then turned by any angle, but whole."""
    light = wf.Projector((0, 0, 0), np.full((2, 2, 3), 0.5), 8, direction=(0, -1, 0), fov=90)
    points = [[x, -1, z] for x in (-0.6, 0, 0.6) for z in (-0.6, 0, 0.6)]
    screen = arriving(light, points) / np.linalg.norm(points, axis=1)
    assert screen == pytest.approx(np.full((3, 9), 4), rel=1e-5)


def test_defaults() -> None:
    light = wf.Projector((0, 1, 0), QUARTERS, target=(0, 0, 0))
    assert (light.intensity.ravel().tolist(), light.fov, light.up.tolist()) == ([1] * 3, 45, [0, 1, 0])
    assert wf.Projector((0, 1, 0), QUARTERS, target=(0, 0, 0), fov=0.5).fov == 0.5


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_a_linear_falloff(blend: float) -> None:
    """Mitsuba 3's spot: linear in the angle between both ends; its power is the integral."""
    light = wf.SpotLight((0, 0, 0), 3, direction=(0, -1, 0), angle=100, blend=blend, falloff="linear")
    n = 4000
    theta = np.radians(50) * (np.arange(n) + 0.5) / n
    points = np.stack([np.sin(theta), -np.cos(theta), 0 * theta], 1)
    inner = 50 * (1 - blend)
    exact = np.clip((50 - np.degrees(theta)) / max(50 - inner, 1e-3), 0, 1)
    seen = arriving(light, points)[0]
    assert seen == pytest.approx(3 * exact, abs=3e-3 if blend else 3)
    power = (seen * np.sin(theta)).mean() * 2 * np.pi * np.radians(50)
    record = light.record(ORIGIN)
    assert record.power(1.0) == pytest.approx([power], rel=2e-3)
    beside = record.irradiance(np.array([[0.5], [-1], [0]]), 1e-6, 9.0)[0, 0]
    assert beside == pytest.approx(arriving(light, [[0.5, -1, 0]])[0, 0], rel=1e-3)


def test_power_of_a_projector_is_the_integral() -> None:
    """Over a screen of the size of the picture; a white one is nowhere brighter than in its corners."""
    axis, up = np.array([0.6, -0.64, 0.48]), np.array([0, 0.6, 0.8])  # perpendicular
    light = wf.Projector((0, 0, 0), QUARTERS, (2, 4, 6), direction=axis, up=up, fov=70)
    rng, edge = np.random.default_rng(0), np.tan(np.radians(35))
    x, y = rng.uniform(-edge, edge, (2, 100_000, 1))
    points = axis + x * np.cross(axis, up) + y * up
    flux = arriving(light, points) / np.linalg.norm(points, axis=1) * 4 * edge**2
    assert light.record(ORIGIN).power(1.0) == pytest.approx(flux.mean(0).mean(), rel=5e-3)
    white = wf.Projector((0, 0, 0), np.ones((1, 1, 3)), (2, 4, 6), direction=axis, up=up, fov=70)
    corner = axis + 0.9999 * edge * (np.cross(axis, up) + up)
    bound = white.record(ORIGIN).irradiance(corner.reshape(3, 1), 1e-7, 9.0)
    assert bound == pytest.approx(arriving(white, [corner]).mean(), rel=1e-3)
    light = wf.Projector((0, 0, 0), QUARTERS, (2, 4, 6), direction=(0, 0, -1), fov=90)
    record = light.record(ORIGIN)
    bound = record.irradiance(np.array([[0.9], [0.9], [-1]]), 0.05, 9.0)[0, 0]
    assert bound >= arriving(light, [[0.9, 0.9, -1], [0.92, 0.88, -1]]).mean(0).max()


def test_a_floor() -> None:
    light = wf.Projector((0, 2, 0), np.full((2, 2, 3), 0.5), 8, target=(0, 0, 0), up=(0, 0, -1))
    scene = wf.Scene([floor()], [light], probe((0.3, 0, 0), np.add((0.3, 0, 0), EYE)))
    plain = wf.Scene([floor()], [wf.PointLight((0, 2, 0), 1)], probe((0, 0, 0), EYE))
    seen = measure(scene, 4, integrator="direct_mis", max_bounces=1).value
    assert seen == pytest.approx(
        4 * measure(plain, 4, integrator="direct_mis", max_bounces=1).value, rel=1e-4
    )


def test_sampling_keeps_the_contract() -> None:
    testing.check_light(wf.Projector((0.1, 5, 0.2), QUARTERS, 3, target=(0, 0, 0), fov=70), samples=1000)


BAD = {
    "picture": ({"picture": None}, "Projector picture is None"),
    "negative": (
        {"picture": np.full((1, 1, 3), -1.0)},
        "Projector picture: .* has the value -1; .* at least 0",
    ),
    "fov": ({"fov": 171}, "Projector fov is 171; it must be above 0 and at most 170 degrees"),
    "neither": ({"target": None}, "Projector needs a target or a direction, and not both"),
    "same": ({"target": (0, 1, 0)}, "Projector position and target are both"),
    "up": ({"up": (0, 0, 0)}, "Projector up is .* must not be zero"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    change, message = BAD[name]
    arguments = {"position": (0, 1, 0), "picture": QUARTERS, "target": (0, 0, 0), **change}
    with pytest.raises(wf.SceneError, match=message):
        wf.Projector(**arguments)

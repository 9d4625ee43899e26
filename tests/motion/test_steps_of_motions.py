"""Matrices while a shutter is open: their steps lose no way that leads back within them, or say so."""

import numpy as np
import pytest
from inside import CUBIC, Deformation, Inverse, Motions, Product, Shutter, Track, Trs, Turn, exposed_scene
from significance import render

import wavefront as wf


def turned(degrees, shift=(0, 0, 0)):
    """A turn about z, and then a shift, as a matrix (4, 4)."""
    matrix, angle = np.eye(4), np.radians(degrees)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = shift
    return matrix


class Spin(wf.Motion):
    """Four turns, of which nothing tells the times of keys."""

    start, end = 0.0, 1.0

    def at_times(self, times):
        return np.stack([turned(4 * 360 * time) for time in np.clip(times, 0, 1)])


class Hop(wf.Motion):
    """A way and back in a fiftieth of the time, of which nothing tells."""

    start, end = 0.0, 1.0

    def at_times(self, times):
        away = np.clip(1 - np.abs(times - 0.64) * 100, 0, 1)
        return np.stack([turned(0, (x, 0, 0)) for x in away])


WHEEL = wf.Keyframes(np.linspace(0, 1, 17), [turned(90 * number) for number in range(17)])
AWAY = (0.26, 0.3, 0.45, 0.49)  # none of these times is that of one of five samples, or nine
TRIP = wf.Keyframes([0, *AWAY, 1], [turned(0, (x, 0, 0)) for x in (0, 0, 1, 1, 0, 0)])
THERE = np.zeros((4, 3, 3))  # a spline between two keys at one place, with tangents
THERE[1:3, 1] = THERE[1, 2] = (1, 0, 0)
MOTIONS = {
    "wheel": WHEEL,
    "spin": Spin(),
    "hop": Hop(),
    "turn": Turn(np.array([0.0, 0, 1]), np.zeros(3), 3 * 360, 0, 1),
    "trip": TRIP,
    "a wheel on a trip": Product(TRIP, WHEEL),
    "a trip on a wheel that is still": Product(turned(30), TRIP),
    "from the trip": Inverse(TRIP),
    "spline": Trs(
        Track(np.array([0, 0.3, 0.45, 1]), THERE, CUBIC),
        Track(np.zeros(1), np.array([[0.0, 0, 0, 1]]), turns=True),
        Track(np.zeros(1), np.ones((1, 3))),
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_steps_are_as_exact_as_stated(name):
    """To a few millionths of the size of what moves; to a ten-thousandth where none tells of bends."""
    motion, times = MOTIONS[name], np.random.default_rng(3).random(500)
    motions = Motions.of([motion.at_times], 0, 1, np.ones(1), motion.keys, [name])
    to_local = motions.at(np.zeros(500, np.intp), times).T.reshape(-1, 3, 4)
    limit = 1e-4 if name == "hop" else 8e-6
    assert np.abs(to_local @ motion.at_times(times) - np.eye(4)[:3]).max() < limit


class Spins(wf.Motion):
    """So many turns."""

    start, end = 0.0, 1.0

    def __init__(self, turns):
        self.turns = turns

    def at_times(self, times):
        matrix, angle = np.tile(np.eye(4), (len(times), 1, 1)), 2 * np.pi * self.turns * times
        matrix[:, 0, 0] = matrix[:, 1, 1] = np.cos(angle)
        matrix[:, 1, 0] = np.sin(angle)
        matrix[:, 0, 1] = -matrix[:, 1, 0]
        return matrix


@pytest.mark.parametrize("turns", [10, pytest.param(1000, marks=pytest.mark.slow)])
def test_fast_spins_are_as_exact_as_stated(turns):
    """Ten turns to a millionth, and a thousand to a hundred-thousandth."""
    spin, times = Spins(turns), np.random.default_rng(3).random(2000)
    motions = Motions.of([spin.at_times], 0, 1, np.ones(1), spin.keys, ["spin"])
    off = np.abs(motions.at(np.zeros(2000, np.intp), times).T.reshape(-1, 3, 4) @ spin.at_times(times))
    off = np.abs(off - np.eye(4)[:3]).max()
    assert 0.1 * motions.error[0] < off < motions.error[0] * 1.1
    assert motions.error[0] < (1e-6 if turns == 10 else 1.1e-5)


def test_what_is_too_fast_for_a_table_is_named(monkeypatch):
    """With the error of its places, and what is tolerated; one of two that share the table."""
    monkeypatch.setattr("wavefront.motion.steps.MOST_STEPS", 64)
    spin, text = (
        Spins(10),
        r"wheel: moves too fast .* 64 steps: places are off by up to 0.0[0-9]+ .* 0.00024 is",
    )
    with pytest.warns(UserWarning, match=text):
        Motions.of([Spins(0.1).at_times, spin.at_times], 0, 1, np.ones(2), spin.keys, ["hand", "wheel"])
    ball = wf.Box((0, 0, 0), 1, name="wheel").transformed(spin)
    with pytest.warns(UserWarning, match=text):
        render(wf.Scene([BAR, ball], [wf.Environment(1)], LOOK), 1, shutter=(0, 1))


def test_few_of_many_motions_are_left_out():
    """They share the times of tests."""
    motions = [lambda times: np.tile(np.eye(4), (len(times), 1, 1)), WHEEL.at_times, TRIP.at_times]
    table = Motions.of(motions, 0, 1, np.ones(3), np.union1d(WHEEL.keys, TRIP.keys), "abc")
    times = np.random.default_rng(4).random(300)
    for number, motion in enumerate(motions):
        to_local = table.at(np.full(300, number), times).T.reshape(-1, 3, 4)
        assert np.abs(to_local @ motion(times) - np.eye(4)[:3]).max() < 8e-6


def test_keys_are_those_of_all_parts():
    assert Product(TRIP, WHEEL).keys.tolist() == np.union1d([0, *AWAY, 1], np.linspace(0, 1, 17)).tolist()
    mesh = wf.Mesh(np.zeros((3, 3, 3)) + np.eye(3), [(0, 1, 2)], times=[0, 0.7, 2])
    assert wf.Instance(mesh, TRIP).keys.tolist() == [0, *AWAY, 1, 0, 0.7, 2]
    assert wf.Sphere((0, 0, 0), 1).keys.size == 0
    assert Spin().keys.tolist() == [0, 1]


BAR = wf.Rectangle((-0.2, -0.9, 0), (0.4, 0, 0), (0, 1.8, 0), material=wf.Diffuse(0))
LOOK = wf.Camera.orthographic((0, 0, 3), (0, 0, 0), height=2.4, size=(12, 12))


def assert_blurred(scene, limit=0.02):
    """Test that a blurred picture is near the mean of many stills, and far from the first."""
    options = {"max_bounces": 1, "branches": 1, "reuse": False, "ground": False, "lighting": None}
    blurred = render(scene, 512, shutter=(0, 1), **options).rgb
    stills = [render(scene.at((k + 0.5) / 128), 8, seed=k, **options).rgb for k in range(128)]
    mean, start = np.mean(stills, 0), render(scene.at(0), 64, **options).rgb
    assert np.abs(blurred - mean).mean() < limit * mean.mean()
    assert np.abs(start - mean).mean() > 3 * limit * mean.mean()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wheel", "spin", "trip"])
def test_what_comes_back_is_blurred(name):
    """A wheel that turns four times is no wheel that stands still."""
    assert_blurred(wf.Scene([BAR.transformed(MOTIONS[name])], [wf.Environment(1)], LOOK))


@pytest.mark.slow
def test_a_camera_and_a_light_that_come_back_are_blurred():
    sky, lamp = [wf.Environment(1)], wf.PointLight((0.5, 0, 1), 3)
    assert_blurred(wf.Scene([BAR], sky, LOOK.transformed(TRIP)))
    floor = wf.Rectangle((-2, -2, -0.5), (4, 0, 0), (0, 4, 0))
    assert_blurred(wf.Scene([floor, BAR], [lamp.transformed(TRIP)], LOOK))


class Trip(Deformation):
    """A bar that goes away and comes back, as a skin of a file may."""

    start, end, keys = 0.0, 1.0, np.array([0, *AWAY, 1])

    def at(self, time):
        return {"vertices": BAR.vertices + TRIP.at(time)[:3, 3]}


def test_a_skin_that_comes_back_goes_along_lines_between_its_keys():
    mesh = wf.Mesh(BAR.vertices, BAR.faces, material=wf.Diffuse(0))
    mesh.deformation = Trip()
    (mover,) = exposed_scene(wf.Scene([mesh]), Shutter(0, 1)).movers.values()
    assert set(AWAY) <= set(mover.keys.tolist())


def test_a_lamp_that_is_flattened_for_a_while_is_a_mesh_that_deforms():
    flat = np.diag([1, 0.3, 1, 1])
    keys = wf.Keyframes([0, *AWAY, 1], [np.eye(4), np.eye(4), flat, flat, np.eye(4), np.eye(4)])
    lamp = wf.Instance(wf.Mesh(BAR.vertices, BAR.faces, emission=1), np.eye(4)).transformed(keys)
    (mover,) = exposed_scene(wf.Scene([lamp]), Shutter(0, 1)).movers.values()
    assert mover.mesh is not None
    assert set(AWAY) <= set(mover.keys.tolist())
    point = wf.PointLight((0, 1, 0), 1).transformed(keys)
    with pytest.raises(wf.SceneError, match="PointLight: its motion stretches by"):
        render(wf.Scene([BAR], [point]), 1, shutter=(0, 1))

"""Keys and shutters that begin and end at any times, and what pictures keep of motion beside light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import STEP, Track, Trs
from significance import render

import wavefront as wf

OPTIONS: dict[str, Any] = {"ground": False, "lighting": None, "branches": 1, "reuse": False}


def shifted(*shift: float) -> np.ndarray:
    """A shift as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, 3] = shift
    return matrix


BAR = wf.Rectangle((-1, -99, 0), (2, 0, 0), (0, 198, 0), two_sided=True)
ABOVE = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=1, size=8)  # the bar covers it
TURNS = Track(np.zeros(1), np.array([[0.0, 0, 0, 1]]), turns=True)
ONES = Track(np.zeros(1), np.ones((1, 3)))


def steps(*times: float) -> Trs:
    """A motion that jumps away at each odd time, and back at each even one."""
    places = [(5.0 * (number % 2), 0, 0) for number in range(len(times))]
    return Trs(Track(np.array(times), np.array(places), STEP), TURNS, ONES)


class Away(wf.Motion):
    """A motion of one's own, which tells no keys: away in the second half of the time."""

    start, end = 0.0, 1.0

    def at_times(self, times: np.ndarray) -> np.ndarray:
        return np.stack([shifted(5.0 * (time > 0.5), 0, 0) for time in times])


FAST = wf.Keyframes([0, 1], [shifted(-1000, 0, 0), shifted(1000, 0, 0)])
TOWARDS = wf.Keyframes([0, 1], [shifted(0, 0, 0), shifted(0, 0, 20)])  # through the camera's plane at 1/4
LATE = wf.Keyframes([0.4, 0.6], [shifted(0, 0, 0), shifted(100, 0, 0)])  # gone after a fiftieth of that
# a motion, when the shutter is open, and the part of the time for which the bar is seen
MOTIONS: dict[str, tuple[wf.Motion, tuple[float, float], float]] = {
    "one key": (wf.Keyframes([0.5], [shifted(0.3, 0, 0)]), (0, 1), 1),
    "before all keys": (wf.Keyframes([2, 3], [shifted(5, 0, 0), shifted(0, 0, 0)]), (0, 1), 0),
    "after all keys": (wf.Keyframes([2, 3], [shifted(5, 0, 0), shifted(0, 0, 0)]), (4, 5), 1),
    "longer than the keys": (LATE, (-1, 2), (1.4 + 0.2 / 100) / 3),
    "shorter than the keys": (
        wf.Keyframes([0, 10], [shifted(-50, 0, 0), shifted(50, 0, 0)]),
        (4.5, 5.5),
        0.2,
    ),
    "beside the keys": (wf.Keyframes([0, 10], [shifted(-50, 0, 0), shifted(50, 0, 0)]), (7, 7.5), 0),
    "at the end of the keys": (wf.Keyframes([0, 1], [shifted(0, 0, 0), shifted(100, 0, 0)]), (1, 2), 0),
    "steps": (steps(0, 0.25, 0.6), (0, 1), 0.65),
    "a step within a short time": (steps(0, 1000.5), (1000, 1001), 0.5),
    "one's own": (Away(), (0, 1), 0.5),
    "fast": (FAST, (0, 1), 1e-3),
    "through the camera": (TOWARDS, (0, 1), 0.25),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_the_bar_is_seen_for_its_part_of_the_time(name: str) -> None:
    motion, shutter, part = MOTIONS[name]
    scene = wf.Scene([BAR.transformed(motion)], wf.Environment(1), ABOVE)
    samples = 1024
    alpha = render(scene, samples, shutter=shutter, aovs="alpha", **OPTIONS).layers["alpha"].astype(float)
    wide = 1.2 / 1000 if name == "fast" else 5e-3  # the edge crosses the picture for a moment
    assert abs(alpha.mean() - part) < 2 / samples / 8 + (wide if 0 < part < 1 else 0)


def test_a_file_that_steps_is_blurred_between_its_places(tmp_path: Path) -> None:
    """Of glTF: a node that is at one place for a third of the time."""
    build = Builder()
    build.mesh({"POSITION": 40 * np.float32(TRIANGLE) - np.float32([10, 10, 0])})
    build.json["nodes"][0].update({"mesh": 0})
    keys = {"input": build.accessor(np.float32([0, 0.75])), "interpolation": "STEP"}
    places = build.accessor(np.float32([(0, 0, 0), (90, 0, 0)]))
    build.json["animations"] = [
        {
            "samplers": [{**keys, "output": places}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        }
    ]
    scene = wf.load(build.gltf(tmp_path / "step.gltf")).add(wf.Environment(1))
    for shutter, part in (((0, 1), 0.75), ((0.7, 0.8), 0.5), ((0, 0.5), 1), ((0.8, 2), 0)):
        image = render(scene, 256, camera=ABOVE, shutter=shutter, aovs="alpha", **OPTIONS)
        assert abs(image.layers["alpha"].mean() - part) < 5e-3


# --- What pictures hold beside light -----------------------------------------------------------------

TIMES = [0, 0.4999, 0.5, 0.5001, 1]
TURNED = np.array([[0, 0, 1, 0.4], [0, 1, 0, 0.1], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
HELD = wf.Keyframes(TIMES, [np.eye(4) if time == 0.5 else TURNED for time in TIMES])
VIEW = wf.Camera.look_at((0, 1, 5), (0, 0, 0), fov=35, size=16)
FLOOR = wf.Rectangle((-3, -0.8, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))
THING = wf.Box((0, 0, 0), (1, 1.2, 0.5), material=wf.Diffuse((0.8, 0.3, 0.1)))
GLASS = wf.Sphere((0.5, 0.4, 1), 0.4, material=wf.Dielectric(1.5))
SAMPLED = ("alpha", "albedo", "denoising_albedo", "denoising_normal", "direct", "indirect", "coverage")
GEOMETRIC = ("depth", "position", "normal", "normal_geometric", "shape_id", "material_id")


@pytest.mark.parametrize("moves", ["thing", "camera"])
def test_layers_of_samples_are_of_their_times_and_the_others_of_the_middle(moves: str) -> None:
    thing = THING.transformed(HELD) if moves == "thing" else THING
    camera = VIEW.transformed(HELD) if moves == "camera" else VIEW
    scene = wf.Scene([FLOOR, thing, GLASS.transformed(HELD)], wf.PointLight((2, 4, 3), 40), camera)
    options = {**OPTIONS, "max_bounces": 3, "aovs": (*SAMPLED, *GEOMETRIC)}
    blurred = render(scene, 4, shutter=(0, 1), **options)
    held, middle = (render(scene.at(time), 4, **options) for time in (0.1, 0.5))
    for name, layer in blurred.layers.items():
        sampled = name.split(".")[0] in SAMPLED
        same, other = (held, middle) if sampled else (middle, held)
        off, far = (np.nanmean(np.abs(layer.astype(float) - image.layers[name])) for image in (same, other))
        size = np.nanmean(np.abs(layer)) + 1e-6
        assert off < 2e-3 * size, name
        assert far > 4 * off or name == "alpha" or name.startswith("coverage"), name


def test_groups_of_lights_that_move_are_told_apart() -> None:
    """Beside still ones, and each with the light of its place."""
    lamp = wf.Rectangle((-0.3, 1.5, -0.3), (0.6, 0, 0), (0, 0, 0.6))
    forms = np.stack([lamp.vertices + np.array([x, 0, 0]) for x in (-1.2, -1.2, 1.5, -1.2, -1.2)])

    def shining(group: str) -> wf.Material:
        return wf.Material(wf.Diffuse(0), emission=5, group=group)

    lamps = [
        wf.Mesh(lamp.vertices, lamp.faces, material=shining("still")),
        wf.Mesh(lamp.vertices, lamp.faces, material=shining("moved")).transformed(HELD),
        wf.Mesh(forms, lamp.faces, times=TIMES, material=shining("deformed")),
        wf.Sphere((1.2, 0.8, 0), 0.2, material=shining("ball")).transformed(HELD),
    ]
    point = wf.PointLight((0, 2, 2), 9, group="point").transformed(HELD)
    scene = wf.Scene([FLOOR, *lamps], point, VIEW)
    options = {**OPTIONS, "max_bounces": 1, "aovs": "light_groups"}
    blurred, held = render(scene, 128, shutter=(0, 1), **options), render(scene.at(0.1), 128, **options)
    for group in ("still", "moved", "deformed", "ball", "point"):
        found, due = (image.layers[f"light_groups.{group}"].astype(float) for image in (blurred, held))
        assert due.mean() > 0.005
        assert abs(found.mean() - due.mean()) < 0.06 * due.mean(), group  # three standard errors


def test_a_crop_is_a_part_of_the_blurred_picture() -> None:
    scene = wf.Scene([FLOOR, THING.transformed(HELD)], wf.Environment(1), VIEW.transformed(HELD))
    whole = render(scene, 4, shutter=(0, 1), **OPTIONS).rgb
    part = render(scene, 4, camera=scene.camera.cropped((3, 5, 13, 12)), shutter=(0, 1), **OPTIONS).rgb
    assert np.array_equal(part, whole[5:12, 3:13])

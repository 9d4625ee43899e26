"""Samples of lights that move, by χ² against the density of their time, which integrates to 1."""

from __future__ import annotations

import numpy as np
import pytest
from inside import CHARTS, Receiver, Report, Shutter, check_density, compile_scene, f4, make_accelerator

import wavefront as wf


def placed(shift, degrees, scale=1.0):
    """A turn about y of something, made larger, and then a shift."""
    turn, matrix = np.radians(degrees), np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(turn)
    matrix[0, 2], matrix[2, 0] = np.sin(turn), -np.sin(turn)
    matrix[:3, :3] *= scale
    matrix[:3, 3] = shift
    return matrix


TURN = wf.Keyframes([0, 1], [placed((0, 0, 0), 0), placed((1, 0.3, -0.5), 80)])
GROWS = wf.Keyframes([0, 1], [placed((0, 0, 0), 0), placed((1, -0.6, -0.5), 80, 1.6)])
FLATTENS = wf.Keyframes([0, 1], [np.eye(4), placed((1, 0.3, -0.5), 80) @ np.diag([1, 1, 0.4, 1])])
RAMP = wf.Texture(np.linspace(0, 4, 64).reshape(8, 8, 1) * np.ones(3), srgb=False)
CORNERS = np.array([(-0.4, 2, -0.4), (0.4, 2, -0.4), (0.4, 2, 0.4), (-0.4, 2.2, 0.4)])
FACES = [(0, 1, 2), (0, 2, 3)]
FORMS = np.stack([CORNERS, CORNERS * (1, 1, 1.5) + (0.3, 0, 0)])
MANY = wf.Box((0, 2, 0), 0.6)  # as a mesh of twelve triangles, each a light


def quad(**emission):
    return wf.Mesh(CORNERS, FACES, uvs=[(0, 0), (1, 0), (1, 1), (0, 1)], **emission)


def instance(**emission):
    return wf.Instance(quad(**emission), placed((0.2, 0.1, 0), 10)).transformed(TURN)


LIGHTS = {
    "rectangle": wf.Rectangle((-0.4, 2, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=3).transformed(TURN),
    "two-sided rectangle": wf.Rectangle(
        (-0.4, 2, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=3, two_sided=True
    ).transformed(TURN),
    "disk": wf.Disk((0, 2, 0), (0, -1, 0.2), 0.4, segments=8, emission=3).transformed(TURN),
    "triangles": quad(emission=3).transformed(TURN),
    "two-sided": quad(emission=3, two_sided=True).transformed(TURN),
    "textured": quad(emission=RAMP).transformed(TURN),
    "two-sided textured": quad(emission=RAMP, two_sided=True).transformed(TURN),
    "sphere": wf.Sphere((0, 2, 0), 0.3, emission=3).transformed(TURN),
    "textured sphere": wf.Sphere((0, 2, 0), 0.3, emission=RAMP).transformed(TURN),
    "box": wf.Mesh(MANY.vertices, MANY.faces, emission=3).transformed(TURN),
    "instance": instance(emission=3),
    "instance that grows": wf.Instance(quad(emission=3), np.eye(4)).transformed(GROWS),
    "sphere that grows": wf.Sphere((0, 2, 0), 0.3, emission=3).transformed(GROWS),
    "instance that flattens": wf.Instance(quad(emission=3), np.eye(4)).transformed(FLATTENS),
    "deforming": wf.Mesh(FORMS, FACES, times=[0, 1], emission=3),
    "deforming two-sided": wf.Mesh(FORMS, FACES, times=[0, 1], emission=3, two_sided=True),
    "deforming instance": wf.Instance(wf.Mesh(FORMS, FACES, times=[0, 1], emission=3), np.eye(4)).transformed(
        TURN
    ),
    "several": None,
}
PIXELS = np.random.default_rng(2).random((6, 12, 3)) ** 4
SKIES = {
    "image": [wf.Environment(PIXELS, transform=TURN)],
    "sky": [wf.Sky.cie(12, (1, 1, 0.5), horizontal=1, direct_normal=2).transformed(TURN)],
    "sun": [wf.DirectionalLight((0.2, -1, 0.3), 2, angle=20).transformed(TURN)],
    "skies": [
        wf.Environment(PIXELS, transform=TURN, rows="poles", filter="nearest"),
        wf.Sky.cie(5, (1, 1, 0.5), horizontal=1, direct_normal=0.5),
    ],
}
SEVERAL = ("triangles", "sphere", "instance", "deforming")
PLACES = (
    ((0, 0, 0), (0, 1, 0)),
    ((2, 1.2, 1), (0.6, 0.8, 0)),
    ((-3, 3.5, -1), (0, -0.6, 0.8)),
)  # and normals


def compiled(name):
    """The scene of a light while the shutter is open from 0 to 1 s."""
    floor = wf.Rectangle((-5, -1, 5), (10, 0, 0), (0, 0, -10))
    if name in SKIES:
        scene = wf.Scene([floor, LIGHTS["rectangle"]], SKIES[name])
    else:
        shapes = [LIGHTS[name]] if name != "several" else [LIGHTS[each] for each in SEVERAL]
        scene = wf.Scene([floor, *shapes])
    make = lambda geometry: make_accelerator(geometry, "numpy")  # noqa: E731
    return compile_scene(scene, make, asked={"shutter": Shutter(0, 1)})


def check_at(scene, where, time, normal, samples, alpha):
    """Test the samples of all lights for a surface with a normal at a place and a time."""
    lights, rng = scene.lights, np.random.default_rng(round(1000 * time))
    place = (np.array(where, float) - scene.center).astype(f4)[:, None]

    def receiver(n):
        return Receiver(
            np.float32(normal)[:, None].repeat(n, 1), np.zeros(n, bool), time=np.full(n, float(time))
        )

    def draw(n):
        u = rng.random((3, n), f4)
        found, _ = lights.sample_li(place.repeat(n, 1), u[0], u[1:], receiver(n))
        return found.wi[:, found.pdf > 0]

    def density(w):
        n = w.shape[1]
        parts = [
            lights.pdf_li(np.full(n, light), place.repeat(n, 1), w, receiver(n))
            for light in range(len(lights))
        ]
        return np.sum(parts, 0)

    report = Report(f"lights at {time:g} s")
    points = np.concatenate([draw(1 << 16) for _ in range(samples >> 16)], 1)
    check_density(report, str(where), CHARTS["sphere"], draw(1 << 14), points, samples, density, alpha)
    report.raise_if_failed()


@pytest.mark.parametrize("name", ["sphere", "deforming"])
def test_samples_at_a_time_have_the_density_of_that_time(name):
    check_at(compiled(name), (0.4, 0.2, -0.3), 0.7, (0, 1, 0), 1 << 17, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LIGHTS, *SKIES])
def test_samples_have_the_densities_of_their_times(name):
    scene = compiled(name)
    for (where, normal), time in zip(PLACES, (0.0, 0.37, 1.0), strict=True):
        check_at(scene, where, time, normal, 1 << 19, 1e-5)

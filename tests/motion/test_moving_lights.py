"""Lights that move are, at a time, the lights that stand still then: samples, densities and radiance."""

import numpy as np
import pytest
from inside import Receiver, Shutter, compile_scene, make_accelerator

import wavefront as wf

N = 256


def placed(shift, degrees):
    turn, matrix = np.radians(degrees), np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(turn)
    matrix[0, 2], matrix[2, 0] = np.sin(turn), -np.sin(turn)
    matrix[:3, 3] = shift
    return matrix


TURN = wf.Keyframes([0, 1], [placed((0, 0, 0), 0), placed((1, 0.3, -0.5), 80)])
RAMP = wf.Texture(np.linspace(0, 4, 64).reshape(8, 8, 1) * np.ones(3), srgb=False)
CORNERS = [(-0.4, 2, -0.4), (0.4, 2, -0.4), (0.4, 2, 0.4), (-0.4, 2.2, 0.4)]
UVS = [(0, 0), (1, 0), (1, 1), (0, 1)]


def shape(**emission):
    return wf.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], uvs=UVS, **emission)


FORMS = np.stack([CORNERS, np.array(CORNERS) * (1, 1, 1.5) + (0.3, 0, 0)])
LIGHTS = {
    "point": wf.PointLight((0.3, 2, 0), 8).transformed(TURN),
    "spot": wf.SpotLight((0.3, 2, 0), 8, direction=(0.2, -1, 0.1)).transformed(TURN),
    "sun": wf.DirectionalLight((0.2, -1, 0.3), 2).transformed(TURN),
    "rectangle": wf.Rectangle((-0.4, 2, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=3).transformed(TURN),
    "triangles": shape(emission=3).transformed(TURN),
    "two-sided": shape(emission=3, two_sided=True).transformed(TURN),
    "textured": shape(emission=RAMP).transformed(TURN),
    "sphere": wf.Sphere((0, 2, 0), 0.3, emission=3).transformed(TURN),
    "deforming": wf.Mesh(FORMS, [(0, 1, 2), (0, 2, 3)], times=[0, 1], emission=3),
}


def table(light, shutter=None):
    floor = wf.Rectangle((-5, -1, 5), (10, 0, 0), (0, 0, -10))
    parts = ([floor, light], []) if isinstance(light, wf.Shape) else ([floor], [light])
    make = lambda geometry: make_accelerator(geometry, "numpy")  # noqa: E731
    return compile_scene(wf.Scene(*parts), make, asked={"shutter": shutter})


@pytest.mark.parametrize("name", LIGHTS)
def test_moving_light_at_a_time_is_the_still_one(name):
    light, rng = LIGHTS[name], np.random.default_rng(1)
    moving = table(light, Shutter(0, 1))
    normal = np.float32([[0], [1], [0]]).repeat(N, 1)
    opaque = np.ones(N, bool)
    choice, u = np.zeros(N, np.float32), rng.random((2, N)).astype(np.float32)
    places = rng.uniform(-1, 1, (3, N)) * [[2], [0.5], [2]]
    for time in (0.0, 0.37, 1.0):
        scenes, moments = (moving, table(light.at(time))), (np.full(N, time), None)
        rows, wi = [], None
        for scene, moment in zip(scenes, moments, strict=True):
            point = (places - scene.center[:, None]).astype(np.float32)
            receiver, lights = Receiver(normal, opaque, time=moment), scene.lights
            sample, number = lights.sample_li(point, choice, u, receiver)
            again = lights.pdf_li(number, point, sample.wi, receiver)
            if not lights.delta_of[0]:
                met = sample.pdf > 0
                np.testing.assert_allclose(again[met], sample.pdf[met], rtol=2e-3)
            wi = sample.wi if wi is None else wi  # those of the light that moves
            first = np.zeros(N, np.intp)
            density = lights.pdf_li(first, point, wi, receiver) / lights.pmf(first, point, receiver)
            rows.append([density, np.where(sample.pdf > 0, sample.radiance, 0)])
            if name != "sphere":  # whose cone is turned by the way, so that u leads elsewhere in it
                chance = lights.pmf(number, point, receiver)
                rows[-1] += [sample.wi, sample.distance, sample.pdf / chance]
        for one, other in zip(*rows, strict=True):
            np.testing.assert_allclose(one, other, rtol=3e-3, atol=3e-4)

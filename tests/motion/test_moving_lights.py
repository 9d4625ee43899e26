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


SPIN = wf.Keyframes([0, 1], [placed((0, 0, 0), 10), placed((1, 2, 3), 130)])  # its ways have no effect
PIXELS = np.random.default_rng(3).random((8, 16, 3)) ** 4
DOMES = {
    "image": lambda turn: wf.Environment(PIXELS, transform=turn),
    "backdrop": lambda turn: wf.Environment(PIXELS, transform=turn, backdrop=PIXELS[::-1]),
    "color": lambda turn: wf.Environment((1, 2, 3), transform=turn),
}


@pytest.mark.parametrize("name", DOMES)
def test_an_environment_turns_as_its_transform_does(name):
    make = DOMES[name]
    moving = make(SPIN)
    assert moving.moves
    assert moving.time_span == (0, 1)
    for time in (0, 0.4, 1):
        still, want = moving.at(time), make(SPIN.at(time)[:3, :3])
        assert not still.moves
        pictures = [wf.render([wf.Sphere((0, 0, 0), 1), sky], 2, size=(12, 8)) for sky in (still, want)]
        np.testing.assert_array_equal(pictures[0].rgb, pictures[1].rgb)
    carried = make(None).transformed(SPIN).at(0.4)
    np.testing.assert_array_equal(carried.radiance, moving.radiance)
    np.testing.assert_allclose(carried._transform, SPIN.at(0.4)[:3, :3], atol=1e-12)


def test_an_environment_at_a_time_draws_directions_by_its_density():
    """Chi-square over the texels, within which the density is constant."""
    count, turn = 1 << 17, SPIN.at(0.4)[:3, :3]
    sky = wf.Environment(PIXELS, transform=SPIN).at(0.4).record(np.zeros(3))
    u = np.random.default_rng(11).random((2, count)).astype(np.float32)
    x, y, z = turn.T @ sky.sample_li(np.zeros((3, count), np.float32), u).wi.astype(float)
    column = ((0.5 - np.arctan2(x, z) / (2 * np.pi)) % 1 * 16).astype(int)
    row = np.minimum(np.arccos(np.clip(y, -1, 1)) / np.pi * 8, 7).astype(int)
    drawn = np.bincount(16 * row + column, minlength=128)
    rows, columns = (each.ravel() for each in np.mgrid[:8, :16])
    polar, longitude = (rows + 0.5) * np.pi / 8, 2 * np.pi * (0.5 - (columns + 0.5) / 16)
    middle = np.sin(polar) * np.sin(longitude), np.cos(polar), np.sin(polar) * np.cos(longitude)
    solid = np.pi / 8 * (np.cos(rows * np.pi / 8) - np.cos((rows + 1) * np.pi / 8))
    density = sky.pdf_li(np.zeros((3, 128), np.float32), (turn @ middle).astype(np.float32))
    due = density.astype(float) * solid * count
    assert due.sum() == pytest.approx(count, rel=1e-5)
    statistic = ((drawn - due) ** 2 / due).sum()
    assert abs(statistic - 127) < 4 * np.sqrt(2 * 127)


def test_radiance_that_is_assigned_to_a_turning_environment_turns():
    moving, want = DOMES["image"](SPIN), wf.Environment(PIXELS[::-1], transform=SPIN.at(0.4)[:3, :3])
    moving.radiance = PIXELS[::-1]
    wi = np.eye(3, dtype=np.float32)
    found = moving.at(0.4).record(np.zeros(3)).le(wi)
    np.testing.assert_array_equal(found, want.record(np.zeros(3)).le(wi))


def test_a_sky_turns_with_its_sun():
    sky = wf.Sky.cie(12, (1, 1, 0.5), horizontal=100, direct_normal=700)
    turn, ways = SPIN.at(0.4)[:3, :3], np.random.default_rng(5).normal(size=(9, 3))
    still = sky.transformed(SPIN).at(0.4)
    np.testing.assert_allclose(still.sun, turn @ sky.sun, atol=1e-12)
    np.testing.assert_allclose(still.radiance(ways @ turn.T), sky.radiance(ways), rtol=1e-4)
    with pytest.raises(wf.SceneError, match="Sky transform must be a rotation"):
        sky.transformed(np.diag([1, 2, 1, 1]))


def test_an_environment_that_would_be_stretched_is_refused():
    stretched = wf.Keyframes([0, 1], [np.eye(4), np.diag([2, 1, 1, 1])])
    with pytest.raises(wf.SceneError, match="Environment transform must be a rotation"):
        wf.Environment(PIXELS, transform=stretched)

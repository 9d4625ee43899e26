"""Where a thing is held for nearly all of the time is where it is seen, wherever it is in between.

What moves is compiled as it is in that middle, so all that a surface knows must be of the time of its ray.
"""

import numpy as np
import pytest
import trimesh

import wavefront as wf

BALL = trimesh.creation.icosphere(1, 1.0)
TIMES = [0, 0.4999, 0.5, 0.5001, 1]
TURNED = np.array([[0, 0, 1, 0.4], [0, 1, 0, 0.1], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
MOVED = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.2], [0, 0, 1, 0], [0, 0, 0, 1.0]])
STRIPES = wf.Texture(np.random.default_rng(0).random((8, 16, 3)).astype(np.float32), srgb=False)
CAMERA = wf.Camera.look_at((0, 1, 5), (0, 0, 0), fov=35, size=(24, 24))
MATTE = wf.Diffuse(0.8)
FLAT = BALL.vertices * [1.4, 0.5, 1]


def held(matrix: np.ndarray) -> wf.Keyframes:
    """The motion of what is elsewhere for a moment alone."""
    return wf.Keyframes(TIMES, [np.eye(4) if time == 0.5 else matrix for time in TIMES])


SHAPES = {
    "smooth mesh": (
        wf.Mesh(BALL.vertices, BALL.faces, normals=BALL.vertices, material=MATTE).transformed(held(TURNED)),
        1e-3,
    ),
    "cylinder": (
        wf.Cylinders([(-0.5, -0.5, 0)], [(0.5, 0.5, 0.3)], 0.4, material=MATTE).transformed(held(TURNED)),
        1e-5,
    ),
    "textured sphere": (
        wf.Sphere((0, 0, 0), 0.8, material=wf.Diffuse(STRIPES)).transformed(held(MOVED)),
        1e-5,
    ),
    "textured sphere that is turned": (
        wf.Sphere((0, 0, 0), 0.8, material=wf.Diffuse(STRIPES)).transformed(held(TURNED)),
        1e-5,
    ),
    "textured sphere with a rotation": (
        wf.Sphere((0, 0, 0), 0.8, material=wf.Diffuse(STRIPES), transform=np.eye(3)).transformed(
            held(TURNED)
        ),
        1e-5,
    ),
    "smooth mesh that deforms": (
        wf.Mesh(
            np.stack([BALL.vertices if time == 0.5 else FLAT for time in TIMES]),
            BALL.faces,
            times=TIMES,
            smooth=True,
            material=MATTE,
        ),
        1e-2,  # the edge of its own shadow is that of the middle
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_it_is_seen_where_it_is_held(name: str) -> None:
    shape, limit = SHAPES[name]
    scene = wf.Scene([shape], [wf.PointLight((2, 4, 3), 40)], CAMERA)
    options = {"workers": 1, "progress": False, "accel": "numpy", "max_bounces": 1, "branches": 1}
    blurred = wf.render(scene, 4, shutter=(0, 1), **options).rgb
    still = wf.render(scene.at(0.1), 4, **options).rgb
    assert np.abs(blurred - still).mean() < limit * still.mean()


def test_caustics_are_seen_from_where_the_camera_is_held() -> None:
    """Paths from lights end at the camera of their time."""
    glass = wf.Sphere((0, 0.5, 0), 0.5, material=wf.Dielectric(1.5))
    floor = wf.Rectangle((-2, -0.2, 2), (4, 0, 0), (0, 0, -4), material=MATTE)
    camera = wf.Camera.look_at((0, 3, 4), (0, 0, 0), fov=35, size=(24, 24)).transformed(held(MOVED))
    scene = wf.Scene([glass, floor], [wf.PointLight((1, 4, 0), 40)], camera)
    options = {"workers": 1, "progress": False, "accel": "numpy", "max_bounces": 4, "caustics": True}
    blurred = wf.render(scene, 16, shutter=(0, 1), **options).rgb
    still = wf.render(scene.at(0.1), 16, **options).rgb
    plain = wf.render(scene.at(0.1), 16, **{**options, "caustics": False}).rgb
    assert np.abs(still - plain).mean() > 0.02 * still.mean()
    assert np.abs(blurred - still).mean() < 1e-3 * still.mean()


def test_textures_of_spheres_do_not_turn_with_them() -> None:
    """As in stills; the spheres go along lines between some places."""
    motion = wf.Keyframes([0, 0.5, 1], [np.eye(4), TURNED, np.diag([-1.0, 1, -1, 1])])
    halves = wf.Diffuse(wf.Texture(np.repeat([[0.05, 0.9]], 4, 0), filter="nearest"))
    ball = wf.Spheres([(0.5, 0, 0), (-0.5, 0.2, 0)], 0.5, material=halves).transformed(motion)
    scene = wf.Scene([ball], [wf.Environment(1)], CAMERA)
    options = {"workers": 1, "progress": False, "accel": "numpy", "max_bounces": 1, "branches": 1}
    blurred = wf.render(scene, 64, shutter=(0, 1), **options).rgb
    stills = [wf.render(scene.at(time), 4, **options).rgb for time in (np.arange(16) + 0.5) / 16]
    assert np.abs(blurred - np.mean(stills, 0)).mean() < 0.02 * blurred.mean()

"""Where a thing is held for nearly all of the time is where it is seen, wherever it is in between.

What moves is compiled as it is in that middle, so all that a surface knows must be of the time of its ray.
"""

from typing import Any

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
        1e-5,
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


# --- With all else -----------------------------------------------------------------------------------


STAYS = np.eye(3)


def placed(linear=STAYS, shift=(0, 0, 0)) -> np.ndarray:
    """A linear map (3, 3), and then a shift, as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, shift
    return matrix


def between(matrix: np.ndarray, middle: np.ndarray) -> wf.Keyframes:
    """The motion of what is held at one place, and in the middle of the time for a moment at another."""
    return wf.Keyframes(TIMES, [middle if time == 0.5 else matrix for time in TIMES])


def over_time(away: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Arrays at all times that are another one in the middle."""
    return np.stack([middle if time == 0.5 else away for time in TIMES])


RNG = np.random.default_rng(1)
QUARTER = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # about z
ABOUT_Y = np.array([[0.5, 0, np.sqrt(0.75)], [0, 1, 0], [-np.sqrt(0.75), 0, 0.5]])
MIRROR = np.diag([-1.0, 1, 1])
TILT = np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]) @ ABOUT_Y
STRETCH = np.array([*np.c_[np.diag([1.5, 0.6, 1]) @ TILT, (0.2, 0.1, 0)], (0, 0, 0, 1)])
GRAY = wf.Texture(RNG.random((8, 16, 1)).astype(np.float32), srgb=False, channel=0)
TILTS = np.stack([RNG.uniform(-0.5, 0.5, (8, 16)), RNG.uniform(-0.2, 0.2, (8, 16)), np.ones((8, 16))], -1)
TILTED = wf.NormalMap((TILTS / np.linalg.norm(TILTS, axis=-1, keepdims=True) + 1).astype(np.float32) / 2)
BUMPY = wf.BumpMap(GRAY, 0.3)
GLASS = wf.Dielectric(1.5)
CORNERS, FACES = 0.7 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.0)]), [(0, 1, 2), (0, 2, 3)]
UVS = [(0, 0), (1, 0), (1, 1), (0, 1)]
CUBE = wf.Box((0, 0, 0), 1.2)
GRID = np.linspace(-1, 1, 12)
Z, Y, X = np.meshgrid(GRID, GRID, GRID, indexing="ij")
RING = np.sqrt((np.sqrt(X**2 + Z**2) - 0.6) ** 2 + Y**2) - 0.25
FLOOR = wf.Rectangle((-3, -0.8, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))
LAMP = wf.PointLight((2, 4, 3), 40)


def quad(material, **more) -> wf.Mesh:
    return wf.Mesh(CORNERS, FACES, uvs=UVS, material=material, **more)


def cube(material, **more) -> wf.Mesh:
    return wf.Mesh(CUBE.vertices, CUBE.faces, material=material, **more)


def quad_over_time(linear, material, **more) -> wf.Mesh:
    return wf.Mesh(
        over_time(CORNERS @ linear.T, CORNERS), FACES, uvs=UVS, times=TIMES, material=material, **more
    )


def filled(bsdf, priority=None, **medium) -> wf.Material:
    return wf.Material(bsdf, interior=wf.Medium(**medium), priority=priority)


AMBER = filled(wf.NullSurface(), absorption=(0.2, 1, 3))
FOG = filled(wf.NullSurface(), scattering=2)
RED = wf.Diffuse((0.9, 0.2, 0.2))
CLOUD = RNG.uniform(-1, 1, (20, 3))
DRINK = [
    wf.Cylinders([(0, -0.6, 0)], [(0, 0.6, 0)], 0.7, material=filled(GLASS, 1, absorption=0.01)),
    wf.Cylinders([(0, -0.5, 0)], [(0, 0.2, 0)], 0.65, material=filled(wf.Dielectric(1.33), 2, absorption=1)),
]
HELD = held(placed(QUARTER, (0.3, 0.2, 0)))
OVER_TIME = quad_over_time(ABOUT_Y @ QUARTER, wf.Diffuse(STRIPES))
LEAVES = [
    wf.Instance(cube(MATTE), placed(np.eye(3) * 0.3, (k - 1, 0.2 * k, 0)), material=RED if k == 1 else None)
    for k in range(4)
]
THINGS: dict[str, list[wf.Shape]] = {
    "stretched": [cube(MATTE).transformed(held(STRETCH))],
    "moved within what moves": [cube(MATTE).transformed(HELD).transformed(held(TURNED))],
    "mirrored": [quad(wf.Diffuse(STRIPES)).transformed(between(placed(MIRROR @ ABOUT_Y), placed(MIRROR)))],
    "mirrored map": [
        quad(wf.Material(MATTE, normal_map=TILTED)).transformed(
            between(placed(MIRROR @ QUARTER), placed(MIRROR))
        )
    ],
    "normal map": [quad(wf.Material(MATTE, normal_map=TILTED)).transformed(HELD)],
    "normal map on what deforms": [quad_over_time(QUARTER, wf.Material(MATTE, normal_map=TILTED))],
    "bumps that grow": [quad(wf.Material(MATTE, normal_map=BUMPY)).transformed(held(placed(0.6 * QUARTER)))],
    "bumps on what deforms": [quad_over_time(0.7 * QUARTER, wf.Material(MATTE, normal_map=BUMPY))],
    "brushed metal": [quad(wf.Conductor("gold", roughness=0.5, roughness_v=0.1)).transformed(HELD)],
    "brushed metal that deforms": [
        quad_over_time(QUARTER, wf.Conductor("gold", roughness=0.5, roughness_v=0.1))
    ],
    "texture on what deforms": [quad_over_time(0.7 * QUARTER, wf.Diffuse(STRIPES))],
    "cut-outs": [quad(wf.Material(MATTE, alpha=GRAY, alpha_cutoff=0.5)).transformed(HELD)],
    "cut-outs that deform": [quad_over_time(0.7 * QUARTER, wf.Material(MATTE, alpha=GRAY))],
    "shadow catcher": [
        wf.Rectangle((-2, -0.5, 2), (4, 0, 0), (0, 0, -4), material=wf.ShadowCatcher()).transformed(
            held(MOVED)
        ),
        cube(MATTE),
    ],
    "unseen": [cube(wf.Material(MATTE, visible_to_camera=False)).transformed(held(TURNED))],
    "glass": [cube(GLASS).transformed(held(TURNED))],
    "prism": [cube(wf.Dielectric((1.45, 1.5, 1.6))).transformed(held(TURNED))],
    "absorber that is alone in the middle of the time": [
        wf.Sphere((0, 0, 0), 0.6, material=AMBER).transformed(between(MOVED, placed(shift=(-1.5, 0, 0)))),
        wf.Sphere((0.4, 0.1, 0), 0.25, material=RED),
    ],
    "absorber that something comes into": [
        wf.Sphere((0, 0, 0), 0.8, material=AMBER),
        wf.Sphere((0, 0, 0), 0.25, material=RED).transformed(
            between(placed(shift=(0.1, 0.1, 0.1)), placed(shift=(2, 0, 0)))
        ),
    ],
    "fog": [wf.Sphere((0, 0, 0), 0.8, material=FOG).transformed(held(MOVED))],
    "fog that is stretched": [cube(FOG).transformed(held(STRETCH))],
    "glow that deforms": [
        wf.Mesh(
            over_time(0.6 * BALL.vertices + [0.5, 0, 0], BALL.vertices),
            BALL.faces,
            times=TIMES,
            material=filled(wf.NullSurface(), absorption=1, emission=(1, 2, 3)),
        )
    ],
    "a drink in a glass": [shape.transformed(HELD) for shape in DRINK],
    "inks that touch": [
        wf.Mesh(
            half.vertices, half.faces, material=filled(wf.NullSurface(), absorption=ink, scattering=0.1)
        ).transformed(held(TURNED))
        for half, ink in (
            (wf.Box((-0.3, 0, 0), 0.6), (0.2, 1, 3)),
            (wf.Box((0.3, 0, 0), 0.6), (3, 1, 0.2)),
        )
    ],
    "spheres": [wf.Spheres(CLOUD, 0.15, colors=(CLOUD + 1) / 2).transformed(held(TURNED))],
    "spheres over time": [wf.Spheres(over_time(CLOUD[:, ::-1], CLOUD), 0.15, times=TIMES)],
    "points over time": [wf.Points(over_time(CLOUD[:, ::-1], CLOUD), 0.15, times=TIMES).transformed(HELD)],
    "capsules": [wf.Capsules(CLOUD[:9], CLOUD[9:18], 0.1).transformed(HELD)],
    "cylinders that are mirrored": [
        wf.Cylinders(CLOUD[:9], CLOUD[9:18], 0.1).transformed(
            between(placed(MIRROR @ ABOUT_Y), placed(MIRROR))
        )
    ],
    "distance grid": [
        wf.SignedDistanceGrid(RING, ((-1, -1, -1), (1, 1, 1))).transformed(held(STRETCH @ TURNED))
    ],
    "height field": [wf.HeightField(np.sin(3 * X[0] * Y[0] + Y[0]), GRID, GRID).transformed(held(TURNED))],
    "instances some of which move": [
        leaf.transformed(held(TURNED)) if number < 2 else leaf for number, leaf in enumerate(LEAVES)
    ],
    "instances of what deforms": [
        *(wf.Instance(OVER_TIME, placed(np.eye(3) * 0.5, (k - 1, 0.1, 0))) for k in range(3)),
        wf.Instance(OVER_TIME, placed(np.eye(3) * 0.5, (0, 1, 0))).transformed(held(TURNED)),
    ],
}


def assert_held(scene: wf.Scene, limit: float = 1e-3, spp: int = 4, **options) -> None:
    """Test a blurred picture against the still one of where things are held, with the same numbers."""
    options = {"max_bounces": 5, "branches": 1, "reuse": False, "ground": False, "lighting": None, **options}
    options |= {"workers": 1, "progress": False, "accel": "numpy"}
    blurred = wf.render(scene, spp, shutter=(0, 1), **options).rgb
    still = wf.render(scene.at(0.1), spp, **options).rgb
    assert np.abs(blurred - still).mean() < limit * still.mean()


QUICK = {
    *("moved within what moves", "mirrored map", "normal map on what deforms", "bumps on what deforms"),
    *("brushed metal that deforms", "cut-outs that deform", "shadow catcher", "a drink in a glass"),
    *("absorber that is alone in the middle of the time", "absorber that something comes into"),
    *(
        "inks that touch",
        "spheres over time",
        "distance grid",
        "instances some of which move",
        "instances of what deforms",
    ),
}


def slow_but(quick: set[str], names: Any) -> list[Any]:
    """Mark all names as slow but some."""
    assert quick <= set(names)
    return [name if name in quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.mark.parametrize("name", slow_but(QUICK, THINGS))
def test_all_of_it_is_of_the_time_of_the_ray(name: str) -> None:
    assert_held(wf.Scene([FLOOR, *THINGS[name]], [LAMP], CAMERA.resized(16)), 2e-3)


def test_a_light_that_goes_into_an_absorber_is_weakened() -> None:
    lamp = wf.PointLight((0, 0, 0), 3).transformed(
        between(placed(shift=(0.1, 0.1, 0.1)), placed(shift=(2, 1, 1)))
    )
    assert_held(wf.Scene([FLOOR, wf.Sphere((0, 0, 0), 0.8, material=AMBER)], [lamp], CAMERA))


CAMERAS = {
    "pinhole": CAMERA,
    "lens": wf.Camera.look_at((0, 1, 5), (0, 0, 0), fov=35, size=(24, 24), aperture=0.3),
    "fisheye": wf.Camera.fisheye(
        [[9, 0, 12], [0, 9, 12], [0, 0, 1]], (0.01, 0, 0, 0), CAMERA.extrinsics(), size=(24, 24)
    ),
    "panorama": wf.Camera.panorama((0, 1, 2), (0, 0, 0), size=(24, 12)),
    "parallel": wf.Camera.orthographic((0, 1, 5), (0, 0, 0), height=4, size=(24, 24)),
    "cropped": CAMERA.cropped((3, 4, 20, 21)),
    "right eye": CAMERA.stereo(0.2)[1],
}


@pytest.mark.parametrize("name", slow_but({"lens", "fisheye"}, CAMERAS))
def test_cameras_are_where_they_are_held(name: str) -> None:
    """Beside what moves, too, and in fog that is around them, but not in the middle of the time."""
    ball = wf.Sphere(CAMERAS[name].origin, 0.5, material=FOG).transformed(
        between(MOVED, placed(shift=(0, 0, 2)))
    )
    scene = wf.Scene(
        [FLOOR, cube(MATTE).transformed(HELD), ball], [LAMP], CAMERAS[name].transformed(held(MOVED))
    )
    assert_held(scene, 3e-3, max_bounces=2)


CLEAR: dict[str, list[wf.Shape]] = {
    "ball": [wf.Sphere((0, 0.3, 0), 0.5, material=GLASS).transformed(held(MOVED))],
    "ball that grows": [
        wf.Sphere((0, 0.3, 0), 0.3, material=GLASS).transformed(held(placed(1.7 * STAYS, (0.3, 0, 0))))
    ],
    "balls over time": [
        wf.Spheres(
            over_time(np.array([(-0.5, 0.3, 0), (0.6, 0.4, 0.5)]), np.array([(0, 0.5, 0), (0.8, 0.5, 0)])),
            0.3,
            material=GLASS,
            times=TIMES,
        )
    ],
    "box beside a ball": [
        cube(GLASS).transformed(held(MOVED)),
        wf.Sphere((-1, 0.3, 0), 0.4, material=GLASS),
    ],
    "mirror that deforms": [quad_over_time(0.6 * ABOUT_Y @ QUARTER, wf.Mirror(), two_sided=True)],
}


@pytest.mark.parametrize("name", slow_but({"balls over time", "box beside a ball"}, CLEAR))
def test_paths_from_lights_begin_where_glass_is_held(name: str) -> None:
    scene, options = wf.Scene([FLOOR, *CLEAR[name]], [LAMP], CAMERA), {"caustics": True, "max_bounces": 4}
    assert_held(scene, **options)
    plain = wf.render(scene.at(0.1), 4, progress=False, workers=1, max_bounces=4).rgb
    lit = wf.render(scene.at(0.1), 4, progress=False, workers=1, **options).rgb
    assert lit.mean() > 1.02 * plain.mean()


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

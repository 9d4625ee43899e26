"""Black and white pictures explain themselves: each likely cause, and no word where there is none."""

import warnings

import numpy as np
import pytest

import wavefront as wf

SIZE = (16, 16)
BALL = wf.Sphere((0, 0, 0), 1, name="ball")
FRONT = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=SIZE)
SHELL = wf.Sphere((0, 0, 5), 0.5, name="shell")  # around the camera
EMITTER = wf.Sphere((3, 3, 3), 0.5, emission=20.0, name="light")
PANEL = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2))  # faces down
FLOOR = wf.Rectangle((-3, -1, 3), (6, 0, 0), (0, 0, -6), name="floor")
BULB = wf.Sphere((0, 0.5, 0), 0.5, material=wf.Dielectric(1.5), name="bulb")
BESIDE = wf.Camera.look_at((0, 2, 5), (0, -1, 1.5), fov=10, size=SIZE)  # sees the floor alone
DARK = [wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0))]
BRIGHT = [wf.PointLight((0, 0, 5), 50)]


def render(shapes, lights=(), camera=FRONT, spp: int = 4, **options) -> wf.Image:
    scene = wf.Scene(shapes, lights, camera)
    return wf.render(scene, spp, progress=False, workers=1, **options)


def upside_down(mesh: wf.Mesh) -> wf.Mesh:
    return wf.Mesh(mesh.vertices, mesh.faces[:, ::-1], emission=5.0, name="panel")


BLACK = {
    "no light": (
        [BALL],
        [],
        {"lighting": None},
        "nothing in the scene emits light; lighting='studio' lights it",
    ),
    "looks away": (
        [BALL, EMITTER],
        [],
        {"camera": wf.Camera.look_at((0, 0, 5), (0, 0, 9), size=SIZE)},
        "the camera sees no shape; the middle of the scene is behind it: look the other way",
    ),
    "looks past": (
        [BALL, EMITTER],
        [],
        {"camera": wf.Camera.look_at((0, 0, 5), (-9, 0, 0), size=SIZE)},
        "the camera sees no shape; it looks past the scene",
    ),
    "light faces away": (
        [BALL, FLOOR, upside_down(PANEL)],
        [],
        {},
        "the lights point away from all that the camera sees; reverse their faces, or .* two_sided=True",
    ),
    "cone misses": (
        [BALL],
        [wf.SpotLight((0, 3, 3), 100, target=(0, 9, 3), angle=30)],
        {},
        "the lights point away from all that the camera sees; direct the SpotLight, or widen its cone",
    ),
    "other side": (
        [wf.Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0))],
        [wf.DirectionalLight((0, 0, 1), 3)],
        {},
        "the camera sees only the sides of surfaces that are turned away from the lights",
    ),
    "camera inside": ([BALL, SHELL, EMITTER], [], {}, "the camera is inside 'shell', where no light gets in"),
    "camera inside, light around": (
        [BALL, SHELL],
        [wf.Environment(1)],
        {},
        "the camera is inside 'shell', where no light gets in",
    ),
    "shadow": (
        [FLOOR, wf.Rectangle((-20, 0, 20), (40, 0, 0), (0, 0, -40), name="roof")],
        [wf.DirectionalLight((0, -1, 0), 3)],
        {"camera": wf.Camera.look_at((0, -0.5, 2), (0, -1, 0), fov=20, size=SIZE)},
        "all that the camera sees is in the shadow of 'roof'",
    ),
    "point light in glass": (
        [FLOOR, BULB],
        [wf.PointLight((0, 0.5, 0), 10)],
        {"camera": BESIDE},
        "'bulb' lets light through, but bends it, .* a light without size there; caustics=True",
    ),
    "light in glass, direct light": (
        [FLOOR, BULB, wf.Sphere((0, 0.5, 0), 0.1, emission=9.0)],
        [],
        {"camera": BESIDE, "integrator": "direct_simple"},
        "light comes through 'bulb' alone, which integrator='direct_simple' does not follow; .*'full' does",
    ),
    "no bounces": (
        [BALL],
        [wf.PointLight((0, 0, 5), 50)],
        {"max_bounces": 0},
        "max_bounces=0 shows lights alone",
    ),
    "black materials": (DARK, BRIGHT, {}, "the materials of all that the camera sees reflect nothing"),
}


@pytest.mark.parametrize("cause", BLACK)
def test_a_black_picture_names_its_cause(cause: str) -> None:
    shapes, lights, options, message = BLACK[cause]
    with pytest.warns(UserWarning, match=f"the picture is black: {message}"):
        image = render(shapes, lights, **options)
    assert not image.rgb.any()


@pytest.mark.parametrize("radiance", [1e-12, 1e-5, 3e-4])
def test_a_dark_picture_names_the_exposure(radiance: float) -> None:
    with pytest.warns(UserWarning, match="the picture is almost black: its brightest pixel is") as caught:
        image = render([BALL], [wf.Environment(radiance)])
    (warning,) = caught
    stops = int(str(warning.message).partition("exposure=")[2].partition(")")[0])
    assert 0.5 <= radiance * 2.0**stops <= 1
    assert image.rgb.max() > 0


WHITE = {
    "bright lights": (
        [wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))],
        [wf.PointLight((0, 0, 3), 1000)],
        "its darkest pixel is .*, and 1 is white",
    ),
    "inside a light": (
        [BALL, wf.Sphere((0, 0, 5), 0.5, emission=4.0, name="sun")],
        [],
        "the camera sees nothing but 'sun', which emits light; save.*exposure=-3. shows",
    ),
    "looks past": (
        [wf.Sphere((0, 0, 9), 1)],
        [wf.Environment(3)],
        "the camera sees no shape, only light from all around that is above 1",
    ),
}


@pytest.mark.parametrize("cause", WHITE)
def test_a_white_picture_names_its_cause(cause: str) -> None:
    shapes, lights, message = WHITE[cause]
    with pytest.warns(UserWarning, match=f"the picture is white: {message}"):
        image = render(shapes, lights)
    assert image.rgb.min() > 1


QUIET = {
    "in order": ([BALL, EMITTER], [], {}),
    "even light": ([BALL], [wf.Environment(1)], {}),
    "lights that are off": ([BALL], [wf.PointLight((0, 0, 5), 0)], {}),
    "a dark light": ([wf.Sphere((0, 0, 0), 1, emission=0.0)], [], {}),
    "darkness around": ([BALL], [wf.Environment(0)], {}),
    "one bright spot": ([BALL, wf.Sphere((0, 0, 2), 0.3, emission=1.0, material=wf.Diffuse(0))], [], {}),
    "one lit pixel": ([wf.Sphere((0, 0, -50), 0.5, emission=1.0)], [], {}),
    "too small to look at": ([BALL], [], {"lighting": None, "camera": FRONT.resized((15, 16))}),
}


@pytest.mark.parametrize("scene", QUIET)
def test_other_pictures_give_no_warning(scene: str) -> None:
    shapes, lights, options = QUIET[scene]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        render(shapes, lights, **options)


def test_shapes_of_instances_are_no_obstacle() -> None:
    """They are traced in frames of their own; the cause is still found."""
    mesh = upside_down(PANEL)
    tile = wf.Rectangle((-1, -1, 1), (2, 0, 0), (0, 1, -2))
    places = [np.eye(4) for _ in range(3)]
    for number, place in enumerate(places):
        place[0, 3] = 2.0 * number - 2
    with pytest.warns(UserWarning, match="the lights point away"):
        render([*(wf.Instance(tile, place) for place in places), mesh], accel="numpy")

"""Cameras: which pixel sees which direction."""

import numpy as np
import pytest
import strategies
from hypothesis import given
from hypothesis import strategies as st
from inside import f4
from significance import render

import wavefront as wf

ORIGIN = np.zeros(3)


def ray(camera: wf.Camera, x: float, y: float) -> np.ndarray:
    """The direction through one film point."""
    _, direction = camera.rays(np.array([x], f4), np.array([y], f4), ORIGIN)
    return direction[:, 0]


def test_the_middle_sees_the_target() -> None:
    """Along -z by default orientation: +x is right, +y is up."""
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=90, size=(40, 20))
    assert ray(camera, 20, 10) == pytest.approx([0, 0, -1])
    s = np.sqrt(0.5)
    assert ray(camera, 20, 0) == pytest.approx([0, s, -s], abs=1e-6)  # row 0 is the top
    assert ray(camera, 20, 20) == pytest.approx([0, -s, -s], abs=1e-6)
    assert ray(camera, 30, 10) == pytest.approx([s, 0, -s], abs=1e-6)  # columns run to the right
    assert ray(camera, 10, 10) == pytest.approx([-s, 0, -s], abs=1e-6)


def test_fov_is_vertical() -> None:
    """Widening the picture shows more at the sides; pixels stay square."""
    for width in (10, 40, 90):
        camera = wf.Camera.look_at((0, 0, 1), (0, 0, 0), fov=60, size=(width, 30))
        top = ray(camera, width / 2, 0)
        assert np.degrees(np.arctan2(top[1], -top[2])) == pytest.approx(30, abs=1e-4)
        right = ray(camera, width, 15)
        assert right[0] / -right[2] == pytest.approx(np.tan(np.radians(30)) * width / 30, rel=1e-5)


@pytest.mark.filterwarnings("ignore:Camera fov")
@given(strategies.rotations(), st.floats(1, 170), st.data())
def test_look_at_turns_with_the_world(turn: np.ndarray, fov: float, data) -> None:
    """Turning origin, target and up turns every ray; the axes stay right-handed."""
    x, y = data.draw(st.floats(0, 64, width=32)), data.draw(st.floats(0, 48, width=32))
    plain = wf.Camera.look_at((1, 2, 3), (0, 1, -1), (0, 1, 0), fov=fov, size=(64, 48))
    turned = wf.Camera.look_at(turn @ (1, 2, 3), turn @ (0, 1, -1), turn @ (0, 1, 0), fov=fov, size=(64, 48))
    assert ray(turned, x, y) == pytest.approx(turn @ ray(plain, x, y), abs=2e-6)
    right, up, backward = turned.rotation.T
    assert np.cross(right, up) == pytest.approx(backward, abs=1e-12)


def test_origins_are_relative_to_the_center() -> None:
    """Subtracted in float64, so nothing is lost far away."""
    camera = wf.Camera.look_at((1e8 + 0.5, 0, 0), (1e8, 0, 0))
    origin, _ = camera.rays(np.zeros(2, f4), np.zeros(2, f4), np.array([1e8, 0, 0]))
    assert origin.T.tolist() == [[0.5, 0, 0]] * 2


def test_every_pixel_sees_its_own_place() -> None:
    colors = {(-1, 0): (1, 0, 0), (0, 0): (0, 1, 0), (-1, -1): (0, 0, 1), (0, -1): (1, 1, 0)}
    quarters = [
        wf.Rectangle((x, y, 0), (1, 0, 0), (0, 1, 0), material=wf.Diffuse(0), emission=c)
        for (x, y), c in colors.items()
    ]
    camera = wf.Camera.look_at((0, 0, 1), (0, 0, 0), fov=60, size=(4, 4))
    rgb = render(wf.Scene(quarters, camera=camera), 1, max_bounces=0).rgb
    assert rgb[0, 0].tolist() == [1, 0, 0]  # top left: x < 0, y > 0
    assert rgb[0, 3].tolist() == [0, 1, 0]
    assert rgb[3, 0].tolist() == [0, 0, 1]
    assert rgb[3, 3].tolist() == [1, 1, 0]


def test_resized_keeps_the_view() -> None:
    camera = wf.Camera.look_at((0, 0, 1), (0, 0, 0), fov=33, size=(4, 4)).resized((7, 5))
    assert (camera.size, camera.fov) == ((7, 5), 33)


BAD = {
    "origin is target": (
        {"target": (1, 2, 3)},
        r"origin and target are both \[1.0, 2.0, 3.0\]; they must differ",
    ),
    "up along the view": ({"target": (1, 5, 3)}, r"up \[0.0, 1.0, 0.0\] must not be zero or parallel"),
    "up zero": ({"up": (0, 0, 0)}, r"up \[0.0, 0.0, 0.0\] must not be zero"),
    "origin short": ({"origin": (1, 2)}, r"Camera origin must have shape \(3,\), got \(2,\)"),
    "origin NaN": ({"origin": (1, np.nan, 3)}, r"Camera origin\[1\] is nan; it must be finite"),
    "target infinite": ({"target": (1, 2, np.inf)}, r"Camera target\[2\] is inf; it must be finite"),
    "up text": ({"up": "sideways"}, r"Camera up is \'sideways\'; it must be a vector, or one of x, y, z"),
    "fov 0": ({"fov": 0}, r"Camera fov is 0; it must be above 0 and below 180"),
    "fov 180": ({"fov": 180}, r"Camera fov is 180; it must be above 0 and below 180"),
    "fov NaN": ({"fov": np.nan}, r"Camera fov is nan"),
    "fov text": ({"fov": "wide"}, r"Camera fov must be a number, got 'wide'"),
    "size 0": ({"size": (0, 5)}, r"size is \(0, 5\); both must be whole numbers from 1 to 65536"),
    "size negative": ({"size": (5, -1)}, r"size is \(5, -1\); both must be"),
    "size too large": ({"size": (5, 65537)}, r"size is \(5, 65537\); both must be"),
    "size fraction": ({"size": (5, 1.5)}, r"size is \(5, 1.5\); both must be"),
    "size a text": ({"size": "640x480"}, r"size must be \(width, height\) or one number for both, got '640"),
    "size three numbers": ({"size": (5, 5, 3)}, r"size must be \(width, height\)"),
    "size text": ({"size": "5x"}, r"size is '5x'; both must be"),
    "size NaN": ({"size": (np.nan, 5)}, r"size must be \(width, height\)"),
    "size infinite": (
        {"size": (np.inf, 5)},
        r"size must be \(width, height\) or one number for both, got \(inf, 5\)",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    change, message = BAD[name]
    arguments = {"origin": (1, 2, 3), "target": (0, 0, 0), **change}
    with pytest.raises(wf.SceneError, match=message):
        wf.Camera.look_at(**arguments)


@pytest.mark.parametrize("fov", [np.pi / 4, 0.8, 1.2345, 3.1])
def test_radians_are_noticed(fov: float) -> None:
    """They look like a narrow field of view; the warning says what they are in degrees."""
    for make in (
        lambda: wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=fov),
        lambda: wf.Camera.from_matrix(np.eye(4), fov),
        lambda: wf.Scene(wf.Sphere((0, 0, 0), 1)).framing_camera(fov),
    ):
        with pytest.warns(UserWarning, match=rf"Camera fov is {fov:.4g} degrees.* {np.degrees(fov):.4g}"):
            assert make().fov == fov


@pytest.mark.parametrize("fov", [1, 2.0, 3.5, 0.1, 40])
def test_degrees_are_taken_as_they_are(fov: float) -> None:
    """Small ones as telescopes have them, too."""
    assert wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=fov).fov == fov


def test_the_fourth_argument_is_the_field_of_view() -> None:
    assert wf.Camera.look_at((0, 0, 5), (0, 0, 0), "y", 30).fov == 30
    with pytest.raises(wf.SceneError, match=r"Camera up is 30; .* A field of view is given by name: fov=40"):
        wf.Camera.look_at((0, 0, 5), (0, 0, 0), 30)


def test_up_may_name_an_axis() -> None:
    named, given = (wf.Camera.look_at((3, 2, 1), (0, 0, 0), up) for up in ("z", (0, 0, 1)))
    assert named.rotation.tobytes() == given.rotation.tobytes()

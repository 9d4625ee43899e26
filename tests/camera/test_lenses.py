"""Lenses and conventions: where points of the world land in the picture."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import Orthographic, Panorama, Perspective, compile_scene, f4, generate, length, make_sampler

import wavefront as wf

ORIGIN = np.zeros(3)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # an exact rotation
K = np.array([[700.0, 0, 330], [0, 650, 250], [0, 0, 1]])


def rays(camera: wf.Camera, x, y, lens=None) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (n, 3) through film points."""
    x, y = np.broadcast_arrays(np.asarray(x, f4).ravel(), np.asarray(y, f4).ravel())
    origin, direction = camera.rays(x, y, ORIGIN, None if lens is None else np.asarray(lens, f4))
    return origin.T.astype(float), direction.T.astype(float)


def ray(camera: wf.Camera, x: float, y: float) -> np.ndarray:
    """The direction through one film point."""
    return rays(camera, x, y)[1][0]


def test_centred_intrinsics_are_a_plain_camera() -> None:
    """fx = fy, the principal point in the middle, and y down: the same picture as look_at."""
    f = 120 / np.tan(np.radians(25))
    k = [[f, 0, 159.5], [0, f, 119.5], [0, 0, 1]]
    camera = wf.Camera.from_intrinsics(k, np.diag([1, -1, -1]), (0, 0, 4), (320, 240))
    plain = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=50, size=(320, 240))
    assert camera.origin == pytest.approx(plain.origin)
    assert camera.rotation == pytest.approx(plain.rotation)
    assert camera.fov == pytest.approx(50)
    for at in ((0, 0), (320, 0), (17, 201)):
        assert ray(camera, *at) == pytest.approx(ray(plain, *at), abs=1e-6)


def test_resized_intrinsics_see_the_same() -> None:
    """Twice the pixels: what was seen at (x, y) is seen at (2x, 2y)."""
    camera = wf.Camera.from_intrinsics(K, TURN, (1, 2, 3), (640, 480))
    double = camera.resized((1280, 960))
    for x, y in ((0, 0), (640, 480), (100.5, 33)):
        assert ray(double, 2 * x, 2 * y) == pytest.approx(ray(camera, x, y), abs=1e-6)


@pytest.mark.parametrize("rows", [3, 4])
@pytest.mark.parametrize(("convention", "flip"), [("opengl", (1, 1, 1)), ("opencv", (1, -1, -1))])
def test_from_matrix(rows: int, convention: str, flip: tuple) -> None:
    """Columns are right, up, backward (OpenGL) or right, down, forward (OpenCV), and the position."""
    plain = wf.Camera.look_at((1, 2, 3), (-1, 0, 7), (0.2, 1, 0), fov=33, size=(30, 20))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = plain.rotation * flip, plain.origin
    camera = wf.Camera.from_matrix(matrix[:rows], fov=33, size=(30, 20), convention=convention)
    for at in ((0, 0), (30, 7), (15, 10)):
        for ours, theirs in zip(rays(camera, *at), rays(plain, *at), strict=True):
            assert ours == pytest.approx(theirs, abs=1e-6)


def test_rounded_matrices_are_rotations() -> None:
    """Five digits are enough: the nearest rotation is taken."""
    camera = wf.Camera.from_matrix(np.vstack([np.c_[np.round(TURN, 5) + 2e-6, ORIGIN], [0, 0, 0, 1]]))
    assert camera.rotation.T @ camera.rotation == pytest.approx(np.eye(3), abs=1e-14)
    assert camera.rotation == pytest.approx(TURN, abs=1e-5)


def test_shift_moves_the_view_without_turning_it() -> None:
    """By a quarter of the width to the right, and half of the height up."""
    plain = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=50, size=(40, 20))
    moved = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=50, size=(40, 20), shift=(0.25, 0.5))
    assert ray(moved, 10, 20) == pytest.approx([0, 0, -1], abs=1e-7)
    assert ray(moved, 3, 4) == pytest.approx(ray(plain, 13, -6), abs=1e-6)


def test_orthographic_rays_are_parallel() -> None:
    camera = wf.Camera.orthographic((1, 2, 3), (1, 2, -7), height=3, size=(40, 20))
    origin, direction = rays(camera, [0, 40, 20], [0, 20, 10])
    assert origin == pytest.approx(np.array([[-2, 3.5, 3], [4, 0.5, 3], [1, 2, 3]]))
    assert direction == pytest.approx(np.array([[0, 0, -1.0]] * 3))
    assert isinstance(camera.projection, Orthographic)


def test_orthographic_size_does_not_depend_on_depth() -> None:
    """Two equal squares, one far behind the other, cover equal parts of the picture."""
    squares = [
        wf.Rectangle((x, -0.5, z), (1, 0, 0), (0, 1, 0), material=wf.Diffuse(0), emission=1.0)
        for x, z in ((-1.5, 0), (0.5, -50))
    ]
    camera = wf.Camera.orthographic((0, 0, 1), (0, 0, 0), height=4, size=(16, 16))
    rgb = wf.render(wf.Scene(squares, camera=camera), 1, max_bounces=0, progress=False).rgb[..., 0]
    expected = np.zeros((16, 16))
    expected[6:10, 2:6] = expected[6:10, 10:14] = 1
    assert rgb.tolist() == expected.tolist()


def test_panorama_directions() -> None:
    """The middle looks ahead, the right half sees what is to the right, the top row is up."""
    camera = wf.Camera.panorama((0, 0, 0), (0, 0, -1), size=(8, 4))
    for at, expected in {
        (4, 2): (0, 0, -1),
        (6, 2): (1, 0, 0),
        (2, 2): (-1, 0, 0),
        (0, 2): (0, 0, 1),
        (8, 2): (0, 0, 1),
        (3, 0): (0, 1, 0),
        (5, 4): (0, -1, 0),
        (4, 1): (0, np.sqrt(0.5), -np.sqrt(0.5)),
    }.items():
        assert ray(camera, *at) == pytest.approx(expected, abs=1e-6)
    assert ray(wf.Camera.panorama((1e20, 0, 0)), 512, 256) == pytest.approx([0, 0, 1], abs=1e-6)
    assert isinstance(camera.projection, Panorama)


@given(st.floats(0, 64, width=32), st.floats(0, 48, width=32), st.sampled_from(["wide", "flat", "round"]))
def test_directions_are_unit(x: float, y: float, kind: str) -> None:
    cameras = {
        "wide": wf.Camera.look_at((0, 0, 0), (1, 2, 3), fov=170, size=(64, 48), aperture=0.3),
        "flat": wf.Camera.orthographic((0, 0, 0), (1, 2, 3), height=9, size=(64, 48)),
        "round": wf.Camera.panorama((0, 0, 0), (1, 2, 3), size=(64, 48)),
    }
    direction = cameras[kind].rays(np.array([x], f4), np.array([y], f4), ORIGIN, np.full((2, 1), 0.3, f4))[1]
    assert length(direction) == pytest.approx(1, abs=1e-6)


def test_rays_of_one_film_point_meet_in_the_plane_of_focus() -> None:
    """They start all over the lens, within its radius, and cross at the focus distance."""
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=50, size=(40, 20), aperture=0.5, focus=3)
    u = np.random.default_rng(1).random((2, 4000))
    origin, direction = rays(camera, np.full(4000, 31.0), 4.0, u)
    radius = np.hypot(origin[:, 0], origin[:, 1])
    assert radius.max() == pytest.approx(0.25, rel=1e-3)
    assert np.mean(radius < 0.125) == pytest.approx(0.25, abs=0.03)  # uniform by area
    assert (origin[:, 2] == 5).all()
    focused = origin + direction * (-3 / direction[:, 2:])
    middle = rays(camera, 31.0, 4.0)
    expected = middle[0] + middle[1] * (-3 / middle[1][:, 2:])
    assert np.abs(focused - expected).max() < 2e-6


def test_focus_is_the_target_by_default() -> None:
    lens = wf.Camera.look_at((1, 2, 2), (0, 0, 0), aperture=0.1).projection
    assert isinstance(lens, Perspective)
    assert lens.focus == 3


@pytest.mark.parametrize("depth", [2.0, 3.9, 4.0, 8.0, 1e6])
def test_circle_of_confusion(depth: float) -> None:
    """A point at z is spread over a disk of diameter A·|z − f|/z in the plane of focus f."""
    aperture, focus, size, n = 0.4, 4.0, 96, 4000
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -focus), fov=20, size=(size, size), aperture=aperture)
    u = np.random.default_rng(1).random((2, n))

    def met(x: float) -> np.ndarray:
        """Where rays through film point (x, 48) pass the depth of the point, (n, 2)."""
        origin, direction = rays(camera, np.full(n, x), 48.0, u)
        return (origin + direction * (-depth / direction[:, 2:]))[:, :2]

    pitch = 2 * np.tan(np.radians(10)) / size * focus  # of pixels, in the plane of focus
    step = (met(49.0) - met(48.0))[:, :1]
    spread = np.hypot(*(met(48.0) / step).T) * pitch  # the film point is linear in the point that is met
    diameter = aperture * abs(depth - focus) / depth
    assert 2 * spread.max() == pytest.approx(diameter, rel=2e-3, abs=1e-5)
    assert np.mean(spread**2) == pytest.approx((diameter / 2) ** 2 / 2, rel=0.05, abs=1e-10)


def test_sharp_only_in_focus() -> None:
    """A speck in the plane of focus lights one pixel; nearer, it lights those of its disk."""
    aperture, size = 2.0, 33
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -4), fov=20, size=(size, size), aperture=aperture)
    pixel = 2 * np.tan(np.radians(10)) / size
    y, x = np.mgrid[:size, :size] - size // 2
    for depth in (4.0, 3.0):
        speck = wf.Sphere((0, 0, -depth), 0.45 * pixel * depth, material=wf.Diffuse(0), emission=1.0)
        image = wf.render(wf.Scene([speck], camera=camera), 256, max_bounces=0, progress=False)
        lit = np.hypot(x, y)[image.rgb[..., 0] > 0].max()
        radius = aperture * (4 - depth) / depth / 2 / (4 * pixel)
        assert lit == pytest.approx(radius, abs=1.5 if radius else 0)
        assert radius in (0, pytest.approx(7.8, abs=0.01))


def test_a_pinhole_needs_no_lens() -> None:
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0))
    assert not camera.uses_lens
    with_numbers = rays(camera, 3, 4, [[0.1], [0.9]])
    for ours, theirs in zip(with_numbers, rays(camera, 3, 4), strict=True):
        assert ours.tolist() == theirs.tolist()


CROPPED = {
    "pinhole": lambda **crop: wf.Camera.look_at((1, 1, 3), (0, 0, 0), size=(23, 17), **crop),
    "lens": lambda **crop: wf.Camera.look_at(
        (1, 1, 3), (0, 0, 0), size=(23, 17), aperture=0.2, shift=(0.1, 0), **crop
    ),
    "matrix": lambda **crop: wf.Camera.from_matrix(np.c_[np.eye(3), (0, 0, 3)], size=(23, 17), **crop),
    "intrinsics": lambda **crop: wf.Camera.from_intrinsics(
        [[20, 0, 11], [0, 20, 9], [0, 0, 1]], np.eye(3), (0, 0, 3), (23, 17), **crop
    ),
    "orthographic": lambda **crop: wf.Camera.orthographic(
        (1, 1, 3), (0, 0, 0), height=3, size=(23, 17), **crop
    ),
    "panorama": lambda **crop: wf.Camera.panorama((1, 1, 3), (0, 0, 0), size=(23, 17), **crop),
}


@pytest.mark.parametrize("kind", CROPPED)
@pytest.mark.parametrize("sampler", ["sobol", pytest.param("independent", marks=pytest.mark.slow)])
def test_a_window_is_cut_from_the_picture(kind: str, sampler: str) -> None:
    shapes = [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-3, -1, 3), (6, 0, 0), (0, 0, -6))]
    options = {"sampler": sampler, "max_bounces": 3, "progress": False}

    def picture(wave_size: int = 65_536, **crop) -> np.ndarray:
        scene = wf.Scene(shapes, [wf.PointLight((2, 3, 2), 9)], CROPPED[kind](**crop))
        return wf.render(scene, 4, wave_size=wave_size, **options).rgb

    whole = picture()
    assert whole.any()
    for x0, y0, x1, y1 in ((5, 3, 14, 16), (0, 0, 23, 1), (22, 16, 23, 17)):
        part = picture(wave_size=50, crop=(x0, y0, x1, y1))
        assert part.tobytes() == np.ascontiguousarray(whole[y0:y1, x0:x1]).tobytes()


def test_cropped_and_resized() -> None:
    """A window can be taken later; resizing keeps it."""
    camera = CROPPED["pinhole"]().cropped((5, 3, 14, 16))
    assert (camera.size, camera.resolution) == ((9, 13), (23, 17))
    assert camera.resized((9, 13)).window == (5, 3, 14, 16)
    double = camera.resized((18, 26))
    assert (double.resolution, double.window) == ((46, 34), (10, 6, 28, 32))


@pytest.mark.parametrize("size", [(18, 26), (9, 13), (27, 39), (40, 30), (5, 20), (90, 13), (1, 1), (6, 9)])
@pytest.mark.parametrize("crop", [(5, 3, 14, 16), (0, 0, 23, 1), (0, 0, 9, 17), (20, 10, 23, 17)])
def test_a_window_of_another_size_shows_the_same_part(
    size: tuple[int, int], crop: tuple[int, int, int, int]
) -> None:
    """Its middle stays where it is, to half a pixel, and its height spans the same angles."""
    camera = CROPPED["pinhole"]().cropped(crop)
    other = camera.resized(size)
    assert other.size == size
    x0, y0, x1, y1 = crop
    scale = size[1] / (y1 - y0)
    ahead = -camera.rotation[:, 2]
    points = camera.origin + ahead * 9 + np.array([[0, 0, 0], [0.3, 0.2, 0], [-0.5, 0.4, 0.3]])
    before, after = (each.project(points)[0] for each in (camera, other))
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    left, top, *_ = other.window
    expected = (before - middle) * scale + np.array(size) / 2
    # what is rounded is the height of the whole picture, too, about whose middle the angles are
    slack = 1 + np.abs(before - middle).max() * 0.5 / 17 * scale
    assert np.abs(after - (left, top) - expected).max() <= slack


def test_window_addresses() -> None:
    """Pixels of a window keep the numbers of the whole picture."""
    camera = CROPPED["pinhole"](crop=(5, 3, 14, 16))
    scene = compile_scene(wf.Scene([wf.Sphere((0, 0, 0), 1, emission=1.0)]), lambda geometry: None)
    pixel = np.arange(9 * 13, dtype=np.uint32)
    paths = generate(scene, camera, make_sampler("sobol"), pixel, np.zeros_like(pixel))
    expected = (np.arange(3, 16)[:, None] * 23 + np.arange(5, 14)).ravel()
    assert paths.pixel.tolist() == expected.tolist()
    assert paths.pixel.dtype == np.uint32


MATRIX = np.eye(4).tolist()


def look(**change):
    return wf.Camera.look_at(**{"origin": (0, 0, 3), "target": (0, 0, 0), **change})


def calibrated(**change):
    return wf.Camera.from_intrinsics(**{"K": K, "R": np.eye(4), "size": (640, 480), **change})


BAD = [
    (lambda: look(aperture=-1), "Camera aperture is -1; it must be"),
    (lambda: look(aperture=np.nan), "Camera aperture is nan"),
    (lambda: look(focus=0), "Camera focus is 0; it must be above 0"),
    (lambda: look(shift=(1,)), r"Camera shift must have shape \(2,\)"),
    (lambda: look(crop=(0, 0, 513, 5)), r"crop is \(0, 0, 513, 5\); it must be whole numbers .* x1 <= 512"),
    (lambda: look(crop=(5, 0, 5, 5)), r"crop is \(5, 0, 5, 5\)"),
    (lambda: look(crop=(0, 9, 5, 5)), r"crop is \(0, 9, 5, 5\)"),
    (lambda: look(crop=(0, 0.5, 5, 5)), r"crop is \(0, 0.5, 5, 5\)"),
    (lambda: look(crop="left"), r"crop must be \(x0, y0, x1, y1\)"),
    (lambda: wf.Camera.from_matrix(np.eye(3)), r"cam_to_world must have shape \(4, 4\), got \(3, 3\)"),
    (lambda: wf.Camera.from_matrix([[np.nan, 0, 0, 0], *MATRIX[1:]]), r"cam_to_world\[0\]\[0\] is nan"),
    (
        lambda: wf.Camera.from_matrix([*MATRIX[:3], [1, 2, 3, 1]]),
        r"cam_to_world\[3\] is \[1.0, 2.0, 3.0, 1.0",
    ),
    (lambda: wf.Camera.from_matrix(np.diag([2, 2, 2, 1])), r"\[:3, :3\] must be a rotation, .* is 3,"),
    (lambda: wf.Camera.from_matrix(np.diag([1, 1, -1, 1])), "must be a rotation; it mirrors"),
    (
        lambda: wf.Camera.from_matrix(MATRIX, convention="blender"),
        "convention is 'blender'; it must be one of opengl, opencv",
    ),
    (lambda: wf.Camera.from_matrix(MATRIX, aperture=0.1), "aperture is 0.1; a lens needs a focus distance"),
    (lambda: calibrated(K=K.T), r"K must be \[\[fx, s, cx\]"),
    (lambda: calibrated(K=-K), r"K must be \[\[fx, s, cx\]"),
    (lambda: calibrated(size=None), r"from_intrinsics needs size=\(width, height\)"),
    (lambda: calibrated(R=np.eye(3)), r"from_intrinsics needs t, or both in one matrix R"),
    (lambda: calibrated(t=(0, 0, 0)), r"R has the shape \(4, 4\) and holds a translation; leave t out"),
    (lambda: calibrated(R=np.diag([2, 2, 2, 1])), r"R\[:3, :3\] must be a rotation, without scale or shear"),
    (lambda: calibrated(R=-np.eye(3), t=(0, 0, 0)), "R must be a rotation; it mirrors"),
    (lambda: calibrated(R=np.eye(3), t=(0, 0)), r"t must have shape \(3,\)"),
    (
        lambda: calibrated(distortion=[0.1] * 6),
        "distortion has 6 numbers; it must have 4, 5 or 8: k1, k2, p1",
    ),
    (lambda: calibrated(distortion=[0.1, np.nan, 0, 0]), r"distortion is \[0.1, nan, 0.0, 0.0\]"),
    (lambda: calibrated(distortion=[0.1] * 9 + [0] * 3), r"distortion\[8:\] is .* not supported"),
    (
        lambda: wf.Camera.orthographic((0, 0, 3), (0, 0, 0), height=0),
        "Camera height is 0; it must be above 0",
    ),
    (lambda: wf.Camera.panorama((0, 0, 3), (0, 0, 3)), "Camera origin and target are both"),
    (lambda: wf.Camera.panorama((0, 0, 3), up=(0, 0, 1)), "must not be zero or parallel"),
]


@pytest.mark.parametrize(("make", "message"), BAD)
def test_bad_arguments_are_named(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_only_perspective_has_a_fov() -> None:
    """Asking for one is an AttributeError, so that getattr with a default works."""
    assert getattr(wf.Camera.panorama((0, 0, 0)), "fov", None) is None

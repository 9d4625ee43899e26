"""Camera.project is the inverse of the rays, for every projection; lens distortion can be undone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import Distortion, f4
from significance import render

import wavefront as wf

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # an exact rotation
K = np.array([[700.0, 0, 330], [0, 650, 250], [0, 0, 1]])
SKEWED = np.array([[700.0, 12.5, 330], [0, 650, 250], [0, 0, 1]])
SHIFT = np.array([1.0, 2, 3])
LENSES = {  # of calibrations: a webcam, a wide action camera, a telephoto lens, one with all eight numbers
    "webcam": (0.08, -0.2, 0.001, -0.002, 0.1),
    "wide": (-0.28, 0.08, 0.0003, 0.0002),
    "pincushion": (0.2, 0.05, 0, 0),
    "rational": (0.4, 0.1, 0.0005, -0.001, 0.02, 0.7, 0.2, 0.03),
}
CAMERAS = {
    "look_at": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), fov=60, size=(64, 48)),
    "shifted": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), size=(64, 48), shift=(0.2, -0.1), aperture=0.1),
    "crop": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), size=(64, 48), crop=(10, 10, 30, 20)),
    "skewed": wf.Camera.from_intrinsics(SKEWED, TURN, SHIFT, (640, 480)),
    "orthographic": wf.Camera.orthographic((1, 2, 3), (0, 0, -1), height=5, size=(64, 48)),
    "panorama": wf.Camera.panorama((1, 2, 3), (0, 0, -1), size=(64, 32)),
    "fisheye": wf.Camera.fisheye(SKEWED, (-0.02, 0.003, 0.001, -0.0005), TURN, SHIFT, (640, 480)),
    "equisolid": wf.Camera.fisheye(K, None, TURN, SHIFT, (640, 480), mapping="equisolid"),
    **{
        name: wf.Camera.from_intrinsics(SKEWED, TURN, SHIFT, (640, 480), distortion=numbers)
        for name, numbers in LENSES.items()
    },
}
ALL_AROUND = "panorama", "fisheye", "equisolid"  # which measure depth along the ray


def opencv(points, k, turn, shift, d):
    """The formulas of OpenCV's documentation, point by point; its pixel centers are at whole numbers."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*d, *[0.0] * (8 - len(d)))
    out = []
    for point in points:
        x, y, z = turn @ point + shift
        x, y = x / z, y / z
        r2 = x**2 + y**2
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
        out.append((k @ (u, v, 1))[:2])
    return np.array(out)


@pytest.mark.parametrize("name", CAMERAS)
def test_points_on_rays_are_seen_where_the_rays_begin(name: str) -> None:
    """All over the film, near and far; the depth is along the axis, of a panorama along the ray."""
    camera = CAMERAS[name]
    rng = np.random.default_rng(3)
    film = rng.uniform(0.01, 0.99, (500, 2)) * camera.resolution
    origin, direction = camera.rays(*film.T.astype(f4), np.zeros(3))
    far = rng.uniform(0.5, 50, 500)
    points = origin.T.astype(float) + direction.T.astype(float) * far[:, None]
    pixels, depth = camera.project(points)
    assert pixels.shape == (500, 2)
    assert np.abs(pixels - film.astype(f4)).max() < 2e-3 if name in LENSES or name == "skewed" else 1e-3
    ahead = (points - camera.origin) @ -camera.rotation[:, 2]
    assert depth == pytest.approx(far if name in ALL_AROUND else ahead, rel=1e-5)


@pytest.mark.parametrize("name", [n for n in CAMERAS if n not in ALL_AROUND])
def test_what_is_behind_is_not_seen(name: str) -> None:
    camera = CAMERAS[name]
    behind = camera.origin + np.array([[0.1], [3.0]]) * camera.rotation[:, 2] + 0.01 * camera.rotation[:, 0]
    pixels, depth = camera.project(behind)
    assert np.isnan(pixels).all()
    assert depth == pytest.approx([-0.1, -3])


def test_a_panorama_sees_all_but_its_own_place() -> None:
    pixels, depth = CAMERAS["panorama"].project([(1, 2, 3), (1, 2, 9), (1, 5, 3)])
    assert np.isnan(pixels).tolist() == [[True, True], [False, False], [False, False]]
    assert depth.tolist() == [0, 6, 3]


def test_pixels_have_their_centers_at_a_half() -> None:
    camera = wf.Camera.from_intrinsics(
        [[40, 3, 15.5], [0, 45, 12], [0, 0, 1]], np.eye(3), (0, 0, 3), (32, 24), distortion=LENSES["wide"]
    )
    for column, row in ((3, 5), (28, 2), (15, 20)):
        origin, direction = camera.rays(np.array([column + 0.5], f4), np.array([row + 0.5], f4), np.zeros(3))
        center = (origin + 4 * direction)[:, 0]
        assert camera.project([center])[0][0] == pytest.approx((column + 0.5, row + 0.5), abs=1e-4)
        ball = wf.Sphere(center, 0.03, material=wf.Diffuse(0), emission=1)
        lit = np.argwhere(render(wf.Scene(ball, camera=camera), 4, max_bounces=0).rgb[..., 0] > 0)
        assert lit.tolist() == [[row, column]]


@pytest.mark.parametrize("name", [None, *LENSES])
def test_project_is_opencvs_model(name: str | None) -> None:
    """A calibration of OpenCV as it is; film positions are its coordinates and half a pixel."""
    d = () if name is None else LENSES[name]
    camera = wf.Camera.from_intrinsics(
        SKEWED, TURN, SHIFT[:, None], (640, 480), distortion=None if name is None else [d]
    )
    rng = np.random.default_rng(1)
    seen = np.column_stack([rng.uniform(-0.4, 0.4, (50, 2)), np.ones(50)]) * rng.uniform(1, 9, (50, 1))
    points = (seen - SHIFT) @ TURN
    expected = opencv(points, SKEWED, TURN, SHIFT, d)
    assert camera.project(points, "integer")[0] == pytest.approx(expected, abs=1e-9)
    assert camera.project(points)[0] == pytest.approx(expected + 0.5, abs=1e-9)
    assert camera.project(points)[1] == pytest.approx(seen[:, 2])


@pytest.mark.parametrize("name", ["wide", "rational"])
def test_a_calibration_of_opencv_agrees_with_the_pixels(name: str) -> None:
    """What a pixel shows is projected by OpenCV's formulas onto its column and row, to 0.01 pixel."""
    k = [[60, 1.5, 33.2], [0, 55, 21.7], [0, 0, 1]]
    camera = wf.Camera.from_intrinsics(k, TURN, SHIFT, (64, 48), distortion=LENSES[name])
    middle = camera.origin - 3 * camera.rotation[:, 2]
    scene = wf.Scene(wf.Sphere(middle, 2, emission=1), camera=camera)
    position = wf.render(scene, 1, max_bounces=0, aovs="position", progress=False).position
    row, column = np.nonzero(np.isfinite(position).all(2))
    assert len(row) > 1000
    seen = opencv(position[row, column].astype(float), np.array(k), TURN, SHIFT, LENSES[name])
    assert np.abs(seen - np.stack([column, row], 1)).max() < 0.01


def test_pixel_centers_at_a_half_move_the_principal_point() -> None:
    """A K of COLMAP is one of OpenCV with half a pixel more, and `intrinsics` gives either."""
    half = np.add(SKEWED, [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    camera = wf.Camera.from_intrinsics(SKEWED, TURN, SHIFT, (640, 480))
    other = wf.Camera.from_intrinsics(half, TURN, SHIFT, (640, 480), pixel_centers="half")
    points = [(-1.0, 1.5, 4.0), (1.2, -2.0, 9.0)]
    assert other.project(points)[0] == pytest.approx(camera.project(points)[0], abs=1e-9)
    for each in (camera, other):
        assert each.intrinsics() == pytest.approx(SKEWED)
        assert each.intrinsics("half") == pytest.approx(half)


@pytest.mark.parametrize(
    "call",
    [
        lambda: wf.Camera.from_intrinsics(K, np.eye(4), size=(640, 480), pixel_centers="corner"),
        lambda: CAMERAS["skewed"].intrinsics("corner"),
        lambda: CAMERAS["skewed"].project([(0, 0, 0)], "corner"),
    ],
)
def test_other_pixel_centers_are_refused(call) -> None:
    with pytest.raises(wf.SceneError, match=r"pixel_centers is 'corner'; it must be one of integer, half"):
        call()


def test_extrinsics_are_taken_in_one_matrix() -> None:
    """(4, 4) and (3, 4), and t as a column or a row, as OpenCV returns it."""
    matrix = np.vstack([np.c_[TURN, SHIFT], [0, 0, 0, 1]])
    plain = wf.Camera.from_intrinsics(K, TURN, SHIFT, (640, 480))
    others = [wf.Camera.from_intrinsics(K, m, size=(640, 480)) for m in (matrix, matrix[:3])]
    others += [wf.Camera.from_intrinsics(K, TURN, t, (640, 480)) for t in (SHIFT[:, None], SHIFT[None])]
    for camera in others:
        assert np.array_equal(camera.origin, plain.origin)
        assert np.array_equal(camera.rotation, plain.rotation)


@pytest.mark.parametrize("name", LENSES)
def test_distortion_is_undone(name: str) -> None:
    lens = Distortion(LENSES[name])
    x, y = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 101), np.linspace(-0.4, 0.4, 81))).reshape(2, -1)
    back = lens.apply(*lens.undo(x, y))
    assert np.hypot(back[0] - x, back[1] - y).max() < 1e-12
    again = lens.undo(*lens.apply(x, y))
    assert np.hypot(again[0] - x, again[1] - y).max() < 1e-9


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(*[st.floats(-0.4, 0.4)] * 2, *[st.floats(-0.01, 0.01)] * 2, st.floats(-0.2, 0.2)),
    st.floats(0.2, 1.5),
)
def test_a_lens_is_refused_or_undone_everywhere(numbers: tuple, half: float) -> None:
    lens = Distortion(numbers)
    grid = np.stack(np.meshgrid(np.linspace(-half, half, 65), np.linspace(-half, half, 65))).reshape(2, -1)
    try:
        lens.check(grid[0], grid[1], str)
    except wf.SceneError:
        return
    x, y = np.random.default_rng(0).uniform(-half, half, (2, 1000))
    u, v = lens.undo(x, y)
    back = lens.apply(u, v)
    assert np.hypot(back[0] - x, back[1] - y).max() < 1e-8
    assert lens.invertible(u, v).all()


def test_undoing_does_not_depend_on_neighbors() -> None:
    lens = Distortion(LENSES["wide"])
    x, y = np.random.default_rng(0).uniform(-0.5, 0.5, (2, 100))
    whole = np.stack(lens.undo(x, y))
    parts = [np.stack(lens.undo(x[a:b], y[a:b])) for a, b in ((0, 1), (1, 8), (8, 100))]
    assert np.array_equal(whole, np.concatenate(parts, 1))


@pytest.mark.parametrize(
    "numbers", [(-0.9, 0, 0, 0), (0, -3.0, 0, 0), (0, 0, 0, 0, 0, -3.0, 0, 0), (0, 0, 0.9, 0)]
)
def test_lenses_that_fold_the_picture_are_refused(numbers: tuple) -> None:
    """One pixel would see several points; points beyond the fold are not projected into the picture."""
    with pytest.raises(
        wf.SceneError, match=r"Distortion\(.*\) cannot be undone inside the picture: near the"
    ):
        wf.Camera.from_intrinsics(K, np.eye(3), (0, 0, 0), (640, 480), distortion=numbers)


def test_points_beyond_a_fold_are_not_seen() -> None:
    """A barrel lens folds outside of the picture; without care such points land in its middle."""
    camera = wf.Camera.from_intrinsics(K, np.eye(3), (0, 0, 0), (640, 480), distortion=(-0.3, 0, 0, 0))
    pixels, depth = camera.project([(1.8, 0, 1.0), (0.3, 0, 1.0)])
    assert np.isnan(pixels[0]).all()
    assert pixels[1, 0] == pytest.approx(330.5 + 700 * 0.3 * (1 - 0.3 * 0.09))
    assert depth.tolist() == [1, 1]


def test_points_must_be_points() -> None:
    with pytest.raises(wf.SceneError, match=r"points must have shape \(n, 3\), got \(3,\)"):
        CAMERAS["look_at"].project((1, 2, 3))

"""Fisheye lenses: OpenCV's model, closed forms of others, their inverse, and what is outside of them."""

import pickle

import numpy as np
import pytest
from inside import MAPPINGS, Polynomial, f4
from significance import render

import wavefront as wf

K = [[300, 4, 330], [0, 290, 250], [0, 0, 1]]
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # an exact rotation
SHIFT = (0.1, -0.2, 0.5)
POINTS = [
    (0.312, 0.416, 0.14),
    (-1.236, 0.352, 2.28),
    (1.084, 2.612, -2.82),
    (7.172, -5.104, 0.54),
    (2.4316, 3.6088, 3.372),
]
OPENCV = {  # pixels by cv2.fisheye.projectPoints of OpenCV 5.0.0, with alpha = K[0][1]/K[0][0]
    (0, 0, 0, 0): (
        *((415.6107, 194.3338), (68.8119, 377.0882), (725.8737, 297.7551), (314.4287, -173.3437)),
        (330.5133, 250.9667),
    ),
    (-0.02, 0.003, 0.001, -0.0005): (
        *((415.4095, 194.4647), (72.9852, 375.0575), (715.8652, 296.5478), (314.8903, -160.7939)),
        (330.5133, 250.9667),
    ),
    (0.1, -0.05, 0.02, -0.003): (
        *((416.5774, 193.7053), (51.814, 385.3589), (766.0495, 302.6016), (312.595, -223.1995)),
        (330.5133, 250.9667),
    ),
    (-0.013, -0.02, 0.01, -0.002): (
        *((415.4543, 194.4355), (75.0206, 374.0672), (706.2408, 295.3868), (315.4104, -146.6556)),
        (330.5133, 250.9667),
    ),
}
FRONT = wf.Camera.look_at((0, 0, 0), (0, 0, -1), size=(100, 100))


def lens(fov: float = 180, **kinds) -> wf.Camera:
    return FRONT.replace(projection=wf.Fisheye(fov, **kinds))


@pytest.mark.parametrize("distortion", OPENCV)
def test_project_is_opencvs_model(distortion: tuple) -> None:
    camera = wf.Camera.fisheye(K, [distortion], TURN, SHIFT, (640, 480))
    assert camera.project(POINTS, "integer")[0] == pytest.approx(np.array(OPENCV[distortion]), abs=1e-4)
    assert camera.intrinsics() == pytest.approx(np.array(K, float))


@pytest.mark.parametrize("distortion", [*OPENCV, (-0.3, 0, 0, 0), (0.5, 0.2, 0, 0)])
def test_every_film_point_inside_the_circle_is_inverted(distortion: tuple) -> None:
    """To the rounding of the rays, float32; in float64 to 1e-12, to where the polynomial folds."""
    camera = wf.Camera.fisheye(K, distortion, size=(640, 480))
    rng = np.random.default_rng(1)
    film = (rng.random((20_000, 2)) * camera.resolution).astype(f4)
    direction = camera.rays(*film.T, np.zeros(3))[1]
    seen = np.isfinite(direction[0])
    back = camera.project(direction.T[seen].astype(float))[0]
    assert seen.mean() > 0.2
    assert np.abs(back - film[seen]).max() < 1e-4
    if any(distortion):
        mapping = Polynomial(np.array(distortion, float))
        radius = np.linspace(0, mapping.largest, 9999)
        assert np.abs(mapping.radius(mapping.angle(radius)) - radius).max() < 1e-12


FORMS = {
    "equidistant": lambda a: a,
    "equisolid": lambda a: 2 * np.sin(a / 2),
    "stereographic": lambda a: 2 * np.tan(a / 2),
    "orthographic": np.sin,
}


@pytest.mark.parametrize("mapping", FORMS)
def test_mappings_have_their_closed_forms(mapping: str) -> None:
    """Half the height is 75° of a field of view of 150°; other angles follow, and have that inverse."""
    camera, angles = lens(150, mapping=mapping), np.radians([0, 1e-6, 10, 45, 75, 89])
    points = np.stack([np.sin(angles), np.zeros(6), -np.cos(angles)], 1) * 3
    pixels, depth = camera.project(points)
    expected = 50 + 50 * FORMS[mapping](angles) / FORMS[mapping](np.radians(75))
    assert pixels[:, 0] == pytest.approx(expected, abs=1e-9)
    assert pixels[:, 1] == pytest.approx(50, abs=1e-9)
    assert depth == pytest.approx(3)
    radius = np.linspace(0, 0.99 * min(MAPPINGS[mapping].largest, 9), 999)
    assert MAPPINGS[mapping].radius(MAPPINGS[mapping].angle(radius)) == pytest.approx(radius, abs=1e-12)


@pytest.mark.parametrize("mapping", FORMS)
def test_what_is_beyond_the_mapping_is_not_seen(mapping: str) -> None:
    camera = lens(150, mapping=mapping)
    behind, beyond = (0.1, 0, 1), (0, 0, 1)
    seen = np.isfinite(camera.project([behind, beyond])[0]).all(1)
    assert seen.tolist() == [mapping != "orthographic", False]


def test_a_polynomial_ends_where_it_folds() -> None:
    """θ − 0.3·θ³ has its maximum at θ = 1/√0.9: beyond that, points would come back into the picture."""
    camera = lens(100, distortion=(-0.3, 0, 0, 0))
    limit = 1 / np.sqrt(0.9)
    angles = limit + np.array([-1e-6, 1e-6])
    pixels = camera.project(np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], 1))[0]
    assert np.isfinite(pixels).all(1).tolist() == [True, False]


def test_outside_of_the_circle_it_is_black() -> None:
    """Opaque, without ids and depths, whatever is around; inside the environment is seen as it is."""
    camera = lens(160, mapping="orthographic")
    scene = wf.Scene([wf.Box((0, 0, -3), 1)], [wf.Environment(0.5)], camera)
    image = render(scene, 2, aovs=("alpha", "depth", "shape_id", "boxes"), background=(0, 0, 1))
    x, y = np.meshgrid(*[np.arange(100) + 0.5 - 50] * 2)
    radius = np.hypot(x, y) * np.sin(np.radians(80)) / 50
    inside, outside = radius < 0.98, radius > 1.03
    assert not image.rgb[outside].any()
    assert (image.alpha[outside] == 1).all()
    assert (image.shape_id[outside] == -1).all()
    assert np.isnan(image.depth[outside]).all()
    assert (image.rgb[inside & (image.shape_id < 0)][:, 2] > 0.9).mean() > 0.95
    assert image.boxes[0]["visible"] is not None


def test_rays_of_a_lens_meet_where_it_is_in_focus() -> None:
    """At the distance of focus in all directions; from points of a disk across the axis."""
    camera = lens(170, aperture=0.4, focus=2.0)
    film = np.random.default_rng(0).uniform(5, 95, (2, 500)).astype(f4)
    sharp = camera.rays(*film, np.zeros(3))[1] * 2
    u = np.random.default_rng(1).random((2, 500)).astype(f4)
    origin, direction = camera.rays(*film, np.zeros(3), u)
    assert np.hypot(origin[0], origin[1]).max() <= 0.2
    assert not origin[2].any()
    along = ((sharp - origin) * direction).sum(0)
    assert np.abs(origin + direction * along - sharp).max() < 2e-6
    assert camera.scaled(2).projection.focus == 4


def test_cameras_keep_their_lens() -> None:
    """Resized and cropped, pickled, and with another parameter."""
    camera = wf.Camera.fisheye(K, (-0.02, 0.003, 0, 0), size=(640, 480))
    double = camera.resized((1280, 960)).project([(1, 0.5, 1)])[0]
    assert double == pytest.approx(camera.project([(1, 0.5, 1)])[0] * 2)
    copy = pickle.loads(pickle.dumps(camera))
    assert np.array_equal(copy.project(POINTS)[0], camera.project(POINTS)[0], equal_nan=True)
    wide = camera.replace(fov=90)
    assert (wide.projection.fov, wide.projection.focal) == (90, None)
    assert wide.projection.distortion.tolist() == [-0.02, 0.003, 0, 0]
    assert "Fisheye(fov=90, distortion=" in repr(wide)


def test_a_checkpoint_is_of_its_lens(tmp_path) -> None:
    scene = wf.Scene([wf.Box((0, 0, -3), 1)], [wf.Environment(0.5)])
    how = {"checkpoint": tmp_path / "a.wfck", "progress": False, "size": 8}
    wf.render(scene, 1, camera=lens(120).resized(8), **how)
    with pytest.raises(wf.SceneError, match="camera"):
        wf.render(scene, 2, camera=lens(121).resized(8), **how)


def test_a_stereo_pair_is_rectified() -> None:
    """The disparity is fx·baseline/z, rows are equal, and both move together."""
    camera = wf.Camera.from_intrinsics([[90, 0, 31.5], [0, 80, 23.5], [0, 0, 1]], TURN, SHIFT, (64, 48))
    left, right = camera.stereo(0.25)
    assert left is camera
    points = camera.origin + (np.array([(0.2, 0.1, -3), (-1, 1, -7)]) @ camera.rotation.T)
    (one, depth), (other, same) = left.project(points), right.project(points)
    assert one[:, 0] - other[:, 0] == pytest.approx(90 * 0.25 / depth)
    assert one[:, 1] == pytest.approx(other[:, 1])
    assert depth == pytest.approx(same)
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = TURN, (1, 2, 3)
    moving = camera.transformed(wf.Keyframes([0, 1], [np.eye(4), turned])).stereo(0.25)
    for time in (0, 0.3, 1):
        a, b = (each.at(time) for each in moving)
        assert b.origin - a.origin == pytest.approx(a.rotation[:, 0] * 0.25)
        assert b.rotation == pytest.approx(a.rotation)


BAD = [
    (lambda: wf.Camera.fisheye(K), r"fisheye needs size=\(width, height\)"),
    (lambda: wf.Camera.fisheye(np.eye(4), size=9), r"K must have shape \(3, 3\)"),
    (lambda: wf.Camera.fisheye(-np.eye(3), size=9), "K must be"),
    (lambda: wf.Camera.fisheye(K, (1, 2, 3), size=9), r"D must have shape \(4,\)"),
    (lambda: wf.Camera.fisheye(K, [0, 0, np.nan, 0], size=9), r"D\[2\] is nan; it must be finite"),
    (lambda: wf.Fisheye(distortion=3), r"Fisheye distortion must have shape \(4,\)"),
    (lambda: wf.Camera.fisheye(K, R=np.eye(3), size=9), "needs t"),
    (lambda: wf.Camera.fisheye(K, size=9, mapping="fish"), "Fisheye mapping is 'fish'; it must be one of"),
    (
        lambda: wf.Camera.fisheye(K, (0.1, 0, 0, 0), size=9, mapping="equisolid"),
        r"mapping is 'equisolid' and distortion \[0.1, 0.0, 0.0, 0.0\]; the distortion is one of the mapping",
    ),
    (lambda: wf.Camera.fisheye(K, size=9, aperture=0.1), "Fisheye aperture is 0.1; a lens needs a focus"),
    (lambda: wf.Fisheye(aperture=-1), "aperture is -1; it must be at least 0"),
    (lambda: wf.Fisheye(aperture=1, focus=0.5), "focus is 0.5; it must be above 0.5, the radius of the lens"),
    (lambda: wf.Fisheye(361), "fov is 361; it must be above 0 and at most 360 degrees, which this mapping"),
    (lambda: wf.Fisheye(360, mapping="stereographic"), "above 0 and below 360"),
    (lambda: wf.Fisheye(181, mapping="orthographic"), "at most 180"),
    (
        lambda: wf.Fisheye(130, distortion=(-0.3, 0, 0, 0)),
        "fov is 130; it must be above 0 and at most 120.79",
    ),
    (lambda: wf.Fisheye(90, focal=1), "fov and focal are both given"),
    (lambda: wf.Fisheye(focal=0), "focal is 0; it must be above 0"),
    (lambda: wf.Fisheye(pixel_aspect=0), "pixel_aspect is 0"),
    (lambda: wf.Fisheye(shift=1), "Fisheye shift must have shape"),
    (lambda: wf.Fisheye(skew=np.inf), "Fisheye skew is inf"),
    (lambda: lens().projection_matrix(), "Fisheye rays has no intrinsic matrix; a perspective one has"),
    (lambda: FRONT.stereo(0), "baseline is 0; it must be above 0"),
]


@pytest.mark.parametrize(("make", "message"), BAD)
def test_bad_arguments_are_named(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()

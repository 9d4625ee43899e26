"""The matrices of cameras: they are those that cameras are made of, and project points as the camera does."""

import numpy as np
import pytest

import wavefront as wf

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # an exact rotation
K = np.array([[700.0, 12.5, 330], [0, 650, 250], [0, 0, 1]])
SHIFT = np.array([1.0, 2, 3])
CAMERAS = {
    "look_at": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), fov=60, size=(64, 48)),
    "shifted": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), size=(64, 48), shift=(0.2, -0.1), aperture=0.1),
    "crop": wf.Camera.look_at((1, 2, 3), (0, 0.5, -1), size=(64, 48), crop=(10, 10, 30, 20)),
    "skewed": wf.Camera.from_intrinsics(K, TURN, SHIFT, (640, 480)),
}


def points_before(camera: wf.Camera) -> np.ndarray:
    """Return points (50, 3) in and beside the picture."""
    rng = np.random.default_rng(5)
    local = rng.uniform((-2, -2, -9), (2, 2, -1), (50, 3))
    return local @ camera.rotation.T + camera.origin


def test_the_matrices_are_those_that_a_camera_was_made_of() -> None:
    camera = CAMERAS["skewed"]
    assert np.allclose(camera.intrinsics(), K, rtol=1e-14)
    extrinsics = camera.extrinsics()
    assert np.allclose(extrinsics[:3], np.column_stack([TURN, SHIFT]), atol=1e-14)
    assert extrinsics[3].tolist() == [0, 0, 0, 1]
    assert np.allclose(extrinsics @ camera.to_matrix("opencv"), np.eye(4), atol=1e-14)
    for convention in ("opengl", "opencv"):
        matrix = camera.to_matrix(convention)
        again = wf.Camera.from_matrix(matrix, convention=convention)
        assert np.allclose(again.rotation, camera.rotation)
        assert np.allclose(again.origin, camera.origin)
    with pytest.raises(wf.SceneError, match="convention is 'blender'"):
        camera.to_matrix("blender")


@pytest.mark.parametrize("name", CAMERAS)
def test_opengls_matrices_project_as_the_camera_does(name: str) -> None:
    """Clip space is the picture; the planes of near and far are its faces."""
    camera = CAMERAS[name]
    points = points_before(camera)
    view = np.linalg.inv(camera.to_matrix())
    clip = np.column_stack([points, np.ones(50)]) @ (camera.projection_matrix(0.5, 20) @ view).T
    x, y, z = clip[:, :3].T / clip[:, 3]
    width, height = camera.resolution
    pixels, depth = camera.project(points)
    assert np.allclose(np.stack([(x + 1) / 2 * width, (1 - y) / 2 * height], 1), pixels, rtol=0, atol=1e-9)
    assert (np.diff(z[np.argsort(depth)]) > 0).all()
    near, far = (camera.projection_matrix(0.5, 20) @ (0, 0, -edge, 1) for edge in (0.5, 20))
    assert near[2] / near[3] == pytest.approx(-1)
    assert far[2] / far[3] == pytest.approx(1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wf.Camera.panorama((0, 0, 0)).intrinsics(), "Panorama rays has no intrinsic matrix"),
        (
            lambda: wf.Camera.orthographic((0, 0, 1), (0, 0, 0), height=2).projection_matrix(),
            "Orthographic rays has no intrinsic matrix",
        ),
        (lambda: CAMERAS["crop"].projection_matrix(0), "near is 0; it must be above 0"),
        (lambda: CAMERAS["crop"].projection_matrix(2, 1), "far is 1; it must be above near, which is 2"),
    ],
)
def test_what_has_no_matrix(call, message) -> None:
    with pytest.raises(wf.SceneError, match=message):
        call()

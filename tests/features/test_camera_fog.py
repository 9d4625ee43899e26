"""A feature of a user's own is one file, which names no other: a fog that only the camera sees."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import wavefront as wf


class CameraFog(wf.Feature):
    """Fades what the camera sees into a color. Light and mirrors know nothing of it."""

    camera_only = True

    def __init__(self, density, color):
        self.density, self.color = density, np.float32(color).reshape(3, 1)

    def fly(self, leg):
        """Weaken camera rays by their length, and add the color of what is in front."""
        paths = leg.paths
        start = paths.origin if paths.prev_vertex is None else paths.prev_vertex  # surfaces passed are behind
        length = leg.hits.t + np.linalg.norm(paths.origin - start, axis=0)
        through = np.exp(-self.density * length)  # 0 where nothing is met
        leg.L[:, paths.slot] += self.color * paths.throughput * (1 - through)
        paths.throughput *= through


SUN = wf.DirectionalLight((0, 0, -1), 3)
WALL = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=wf.Diffuse(0.5))
PANE = wf.Rectangle((-9, -9, 1), (18, 0, 0), (0, 18, 0), material=wf.Material(wf.Diffuse(0), alpha=0.0))
CAMERA = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=1, size=(4, 4))
FOG = CameraFog(0.25, (0, 0, 1))
OPTIONS = {"spp": 4, "workers": 1, "progress": False}


@pytest.mark.parametrize("shapes", [[WALL], [WALL, PANE]], ids=["wall", "behind a clear pane"])
def test_only_the_camera_sees_it(shapes) -> None:
    scene = wf.Scene(shapes, [SUN], CAMERA)
    clear = wf.render(scene, **OPTIONS).rgb
    foggy = wf.render(scene, features=FOG, **OPTIONS).rgb
    assert foggy == pytest.approx(clear * np.exp(-1) + np.array([0, 0, 1 - np.exp(-1)]), rel=1e-4)
    assert np.array_equal(wf.render(scene, features=[], **OPTIONS).rgb, clear)


def test_a_mirror_shows_no_fog() -> None:
    mirror = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=wf.Mirror(1.0))
    scene = wf.Scene([mirror], [wf.Environment(1.0)], CAMERA)
    foggy = wf.render(scene, features=[FOG], **OPTIONS).rgb
    assert foggy[..., 0] == pytest.approx(np.exp(-1), rel=1e-4)  # once, on the way to the mirror


@pytest.mark.parametrize("integrator", ["full", "direct_mis", "direct_simple", "naive"])
def test_every_estimator_meets_it(integrator: str) -> None:
    scene = wf.Scene([WALL], [wf.Environment(1.0)], CAMERA)
    clear, foggy = (
        wf.render(scene, features=each, integrator=integrator, **OPTIONS).rgb for each in ([], [FOG])
    )
    assert foggy[..., 0] == pytest.approx(clear[..., 0] * np.exp(-1), rel=1e-4)


def test_it_is_sent_to_workers() -> None:
    scene = wf.Scene([WALL], [SUN], CAMERA)
    sent = pickle.loads(pickle.dumps(FOG))
    alone, many = (
        wf.render(scene, 4, features=each, executor=executor, progress=False).rgb
        for each, executor in ((FOG, None), (sent, ThreadPoolExecutor(2)))
    )
    assert np.array_equal(alone, many)


def test_sensors_measure_the_light_that_is_there() -> None:
    scene = wf.Scene([WALL], [wf.Environment(1.0)])
    clear, foggy = (
        wf.measure(scene, [(0, 0, 2)], normals=[(0, 0, 1)], spp=16, workers=1, progress=False, features=each)
        for each in ([], FOG)
    )
    assert np.array_equal(clear.value, foggy.value)


def test_a_checkpoint_of_another_fog_is_refused(tmp_path) -> None:
    scene, path = wf.Scene([WALL], [SUN], CAMERA), str(tmp_path / "foggy.wfck")
    wf.render(scene, features=FOG, checkpoint=path, **OPTIONS)
    with pytest.raises(wf.SceneError, match="scene"):
        wf.render(scene, features=CameraFog(0.5, (0, 0, 1)), checkpoint=path, **{**OPTIONS, "spp": 8})


@pytest.mark.parametrize("other", ["caustics", "reuse"])
def test_what_does_not_go_with_features(other: str) -> None:
    with pytest.raises(wf.SceneError, match=rf"{other}=True does not go with features="):
        wf.render(WALL, features=FOG, **{other: True})


def test_what_is_no_feature() -> None:
    with pytest.raises(wf.SceneError, match=r"features is \[3\]; it must be one or more objects of subcl"):
        wf.render(WALL, features=[3])

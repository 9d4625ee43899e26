"""A feature of a user's own is one file, which names no other: a fog that only the camera sees."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from inside import Dimension, numbers_of

import wavefront as wf


class CameraFog(wf.Feature):
    """Fades what the camera sees into a color. Light and mirrors know nothing of it."""

    camera_only = True

    def __init__(self, density, color):
        self.density, self.color = density, np.float32(color).reshape(3, 1)

    def fly(self, leg):
        """Weaken camera rays by their length, and add the color of what is in front."""
        through = np.exp(-self.density * leg.length)  # 0 where nothing is met
        leg.L[:, leg.paths.slot] += self.color * leg.paths.throughput * (1 - through)
        leg.paths.throughput *= through


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


def test_the_page_for_contributors_has_this_fog() -> None:
    page = (Path(__file__).parents[2] / "docs" / "architecture.md").read_text("utf-8")
    code = page.partition("### Feature\n")[2].partition("```python\n")[2].partition("\n\n\nfog =")[0]
    own: dict[str, type[wf.Feature]] = {}
    exec(code, own)
    scene = wf.Scene([WALL, PANE], [SUN], CAMERA)
    pages, here = (
        wf.render(scene, features=each, **OPTIONS).rgb for each in (own["CameraFog"](0.25, (0, 0, 1)), FOG)
    )
    assert np.array_equal(pages, here)


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


def test_surfaces_that_only_a_feature_lets_pass() -> None:
    class Ghost(wf.Feature):
        """Lets the camera see through what is nearer than two units, by half."""

        camera_only = True

        def passable(self, scene, rays, hits, lanes):
            return hits.t[lanes] < 2

        def thin(self, opacity, passage):
            opacity *= np.float32(0.5)

    black = wf.Rectangle((-9, -9, 2.5), (18, 0, 0), (0, 18, 0), material=wf.Diffuse(0.0))
    scene, options = wf.Scene([black], [wf.Environment(1.0)], CAMERA), {**OPTIONS, "spp": 256}
    assert wf.render(scene, **options).rgb.max() == 0
    assert wf.render(scene, features=Ghost(), **options).rgb.mean() == pytest.approx(0.5, abs=0.03)


def test_features_have_random_numbers_of_their_own() -> None:
    class Spots(wf.Feature):
        """Shows the numbers that it draws."""

        camera_only = True

        def meet(self, leg):
            at = leg.paths.pixel, leg.paths.sample, leg.bounce
            leg.emission.radiance = np.stack([leg.sampler.draw_1d(*at, self.dimensions[k]) for k in range(3)])

    numbers = wf.render(
        wf.Scene([wf.Sphere((0, 0, 99), 0.1)], [wf.Environment(1.0)], CAMERA),
        features=Spots(),
        **{**OPTIONS, "spp": 1, "sampler": "independent"},
    ).rgb
    assert len(np.unique(numbers)) == numbers.size
    assert ((numbers >= 0) & (numbers < 1)).all()
    used = [range(first, numbers_of(first).stop) for first in Dimension if first != Dimension.FEATURE]
    assert not any(number in Spots.dimensions for each in used for number in (each.start, each.stop - 1))

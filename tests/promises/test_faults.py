"""Samples that are not finite: dropped, counted, and the first one named by bounce and material."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import BsdfSample, column, f4, li_full
from significance import render

import wavefront as wf


class Spoiled(wf.Diffuse):
    """A material that spoils a part of its samples."""

    part = 1.0

    def sample_f(self, wo: Any, u: Any) -> BsdfSample:
        """Draw as Diffuse does, and spoil some weights."""
        sample = super().sample_f(wo, u)
        sample.weight = np.where(u[0] < self.part, f4(np.nan), sample.weight).astype(f4)
        return sample


class SpoiledMatte(Spoiled):
    """The same, so that pixels share what paths find there."""

    view_independent = True


class SpoiledValue(wf.Diffuse):
    """A material whose values are not finite."""

    def f(self, wo: Any, wi: Any) -> Any:
        """Return infinities."""
        return np.full_like(wi, np.inf)


@dataclass(eq=False)
class SpoiledLight(wf.DeltaLight):
    """Parallel light from above, without a finite radiance."""

    toward: np.ndarray  # (3, k) unit direction to the light

    def record(self, center: Any) -> Any:
        """Return itself."""
        return self

    def sample_li(self, point: Any, u: Any) -> wf.LightSample:
        """Spoil the radiance."""
        one = np.ones(point.shape[1], f4)
        toward = np.broadcast_to(self.toward, point.shape)
        return wf.LightSample(toward, toward * f4(np.nan), pdf=one, distance=one * f4(np.inf), cos_light=one)

    def power(self, scene_radius: Any) -> Any:
        """Return any power."""
        return np.ones(1, f4)


def room(material: Any, mirror: Any = None, light: Any = None) -> wf.Scene:
    """Return a mirror that the camera sees, in which it sees a wall of the material."""
    mirror = wf.Rectangle(
        (-5, 0, -5), (0, 0, 10), (10, 0, 0), material=mirror or wf.Mirror(0.9), name="mirror"
    )
    wall = wf.Rectangle((-5, 0, -4), (10, 0, 0), (0, 10, 0), material=material, name="wall")
    ball = wf.Sphere((9, 9, 9), 0.1, material=wf.Diffuse(0.1), name="far")
    camera = scenes.probe((0, 0, -1), (0, 1, 1))
    return wf.Scene([ball, wall, mirror], light or [wf.Environment(1.0)], camera)


def first_fault(scene: wf.Scene, **options: Any) -> str:
    """Return what the error says of the first bad sample."""
    with pytest.raises(wf.RenderError, match="samples were not finite and were dropped; first: ") as caught:
        render(scene, 16, **options)
    assert np.isfinite(caught.value.image.rgb).all()
    return str(caught.value).partition("first: ")[2]


@pytest.mark.parametrize("integrator", ["full", "naive"])
@pytest.mark.parametrize("branches", [1, 3])
def test_a_bsdf_sample_is_named(integrator: str, branches: int) -> None:
    """At the second surface of the path: the mirror in front of it is not blamed."""
    if integrator == "naive" and branches > 1:
        branches = 1  # it has none
    found = first_fault(room(Spoiled(0.5)), integrator=integrator, branches=branches)
    assert found == "pixel 0, sample 0, bounce 1, BSDF sample of material Spoiled of 'wall'"


def test_a_fault_of_a_shared_point_is_named() -> None:
    material = SpoiledMatte(0.5)
    material.part = 0.005
    scene = wf.Scene(
        [
            wf.Rectangle((-5, 0, -5), (0, 0, 10), (10, 0, 0), material=wf.Diffuse(0.9), name="floor"),
            wf.Rectangle((-5, 0, -4), (10, 0, 0), (0, 10, 0), material=material, name="wall"),
        ],
        [wf.Environment(1.0)],
        scenes.probe((0, 0, -3.9), (0, 3, -3.5)),
    )
    found = first_fault(scene, reuse=True)
    assert found.endswith("bounce 1, BSDF sample of material SpoiledMatte of 'wall'")


@pytest.mark.parametrize("integrator", ["full", "direct_mis", "direct_simple"])
def test_a_light_sample_is_named(integrator: str) -> None:
    found = first_fault(room(SpoiledValue(0.5), light=[wf.PointLight((0, 3, 0), 10)]), integrator=integrator)
    assert found == "pixel 0, sample 0, bounce 1, light sample at material SpoiledValue of 'wall'"


def test_a_fault_of_a_light_is_named_by_where_it_shines() -> None:
    scene = room(wf.Diffuse(0.5), light=[SpoiledLight(column((0, 0.6, 0.8)))])
    assert first_fault(scene) == "pixel 0, sample 0, bounce 1, light sample at material Diffuse of 'wall'"


def test_the_first_surface_is_bounce_0() -> None:
    scene = room(wf.Diffuse(0.5), mirror=Spoiled(0.5))
    assert first_fault(scene) == "pixel 0, sample 0, bounce 0, BSDF sample of material Spoiled of 'mirror'"
    box = wf.Mesh([[9, 9, 0], [9, 9, 1], [9, 8, 0]], [[0, 1, 2]])
    scene.shapes += [wf.Instance(box, np.eye(4)), wf.Instance(box, np.diag([2.0, 2, 2, 1]))]
    assert first_fault(scene) == "pixel 0, sample 0, bounce 0, BSDF sample of material Spoiled of a shape"


def test_a_few_are_a_warning_with_the_picture() -> None:
    material = Spoiled(0.5)
    material.part = 3e-5
    with pytest.warns(UserWarning, match=r"first: pixel \d+, sample \d+, bounce 1, BSDF sample of .* 'wall'"):
        image = render(room(material), 2048)
    assert 0 < image.metadata["bad_samples"] <= 1e-4 * image.metadata["samples"]
    assert np.isfinite(image.rgb).all()


def test_an_integrator_of_the_users_own_is_named_by_pixel_and_sample() -> None:
    """Its steps are unknown; a sound path of the built-in steps blames nobody."""

    def spoiled(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
        return np.full((3, len(paths)), np.nan, f4)

    assert first_fault(room(wf.Diffuse(0.5)), integrator=spoiled) == "pixel 0, sample 0"


RARE = 40_009  # one sample of so many is spoiled


def with_rare_faults(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
    """Estimate as "full" does, and spoil a few samples."""
    pixel, sample = paths.pixel.copy(), paths.sample.copy()
    radiance = li_full(scene, paths, sampler, max_bounces)
    radiance[:, (pixel * 64 + sample) % RARE == 3] = np.nan
    return radiance


def with_many_faults(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
    """Return 2 for three samples of four, and infinity for the fourth."""
    return np.full((3, 1), 2, f4) + np.where(paths.sample % 4 == 1, f4(np.inf), f4(0))


def small_room() -> wf.Scene:
    """Return a room that is seen by 40 x 32 pixels."""
    return scenes.everything(size=(40, 32))


def test_the_mean_of_a_pixel_is_that_of_the_samples_that_are_left() -> None:
    """A quarter is dropped, which would darken the picture by a quarter if it counted as black."""
    with pytest.raises(
        wf.RenderError, match="256 of 1024 samples were not finite and were dropped"
    ) as caught:
        render(room(wf.Diffuse(0.5)), 16, integrator=with_many_faults)
    image = caught.value.image
    assert (image.rgb == 2).all()
    assert (image.counts == 12).all()
    assert (image.variance == 0).all()
    assert (image.standard_error == 0).all()
    assert (image.spp, image.metadata["bad_samples"]) == (16, 256)


def test_a_pixel_without_other_samples_is_black() -> None:
    """And its error is not known."""
    with pytest.raises(wf.RenderError) as caught:
        render(room(Spoiled(0.5)), 4)
    image = caught.value.image
    assert not image.rgb.any()
    assert not image.counts.any()
    assert np.isnan(image.standard_error).all()


def test_layers_leave_the_same_samples_out() -> None:
    """All samples see the wall in the mirror, so what is left of them does."""
    material = Spoiled(0.5)
    material.part = 0.25
    with pytest.raises(wf.RenderError) as caught:
        render(room(material), 16, aovs=("alpha", "albedo", "coverage", "direct", "indirect"))
    image = caught.value.image
    assert 0 < image.counts.min() < 16
    assert (image.alpha == 1).all()
    assert (image.coverage["mirror"] == 1).all()
    np.testing.assert_allclose(image.albedo, 0.9, atol=1e-6)
    np.testing.assert_allclose(image.direct + image.indirect, image.rgb, rtol=1e-5)


class SpoiledAlbedo(wf.Diffuse):
    """A material that scatters well, and has no albedo in directions from one side."""

    value = np.nan

    def albedo(self, wo: Any) -> Any:
        """Spoil some."""
        return np.where(wo[0] > 0.1, f4(self.value), f4(0.5)) * np.ones((3, 1), f4)


def wall_of(material: Any) -> wf.Scene:
    """A wall that is seen from above and, where x > 0, from the right."""
    wall = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=material, name="wall")
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=60, size=(16, 16))
    return wf.Scene([wall], [wf.Environment(1)], camera)


@pytest.mark.parametrize(("layer", "value"), [("albedo", np.nan), ("denoising_albedo", -np.inf)])
def test_a_layer_that_is_not_finite_is_dropped_counted_and_named(layer: str, value: float) -> None:
    """With its sample, in the picture, too, whose radiance is finite; the mean is that of the others."""
    material = SpoiledAlbedo(0.5)
    material.value = value
    assert render(wall_of(material), 4).metadata["bad_samples"] == 0  # nobody has asked
    with pytest.raises(wf.RenderError, match="not finite and were dropped") as caught:
        render(wall_of(material), 16, aovs=layer)
    text, image = str(caught.value), caught.value.image
    assert f"bounce 0, AOV {layer!r} at material SpoiledAlbedo of 'wall'" in text
    assert int(text.split()[0]) == image.metadata["bad_samples"] == 16 * 256 - image.counts.sum()
    assert 0 < image.counts.sum() < 16 * 256
    there = image.counts > 0
    assert (image.layers[layer][there] == 0.5).all()
    assert not image.layers[layer][~there].any()
    assert (image.rgb[there] > 0).all()


def test_a_normal_that_is_not_finite_is_dropped() -> None:
    scene = wall_of(wf.Diffuse(0.5))

    class Spoiled(wf.Feature):
        def tilt(self, scene: Any, rays: Any, surface: Any) -> None:
            surface.ns = surface.ns.copy()
            surface.ns[:, surface.point[0] > 1] = np.nan

    with pytest.raises(wf.RenderError, match="were not finite and were dropped") as caught:
        render(scene, 4, aovs="denoising_normal", max_bounces=0, features=Spoiled())
    image = caught.value.image
    assert 0 < image.metadata["bad_samples"] < 4 * 256
    assert np.isfinite(image.denoising_normal).all()
    assert (image.denoising_normal[image.counts > 0] == (0, 0, 1)).all()


@pytest.mark.filterwarnings("ignore:.*were not finite")
@pytest.mark.parametrize(
    "cut", [{"wave_size": 700}, {"workers": 3, "executor": "threads", "wave_size": 1000}]
)
@pytest.mark.slow
def test_dropped_samples_leave_the_bits_to_no_division(cut: dict[str, Any], tmp_path: Path) -> None:
    """Neither waves and workers, nor merged pictures, nor a render that is resumed."""
    options: dict[str, Any] = {
        "integrator": with_rare_faults,
        "max_bounces": 2,
        "aovs": ("alpha", "albedo", "direct"),
        "progress": False,
        "accel": "numpy",
    }
    whole = wf.render(small_room(), 64, **options)
    assert whole.metadata["bad_samples"] == 3
    assert (whole.counts == 63).sum() == 3
    path = tmp_path / "render.wfck"
    wf.render(small_room(), 32, checkpoint=path, **options, **cut)
    parts = [wf.render(small_room(), samples=range(*each), **options) for each in ((0, 20), (20, 64))]
    others = [
        wf.render(small_room(), 64, **options, **cut),
        wf.render(small_room(), 64, checkpoint=path, **options),
        wf.Image.load(path),
        parts[0].merge(parts[1]),
        parts[1].merge(parts[0]),
    ]
    for image in others:
        assert image.rgb.tobytes() == whole.rgb.tobytes()
        assert (image.counts == whole.counts).all()
        assert image.metadata["bad_samples"] == 3
        for name in options["aovs"]:
            assert image.layers[name].tobytes() == whole.layers[name].tobytes()

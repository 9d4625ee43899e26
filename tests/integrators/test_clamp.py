"""`clamp=`: what it limits, what it says about the light that it removed, and that its bits stay."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import cornell_box
from scipy import stats
from significance import ALPHA

import wavefront as wf

pytestmark = pytest.mark.filterwarnings("ignore:clamp=")


def caustic(size: int = 24) -> wf.Scene:
    """A small bright lamp, and a glass ball and a mirror that focus its light on a floor."""
    return wf.Scene(
        [
            wf.Rectangle((-3, 0, -3), (0, 0, 6), (6, 0, 0), material=wf.Diffuse((0.7, 0.6, 0.5))),
            wf.Sphere((-0.4, 0.5, 0.3), 0.5, material=wf.Dielectric(1.5)),
            wf.Rectangle((-1, 0, -1), (2, 0, 0), (0, 1.5, 0), material=wf.Mirror(0.9)),
            wf.Sphere((0.8, 1.5, 0.6), 0.15, emission=(60, 50, 40)),
        ],
        camera=wf.Camera.look_at((0, 1.6, 4), (0, 0.4, 0), fov=40, size=(size, size)),
    )


def render(clamp: float | None, spp: int = 16, **settings: Any) -> wf.Image:
    """Render the scene."""
    return wf.render(caustic(), spp, clamp=clamp, lighting=None, workers=1, **settings)


def test_the_layer_holds_what_was_removed() -> None:
    """It and the picture together are the picture without a clamp; direct light is that of before."""
    plain, dark = render(None, aovs="direct"), render(0.5, aovs=("direct", "indirect", "light_groups"))
    assert dark.clamped.max() > 1
    assert np.allclose(dark.rgb + dark.clamped, plain.rgb, rtol=1e-5, atol=1e-6)
    assert np.array_equal(dark.direct, plain.direct)
    assert np.allclose(dark.direct + dark.indirect, dark.rgb, rtol=1e-5, atol=1e-6)
    assert np.allclose(sum(dark.light_groups.values()), dark.rgb, rtol=1e-5, atol=1e-6)
    assert dark.clamped.shape == dark.errors["clamped"].shape == dark.rgb.shape


def test_contributions_are_limited() -> None:
    """A sample of three bounces gets indirect light four times at most, twice at each of the last two."""
    bright, dark = (render(c, spp=1, size=(64, 64), max_bounces=3, aovs="indirect") for c in (None, 0.25))
    assert bright.indirect.mean(2).max() > 5
    assert 0.25 * (1 - 1e-5) < dark.indirect.mean(2).max() <= 1 + 1e-5


def test_colors_stay() -> None:
    room = wf.Scene(
        [wf.Sphere((0, 0, 0), 1, material=wf.Diffuse((0.8, 0.4, 0.2)))],
        wf.Environment((4, 2, 1)),
        wf.Camera.look_at((0, 0, 0.5), (0, 0, 0), size=(8, 8)),
    )
    room.shapes[0].material = wf.Material(wf.Diffuse(0.5), emission=(4, 2, 1))
    dark = wf.render(room, 4, clamp=0.1, max_bounces=3)
    assert np.allclose(dark.clamped / dark.clamped[..., :1], [1, 0.5, 0.25], rtol=1e-4)
    assert np.allclose(dark.rgb / dark.rgb[..., :1], [1, 0.5, 0.25], rtol=1e-4)


def test_metadata_say_how_much_light_is_missing() -> None:
    """As a part of all light; the setting is beside it, and a warning where it is much."""
    with pytest.warns(UserWarning, match=r"clamp=0.5 removed \d+\.\d % of the light, so the picture is too"):
        dark = render(0.5)
    lost, left = dark.clamped.mean(dtype=np.float64), dark.rgb.mean(dtype=np.float64)
    assert dark.metadata["clamped"] == pytest.approx(lost / (lost + left), rel=1e-6)
    assert dark.metadata["clamp"] == 0.5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        slight = render(1000.0)
    assert slight.metadata["clamped"] == 0
    assert np.array_equal(slight.rgb, render(None).rgb)
    assert "clamped" not in render(None).metadata


def test_the_bits_do_not_depend_on_workers_or_waves() -> None:
    whole = render(0.3)
    settings = {"wave_size": 170, "workers": 2, "executor": "threads"}
    other = wf.render(caustic(), 16, clamp=0.3, lighting=None, **settings)
    assert np.array_equal(other.rgb, whole.rgb)
    assert np.array_equal(other.clamped, whole.clamped)
    assert other.metadata["clamped"] == whole.metadata["clamped"]


def test_merged_and_resumed_pictures_know_the_light_that_is_missing(tmp_path: Path) -> None:
    whole = render(0.3)
    parts = [wf.render(caustic(), clamp=0.3, lighting=None, samples=r) for r in (range(6), range(6, 16))]
    parts[0].save(tmp_path / "part.npz")
    merged = wf.Image.load(tmp_path / "part.npz").merge(parts[1])
    assert np.array_equal(merged.rgb, whole.rgb)
    assert np.array_equal(merged.clamped, whole.clamped)
    assert merged.metadata["clamped"] == whole.metadata["clamped"]
    path = tmp_path / "picture.wfck"
    render(0.3, spp=4, checkpoint=path)
    assert np.array_equal(render(0.3, checkpoint=path).clamped, whole.clamped)
    with pytest.raises(wf.SceneError, match=r"clamp was 0.3 and is 0.4"):
        render(0.4, checkpoint=path)


def test_branches_are_clamped_like_samples_of_their_own() -> None:
    box = cornell_box((16, 16))
    one, four = (
        wf.render(box, spp, branches=ways, seed=ways, clamp=0.1, workers=1, executor="threads")
        for spp, ways in ((64, 1), (32, 4))
    )
    assert one.clamped.mean() > 0.005
    difference = one.clamped.sum(dtype=np.float64) - four.clamped.sum(dtype=np.float64)
    error = np.sqrt(sum((each.errors["clamped"].astype(np.float64) ** 2).sum() for each in (one, four)))
    assert abs(difference) / (3**0.5 * error) < stats.norm.isf(ALPHA / 2)  # channels share their noise


def test_what_is_not_finite_is_not_hidden() -> None:
    """An infinite value does not become the clamp."""

    class Broken(wf.Bsdf):
        """Diffuse, but infinite in some directions."""

        def f(self, wo: Any, wi: Any) -> Any:
            """Return the values."""
            return np.broadcast_to(np.where(wi[0] > 0.9, np.float32(np.inf), np.float32(0.2)), wi.shape)

    ball = wf.Sphere((0, 0, 0), 1, material=Broken())
    floor = wf.Rectangle((-3, -1, -3), (0, 0, 6), (6, 0, 0))
    with pytest.raises(wf.RenderError, match="not finite"):
        wf.render(wf.Scene([ball, floor], wf.Environment(1)), 4, size=(24, 24), clamp=1)


def test_an_integrator_must_add_light_by_the_functions_that_clamp() -> None:

    def constant(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
        return np.ones((3, len(paths)), np.float32)

    with pytest.raises(wf.SceneError, match="cannot give the AOV 'clamped'"):
        wf.render(caustic(), 1, lighting=None, clamp=1, integrator=constant)


@pytest.mark.parametrize("value", [0, -1, np.nan, "much"])
def test_other_values_are_refused(value: Any) -> None:
    with pytest.raises(wf.SceneError, match=r"^clamp (is|must)"):
        wf.render("no such file", clamp=value)

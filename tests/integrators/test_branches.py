"""Paths that go on in several ways: the same means, less noise, the same bits however they are cut."""

import numpy as np
import pytest
import scenes
from significance import assert_same_images, measure, render, repeat

import wavefront as wf


def shade_and_sun(size: tuple[int, int] = (8, 8)) -> wf.Scene:
    """A corner in the shade: all of its light comes from a sunlit wall."""
    shapes = [
        scenes.floor(),
        wf.Rectangle((-2, 0, -1), (4, 0, 0), (0, 3, 0), material=wf.Diffuse(0.7)),
        wf.Rectangle((-2, 1.5, 0.5), (4, 0, 0), (0, 0, -0.8), material=wf.Diffuse(0.7)),
    ]
    sun = wf.DirectionalLight((0, -1, -1.5), 3.0)
    return wf.Scene(shapes, [sun], wf.Camera.look_at((0, 1, 2), (0, 0, -0.4), fov=30, size=size))


@pytest.mark.parametrize(
    ("sampler", "branches"),
    [("sobol", 2), ("independent", 5), pytest.param("bluenoise", 5, marks=pytest.mark.slow)],
)
@pytest.mark.first(1)
def test_branches_keep_the_mean(sampler: str, branches: int) -> None:
    options = {"max_bounces": 8, "sampler": sampler}
    usual = repeat(scenes.room(), 12, 10, **options)
    other = repeat(scenes.room(), 6, 10, branches=branches, first_seed=100, **options)
    assert_same_images(usual, other, 0.01)


def test_light_of_a_furnace() -> None:
    """Emission met by the branches counts once, however many there are."""
    for bounces, exact in ((0, 1), (1, 1.5), (3, 1.875)):
        image = render(scenes.furnace(0.5), 32, max_bounces=bounces, branches=4)
        assert image.rgb.mean() == pytest.approx(exact, rel=0.01)


def test_no_light_is_lost_or_won() -> None:
    """On a white ball in a white sky each branch brings 1, and so does their sum."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(1.0))
    scene = wf.Scene([ball], [wf.Environment(1.0)], wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(8, 8)))
    for branches in (2, 3, 7):
        assert render(scene, 2, branches=branches).rgb == pytest.approx(1, rel=1e-5)


def test_direct_light_is_as_without() -> None:
    """Of a light without size nothing is left to the branches, and the numbers are the same."""
    scene = wf.Scene([scenes.floor()], [wf.PointLight((0, 2, 0), 1)], scenes.probe(scenes.HERE, scenes.EYE))
    alone, several = (render(scene, 8, max_bounces=2, branches=n).rgb for n in (1, 3))
    assert alone.tobytes() == several.tobytes()
    assert measure(scene, 8, branches=3).value > 0


def test_branches_take_noise_off_indirect_light() -> None:
    """Four per path leave at most a third of the variance in a corner that has no other light."""
    variance = [repeat(shade_and_sun(), 16, branches=n).var(0, ddof=1).mean() for n in (1, 4)]
    assert variance[1] < variance[0] / 3


@pytest.mark.parametrize("cut", [{"wave_size": 11}, {"wave_size": 64, "workers": 3}])
def test_waves_and_workers_change_no_bit(cut: dict) -> None:
    scene = scenes.everything((7, 5))
    whole = render(scene, 3, branches=3)
    assert render(scene, 3, branches=3, **cut).rgb.tobytes() == whole.rgb.tobytes()
    assert whole.metadata["branches"] == 3


def test_samples_do_not_depend_on_how_many_follow() -> None:
    """The mean of 8 samples is that of the first 4 and the next 4; each is as good by itself."""
    scene, cut = shade_and_sun(), {"branches": 2, "sampler": "independent"}
    short, long = (render(scene, spp, **cut).rgb.astype(float) for spp in (4, 8))
    rest = 2 * long - short
    assert (rest > -1e-6).all()
    assert np.abs(rest - short).max() > 1e-3
    assert rest.mean() == pytest.approx(short.mean(), rel=0.1)


def test_noise_is_known_with_branches_too() -> None:
    """The standard error estimated from one picture is the scatter of several: see test_error_estimate.py."""
    images = [render(shade_and_sun(), 64, branches=3, seed=k) for k in range(16)]
    scatter = np.var([image.rgb for image in images], 0, ddof=1).mean()
    estimate = np.mean([image.standard_error**2 for image in images])
    assert 0.9 < estimate / scatter < 1.4**2


def test_each_branch_has_a_light_sample() -> None:
    """Direct light alone has a quarter of the variance with four branches, where nothing else has noise."""
    panel = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), material=wf.Diffuse(0), emission=2)
    floor = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.5))
    post = wf.Sphere((0, 0.6, 0), 0.4, material=wf.Diffuse(0.5))
    camera = wf.Camera.look_at((1, 0.5, 1.5), (0.5, 0, 0.6), fov=8, size=(8, 8))  # no edge in sight
    scene = wf.Scene([panel, floor, post], camera=camera)
    how = {"max_bounces": 1, "sampler": "independent", "reuse": False}
    one, four = (repeat(scene, 4, branches=branches, **how) for branches in (1, 4))
    assert four.var(0).mean() < 0.3 * one.var(0).mean()
    assert_same_images(one, four, max_error=0.02)


def test_branches_choose_other_lights() -> None:
    """Four branches below four lights of the same power take one each: nothing is left of the noise."""
    floor = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.5))
    lights = [wf.PointLight((x, 1, z), 1) for x in (-1, 0.4) for z in (-0.6, 0.8)]
    camera = wf.Camera.look_at((1, 0.5, 1.5), (0.5, 0, 0.6), fov=0.01, size=(4, 4))
    how = {"max_bounces": 1, "light_sampler": "uniform", "reuse": False}
    one, four = (repeat(wf.Scene([floor], lights, camera), 1, branches=n, **how) for n in (1, 4))
    assert four.std(0).max() < 1e-3 * four.mean() < 1e-2 * one.std(0).mean()

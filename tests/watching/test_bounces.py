"""Light by how often it has been scattered, and the curves of BSDFs."""

import numpy as np
import pytest

import wavefront as wf

FURNACE = [wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5), emission=1)]
INSIDE = wf.Camera.look_at((0, 0, 0), (0, 0, -1), size=(8, 8))


def test_a_floor_below_a_white_sky_scatters_once():
    floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))
    scene = wf.Scene(
        [floor], [wf.Environment(1)], camera=wf.Camera.look_at((0, 2, 0.1), (0, 0, 0), size=(8, 8))
    )
    light = wf.bounces(scene, spp=16, most=2, progress=False)
    np.testing.assert_array_equal(light[0], 0)
    np.testing.assert_allclose(light[1], 0.5, rtol=1e-5)
    np.testing.assert_array_equal(light[2], 0)


def test_the_sum_is_the_picture():
    floor = wf.Rectangle((-4, -1, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.6))
    panel = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=(9, 8, 6))
    scene = [wf.Sphere((0, 0, 0), 1), floor, panel]
    light = wf.bounces(scene, spp=4, most=3, size=(12, 12), progress=False)
    image = wf.render(
        scene, 4, size=(12, 12), max_bounces=3, branches=1, reuse=False, guide=False, progress=False
    )
    np.testing.assert_allclose(light.sum(0), image.rgb, atol=1e-5)
    assert (light >= -1e-5).all()
    assert light[3].any()


@pytest.mark.parametrize(
    "given", [{"max_bounces": 3}, {"noise": 0.1}, {"branches": 2}, {"most": -1}, {"most": 0.5}]
)
def test_what_the_pictures_cannot_share(given):
    with pytest.raises(wf.SceneError, match=f"bounces: {next(iter(given))} is"):
        wf.bounces(FURNACE, spp=1, camera=INSIDE, **given)


def test_no_samples_are_told_where_direct_light_is():
    with pytest.raises(wf.SceneError, match=r'spp is 0; it must be .*integrator="direct_mis"'):
        wf.render(FURNACE, 0, camera=INSIDE)


def test_curves_of_a_bsdf():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    axes = wf.Diffuse(0.5).plot((0.6, 0, 0.8))
    curves = {line.get_label(): line.get_data() for line in axes.get_lines()}
    angle, f = curves["f"]
    above = np.cos(angle) > 0
    np.testing.assert_allclose(f[above], 0.5 / np.pi, rtol=1e-5)
    np.testing.assert_array_equal(f[~above], 0)
    np.testing.assert_allclose(curves["pdf"][1][above], np.cos(angle[above]) / np.pi, atol=1e-5)
    assert curves["wo"][0][0] == pytest.approx(np.arctan2(0.6, 0.8))
    rough = wf.Conductor.named("gold", roughness=0.2).plot((0.6, 0, 0.8))
    angle, f = next(line for line in rough.get_lines() if line.get_label() == "f").get_data()
    assert angle[f.argmax()] == pytest.approx(2 * np.pi - np.arctan2(0.6, 0.8), abs=0.2)  # the mirror image
    assert "delta" in wf.Mirror().plot().get_title()
    pyplot.close("all")


@pytest.mark.parametrize(
    ("bsdf", "wo", "message"),
    [
        (wf.Diffuse(0.5), (0, 0, -1), "third component"),
        (wf.Diffuse(0.5), (0, 1), "wo"),
        (wf.Diffuse(wf.Texture(np.ones((2, 2, 3)))), (0, 0, 1), "reflectance of Diffuse vary"),
    ],
)
def test_what_has_no_curve(bsdf, wo, message):
    pytest.importorskip("matplotlib")
    with pytest.raises(wf.SceneError, match=message):
        bsdf.plot(wo)

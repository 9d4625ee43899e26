"""Shadow catchers: the camera sees the background through them, less the light that objects block."""

import numpy as np
import pytest
from inside import installed

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 4, 4), (0, 0, 0), fov=30, size=(24, 18))
BLOCK = wf.Rectangle((-0.5, 0.6, -0.5), (0, 0, 1), (1, 0, 0), name="block")


def floor(material) -> wf.Mesh:
    """Return a level square that fills the view."""
    return wf.Rectangle((-6, 0, -6), (0, 0, 12), (12, 0, 0), material=material, name="floor")


def alpha_of(light, spp=64, **settings) -> wf.Image:
    scene = wf.Scene([floor(wf.ShadowCatcher()), BLOCK], light, CAMERA)
    return wf.render(scene, spp=spp, background="transparent", **settings)


def test_the_shadow_of_parallel_light_is_opaque_and_black() -> None:
    """At each pixel whose center ray meets the floor clearly inside or outside of the block's shadow."""
    image = alpha_of(wf.DirectionalLight((1.5, -1, 0), 3), spp=16, aovs=("position", "shape_id"))
    x, _, z = image.position.transpose(2, 0, 1)
    at_block = np.stack([x - 0.9, z])  # where the light crosses the height of the block
    outside = np.abs(at_block).max(0) - 0.5
    on_floor = image.shape_id == 0
    away = [np.roll(on_floor, shift, axis) for shift in (1, -1) for axis in (0, 1)]
    inner = on_floor & np.logical_and.reduce(away)
    umbra, lit = inner & (outside < -0.25), inner & (outside > 0.25)
    assert umbra.sum() > 3
    assert lit.sum() > 100
    assert (image.alpha[umbra] == 1).all()
    assert (image.rgb[umbra] == 0).all()
    assert (image.alpha[lit] == 0).all()
    assert (image.rgb[lit] == 0).all()


SKY = np.full((32, 64, 3), 0.3)
SKY[4:9, 20:30] = 12  # a window
PANEL = wf.Rectangle((-4, 2.5, -4), (8, 0, 0), (0, 0, 8), emission=4, name="panel")


@pytest.mark.parametrize("light", ["environment", "window", "panel", "both"])
def test_the_opacity_is_the_part_of_the_direct_light_that_is_blocked(light: str) -> None:
    """Against pictures of a diffuse floor with all that is in the way, and of each light without it."""
    lights = {"environment": [wf.Environment(1)], "panel": []}.get(light, [wf.Environment(SKY)])
    panel = [PANEL] if light in ("panel", "both") else []
    camera = wf.Camera.look_at((0.9, 0.5, 0), (0.2, 0, 0), fov=1, size=(1, 1))  # under the block
    settings = {"camera": camera, "max_bounces": 1, "integrator": "full"}
    base = floor(wf.Diffuse(0.5))
    shadowed = wf.render(wf.Scene([base, *panel, BLOCK], lights), spp=4096, **settings)
    alone = [wf.Scene([base], each) for each in lights] + [wf.Scene([base, each]) for each in panel]
    free = sum(float(wf.render(each, spp=4096, **settings).rgb.mean()) for each in alone)
    expected = 1 - float(shadowed.rgb.mean()) / free
    scene = wf.Scene([floor(wf.ShadowCatcher()), *panel, BLOCK], lights)
    found = wf.render(scene, spp=4096, background="transparent", **settings)
    assert 0.05 < expected < 0.99
    error = float(found.errors["alpha"].max())
    assert error < 0.01
    assert float(found.alpha[0, 0]) == pytest.approx(expected, abs=0.03 + 4 * error)


def test_what_is_behind_a_catcher_is_seen_through_it() -> None:
    black = wf.Diffuse(0)
    wall = wf.Rectangle((-9, -3, -9), (0, 0, 18), (18, 0, 0), material=black, emission=(0.25, 0.5, 0.75))
    scene = wf.Scene([floor(wf.ShadowCatcher()), wall], wf.DirectionalLight((0, -1, 0), 1), CAMERA)
    assert (wf.render(scene, spp=4).rgb == (0.25, 0.5, 0.75)).all()


@pytest.mark.parametrize(
    "accel", ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]
)
def test_catchers_may_be_instances_with_a_material_of_their_own(accel) -> None:
    """Embree copies such small instances to meshes of their own."""
    plain = floor(wf.Diffuse(0.5))
    lower = np.eye(4)
    lower[1, 3] = -1
    shapes = [
        wf.Instance(plain, np.eye(4), material=wf.ShadowCatcher(), name="catcher"),
        wf.Instance(plain, lower, name="floor"),
    ]
    light = wf.DirectionalLight((0, -1, 0), 1)
    settings = {"spp": 4, "background": "transparent", "accel": accel}
    image = wf.render(wf.Scene(shapes, light, CAMERA), **settings)
    assert (image.alpha == 1).all()  # the floor below, which is dark under the catcher
    only = wf.render(wf.Scene(shapes[:1], light, CAMERA), **settings)
    assert (only.alpha == 0).all()


def test_a_composite_over_a_color_is_the_picture_with_that_background() -> None:
    clear = alpha_of(wf.Environment(1), spp=16)
    scene = wf.Scene([floor(wf.ShadowCatcher()), BLOCK], wf.Environment(1), CAMERA)
    colored = wf.render(scene, spp=16, background=(0.2, 0.5, 1))
    over = clear.rgb + (1 - clear.alpha[..., None]) * np.array((0.2, 0.5, 1), np.float32)
    assert over == pytest.approx(colored.rgb, abs=1e-6)


def test_pictures_with_catchers_are_the_same_bits_for_any_division() -> None:
    first = alpha_of(wf.Environment(SKY), spp=2, accel="numpy")
    for settings in ({"workers": 2, "executor": "threads"}, {"wave_size": 100}):
        other = alpha_of(wf.Environment(SKY), spp=2, accel="numpy", **settings)
        assert first.rgb.tobytes() == other.rgb.tobytes()
        assert first.alpha.tobytes() == other.alpha.tobytes()

"""Surfaces that the camera does not see: it sees what is behind them, and all else sees them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from inside import Unseen, compile_scene, make_accelerator
from scenes import ALL

import wavefront as wf

SIZE = (12, 12)
UNSEEN = wf.Material(wf.Diffuse(0.3), visible_to_camera=False)
GOLD = wf.Material(wf.Conductor.named("gold", roughness=0.3), name="gold")


def wall(material: Any = None) -> wf.Mesh:
    """A square that faces +z."""
    material = wf.Diffuse((0.5, 0.4, 0.3)) if material is None else material
    return wf.Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0), material=material, name="wall")


def lamp(**parameters: Any) -> wf.Sphere:
    """A ball that shines, before the wall."""
    return wf.Sphere((0, 0, 1), 0.3, **{"material": UNSEEN, "emission": 5.0, "name": "lamp"} | parameters)


def behind(distance: float) -> wf.Camera:
    """A camera that sees the same square meter of the wall from any distance."""
    fov = 2 * np.degrees(np.arctan(0.5 / distance))
    return wf.Camera.look_at((0, 0, distance), (0, 0, 0), fov=fov, size=SIZE)


def pictures(*shapes: Any, spp: int = 4, **settings: Any) -> list[Any]:
    """Return the picture from behind the lamp, and that from between it and the wall."""
    return [wf.render([*shapes], spp=spp, camera=behind(z), **settings) for z in (3.0, 0.5)]


@pytest.mark.parametrize(
    "settings",
    [
        *({"integrator": name} for name in ALL),
        {"branches": 4},
        {"reuse": True},
        pytest.param({"guide": True, "branches": 1, "reuse": False}, marks=pytest.mark.slow),
    ],
    ids=str,
)
@pytest.mark.usefixtures("short_training")
def test_the_camera_sees_what_is_behind(settings: dict[str, Any]) -> None:
    """Both cameras see the same points of a matte wall, so the pictures have the same numbers."""
    through, free = pictures(wall(), lamp(), **settings)
    assert free.rgb.mean() > 0.01
    np.testing.assert_allclose(through.rgb, free.rgb, 2e-3, 1e-4)


@pytest.mark.parametrize(
    "shape",
    [
        wf.Rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0), material=UNSEEN, emission=3.0, two_sided=True),
        wf.Instance(
            wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), np.eye(4) + np.eye(4, k=3), material=UNSEEN
        ),
    ],
    ids=["mesh", "instance"],
)
def test_shapes_of_all_kinds(shape: Any) -> None:
    through, free = pictures(wall(), shape, wf.Environment(0.5))
    np.testing.assert_allclose(through.rgb, free.rgb, 2e-3, 1e-4)


def test_several_surfaces_behind_each_other() -> None:
    lamps = [lamp(), wf.Sphere((0, 0, 1.8), 0.3, material=UNSEEN), wf.Sphere((0, 0, 1), 0.1, material=UNSEEN)]
    through, free = pictures(wall(), *lamps)
    np.testing.assert_allclose(through.rgb, free.rgb, 2e-3, 1e-4)


def test_it_is_there_for_all_but_the_camera() -> None:
    camera = wf.Camera.look_at((0, 0, 3), (0, 0, 0), fov=5, size=(4, 4))
    mirror = wall(wf.Mirror(1.0))
    assert wf.render([mirror, lamp()], spp=1, camera=camera).rgb.min() == 5
    shade = lamp(emission=None, material=wf.Material(wf.Diffuse(0), visible_to_camera=False))
    sun = wf.DirectionalLight((0, 0, -1), 1)
    assert wf.render([wall(), shade, sun], spp=1, camera=camera, max_bounces=1).rgb.max() == 0


def test_aovs_are_those_of_what_is_behind() -> None:
    names = ["depth", "shape_id", "material_id", "normal", "albedo", "direct", "boxes"]
    image = wf.render([wall(GOLD), lamp()], spp=2, camera=behind(3.0), aovs=names)
    plain = wf.render([wall(GOLD), wf.Environment(1)], spp=2, camera=behind(3.0), aovs=names)
    for name in ("depth", "shape_id", "material_id", "normal", "albedo"):
        np.testing.assert_allclose(getattr(image, name), getattr(plain, name), 1e-3, 1e-3)
    assert image.boxes == plain.boxes
    assert image.direct.max() < 5


def test_alpha_is_0_where_nothing_is_behind() -> None:
    image = wf.render([lamp()], spp=2, camera=behind(3.0), background="transparent")
    assert image.alpha.max() == image.rgb.max() == 0


@pytest.mark.parametrize("scattering", [0.0, 1.0], ids=["absorbs", "beside fog"])
def test_media_before_it_absorb(scattering: float) -> None:
    glass = wf.Material(wf.NullSurface(), interior=wf.Medium(absorption=1))
    fog = wf.Material(wf.NullSurface(), interior=wf.Medium(scattering=scattering))
    slab, far = wf.Box((0, 0, 2.1), (4, 4, 1), material=glass), wf.Box((0, 0, -3), 1, material=fog)
    through, free = pictures(wall(), lamp(), slab, far)
    middle = slice(5, 7)  # where rays are perpendicular to the slab
    np.testing.assert_allclose(through.rgb[middle, middle], free.rgb[middle, middle] * np.exp(-1), 2e-3)


def test_paths_from_lights_reach_the_camera_through_it() -> None:
    glass, point = wf.Sphere((0, 0, 0.8), 0.4, material="glass"), wf.PointLight((0, 0, 2.5), 10)
    camera = wf.Camera.look_at((2, 0, 1), (0.1, 0, 0), fov=20, size=(16, 16))
    settings: Any = {"spp": 64, "camera": camera, "caustics": True}
    black = wf.Material(wf.Diffuse(0), visible_to_camera=False)
    lid = wf.Rectangle((1, -0.5, 0.1), (0, 1, 0), (0.1, 0, 1.2), material=black)
    free = wf.render([wall(), glass, point], **settings).rgb.mean()
    assert free > 2 * wf.render([wall(), glass, point], **settings | {"caustics": False}).rgb.mean()
    assert wf.render([wall(), glass, point, lid], **settings).rgb.mean() == pytest.approx(free, 0.05)


@pytest.mark.filterwarnings("ignore:the picture is black")
def test_paths_from_lights_do_not_show_it() -> None:
    unseen = wall(wf.Material(wf.Diffuse(0.8), visible_to_camera=False))
    glass, point = wf.Sphere((0, 0, 0.8), 0.4, material="glass"), wf.PointLight((0, 0, 2.5), 10)
    camera = wf.Camera.look_at((1, 0, 0.4), (0.9, 0, 0), fov=60, size=(8, 8))
    image = wf.render([unseen, glass, point], spp=16, camera=camera, caustics=True)
    assert image.rgb.max() == 0


def test_scenes_without_it_have_no_table_of_it() -> None:
    for material, known in (("clay", False), (UNSEEN, True)):
        scene = wf.Scene(wall(material))
        compiled = compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))
        assert (compiled.program.find(Unseen) is not None) == known

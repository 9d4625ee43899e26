"""Cameras and lights of trimesh scenes."""

import warnings

import numpy as np
import pytest
import trimesh
from inside import from_trimesh
from trimesh.scene import cameras, lighting
from trimesh.transformations import rotation_matrix, translation_matrix

import wavefront as wf

UP = rotation_matrix(np.pi / 2, (1, 0, 0))  # -z becomes y


@pytest.fixture
def held():
    return trimesh.Scene(trimesh.creation.box())


def place(held, light, matrix):
    """Add a light to a trimesh scene."""
    held.lights = [*(getattr(held, "_lights", None) or []), light]
    held.graph.update(frame_to=light.name, matrix=matrix)


def white(intensity, **options):
    return {"color": [255, 255, 255, 255], "intensity": intensity, "name": "l", **options}


def test_the_resolution_is_the_size_of_the_picture(held):
    held.camera = cameras.Camera(resolution=(320, 240), fov=(60, 45))
    held.camera_transform = translation_matrix((0, 0, 5))
    camera = from_trimesh(held).camera
    assert camera.size == (320, 240)
    assert camera.fov == pytest.approx(45)
    assert camera.origin == pytest.approx([0, 0, 5])
    assert camera.projection.pixel_aspect == 1  # trimesh's own rule: angles and sides are alike


@pytest.mark.parametrize("focal", [(300, 300), (300, 200)])
def test_a_camera_sees_points_where_trimesh_says(held, focal):
    """By focal lengths: the rays are those of `to_rays`, through the middles of pixels."""
    held.camera = cameras.Camera(resolution=(64, 48), focal=focal)
    held.camera_transform = np.eye(4)
    camera = from_trimesh(held).camera
    x, y = np.float32([10.5, 40.5]), np.float32([7.5, 20.5])
    _, direction = camera.rays(x, y, np.zeros(3))
    seen = direction[:2] / -direction[2]
    expected = np.stack([(x - 32) / focal[0], (24 - y) / focal[1]])
    assert seen == pytest.approx(expected, rel=1e-5)


def test_a_camera_without_a_transform_sees_the_whole_scene(held):
    held.camera = cameras.Camera(resolution=(40, 30), fov=(60, 45))
    with pytest.warns(UserWarning, match="trimesh object: its camera has no transform; it is placed to see"):
        scene = from_trimesh(held)
    framing = scene.framing_camera(fov=45, size=(40, 30))
    assert np.array_equal(scene.camera.origin, framing.origin)
    assert np.array_equal(scene.camera.rotation, framing.rotation)
    assert (scene.camera.fov, scene.camera.size) == (45, (40, 30))


def test_a_wrong_camera_is_named(held):
    held.camera = cameras.Camera(resolution=(100_000, 240), fov=(60, 45))
    held.camera_transform = np.eye(4)
    with pytest.raises(wf.SceneError, match=r"trimesh object: its camera: size is \(100000, 240\)"):
        from_trimesh(held)


def test_point_lights(held):
    """Their colors are linear codes of 8 bits."""
    light = lighting.PointLight(name="l", color=[255, 51, 0, 255], intensity=50.0)
    place(held, light, translation_matrix((2, 3, 4)))
    (found,) = from_trimesh(held).lights
    assert isinstance(found, wf.PointLight)
    assert found.position.tolist() == [2, 3, 4]
    assert found.intensity.ravel() == pytest.approx([50, 10, 0])


def test_directional_lights(held):
    place(held, lighting.DirectionalLight(**white(3)), UP)
    (found,) = from_trimesh(held).lights
    assert isinstance(found, wf.DirectionalLight)
    assert found.direction == pytest.approx([0, 1, 0], abs=1e-12)
    assert found.irradiance.ravel() == pytest.approx([3, 3, 3])


@pytest.mark.parametrize("inner", [0.0, 0.3, 0.6])
def test_spot_lights(held, inner):
    light = lighting.SpotLight(innerConeAngle=inner, outerConeAngle=0.6, **white(8))
    place(held, light, translation_matrix((0, -5, 0)) @ UP)
    (found,) = from_trimesh(held).lights
    assert isinstance(found, wf.SpotLight)
    assert found.position == pytest.approx([0, -5, 0])
    assert found.direction == pytest.approx([0, 1, 0], abs=1e-12)
    assert (found.angle, found.blend) == pytest.approx((np.degrees(1.2), 1 - inner / 0.6))


def test_several_lights_and_their_order(held):
    for i in range(3):
        place(held, lighting.PointLight(**white(i, name=f"l{i}")), translation_matrix((i, 2, 0)))
    assert [light.position[0] for light in from_trimesh(held).lights] == [0, 1, 2]


def test_a_scene_without_lights_has_none_and_gets_none(held):
    """Trimesh makes lights when it is asked for them."""
    assert from_trimesh(held).lights == []
    assert getattr(held, "_lights", None) is None


def test_lights_that_trimesh_made_are_left_out_and_named(held):
    """As it does for its viewer: two gray points, weak or strong by the size of the scene."""
    assert len(held.lights) == 2
    with pytest.warns(UserWarning, match="not honored: the lights that trimesh made for its viewer"):
        assert from_trimesh(held).lights == []
    place(held, lighting.PointLight(**white(1)), np.eye(4))
    assert len(from_trimesh(held).lights) == 3  # somebody went on from them


def test_what_lights_have_besides_is_named(held):
    place(held, lighting.PointLight(**white(1, radius=5.0)), np.eye(4))
    with pytest.warns(UserWarning, match="trimesh object: light 'l': not honored: radius"):
        assert len(from_trimesh(held).lights) == 1


def test_a_light_without_a_transform_stands_at_the_origin(held):
    held.lights = [lighting.PointLight(**white(1))]
    with pytest.warns(UserWarning, match="light 'l' has no transform; it stands at the origin"):
        (found,) = from_trimesh(held).lights
    assert found.position.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("light", "message"),
    [
        (lighting.PointLight(**white(np.nan)), r"light 'l': intensity is \[nan\]; it must be 1 finite"),
        (lighting.Light, r"light .* is a ABCMeta; it must be one of PointLight, DirectionalLight, SpotLight"),
    ],
)
def test_wrong_lights_are_named(held, light, message):
    held.lights = [light]
    held.graph.update(frame_to="l", matrix=np.eye(4))
    with pytest.raises(wf.SceneError, match=message):
        from_trimesh(held)


@pytest.mark.parametrize(
    ("light", "message"),
    [
        (lighting.PointLight(**white(-1)), r"light 'l': intensity is -1; clamped to 0"),
        (lighting.SpotLight(outerConeAngle=0.0, **white(1)), r"light 'l': outerConeAngle is 0; clamped to"),
    ],
)
def test_numbers_of_lights_are_clamped(held, light, message):
    held.lights = [light]
    held.graph.update(frame_to="l", matrix=np.eye(4))
    with pytest.warns(UserWarning, match=message):
        from_trimesh(held)


def test_a_lit_scene_needs_no_warning(held):
    light = lighting.PointLight(**white(100))
    place(held, light, translation_matrix((0, 0, 5)))
    held.camera = cameras.Camera(resolution=(4, 4), fov=(10, 10))
    held.camera_transform = translation_matrix((0, 0, 5))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = wf.render(held, spp=4, max_bounces=1, workers=1, progress=False)
    # albedo/π · I/d², at a distance of 4.5
    assert image.rgb.shape == (4, 4, 3)
    albedo = from_trimesh(held).shapes[0].material.bsdf.reflectance.mean()
    assert image.rgb.mean() == pytest.approx(albedo / np.pi * 100 / 4.5**2, rel=0.02)

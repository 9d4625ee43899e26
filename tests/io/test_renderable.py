"""What render() is given: meshes of any kind, with a material, a camera, a size and what is up."""

import numpy as np
import pytest
import trimesh
from significance import render

import wavefront as wf

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]])
RED = wf.Diffuse((0.8, 0.1, 0.1))
LIGHT = wf.Environment()


@pytest.fixture
def obj(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return tmp_path / "a.obj"


def test_a_size_and_a_camera_may_be_given() -> None:
    own, other = (wf.Camera.look_at((0, 0, z), (0, 0, 0), size=(8, 6)) for z in (4, 9))
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1), LIGHT, own)
    assert render(scene, 1, size=(5, 3)).rgb.shape == (3, 5, 3)
    near, far = render(scene, 1), render(scene, 1, camera=other)
    assert scene.camera is own
    scene.camera = other
    assert far.rgb.tobytes() == render(scene, 1).rgb.tobytes() != near.rgb.tobytes()
    assert render(scene, 1, camera=own, size=(4, 4)).rgb.shape == (4, 4, 3)


@pytest.mark.parametrize("kind", ["pair", "path", "trimesh", "mesh", "list", "instance"])
def test_a_material_for_what_has_none(kind, obj) -> None:
    """The picture is that of the mesh with the material, and the user's mesh stays as it was."""
    mesh = wf.Mesh(*TRIANGLE)
    subject = {
        "pair": TRIANGLE,
        "path": obj,
        "trimesh": trimesh.Trimesh(*TRIANGLE, process=False),
        "mesh": mesh,
        "list": [mesh],
        "instance": wf.Instance(mesh, np.eye(4)),
    }[kind]
    found = render(subject, 2, material=RED, size=(6, 6)).rgb
    assert found.tobytes() == render(wf.Mesh(*TRIANGLE, material=RED), 2, size=(6, 6)).rgb.tobytes()
    assert not mesh.has_material
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [0.5] * 3


@pytest.mark.parametrize(
    ("subject", "message"),
    [
        (wf.Scene(wf.Mesh(*TRIANGLE)), "material is for bare meshes; in a wf.Scene set those of its shapes"),
        (wf.Mesh(*TRIANGLE, material=RED, name="roof"), "roof has a material of its own"),
        ([wf.Instance(wf.Mesh(*TRIANGLE, material=RED), np.eye(4))], "has a material of its own"),
    ],
)
def test_a_material_replaces_no_other(subject, message) -> None:
    with pytest.raises(wf.SceneError, match=message):
        render(subject, 1, material=wf.Mirror())


def test_a_material_must_be_one() -> None:
    with pytest.raises(
        wf.SceneError, match=r'material must be a material such as wf.Diffuse\(0.5\) or "gold", got 3'
    ):
        render(TRIANGLE, 1, material=3)


def tower() -> wf.Mesh:
    """A column along z, as a CAD program has it."""
    box = trimesh.creation.box((0.4, 0.6, 3))
    return wf.Mesh(box.vertices, box.faces)


def turned(mesh: wf.Mesh) -> wf.Mesh:
    """The same with y up: the scene that a z-up picture must equal."""
    x, y, z = mesh.vertices.T
    return wf.Mesh(np.stack([x, z, -y], 1), mesh.faces)


@pytest.mark.parametrize("up", ["z", "+Z", (0, 0, 1), [0, 0, 2.5]])
def test_z_is_up(up) -> None:
    """The picture is that of the mesh turned by hand, and the tower stands."""
    upright = render([tower(), LIGHT], 4, up=up, size=(24, 24)).rgb
    assert upright == pytest.approx(render([turned(tower()), LIGHT], 4, size=(24, 24)).rgb, abs=1e-4)
    dark = np.argwhere(upright[..., 0] < 0.9)
    assert np.ptp(dark[:, 0]) > 3 * np.ptp(dark[:, 1])


@pytest.mark.parametrize("up", ["x", "-x", "-y", "-z", (1, 1, 1), (0.2, -1, 0.3)])
def test_any_direction_is_up(up) -> None:
    """The camera's up is in the plane of it and the view, and the scene is seen from above."""
    camera = wf.Scene(tower()).framing_camera(up=up)
    axis = wf.camera.upward("up", up)
    axis = axis / np.linalg.norm(axis)
    right, upright, backward = camera.rotation.T
    assert right @ axis == pytest.approx(0, abs=1e-12)
    assert upright @ axis > 0.9
    assert backward @ axis == pytest.approx(np.sin(np.radians(22)), abs=1e-3)


@pytest.mark.parametrize("direction", [(1, 0, 0), (-2, 1, 0.5), (0, 1, 0), (0, -3, 0)])
def test_a_scene_is_framed_from_any_direction(direction) -> None:
    scene = wf.Scene([tower(), wf.Sphere((3, 0, 0), 0.5)])
    camera = scene.framing_camera(direction=direction, size=(40, 20))
    assert camera.rotation[:, 2] == pytest.approx(np.array(direction) / np.linalg.norm(direction))
    local = (scene.shapes[0].vertices - camera.origin) @ camera.rotation
    assert (np.abs(local[:, :2] / local[:, 2:]) <= np.tan(np.radians(20)) * np.array([2, 1])).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"up": "q"}, "up is 'q'; it must be a vector, or one of x, y, z"),
        ({"up": (0, 0, 0)}, "must not be zero"),
        ({"up": 3}, "up is 3; it must be a vector"),
        ({"size": (0, 5)}, "size is"),
        ({"camera": (0, 0, 5)}, "camera must be a wf.Camera, got"),
    ],
)
def test_bad_views_are_named(options, message) -> None:
    with pytest.raises(wf.SceneError, match=message):
        render(TRIANGLE, 1, **options)


def test_up_does_not_turn_a_camera_that_is_given() -> None:
    scene = wf.Scene(wf.Mesh(*TRIANGLE), LIGHT, wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(6, 5)))
    np.testing.assert_array_equal(render(scene, 1, up="z").rgb, render(scene, 1).rgb)
    scene.lights = []
    turned_light, light = (render(scene, 1, up=up, lighting="cloudy").rgb for up in ("z", "y"))
    assert (turned_light != light).any()


def test_scenes_take_objects_of_trimesh() -> None:
    """Alone, in a list, appended and assigned; a scene of trimesh brings all of its meshes."""
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(1)
    both = trimesh.Scene([box, ball])
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1), box])
    assert [type(shape) for shape in scene.shapes] == [wf.Sphere, wf.Mesh]
    scene.shapes.append(ball)
    scene.shapes += [both]
    assert [len(shape.faces) for shape in scene.shapes[1:]] == [12, 80, 12, 80]
    scene.shapes.insert(0, box)
    scene.shapes[1] = both
    assert [len(shape.faces) for shape in scene.shapes[:3]] == [12, 12, 80]
    scene.shapes = ball
    assert len(wf.Scene(box).shapes) == len(scene.shapes) == 1


def test_add() -> None:
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1))
    assert scene.add(trimesh.creation.box(), wf.Environment()).add(wf.PointLight((0, 0, 3), 1)) is scene
    assert (len(scene.shapes), len(scene.lights)) == (2, 2)
    with pytest.raises(wf.SceneError, match=r"shapes\[1\] is 'ball'"):
        scene.add(wf.Sphere((2, 0, 0), 1), "ball")
    with pytest.raises(wf.SceneError, match="more than one Environment"):
        scene.add(wf.Sphere((2, 0, 0), 1), wf.Environment(2))
    assert (len(scene.shapes), len(scene.lights)) == (2, 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda scene: scene.shapes.append("ball"), r"shapes\[1\] is 'ball'; it must be one of wf.Mesh"),
        (lambda scene: scene.shapes.extend(5), r"shapes must be a list of wf.Mesh"),
        (lambda scene: scene.shapes.insert(0, None), r"shapes\[0\] is None"),
        (lambda scene: scene.shapes.__setitem__(0, wf.Environment()), r"shapes\[0\] is "),
        (lambda scene: setattr(scene, "shapes", "ball"), r"shapes must be a list of wf.Mesh"),
        (lambda scene: scene.lights.append(3), r"lights\[1\] is 3; it must be one of wf.PointLight"),
        (lambda scene: setattr(scene, "lights", [None]), r"lights\[0\] is None"),
        (lambda scene: setattr(scene, "camera", "x"), r"camera must be a wf.Camera, got 'x'"),
        (lambda scene: (scene.shapes.clear(), render(scene, 1)), r"the scene has no shapes"),
        (
            lambda scene: (scene.lights.append(wf.Environment()), render(scene, 1)),
            r"more than one Environment",
        ),
    ],
)
def test_changes_of_a_scene_are_checked(change, message) -> None:
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1), [wf.Environment()])
    with pytest.raises(wf.SceneError, match=message):
        change(scene)


def test_a_lone_light_may_be_assigned() -> None:
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1))
    scene.lights = wf.Environment(0.3)
    assert len(scene.lights) == 1
    assert render(scene, 1, size=(4, 4)).rgb.max() == pytest.approx(0.3)


def test_scenes_survive_copies_and_pickles() -> None:
    import copy
    import pickle

    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment()])
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert len(other.shapes) == len(other.lights) == 1
        with pytest.raises(wf.SceneError, match="shapes"):
            other.shapes.append(3)

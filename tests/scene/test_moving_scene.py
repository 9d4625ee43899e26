"""Scenes in which something moves: each of their times is a still scene."""

import gc
from copy import deepcopy

import numpy as np
import pytest
from counting import calls

import wavefront as wf

TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]


def moved(x=0.0, y=0.0, z=0.0, scale=1.0):
    out = np.diag([scale, scale, scale, 1.0])
    out[:3, 3] = x, y, z
    return out


SLIDE = wf.Keyframes([0, 2], [moved(), moved(4)])


def triangle(**more):
    return wf.Mesh(TRIANGLE, [(0, 1, 2)], **more)


SHAPES = {
    "mesh": triangle(),
    "instance": wf.Instance(triangle(), moved(0, 1)),
    "sphere": wf.Sphere((0, 0, 1), 0.5, emission=3),
    "spheres": wf.Spheres([(0, 0, 0), (1, 2, 3)], 0.25, colors=[(1, 0, 0), (0, 1, 0)]),
    "cylinders": wf.Cylinders([(0, 0, 0)], [(0, 1, 0)], 0.1),
    "capsules": wf.Capsules([(0, 0, 0)], [(0, 1, 0)], 0.1),
    "grid": wf.SignedDistanceGrid(np.linspace(-1, 1, 27).reshape(3, 3, 3)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_moves_as_it_would_be_placed(name):
    shape = SHAPES[name]
    moving = shape.transformed(SLIDE)
    assert moving.moves
    assert not shape.moves
    assert moving.time_span == (0, 2)
    assert shape.at(1) is shape
    for at in (-1, 0, 0.5, 3):
        still = moving.at(at)
        assert not still.moves
        assert still.emission is moving.emission
        assert still.name == moving.name
        np.testing.assert_array_equal(still.bounds, shape.transformed(SLIDE.at(at)).bounds)
    np.testing.assert_array_equal(
        moving.bounds, moving.at(0).bounds
    )  # as a still shape it is that of its start


@pytest.mark.parametrize("name", SHAPES)
def test_a_moving_shape_is_placed_and_carried_further(name):
    shape, up = SHAPES[name], moved(0, 0, 5, 2)
    later = wf.Keyframes([1, 3], [moved(), moved(0, 8)])
    placed = shape.transformed(SLIDE).transformed(up)
    np.testing.assert_allclose(placed.at(1).bounds, shape.transformed(up @ moved(2)).bounds, atol=1e-12)
    both = shape.transformed(SLIDE).transformed(later)
    np.testing.assert_allclose(both.at(2).bounds, shape.transformed(moved(4, 4)).bounds, atol=1e-12)
    assert both.time_span == (0, 3)
    doubled = shape.transformed(SLIDE).scaled(2)
    np.testing.assert_allclose(doubled.at(2).bounds, 2 * shape.transformed(moved(4)).bounds, atol=1e-12)


def test_what_is_changed_of_a_moving_shape_holds_at_all_times():
    for shape in (wf.Sphere((0, 0, 0), 1), triangle(), wf.Spheres([(0, 0, 0)], 1)):
        moving = shape.transformed(SLIDE)
        moving.name, moving.material = "red", wf.Diffuse((1, 0, 0))
        still = moving.at(1)
        assert still.name == "red"
        assert still.material is moving.material


def test_a_deforming_mesh_is_linear_between_its_times():
    rng = np.random.default_rng(1)
    forms = rng.normal(size=(3, 5, 3))
    faces = [(0, 1, 2), (2, 3, 4)]
    mesh = wf.Mesh(forms, faces, times=[0, 1, 3])
    np.testing.assert_array_equal(mesh.vertices, forms[0])
    np.testing.assert_array_equal(mesh.at(1).vertices, forms[1])
    np.testing.assert_allclose(mesh.at(2).vertices, (forms[1] + forms[2]) / 2, atol=1e-15)
    assert mesh.moves
    assert not mesh.at(0).moves
    assert mesh.at(2).normals is None
    placed = mesh.transformed(moved(1, 2, 3))
    np.testing.assert_array_equal(placed.at(3).vertices, forms[2] + [1, 2, 3])
    carried = mesh.transformed(SLIDE)
    np.testing.assert_array_equal(carried.at(2).to_mesh().vertices, np.add(mesh.at(2).vertices, (4, 0, 0)))


def test_normals_of_a_deforming_mesh_are_given_or_computed_for_each_time():
    flat = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], float)
    bent = flat.copy()
    bent[3, 2] = 1
    faces = [(0, 1, 2), (2, 1, 3)]
    smooth = wf.Mesh([flat, bent], faces, times=[0, 1], smooth=True)
    for at, form in ((0, flat), (1, bent), (0.5, (flat + bent) / 2)):
        still, want = smooth.at(at), wf.Mesh(form, faces, smooth=True)
        np.testing.assert_array_equal(still.vertices[still.faces], want.vertices[want.faces])
        if want.normals is None:
            assert still.normals is None
        else:
            np.testing.assert_array_equal(still.normals[still.faces], want.normals[want.faces])
    up, aside = np.tile([(0.0, 0, 1)], (4, 1)), np.tile([(1.0, 0, 0)], (4, 1))
    given = wf.Mesh([flat, bent], faces, times=[0, 1], normals=[up, aside])
    np.testing.assert_array_equal(given.at(0.25).normals, 0.75 * up + 0.25 * aside)


def test_spheres_points_and_sticks_with_places_for_each_time():
    places = np.random.default_rng(2).normal(size=(2, 6, 3))
    middle = (places[0] + places[1]) / 2
    atoms = wf.Spheres(places, 0.1, times=[0, 1])
    np.testing.assert_allclose(atoms.at(0.5).centers, middle, atol=1e-15)
    points = wf.Points(places, 0.1, colors=places[0, :, 0], cmap="viridis", times=[0, 1])
    np.testing.assert_array_equal(points.at(1).centers, places[1])
    assert points.at(1).colors is points.colors
    bonds = wf.Capsules(places[:, :3], places[0, 3:], 0.05, times=[0, 1])
    np.testing.assert_array_equal(bonds.at(1).starts, places[1, :3])
    np.testing.assert_array_equal(bonds.at(1).ends, places[0, 3:])
    sticks = wf.Cylinders(places[:, :3], places[:, 3:], 0.05, times=[0, 1])
    np.testing.assert_array_equal(sticks.at(1).ends, places[1, 3:])


FORMS = np.zeros((2, 3, 3)) + np.array(TRIANGLE)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.Mesh(FORMS, [(0, 1, 2)]), r"mesh: vertices has the shape \(2, 3, 3\); .* needs times="),
        (lambda: wf.Mesh(FORMS, [(0, 1, 2)], times=[0, 1, 2]), r"vertices has 2 forms and times 3"),
        (
            lambda: wf.Mesh(FORMS, [(0, 1, 2)], times=[1, 0]),
            r"mesh: times\[1\] is 0, after mesh: times\[0\] = 1",
        ),
        (lambda: wf.Mesh(TRIANGLE, [(0, 1, 2)], times=[0]), r"vertices must have shape \(t, n, 3\)"),
        (lambda: wf.Mesh(FORMS * 1e39, [(0, 1, 2)], times=[0, 1]), r"vertices\[0\]\[1\]\[0\] is 1e\+39"),
        (lambda: wf.Mesh(FORMS * np.nan, [(0, 1, 2)], times=[0, 1]), r"vertices\[0\]\[0\]\[0\] is nan"),
        (
            lambda: wf.Mesh(FORMS, [(0, 1, 2)], times=[0, 1], normals=np.ones((3, 3))),
            r"normals have the shape \(3, 3\)",
        ),
        (
            lambda: wf.Mesh(FORMS, [(0, 1, 2)], times=[0, 1], normals=FORMS + 1, tangents=np.ones((3, 4))),
            "deforms; then it cannot have tangents",
        ),
        (lambda: wf.Spheres(FORMS, 1), r"centers has the shape \(2, 3, 3\)"),
        (lambda: wf.Spheres(TRIANGLE, 1, times=[0]), r"centers must have shape \(t, n, 3\)"),
        (lambda: wf.Capsules(FORMS, FORMS[:1], 1, times=[0, 1]), r"ends has 1 form and times 2"),
        (lambda: wf.Points(FORMS, 1), r"points has the shape \(2, 3, 3\)"),
        (
            lambda: wf.Spheres(FORMS, 1, times=[0, 1]).placed(np.tile(np.eye(4), (2, 1, 1))),
            r"spheres: moves; place each copy by itself",
        ),
        (lambda: triangle().transformed(SLIDE).at(np.inf), "time is inf; it must be finite"),
        (lambda: wf.Scene(triangle()).at("noon"), "time must be a number"),
    ],
)
def test_malformed_times(make, message):
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_cameras_move():
    turn = wf.shapes.transform.rotation("x", "y", 90, (0, 0, 0))
    path = wf.Keyframes([0, 1], [moved(0, 0, 4), turn @ moved(0, 0, 4)])
    camera = wf.Camera.from_matrix(path, 30, size=(40, 30), crop=(0, 0, 20, 30))
    assert camera.moves
    assert camera.time_span == (0, 1)
    for at in (0, 0.3, 2):
        want, found = wf.Camera.from_matrix(path.at(at), 30), camera.at(at)
        np.testing.assert_allclose(found.origin, want.origin, atol=1e-12)
        np.testing.assert_allclose(found.rotation, want.rotation, atol=1e-12)
        assert not found.moves
        assert found.size == (20, 30)
        assert found.fov == 30
    seen = wf.Camera.from_matrix(path, 30, convention="opencv").at(1)
    np.testing.assert_allclose(seen.to_matrix("opencv"), path.at(1), atol=1e-12)
    for other in (
        camera.resized((10, 15)),
        camera.cropped((0, 0, 9, 9)),
        camera.replace(fov=20),
        camera.scaled(1),
    ):
        np.testing.assert_allclose(other.at(1).origin, camera.at(1).origin)
    assert not camera.replace(origin=(0, 0, 1)).moves
    given = {"K": [[40, 0, 20], [0, 40, 15], [0, 0, 1]], "size": (40, 30)}
    outside = wf.Keyframes(
        [0, 1], [wf.Camera.look_at(eye, (0, 0, 0)).extrinsics() for eye in ((0, 0, 4), (1, 2, 3))]
    )
    calibrated = wf.Camera.from_intrinsics(R=outside, **given)
    for at in (0, 0.5, 1):
        np.testing.assert_allclose(calibrated.at(at).extrinsics(), outside.at(at), atol=1e-9)
    np.testing.assert_allclose(calibrated.extrinsics(), outside.at(0), atol=1e-12)
    dolly = wf.Camera.look_at((0, 0, 4), (0, 0, 0)).transformed(SLIDE)
    np.testing.assert_allclose(dolly.at(2).origin, (4, 0, 4))
    np.testing.assert_allclose(dolly.transformed(moved(0, 1)).at(2).origin, (4, 1, 4))
    with pytest.raises(wf.SceneError, match=r"cam_to_world.*must be a rotation"):
        wf.Camera.from_matrix(wf.Keyframes([0], [np.diag([2, 2, 2, 1])]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: wf.Camera.look_at((0, 0, 4), (0, 0, 0)).transformed(np.zeros((4, 4))),
            r"Camera transform takes the view to \[0.0, 0.0, 0.0\]; it must not be zero",
        ),
        (
            lambda: wf.Camera.look_at((0, 0, 4), (0, 0, 0)).transformed(np.eye(3)),
            r"Camera transform must have shape",
        ),
        (
            lambda: wf.PointLight((0, 0, 0), 1).transformed(2 * np.eye(4)),
            "PointLight transform has the last row",
        ),
        (lambda: triangle().transformed(np.eye(3)), "mesh: transform matrix must have shape"),
        (lambda: triangle().transformed(SLIDE).transformed(2 * np.eye(4)), "has the last row"),
        (lambda: wf.Instance(triangle(), [SLIDE]), "transform must"),
        (lambda: wf.Instance.many(triangle(), [SLIDE, np.eye(4)]), "transforms must"),
        (lambda: wf.Group([triangle()]).placed([SLIDE, 3]), "Group transforms must"),
        (
            lambda: wf.Sphere((0, 0, 0), 1).transformed(wf.Keyframes([0], [np.diag([1, 2, 1, 1])])),
            "stretches by 1 along one axis and 2 along another",
        ),
    ],
)
def test_transforms_that_cannot_be(make, message):
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_the_garbage_collector_is_left_as_it_was():
    was = gc.isenabled()
    for enabled in (True, False):
        (gc.enable if enabled else gc.disable)()
        wf.Instance.many(triangle(), [np.eye(4)] * 3)
        assert gc.isenabled() is enabled
    (gc.enable if was else gc.disable)()


def ies(tmp_path):
    table = "0 30 60 90  0  1000 900 400 0"
    file = tmp_path / "lamp.ies"
    file.write_text(f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1 20\n{table}")
    return wf.IESLight(file, (0, 3, 0))


def test_lights_move(tmp_path):
    turn = wf.shapes.transform.rotation("x", "z", 90, (0, 0, 0))
    motion = wf.Keyframes([0, 1], [np.eye(4), turn])
    slide = np.random.default_rng(0).random((4, 4, 3))
    lights = [
        wf.PointLight((1, 0, 0), 5),
        wf.PointLights([(1, 0, 0), (2, 0, 0)], 5),
        wf.SpotLight((1, 0, 0), 5, target=(0, 0, 0), picture=slide),
        wf.Projector((1, 0, 0), slide, direction=(-1, 0, 0)),
        ies(tmp_path),
        wf.DirectionalLight((-1, 0, 0), 3),
    ]
    for light in lights:
        moving = light.transformed(motion)
        assert moving.moves
        assert moving.at(1) is not moving
        assert light.at(1) is light
        still = moving.at(1)
        for name in ("position", "positions"):
            if hasattr(light, name):
                np.testing.assert_allclose(
                    getattr(still, name), getattr(light, name) @ turn[:3, :3].T, atol=1e-12
                )
        if getattr(light, "direction", None) is not None:
            np.testing.assert_allclose(still.direction, turn[:3, :3] @ light.direction, atol=1e-12)
        moving.group = "key"
        assert moving.at(0.5).group == "key"
        assert not still.moves
        further = moving.transformed(turn).at(0)
        if hasattr(light, "position"):
            np.testing.assert_allclose(further.position, turn[:3, :3] @ light.position, atol=1e-12)
    mirror = np.diag([-1, 1, 1, 1])
    for light in lights[2:5]:
        with pytest.raises(wf.SceneError, match="transform mirrors"):
            light.transformed(mirror)


def test_a_scene_of_a_moment_shares_what_stands_still():
    floor, ball = wf.Plane((0, -1, 0), (0, 1, 0)), wf.Sphere((0, 0, 0), 1).transformed(SLIDE)
    lamp = wf.PointLight((0, 3, 0), 5)
    scene = wf.Scene([floor, ball], [lamp, lamp.transformed(SLIDE)], wf.Camera.look_at((0, 0, 9), (0, 0, 0)))
    assert scene.moves
    assert (scene.start, scene.end, scene.duration) == (0, 2, 2)
    still = scene.at(1)
    assert still.shapes[0] is floor
    assert still.lights[0] is lamp
    assert still.camera is scene.camera
    assert still.accelerators is scene.accelerators
    assert still.moment == 1
    assert scene.moment is None
    assert not still.moves
    assert still.at(0) is still
    assert still.shapes[1].center.tolist() == [2, 0, 0]
    assert still.lights[1].position.tolist() == [2, 3, 0]
    quiet = wf.Scene([floor], [lamp])
    assert not quiet.moves
    assert quiet.at(3) is quiet
    assert (quiet.start, quiet.end, quiet.duration) == (0, 0, 0)


def test_changes_of_a_scene_count_at_the_next_moment():
    box = wf.Box((0, 0, 0), 1)
    scene = wf.Scene([wf.Instance(box, SLIDE)])
    assert scene.at(2).shapes[0].transform[0, 3] == 4
    scene.shapes[0].transform = wf.Keyframes([0, 2], [moved(), moved(0, 4)])
    assert scene.at(2).shapes[0].transform[:3, 3].tolist() == [0, 4, 0]
    scene.shapes[0].transform = moved(1)
    assert not scene.moves
    assert scene.at(2) is scene
    scene.shapes[0].mesh = wf.Mesh(FORMS, [(0, 1, 2)], times=[0, 1])
    assert scene.moves
    assert scene.at(1).shapes[0].mesh.moves is False
    scene.add(wf.Sphere((0, 0, 0), 1).transformed(SLIDE))
    assert scene.at(2).shapes[1].center[0] == 4


def test_instances_of_a_deforming_mesh_share_its_form():
    mesh = wf.Mesh([TRIANGLE, np.array(TRIANGLE) * 2], [(0, 1, 2)], times=[0, 1])
    scene = wf.Scene([mesh, *wf.Instance.many(mesh, [moved(), moved(1)]), wf.Instance(mesh, SLIDE)])
    shapes = scene.at(1).shapes
    assert shapes[1].mesh is shapes[0]
    assert shapes[2].mesh is shapes[0]
    assert shapes[3].mesh is shapes[0]
    np.testing.assert_array_equal(shapes[0].vertices, np.array(TRIANGLE) * 2)
    assert scene.shapes[1].moves
    assert scene.shapes[3].time_span == (0, 2)


def test_a_motion_that_flattens_leaves_out_what_has_no_area():
    class Shrink(wf.Motion):
        start, end = 0.0, 1.0

        def __init__(self, factors):
            self.factors = factors

        def at_times(self, times):
            part = 1 - np.clip(times, 0, 1)
            rows = [np.where(self.factors, 1.0, each) for each in part]
            return np.stack([np.diag([*row, 1.0]) for row in rows])

    box = wf.Box((0, 0, 0), 2)
    scene = wf.Scene(
        [wf.Instance(box, Shrink((True, False, True))), wf.Instance(box, Shrink((False,) * 3)), box]
    )
    shapes = scene.at(1).shapes
    assert len(shapes) == 2
    assert shapes[0].bounds.tolist() == [[-1, 0, -1], [1, 0, 1]]
    assert len(shapes[0].faces) == 4
    with pytest.raises(wf.SceneError, match="at 1 s the scene has no shapes"):
        wf.Scene([wf.Instance(box, Shrink((False,) * 3))]).at(1)


def test_framing_ground_and_light_are_those_of_all_times():
    ball = wf.Sphere((0, 0, 0), 1).transformed(SLIDE)
    scene = wf.Scene([ball])
    first, last = (scene.at(at).framing_camera() for at in (0, 2))
    np.testing.assert_array_equal(first.to_matrix(), last.to_matrix())
    np.testing.assert_array_equal(first.to_matrix(), scene.framing_camera().to_matrix())
    np.testing.assert_allclose(scene.at(1).reach, [[-1, -1, -1], [5, 1, 1]])
    assert scene.at(1).reach is scene.at(2).reach  # found once
    np.testing.assert_array_equal(scene.at(1).bounds, [[1, -1, -1], [3, 1, 1]])
    pixels, _ = first.project([(0, 0, 0), (4, 0, 0)])
    assert (pixels > 0).all()
    assert (pixels < 512).all()


def test_a_moving_scene_renders_its_start():
    given = {"spp": 2, "size": (16, 12), "progress": False, "workers": 1}
    scene = wf.Scene([wf.Box((0, 0, 0), 1).transformed(SLIDE)], wf.Environment(1))
    start = wf.render(scene, **given)
    np.testing.assert_array_equal(start.rgb, wf.render(scene.at(0), **given).rgb)
    assert (start.rgb != wf.render(scene.at(2), **given).rgb).any()


def test_groups_move():
    group = wf.Group([triangle(), wf.Sphere((0, 0, 0), 1)])
    moving = group.placed([SLIDE, wf.Keyframes([0, 1], [moved(), moved(0, 1)])], name="copy")
    assert moving.moves
    assert not group.moves
    assert group.at(1) is group
    assert [shape.name for shape in moving] == ["copy"] * 4
    places = [shape.bounds[0].tolist() for shape in moving.at(1)]
    assert places == [[2, 0, 0], [1, -1, -1], [0, 1, 0], [-1, 0, -1]]
    assert len(group.placed(SLIDE)) == 2


def test_scenes_that_move_are_copied():
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1).transformed(SLIDE)])
    scene.at(1)
    assert deepcopy(scene).at(2).shapes[0].center.tolist() == [4, 0, 0]


def test_many_instances_are_placed_together():
    def scene(count):
        found = wf.Scene(wf.Instance.many(triangle(), [few[k % 50] for k in range(count)]))
        found.at(0)
        return found

    ends = np.tile(np.eye(4), (50, 2, 1, 1))
    ends[:, :, :3, 3] = np.random.default_rng(0).normal(size=(50, 2, 3))
    few = [wf.Keyframes([0, 1], each) for each in ends]
    several, many = scene(50), scene(550)
    np.testing.assert_array_equal(many.at(0.25).shapes[57].transform, few[7].at(0.25))
    # two calls look at an instance and make its copy; a loop over motions takes hundreds
    assert calls(lambda: many.at(0.75)) - calls(lambda: several.at(0.75)) <= 2.5 * 500


def test_what_stands_still_has_its_box_computed_once(calls_of):
    boxes = calls_of("wavefront.scene.scene.instance_bounds")
    still = wf.Instance.many(triangle(), [moved(k) for k in range(50)])
    scene = wf.Scene([*still, wf.Instance(triangle(), SLIDE), wf.Sphere((0, 0, 0), 1).transformed(SLIDE)])
    np.testing.assert_array_equal(scene.at(1).reach, [[-1, -1, -1], [50, 1, 1]])
    assert sum(len(call.args[0]) for call in boxes) == 50 + 17  # of the moving one, at 17 times


def test_instances_of_a_moment_keep_attributes_of_ones_own_and_know_new_motions():
    instances = wf.Instance.many(triangle(), [SLIDE, SLIDE, SLIDE])
    instances[1].label = "mine"
    scene = wf.Scene(instances)
    assert [vars(each).get("label") for each in scene.at(1).shapes] == [None, "mine", None]
    instances[2].transform = wf.Keyframes([0, 2], [moved(), moved(0, 8)])
    assert scene.at(1).shapes[2].transform[:3, 3].tolist() == [0, 4, 0]
    assert not any("motion" in vars(each) for each in scene.at(1).shapes)

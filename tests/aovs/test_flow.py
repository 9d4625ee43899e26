"""Optical flow: p + flow is where the other picture shows the point, and what hides it there."""

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import RENDER_OPTIONS, flow_times
from significance import render

import wavefront as wf

START, BEFORE, AFTER = 0.3, 0.15, 0.6
BOTH = ("flow", "flow_back")
MASKS = ("flow_occluded", "flow_back_occluded")


def placed(shift=(0, 0, 0), degrees=0.0, axis=1, scale=1.0):
    """A scale, a turn about an axis, and then a shift, as a matrix (4, 4)."""
    turn, (i, j) = np.radians(degrees), [each for each in range(3) if each != axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(turn)
    matrix[i, j], matrix[j, i] = np.sin(turn), -np.sin(turn)
    matrix[:3, :3] *= scale
    matrix[:3, 3] = shift
    return matrix


TURN = wf.Keyframes([0, 0.4, 1], [placed(), placed((0.5, 0.2, 0), 60, scale=1.2), placed((1.5, 0, 0.5), 170)])
SLIDE = wf.Keyframes([0, 1], [placed(), placed((1, 0.3, -0.5))])
PAN = wf.Keyframes([0, 1], [placed(), placed((0.3, -0.1, -0.2), 4)])
FORMS = np.stack(
    [np.eye(3), [[1, 0.3, 0], [0, 0.6, 0], [0, 0, 1.2]], [[0.8, 0, 0.4], [0, 1.3, 0], [0.2, 0, 0.7]]]
)
KEYS = np.array([0, 0.4, 1.0])
VIEW = wf.Camera.look_at((0.5, 2, 6), (0.3, 0, 0), fov=35, size=(48, 36))


def form(time):
    """The linear map (4, 4) of a mesh that deforms, as `Mesh` interpolates its vertices."""
    matrix = np.eye(4)
    for row in range(3):
        for column in range(3):
            matrix[row, column] = np.interp(time, KEYS, FORMS[:, row, column])
    return matrix


def ball(rings=9):
    """Vertices and faces of a ball."""
    polar, around = np.linspace(0.01, np.pi - 0.01, rings), np.linspace(0, 2 * np.pi, 2 * rings)
    p, a = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    vertices = 0.7 * np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], 1)
    row, column = (x.ravel() for x in np.indices((rings - 1, 2 * rings - 1)))
    one = row * 2 * rings + column
    two = one + 2 * rings
    return vertices, np.concatenate([np.stack([one, one + 1, two], 1), np.stack([one + 1, two + 1, two], 1)])


def deforming(**options):
    vertices, faces = ball()
    return wf.Mesh(vertices @ FORMS.transpose(0, 2, 1), faces, times=KEYS, **options)


# a shape, and the matrices (4, 4) that take its points at their start to where they are at a time
MOVING = {
    "instance": (wf.Box((0, 0, 0), 1).transformed(TURN), TURN.at),
    "sphere": (wf.Sphere((0, 0, 0), 0.7).transformed(TURN), TURN.at),
    "deforming": (deforming(), form),
    "creased": (deforming(smooth=60), form),
    "deforming instance": (deforming().transformed(TURN), lambda time: TURN.at(time) @ form(time)),
    "spheres": (wf.Spheres([[(0, 0, 0)], [(1, 0.3, -0.5)]], 0.6, times=[0, 1]), SLIDE.at),
    "capsules": (
        wf.Capsules(
            [[(-0.5, 0, 0)], [(0.5, 0.3, -0.5)]], [[(0.5, 0, 0)], [(1.5, 0.3, -0.5)]], 0.4, times=[0, 1]
        ),
        SLIDE.at,
    ),
    "moving in what moves": (
        wf.Group([wf.Group([wf.Box((0, 0, 0), 1)]).placed(TURN)]).placed(SLIDE),
        lambda time: SLIDE.at(time) @ TURN.at(time),
    ),
    "still": (wf.Box((0, 0, 0), 1), lambda time: np.eye(4)),
}
K = [[40, 1, 24], [0, 42, 18], [0, 0, 1]]
CAMERAS = {
    "perspective": VIEW,
    "distorted": wf.Camera.from_intrinsics(
        K, VIEW.extrinsics(), size=(48, 36), distortion=(-0.2, 0.05, 0, 0)
    ),
    "fisheye": wf.Camera.fisheye(K, (-0.02, 0.003, 0, 0), VIEW.extrinsics(), size=(48, 36)),
    "orthographic": wf.Camera.orthographic((0.5, 2, 6), (0.3, 0, 0), height=4, size=(48, 36)),
    "panorama": wf.Camera.panorama((0.2, 0.6, 1.5), (0.3, 0, -1), size=(64, 32)),
    "crop": VIEW.cropped((10, 5, 40, 30)),
}


def centers(image):
    """Film points (h, w, 2) of the middles of pixels."""
    x0, y0, x1, y1 = image.metadata["window"]
    return np.stack(np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5), -1)


def flows(scene, names=BOTH, **options):
    return render(scene, 1, aovs=(*names, "position", "shape_id"), flow_times=(BEFORE, AFTER), **options)


def assert_flow(image, camera, at, shape=0):
    """Test the flow of one shape, whose points `at` takes from their start to where they are at a time."""
    seen = image.shape_id == shape
    assert seen.sum() > 40
    point = np.c_[image.position[seen].astype(float), np.ones(seen.sum())]
    for name, time in (("flow", AFTER), ("flow_back", BEFORE)):
        there = (point @ (at(time) @ np.linalg.inv(at(START))).T)[:, :3]
        found = centers(image)[seen] + image.layers[name][seen]
        assert np.abs(camera.at(time).project(there)[0] - found).max() < 1e-3


@pytest.mark.parametrize("name", MOVING)
def test_the_flow_leads_to_where_the_point_is_seen(name):
    """To 1e-3 pixel, of a moment of a scene with a camera that moves."""
    shape, at = MOVING[name]
    camera = VIEW.transformed(PAN)
    image = flows(wf.Scene([shape], camera=camera).at(START))
    assert_flow(image, camera, at)
    assert np.isnan(image.flow[image.shape_id < 0]).all()
    assert np.isnan(image.flow_back[image.shape_id < 0]).all()


@pytest.mark.parametrize("name", CAMERAS)
def test_every_camera_has_flow(name):
    camera = CAMERAS[name].transformed(PAN)
    shape, at = MOVING["instance"]
    assert_flow(flows(wf.Scene([shape], camera=camera).at(START)), camera, at)


def test_the_flow_begins_in_the_middle_of_the_shutter():
    """With ids, positions and depth of that time, those of the still scene; without one at the start."""
    camera = VIEW.transformed(PAN)
    scene = wf.Scene([shape for shape, _ in (MOVING["instance"], MOVING["spheres"])], camera=camera)
    names = (*BOTH, "depth", "uv")
    blurred = flows(scene, names, shutter=(START - 0.1, START + 0.1))
    still = flows(scene.at(START), names)
    assert (blurred.shape_id == still.shape_id).mean() > 0.995
    same = blurred.shape_id == still.shape_id
    for name, error in (("flow", 1e-3), ("flow_back", 1e-3), ("depth", 1e-5), ("uv", 1e-4)):
        one, other = blurred.layers[name][same], still.layers[name][same]
        assert np.nanmax(np.abs(one - other)) < error
    begin = flows(scene)
    first = scene.at(0)
    assert np.array_equal(begin.flow, flows(first).flow, equal_nan=True)


def test_flow_across_the_seam_of_a_panorama_takes_the_shorter_way():
    """Of a ball that passes behind the camera: pixels at the right edge go on at the left one."""
    sphere = wf.Spheres([[(-0.8, 0, 4)], [(1.2, 0, 4)]], 1, times=[0, 1])
    camera = wf.Camera.panorama((0, 0, 0), (0, 0, -1), size=(64, 32))
    image = flows(wf.Scene([sphere], camera=camera).at(START))
    seen = image.shape_id == 0
    assert seen[:, 0].any()
    assert seen[:, -1].any()
    assert np.abs(image.flow[seen]).max() < 4
    assert (image.flow[seen][:, 0] < -0.5).all()


def test_pictures_are_of_places_not_of_ways(tmp_path):
    """A checkpoint of a moment goes on with another camera that is there at that time."""
    one, other = (VIEW.resized(8).transformed(each).at(0) for each in (PAN, SLIDE))
    assert one.over_time.moves
    assert np.array_equal(one.origin, other.origin)
    scene, file = wf.Scene([wf.Box((0, 0, 0), 1)], [wf.Environment(1)]), tmp_path / "a.wfck"
    render(scene, 1, camera=one, checkpoint=file)
    assert render(scene, 2, camera=other, checkpoint=file).spp == 2


def test_frames_of_a_camera_that_moves_alone_have_their_own_flow():
    scene = wf.Scene([wf.Box((0, 0, 0), 1)], [wf.Environment(1)], VIEW.resized(12).transformed(PAN))
    times = [0.1, 0.2, 0.4]
    for frame, time, after in zip(
        wf.render_frames(scene, times, 1, aovs="flow", progress=False), times, (0.2, 0.4, 0.6), strict=True
    ):
        alone = wf.render(scene.at(time), 1, aovs="flow", flow_times=(0, after), progress=False)
        assert np.nanmax(np.abs(frame.flow - alone.flow)) < 1e-5


def test_what_stands_still_has_no_flow():
    image = flows(wf.Scene([wf.Box((0, 0, 0), 1), wf.Sphere((2, 0, 0), 0.7)], camera=VIEW), (*BOTH, *MASKS))
    seen = image.shape_id >= 0
    assert np.abs(image.flow[seen]).max() < 1e-4
    assert not image.flow_occluded[seen].any()


def test_a_cut_camera_keeps_its_way():
    """Also resized, and of a stereo pair: each has the flow of its own motion."""
    shape, at = MOVING["instance"]
    for camera in VIEW.transformed(PAN).resized((60, 40)).cropped((5, 5, 55, 35)).stereo(0.2):
        assert_flow(flows(wf.Scene([shape]).at(START), camera=camera.at(START)), camera, at)


def test_masks_say_what_is_hidden():
    """Where the other picture shows another shape at that place, or ends: nowhere else, except at edges."""
    wall = wf.Rectangle((-4, -3, -2), (8, 0, 0), (0, 6, 0))
    scene = wf.Scene([wall, wf.Box((-1, 0, 0), 1).transformed(SLIDE)], camera=VIEW.transformed(PAN))
    image = flows(scene.at(START), (*BOTH, *MASKS))
    for name, time in (("flow", AFTER), ("flow_back", BEFORE)):
        other = render(scene.at(time), 1, aovs="shape_id").shape_id
        row, column = np.nonzero(image.shape_id >= 0)
        there = centers(image)[row, column] + image.layers[name][row, column]
        x, y = np.floor(there).astype(int).T
        inside = (x >= 0) & (x < 48) & (y >= 0) & (y < 36)
        hidden = ~inside
        hidden[inside] = other[y[inside], x[inside]] != image.shape_id[row, column][inside]
        found = image.layers[f"{name}_occluded"][row, column]
        assert set(np.unique(found)) == {0, 1}
        assert hidden.sum() > 20
        assert (found[~inside] == 1).all()
        assert (found != hidden).mean() < 0.03  # at edges, where pixels show both
    assert (image.flow_occluded[image.shape_id < 0] == -1).all()
    assert image.flow_occluded.dtype == np.int32


def test_flow_of_a_rolling_shutter_leads_to_the_row_that_is_read_then():
    camera = VIEW.transformed(PAN).replace(rolling_shutter=0.2)
    scene = wf.Scene([MOVING["instance"][0]], camera=camera)
    image = flows(scene, (*BOTH, *MASKS), shutter=(START - 0.01, START + 0.01))
    row, column = np.nonzero(image.shape_id == 0)
    there = centers(image)[row, column] + image.flow[row, column]
    begin, end = START + 0.2 * row / 36, AFTER + 0.2 * np.floor(there[:, 1]) / 36
    for at in range(0, len(row), 7):
        way = TURN.at(end[at]) @ np.linalg.inv(TURN.at(begin[at]))
        point = way[:3, :3] @ image.position[row[at], column[at]].astype(float) + way[:3, 3]
        assert np.abs(camera.at(end[at]).project([point])[0][0] - there[at]).max() < 1e-3
    ball = wf.Sphere((0, 0, 0), 0.7).transformed(SLIDE)
    image = flows(wf.Scene([ball], camera=camera), MASKS, shutter=(START - 0.01, START + 0.01))
    assert 0 <= image.flow_occluded[image.shape_id == 0].mean() < 0.05


def test_frames_lead_to_their_neighbors():
    """Beyond the ends time goes on evenly; the first and the last flow are those of these times."""
    scene = wf.Scene([MOVING["instance"][0]], camera=VIEW.resized((24, 18)).transformed(PAN))
    times = [0.1, 0.3, 0.6]
    around = [(2 * 0.1 - 0.3, 0.3), (0.1, 0.6), (0.3, 2 * 0.6 - 0.3)]
    frames = wf.render_frames(scene, times, 1, aovs=BOTH, progress=False)
    for frame, time, pair in zip(frames, times, around, strict=True):
        alone = wf.render(scene.at(time), 1, aovs=BOTH, flow_times=pair, progress=False)
        for name in BOTH:
            assert np.array_equal(frame.layers[name], alone.layers[name], equal_nan=True)


def test_flow_is_saved(tmp_path):
    image = flows(wf.Scene([MOVING["instance"][0]], camera=VIEW).at(START), (*BOTH, *MASKS))
    image.save(tmp_path / "flow.exr")
    again = wf.Image.load(tmp_path / "flow.exr")
    for name in (*BOTH, *MASKS):
        assert np.array_equal(again.layers[name], image.layers[name], equal_nan=True)


def test_the_command_line_takes_times():
    assert flow_times("0.25:0.75") == (0.25, 0.75)
    assert "flow_times" in RENDER_OPTIONS
    with pytest.raises(wf.SceneError, match="'1' is not BEFORE:AFTER"):
        flow_times("1")


class Vanishing(wf.Motion):
    """A motion that flattens what it moves at 1 s."""

    start, end = 0.0, 1.0

    def at_times(self, times):
        out = np.tile(np.eye(4), (len(times), 1, 1))
        out[:, 0, 0] = 1 - np.clip(times, 0, 1)
        return out


def test_mistakes_are_named():
    scene = wf.Scene([MOVING["instance"][0]], camera=VIEW.resized(4))
    with pytest.raises(wf.SceneError, match=r"aovs has 'flow'; it needs flow_times=\(before, after\)"):
        render(scene, 1, aovs="flow")
    with pytest.raises(wf.SceneError, match=r"flow_times must have shape \(2,\)"):
        render(scene, 1, aovs="flow", flow_times=3)
    with pytest.raises(wf.SceneError, match=r"flow_times\[1\] is inf; it must be finite"):
        render(scene, 1, flow_times=(0, np.inf))
    with pytest.raises(wf.SceneError, match="flow of one frame needs flow_times"):
        next(wf.render_frames(scene, [0.1], 1, aovs="flow"))
    flat = wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)).transformed(Vanishing())
    with pytest.raises(wf.SceneError, match="at 1 s a shape has no size; flow needs a scene with all"):
        flows(wf.Scene([wf.Sphere((0, 0, 0), 1), flat], camera=VIEW.resized(4)).at(1))
    with pytest.raises(AttributeError, match=r"no layer 'flow'; render it with aovs=\('flow',\)"):
        _ = render(scene, 1).flow


def test_flow_of_a_skinned_mesh_of_a_file(tmp_path):
    """A triangle on two joints: corners go by the mean of the joints' matrices, points between them along."""
    build = Builder()
    build.json["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 1, 0]}]
    build.json["scenes"][0]["nodes"] = [0, 1]
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 1, 3] = -1
    columns = build.accessor(inverse.transpose(0, 2, 1).reshape(2, 16).astype(np.float32))
    build.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": columns}]
    weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [0.25, 0.75, 0, 0]], np.float32)
    joints = np.tile(np.uint8([0, 1, 0, 0]), (3, 1))
    build.mesh({"POSITION": TRIANGLE, "JOINTS_0": joints, "WEIGHTS_0": weights})
    half = float(np.sqrt(0.5))
    keys = {"input": build.accessor(np.array([0, 1], np.float32)), "interpolation": "LINEAR"}
    turns = build.accessor(np.array([[0, 0, 0, 1], [0, 0, half, half]], np.float32))
    build.json["animations"] = [
        {
            "samplers": [{**keys, "output": turns}],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
        }
    ]
    camera = wf.Camera.look_at((0.3, 0.5, 4), (0.3, 0.5, 0), size=(48, 36)).transformed(PAN)
    scene = wf.load(build.gltf(tmp_path / "arm.gltf"))
    image = flows(scene.at(START), camera=camera.at(START))

    def corners(time):
        """The corners (4, 3), as columns, at a time."""
        second = placed((0, 1, 0), 0) @ placed(degrees=-90 * time, axis=2) @ placed((0, -1, 0))
        mixed = [first * np.eye(4) + other * second for first, other in weights[:, :2].astype(float)]
        return np.stack([matrix @ [*corner, 1] for matrix, corner in zip(mixed, TRIANGLE, strict=True)], 1)

    # on its plane, points go as an affine map that takes corner to corner
    beside = np.array([[0.0], [0], [1], [0]])
    maps = {time: np.hstack([corners(time), beside]) for time in (START, BEFORE, AFTER)}
    assert np.abs(scene.at(AFTER).shapes[0].vertices.T - corners(AFTER)[:3]).max() < 1e-6
    assert_flow(image, camera, lambda time: maps[time])


def test_flow_of_a_mesh_that_melts_with_many_faces_is_that_of_its_corners():
    """Where no affine map describes it: by the corners of the triangle that holds the point."""
    vertices, faces = ball(7)
    forms = np.stack(
        [vertices, vertices + 0.2 * np.sin(5 * vertices[:, [1, 2, 0]]), vertices * (1, 0.5, 1.2)]
    )
    mesh, camera = wf.Mesh(forms, faces, times=KEYS), VIEW.transformed(PAN)
    image = flows(wf.Scene([mesh], camera=camera).at(START))
    seen = image.shape_id == 0
    point = image.position[seen].astype(float)
    a, b, c = mesh.at(START).vertices[faces].transpose(1, 0, 2)
    frame = np.stack([b - a, c - a, np.cross(b - a, c - a)], -1)
    local = np.linalg.solve(frame[None], (point[:, None] - a)[..., None])[..., 0]
    outside = np.maximum(-local[..., :2].min(2), local[..., :2].sum(2) - 1)
    outside = np.maximum(outside, 0) + np.abs(local[..., 2])
    face = outside.argmin(1)
    u, v, _ = local[np.arange(len(face)), face].T[..., None]
    d, e, f = mesh.at(AFTER).vertices[faces[face]].transpose(1, 0, 2)
    there = d + (e - d) * u + (f - d) * v
    found = centers(image)[seen] + image.flow[seen]
    assert np.abs(camera.at(AFTER).project(there)[0] - found).max() < 1e-3

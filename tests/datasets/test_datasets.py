"""Data sets: COCO is read by its own reader, BOP has its published layout, and all matrices project."""

import json
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh
from inside import annotated_objects, dataset, diameter, mask_box, run_lengths, write_models
from pycocotools.coco import COCO
from pycocotools.mask import toBbox
from trimesh.transformations import rotation_matrix, translation_matrix

import wavefront as wf

# the ball and the plate of `scene`
pytestmark = pytest.mark.filterwarnings("ignore:objects without a (model|pose)")

SIZE = (60, 40)
MM = 250  # millimeters of a scene unit
BOX = trimesh.creation.box((1, 1, 1))
CRATE = wf.Mesh(BOX.vertices, BOX.faces, name="crate")
TURNED = translation_matrix((0.5, 0, 0)) @ rotation_matrix(0.4, (1, 1, 0))
FLAT = np.diag([0.3, 0.3, 0.1, 1])


def scene() -> wf.Scene:
    """Two crates of one mesh, one of them cut off by the edge, a flat one hidden by a ball, and a floor."""
    return wf.Scene(
        [
            wf.Instance(CRATE, TURNED, name="crate"),
            wf.Sphere((-1, 0, 1.5), 0.6, name="ball"),
            wf.Rectangle((-9, -2, -9), (0, 0, 18), (18, 0, 0), name="floor"),
            wf.Instance(CRATE, translation_matrix((3.3, 0, 0)), name="crate"),
            wf.Instance(CRATE, translation_matrix((-1.15, 0, 0.5)) @ FLAT, name="plate"),
        ],
        [wf.Environment(1)],
    )


START = wf.Camera.look_at((0, 1, 6), (0, 0, 0), fov=40, size=SIZE)
CAMERAS = [
    START,
    wf.Camera.from_intrinsics([[70, 2, 31], [0, 65, 18], [0, 0, 1]], START.extrinsics(), size=SIZE),
    wf.orbit(wf.Camera.look_at((0, 1, 6), (0, 0, 0), size=(120, 80), crop=(30, 20, 90, 60)), (0, 0, 0), 200),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of three views in both formats."""
    path = tmp_path_factory.mktemp("data") / "set"
    wanted = ("crate", "ball", "plate")
    done = wf.write_dataset(
        path,
        scene(),
        CAMERAS,
        2,
        format=("coco", "bop"),
        objects=wanted,
        millimeters=MM,
        aovs="position",
        progress=False,
    )
    assert done == 3
    return path


def loaded(path: Path) -> dict:
    return json.loads(path.read_text())


def layers(folder: Path, number: int) -> wf.Image:
    return wf.Image.load(folder / "layers" / f"{number:06d}.exr")


def seen_points(folder: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (n, 4) that the pixels of a view show, and the pixels (n, 2), column and row."""
    position = layers(folder, number).position
    row, column = np.nonzero(np.isfinite(position).all(2))
    points = position[row, column].astype(float)
    return np.column_stack([points, np.ones(len(points))]), np.stack([column, row], 1)


@pytest.mark.parametrize("number", range(3))
def test_every_matrix_projects_points_onto_their_pixels(folder: Path, number: int) -> None:
    """To 0.01 pixel: OpenCV's and OpenGL's, of cameras with any principal point, and of windows."""
    points, pixels = seen_points(folder, number)
    assert len(points) > 1000
    found = loaded(folder / "cameras.json")[f"{number:06d}"]
    cv, gl = found["opencv"], found["opengl"]
    world = points @ np.array(cv["world_to_camera"]).T
    seen = world[:, :3] @ np.array(cv["K"]).T
    assert np.abs(seen[:, :2] / seen[:, 2:] - pixels).max() < 0.01
    assert np.allclose(np.array(cv["camera_to_world"]) @ cv["world_to_camera"], np.eye(4))
    depth = layers(folder, number).depth
    assert np.allclose(seen[:, 2], depth[np.isfinite(depth)], rtol=1e-5)
    clip = points @ (np.array(gl["projection"]) @ gl["world_to_camera"]).T
    x, y, z = clip[:, :3].T / clip[:, 3]
    width, height = found["size"]
    centers = np.stack([(x + 1) / 2 * width, (1 - y) / 2 * height], 1) - 0.5
    assert np.abs(centers - pixels).max() < 0.01
    assert (np.abs(z) < 1).all()  # between the planes
    assert np.allclose(np.array(gl["camera_to_world"]) @ gl["world_to_camera"], np.eye(4))


def test_layers_hold_what_the_render_gives(folder: Path) -> None:
    image = wf.render(scene(), 2, camera=CAMERAS[0], aovs=("depth", "normal", "shape_id"), progress=False)
    found = layers(folder, 0)
    assert np.array_equal(found.rgb, image.rgb)
    for name in ("depth", "normal", "shape_id"):
        assert np.array_equal(found.layers[name], image.layers[name], equal_nan=True)
    assert found.names["shape"][1] == "ball"


def test_the_distortion_is_opencvs(tmp_path: Path) -> None:
    lens = (-0.2, 0.05, 0.001, 0)
    camera = wf.Camera.from_intrinsics(
        START.intrinsics(), START.extrinsics(), size=SIZE, distortion=lens, crop=(0, 0, 20, 20)
    )
    wf.write_dataset(tmp_path, scene(), [camera], 1, progress=False)
    assert loaded(tmp_path / "cameras.json")["000000"]["opencv"]["distortion"][:4] == list(lens)


def test_a_fisheye_is_opencvs(tmp_path: Path) -> None:
    """K and coefficients project what pixels show onto them; there is no matrix of OpenGL."""
    given = ([[20, 0, 14.5], [0, 19, 13], [0, 0, 1]], (-0.05, 0.003, 0, 0))
    camera = wf.Camera.fisheye(*given, START.extrinsics(), size=SIZE, crop=(2, 3, 20, 20))
    wf.write_dataset(tmp_path, scene(), [camera], 1, progress=False, aovs="position")
    found = loaded(tmp_path / "cameras.json")["000000"]
    cv = found["opencv"]
    assert (cv["model"], cv["mapping"]) == ("fisheye", "equidistant")
    assert "projection" not in found["opengl"]
    points, pixels = seen_points(tmp_path, 0)
    x, y, z = (points @ np.array(cv["world_to_camera"]).T)[:, :3].T
    angle = np.arctan2(np.hypot(x, y), z)
    k1, k2, _, _ = cv["distortion"]
    radius = angle * (1 + k1 * angle**2 + k2 * angle**4) / np.hypot(x, y)
    seen = np.stack([x * radius, y * radius, np.ones_like(x)], 1) @ np.array(cv["K"]).T
    assert len(points) > 100
    assert np.abs(seen[:, :2] - pixels).max() < 0.01


@pytest.fixture(scope="module")
def coco(folder: Path) -> COCO:
    return COCO(folder / "annotations.json")


@pytest.mark.filterwarnings("ignore:__array__ implementation")  # of pycocotools
def test_coco_is_read_by_its_own_reader(folder: Path, coco: COCO) -> None:
    assert [each["name"] for each in coco.loadCats(coco.getCatIds())] == ["crate", "ball", "plate"]
    assert len(coco.getImgIds()) == 3
    for number, view in coco.imgs.items():
        picture = iio.imread(folder / "images" / view["file_name"])
        assert picture.shape == (view["height"], view["width"], 3) == (40, 60, 3)
        image = layers(folder, number)
        assert np.array_equal(picture, image.to_uint8())
        found = {each["shape_id"]: each for each in coco.imgToAnns[number]}
        assert set(found) == set(np.unique(image.shape_id)) - {-1, 2}
        for shape, each in found.items():
            mask = image.shape_id == shape
            assert np.array_equal(coco.annToMask(each), mask)
            assert each["area"] == mask.sum()
            assert each["bbox"] == mask_box(mask) == toBbox(coco.annToRLE(each)).tolist()
            assert each["iscrowd"] == 0
            assert coco.cats[each["category_id"]]["name"] == image.names["shape"][shape]
    assert min(coco.anns) == 1


def test_boxes_and_run_lengths_of_a_mask() -> None:
    mask = np.array([[1, 0], [1, 0], [0, 1]], bool)
    assert mask_box(mask) == [0, 0, 2, 3]
    assert mask_box(mask[2:]) == [1, 0, 1, 1]
    assert mask_box(~mask[:, :0]) is None
    assert run_lengths(mask) == [0, 2, 3, 1]
    assert run_lengths(~mask) == [2, 3, 1]
    assert run_lengths(np.zeros((2, 2), bool)) == [4]
    assert run_lengths(np.ones((2, 2), bool)) == [0, 4]


CAMERA_KEYS = {"cam_K": 9, "cam_R_w2c": 9, "cam_t_w2c": 3}
POSE_KEYS = {"cam_R_m2c": 9, "cam_t_m2c": 3}
BOXES = ("bbox_obj", "bbox_visib")
COUNTS = ("px_count_all", "px_count_valid", "px_count_visib")


def numbers(values: object, count: int) -> bool:
    return isinstance(values, list) and len(values) == count and all(isinstance(x, float) for x in values)


def test_bop_has_its_published_layout(folder: Path) -> None:
    """As docs/bop_datasets_format.md of the BOP toolkit describes it."""
    root = folder / "train" / "000000"
    cameras, poses, infos = (loaded(root / f"scene_{key}.json") for key in ("camera", "gt", "gt_info"))
    assert list(cameras) == list(poses) == list(infos) == ["0", "1", "2"]
    k = cameras["0"]["cam_K"]
    about = {"fx": k[0], "fy": k[4], "cx": k[2], "cy": k[5], "width": 60, "height": 40, "depth_scale": 0.1}
    assert loaded(folder / "camera.json") == about
    masks = set()
    for number in range(3):
        camera = cameras[str(number)]
        assert camera.keys() == {*CAMERA_KEYS, "depth_scale"}
        assert all(numbers(camera[key], count) for key, count in CAMERA_KEYS.items())
        assert camera["depth_scale"] == 0.1
        name = f"{number:06d}"
        rgb, depth = iio.imread(root / "rgb" / f"{name}.png"), iio.imread(root / "depth" / f"{name}.png")
        assert (rgb.shape, rgb.dtype) == ((40, 60, 3), np.uint8)
        assert (depth.shape, depth.dtype) == ((40, 60), np.uint16)
        assert len(poses[str(number)]) == len(infos[str(number)]) >= 3
        for at, (pose, info) in enumerate(zip(poses[str(number)], infos[str(number)], strict=True)):
            assert pose.keys() == {*POSE_KEYS, "obj_id"}
            assert all(numbers(pose[key], count) for key, count in POSE_KEYS.items())
            assert isinstance(pose["obj_id"], int)
            assert pose["obj_id"] >= 1
            turn = np.reshape(pose["cam_R_m2c"], (3, 3))
            assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-8)
            assert np.linalg.det(turn) > 0
            assert info.keys() == {*BOXES, *COUNTS, "visib_fract"}
            assert all(isinstance(x, int) for key in BOXES for x in info[key])
            assert all(isinstance(info[key], int) for key in COUNTS)
            assert info["visib_fract"] == info["px_count_visib"] / info["px_count_all"]
            for kind in ("mask", "mask_visib"):
                mask = iio.imread(root / kind / f"{name}_{at:06d}.png")
                assert (mask.shape, mask.dtype) == ((40, 60), np.uint8)
                assert set(np.unique(mask)) <= {0, 255}
            masks.add(f"{name}_{at:06d}.png")
    for kind in ("mask", "mask_visib"):
        assert {path.name for path in (root / kind).iterdir()} == masks


@pytest.mark.parametrize("number", range(3))
def test_bops_poses_and_depth_are_those_of_the_picture(folder: Path, number: int) -> None:
    """K·[R, t] takes points of the world, and of models, to their pixels; lengths are millimeters."""
    root = folder / "train" / "000000"
    camera = loaded(root / "scene_camera.json")[str(number)]
    image = layers(folder, number)
    k = np.reshape(camera["cam_K"], (3, 3))
    points, pixels = seen_points(folder, number)

    def seen(world: np.ndarray, turn: list[float], shift: list[float]) -> np.ndarray:
        film = (MM * world @ np.reshape(turn, (3, 3)).T + shift) @ k.T
        return film[:, :2] / film[:, 2:]

    at = seen(points[:, :3], camera["cam_R_w2c"], camera["cam_t_w2c"])
    assert np.abs(at - pixels).max() < 0.01
    codes = iio.imread(root / "depth" / f"{number:06d}.png")
    assert np.array_equal(codes == 0, np.isnan(image.depth))
    met = codes > 0
    assert np.abs(codes[met] * camera["depth_scale"] - MM * image.depth[met]).max() < 0.051

    poses = loaded(root / "scene_gt.json")[str(number)]
    masks = [iio.imread(root / "mask_visib" / f"{number:06d}_{k:06d}.png") > 0 for k in range(len(poses))]
    models = {0: TURNED, 3: translation_matrix((3.3, 0, 0))}  # the others are in world coordinates
    for pose, mask in zip(poses, masks, strict=True):
        if not mask.any():
            continue
        shape = int(image.shape_id[mask][0])
        row, column = np.nonzero(mask)
        world = np.column_stack([image.position[row, column], np.ones(len(row))])
        local = world @ np.linalg.inv(models.get(shape, np.eye(4))).T
        at = seen(local[:, :3], pose["cam_R_m2c"], pose["cam_t_m2c"])
        assert np.abs(at - np.stack([column, row], 1)).max() < 0.01
        assert pose["obj_id"] == {0: 1, 1: 2, 3: 1, 4: 3}[shape]


def test_bop_has_the_models_of_meshes(folder: Path) -> None:
    """Of crates in their own coordinates, of the plate in the world's; a ball is no mesh."""
    sizes = loaded(folder / "models" / "models_info.json")
    assert {path.name for path in (folder / "models").iterdir()} == {
        "models_info.json",
        "obj_000001.ply",
        "obj_000003.ply",
    }
    expected = {"1": np.eye(4), "3": translation_matrix((-1.15, 0, 0.5)) @ FLAT}
    assert sizes.keys() == expected.keys()
    for key, matrix in expected.items():
        model = trimesh.load(folder / "models" / f"obj_{int(key):06d}.ply", process=False)
        points = MM * trimesh.transform_points(CRATE.vertices, matrix)
        assert np.allclose(model.vertices, points, rtol=1e-6, atol=1e-4)
        assert np.array_equal(model.faces, CRATE.faces)
        info = sizes[key]
        assert info.keys() == {"diameter", *(f"{kind}_{axis}" for kind in ("min", "size") for axis in "xyz")}
        assert np.allclose([info[f"min_{axis}"] for axis in "xyz"], points.min(0))
        assert np.allclose([info[f"size_{axis}"] for axis in "xyz"], np.ptp(points, 0))
        assert info["diameter"] == pytest.approx(np.linalg.norm(np.ptp(points, 0)))


def test_models_keep_normals_and_colors(tmp_path: Path) -> None:
    """Colors as sRGB codes; the box is that of the vertices that faces use."""
    vertices = [*np.eye(3), (9, 9, 9)]
    normals, codes = np.tile([0.6, 0, 0.8], (4, 1)), np.arange(16, dtype=np.uint8).reshape(4, 4) * 16
    mesh = wf.Mesh(vertices, [(0, 1, 2)], normals=normals, colors=codes)
    objects = annotated_objects([mesh], None)
    write_models(tmp_path, [mesh], objects, 1000)
    model = trimesh.load(tmp_path / "models" / "obj_000001.ply", process=False)
    assert np.allclose(model.vertex_normals, normals)
    assert np.array_equal(model.visual.vertex_colors, codes)
    info = loaded(tmp_path / "models" / "models_info.json")["1"]
    assert info["size_x"] == 1000
    assert info["diameter"] == pytest.approx(1000 * np.sqrt(2))


@pytest.mark.parametrize("kind", ["cloud", "sphere", "line", "one"])
def test_diameters_are_those_of_all_pairs(kind: str) -> None:
    random = np.random.default_rng(3)
    points = {
        "cloud": random.random((700, 3)) * (1, 2, 3),
        "sphere": trimesh.creation.icosphere(3).vertices,
        "line": np.outer(random.random(300), (1, 2, 3)),
        "one": np.ones((1, 3)),
    }[kind]
    every = np.linalg.norm(points[:, None] - points, axis=2).max()
    assert diameter(points) == pytest.approx(every, rel=1e-12)


def test_bops_silhouettes_are_of_the_whole_objects(folder: Path) -> None:
    """Also where another object hides them, and beyond the edge of the picture."""
    root = folder / "train" / "000000"
    crate, ball, cut, plate = loaded(root / "scene_gt_info.json")["0"]
    assert ball["visib_fract"] == crate["visib_fract"] == 1
    assert plate["px_count_visib"] == 0
    assert plate["px_count_all"] > 0
    assert plate["bbox_obj"] == plate["bbox_visib"] == [-1, -1, -1, -1]
    wide = wf.Camera.from_intrinsics(
        np.add(START.intrinsics(), [[0, 0, 60], [0, 0, 40], [0, 0, 0]]), START.extrinsics(), size=(180, 120)
    )
    alone = wf.render([scene().shapes[3], wf.Environment(1)], 1, camera=wide, aovs="shape_id").shape_id == 0
    x, y, width, height = mask_box(alone)
    assert cut["bbox_obj"] == [x - 60, y - 40, width, height]
    assert cut["bbox_obj"][0] + width > 60  # beyond the right edge
    assert cut["px_count_all"] == alone.sum()
    assert cut["px_count_valid"] == cut["px_count_visib"] < cut["px_count_all"]


def test_the_depth_scale_suits_the_picture_or_is_refused(tmp_path: Path) -> None:
    far = wf.Camera.look_at((0, 1, 60), (0, 0, 0), fov=10, size=(16, 12))
    wf.write_dataset(tmp_path / "a", scene(), [far], 1, format="bop", progress=False)
    camera = loaded(tmp_path / "a/train/000000/scene_camera.json")["0"]
    codes = iio.imread(tmp_path / "a/train/000000/depth/000000.png")
    depth = layers(tmp_path / "a", 0).depth
    assert codes.max() == 65535
    assert np.nanmax(depth) * 1000 == pytest.approx(65535 * camera["depth_scale"], rel=1e-6)
    with pytest.raises(wf.SceneError, match=r"depth_scale is 0.5 mm; the picture is .* it must be at least"):
        wf.write_dataset(tmp_path / "b", scene(), [far], 1, format="bop", depth_scale=0.5, progress=False)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".exr"  # it holds how long it took
    }


def test_a_call_that_was_stopped_goes_on(tmp_path: Path, fails: Callable[..., Any]) -> None:
    """The views that are missing are rendered, and all files are those of one call."""

    def write(name: str) -> int:
        return wf.write_dataset(
            tmp_path / name, scene(), CAMERAS, 1, format=("coco", "bop"), progress=False, workers=1
        )

    assert write("whole") == 3
    calls = count(1)
    fails("wavefront.Session.run", wf.Interrupted("stopped"), lambda session: next(calls) == 2)
    with pytest.raises(wf.Interrupted):
        write("parts")
    assert not (tmp_path / "parts" / "annotations.json").exists()
    assert write("parts") == 2
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")
    assert write("parts") == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, "seed was 0 and is 1"),
        ({"spp": 2}, "spp was 1 and is 2"),
        ({"format": "bop"}, r"format was \['coco'\] and is \['bop'\]"),
        ({"cameras": CAMERAS[1:2]}, "the camera differs"),
        ({"objects": "ball"}, "objects was"),
        ({"scene": [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]}, "the scene differs"),
    ],
)
def test_another_data_set_in_the_folder_is_refused(tmp_path: Path, change: dict, message: str) -> None:
    def write(scene=None, cameras=CAMERAS[:1], spp=1, **settings) -> int:
        return wf.write_dataset(tmp_path, scene or BALLS, cameras, spp, progress=False, **settings)

    assert write() == 1
    before = contents(tmp_path)
    with pytest.raises(wf.SceneError, match=message):
        write(**change)
    assert contents(tmp_path) == before


BALLS = wf.Scene(
    [wf.Sphere((0, 0, 0), 1, name="ball"), wf.Sphere((1, 0, 0), 1, name="other")], [wf.Environment(1)]
)


def test_views_that_cannot_be_compared_are_rendered_again(tmp_path: Path) -> None:
    class Odd(wf.Diffuse):
        def __init__(self) -> None:
            super().__init__(0.5)
            self.handle = (each for each in "abc")

    odd = wf.Scene([wf.Sphere((0, 0, 0), 1, material=Odd())], [wf.Environment(1)])
    for _ in range(2):
        assert wf.write_dataset(tmp_path, odd, CAMERAS[:1], 1, progress=False, workers=1) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"format": "voc"}, "format is 'voc'; it must be one of coco, bop"),
        ({"format": ()}, "format is empty"),
        ({"objects": ["bal"]}, r"objects has 'bal'; .*'other'; did you mean 'ball'\?"),
        ({"cameras": []}, "cameras is empty"),
        ({"cameras": [START, wf.Camera.panorama((0, 0, 0))]}, r"cameras\[1\]: .* no intrinsic matrix"),
        (
            {"cameras": [wf.Camera.fisheye(np.eye(3), size=9)], "format": "bop"},
            r"cameras\[0\] has a lens Fisheye\(.*BOP's cameras are perspective ones",
        ),
        ({"cameras": [3]}, r"cameras\[0\] must be a wf.Camera"),
        ({"cameras": 3}, "cameras must be a list of cameras, such as .*, got 3"),
        ({"millimeters": 0, "format": "bop"}, "millimeters is 0; it must be above 0"),
        ({"depth_scale": -1, "format": "bop"}, "depth_scale is -1; it must be above 0"),
        ({"checkpoint": "a.wfck"}, "checkpoint is 'a.wfck'"),
        ({"samples": range(3)}, "samples is range"),
        ({"tone": "film"}, "tone is 'film'"),
    ],
)
def test_mistakes_leave_no_folder(tmp_path: Path, arguments: dict, message: str) -> None:
    settings = {"cameras": [START], "progress": False, **arguments}
    with pytest.raises(wf.SceneError, match=message):
        wf.write_dataset(tmp_path / "set", BALLS, **settings)
    assert not list(tmp_path.iterdir())


def test_bop_refuses_distorted_cameras(tmp_path: Path) -> None:
    camera = wf.Camera.from_intrinsics(
        START.intrinsics(), START.extrinsics(), size=SIZE, distortion=(-0.1, 0, 0, 0)
    )
    with pytest.raises(wf.SceneError, match=r"cameras\[0\] has a lens .*k1=-0.1.*no distortion"):
        wf.write_dataset(tmp_path / "set", BALLS, [camera], format="bop")


def test_records_of_views_are_checked(tmp_path: Path) -> None:
    assert wf.write_dataset(tmp_path, BALLS, [START], 1, progress=False) == 1
    record = tmp_path / dataset.VIEWS_FOLDER / "000000.json"
    for content in ("{", "[]", '{"identity": {}}'):
        record.write_text(content)
        with pytest.raises(wf.SceneError, match=r"000000\.json: is no"):
            wf.write_dataset(tmp_path, BALLS, [START], 1, progress=False)


@pytest.mark.slow
def test_setting_up_takes_under_a_twentieth_of_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """200 views of one mesh: the scene is compiled once, and a further view costs next to nothing."""
    ball = trimesh.creation.icosphere(subdivisions=6)  # 81920 faces
    views = wf.Scene([wf.Mesh(ball.vertices, ball.faces, name="ball")], [wf.Environment(1)])
    spent = 0.0

    def timed(method: Callable[..., None]) -> Callable[..., None]:
        def call(*args: object, **settings: object) -> None:
            nonlocal spent
            begin = time.perf_counter()
            method(*args, **settings)
            spent += time.perf_counter() - begin

        return call

    for name in ("_set_up", "set_camera"):
        monkeypatch.setattr(wf.Session, name, timed(getattr(wf.Session, name)))
    begin = time.perf_counter()
    cameras = wf.turntable(views, 200, size=(96, 72))
    assert wf.write_dataset(tmp_path, views, cameras, 16, format=("coco", "bop"), progress=False) == 200
    whole = time.perf_counter() - begin
    print(f"set-up {spent:.2f} s of {whole:.1f} s: {spent / whole:.1%}")
    assert spent < 0.05 * whole
    assert len(COCO(tmp_path / "annotations.json").imgs) == 200


def test_objects_without_a_model_or_a_pose_are_told(tmp_path) -> None:
    with pytest.warns(UserWarning, match="objects without a") as caught:
        write_models(tmp_path, scene().shapes, annotated_objects(scene().shapes, None), MM)
    assert [str(each.message).partition(":")[2].partition(";")[0] for each in caught] == [
        " 'ball' (Sphere)",
        " 'plate'",
    ]

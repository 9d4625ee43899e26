"""Data sets of scenes that move: views at several times, and flow in the layouts of KITTI and Sintel."""

import json
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from inside import kitti_file

import wavefront as wf

TIMES = [0.0, 0.2, 0.5]
SIZE = (24, 18)


def way(*shift):
    """A motion along a line from 0 to 1 s."""
    there = np.eye(4)
    there[:3, 3] = shift
    return wf.Keyframes([0, 1], [np.eye(4), there])


def scene() -> wf.Scene:
    box = wf.Instance(wf.Box((0, 0, 0), 1), way(1, 0, 0.5), name="box")
    return wf.Scene(
        [box, wf.Rectangle((-5, -1, -5), (0, 0, 10), (10, 0, 0), name="floor")], [wf.Environment(1)]
    )


CAMERAS = wf.Camera.look_at((0, 1, 4), (0, 0, 0), size=SIZE).transformed(way(0.2, 0, 0)).stereo(0.3)
FORMATS = ("coco", "bop", "kitti", "sintel")
KITTI, SINTEL = Path("KittiFlow/training"), Path("Sintel/training")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("set")
    assert wf.write_dataset(out, scene(), CAMERAS, 1, format=FORMATS, times=TIMES, progress=False) == 6
    return out


def expected(number: int) -> wf.Image:
    """The view of a number, rendered alone."""
    frame, around = number % 3, [-0.2, *TIMES, 0.8]
    camera = CAMERAS[number // 3].at(TIMES[frame])
    return wf.render(
        scene().at(TIMES[frame]),
        1,
        camera=camera,
        aovs=("flow", "flow_occluded", "depth"),
        flow_times=(around[frame], around[frame + 2]),
        progress=False,
        denoise=False,
    )


@pytest.mark.parametrize("number", [0, 1, 5])
def test_views_are_those_of_times(folder: Path, number: int) -> None:
    """Camera by camera, with the poses of the times."""
    found, image = wf.Image.load(folder / f"layers/{number:06d}.exr"), expected(number)
    assert np.array_equal(found.rgb, image.rgb)
    for name in ("flow", "flow_occluded", "depth"):
        assert np.array_equal(found.layers[name], image.layers[name], equal_nan=True)
    about = json.loads((folder / "cameras.json").read_text())[f"{number:06d}"]
    camera = CAMERAS[number // 3].at(TIMES[number % 3])
    assert about["time"] == TIMES[number % 3]
    assert np.allclose(about["opencv"]["world_to_camera"], camera.extrinsics())
    pose = json.loads((folder / "train/000000/scene_gt.json").read_text())[str(number)][0]
    placed = camera.extrinsics() @ way(1, 0, 0.5).at(TIMES[number % 3])
    assert np.allclose(pose["cam_t_m2c"], 1000 * placed[:3, 3], atol=1e-3)


def test_kitti_has_pairs_of_pictures_with_their_flow(folder: Path) -> None:
    """As torchvision's and KITTI's own readers decode it: (code - 2^15)/64, and whether it is valid."""
    pairs = sorted((folder / KITTI / "image_2").glob("*_10.png"))
    assert [each.name for each in pairs] == [f"{number:06d}_10.png" for number in (0, 1, 3, 4)]
    for number in (0, 1, 3, 4):
        pictures = [iio.imread(folder / f"images/{number + step:06d}.png") for step in (0, 1)]
        for picture, end in zip(pictures, ("10", "11"), strict=True):
            assert np.array_equal(iio.imread(folder / KITTI / f"image_2/{number:06d}_{end}.png"), picture)
        found = wf.Image.load(folder / f"layers/{number:06d}.exr")
        for name, wanted in (("flow_occ", found.flow_occluded >= 0), ("flow_noc", found.flow_occluded == 0)):
            codes = sixteen_bits(folder / KITTI / f"{name}/{number:06d}_10.png")
            assert np.array_equal(codes[..., 2], wanted)
            assert np.abs((codes[..., :2].astype(float) - 2**15) / 64 - found.flow)[wanted].max() <= 1 / 128
            assert not codes[~wanted].any()


def sixteen_bits(path: Path) -> np.ndarray:
    """The codes (H, W, 3) of a png; not by Pillow, which reads 8 bits of them."""
    import zlib

    data, at, pixels = path.read_bytes(), 8, b""
    while at < len(data):
        size, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        content = data[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height = (int.from_bytes(content[i : i + 4], "big") for i in (0, 4))
            assert tuple(content[8:10]) == (16, 2)
        pixels += content if kind == b"IDAT" else b""
        at += 12 + size
    rows = np.frombuffer(zlib.decompress(pixels), np.uint8).reshape(height, 1 + 6 * width)
    assert (rows[:, 0] == 2).all()  # differences to the row above
    sums = np.cumsum(rows[:, 1:], 0, dtype=np.uint8)
    return np.ascontiguousarray(sums).view(">u2").reshape(height, width, 3)


def test_sintel_has_sequences_with_their_flow(folder: Path) -> None:
    """Middlebury's .flo, byte by byte, and masks."""
    for camera in (0, 1):
        place = f"camera_{camera:02d}"
        for frame in range(3):
            picture = iio.imread(folder / f"images/{3 * camera + frame:06d}.png")
            for kind in ("clean", "final"):
                assert np.array_equal(
                    iio.imread(folder / SINTEL / kind / place / f"frame_{frame + 1:04d}.png"), picture
                )
        for frame in range(2):
            found = wf.Image.load(folder / f"layers/{3 * camera + frame:06d}.exr")
            data = (folder / SINTEL / "flow" / place / f"frame_{frame + 1:04d}.flo").read_bytes()
            assert np.frombuffer(data[:4], "<f4") == np.float32(202021.25)
            assert np.frombuffer(data[4:12], "<i4").tolist() == [24, 18]
            flow, seen = np.frombuffer(data[12:], "<f4").reshape(18, 24, 2), found.flow_occluded >= 0
            assert np.array_equal(flow[seen], found.flow[seen])
            assert (flow[~seen] > 1e9).all()
            for name, code in (("occlusions", 1), ("invalid", -1)):
                mask = iio.imread(folder / SINTEL / name / place / f"frame_{frame + 1:04d}.png")
                assert np.array_equal(mask[..., 0] == 255, found.flow_occluded == code)
        assert len(list((folder / SINTEL / "flow" / place).iterdir())) == 2


def test_the_same_call_goes_on(folder: Path) -> None:
    (folder / "views/000004.json").unlink()
    options = {"format": FORMATS, "times": TIMES, "progress": False}
    assert wf.write_dataset(folder, scene(), CAMERAS, 1, **options) == 1
    with pytest.raises(wf.SceneError, match=r"is of another data set: .*flow_times"):
        wf.write_dataset(folder, scene(), CAMERAS, 1, **{**options, "times": [0, 0.2, 0.6]})


def test_flow_beyond_what_a_png_holds_is_not_valid(tmp_path: Path) -> None:
    flow = np.array([[[511.99, 0], [512, 0], [0, -511.99], [0, -513], [np.nan, 0]]], np.float32)
    path = tmp_path / "far.png"
    path.write_bytes(kitti_file(flow, np.isfinite(flow).all(2)))
    assert sixteen_bits(path)[0, :, 2].tolist() == [1, 0, 1, 0, 0]


BAD = [
    ({"times": [0, 0]}, r"times is \[0.0, 0.0\]; they must rise"),
    ({"times": []}, r"times is \[\]; they must rise, and there must be at least one"),
    ({"times": [0, np.nan]}, r"times\[1\] is nan"),
    ({"times": 3}, r"times must have shape \(n,\)"),
    ({"times": [0, 1], "shutter": (0, 1)}, "shutter is of one time; views at several times have none"),
    (
        {"format": "kitti"},
        "format is 'kitti', which has flow from one time to the next; give at least two times",
    ),
    ({"format": ("coco", "sintel"), "times": [1]}, "format is 'sintel', which has flow"),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_mistakes_are_named(options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.write_dataset(tmp_path / "set", scene(), CAMERAS, 1, progress=False, **options)
    assert not (tmp_path / "set").exists()


def test_flow_is_saved_by_extension(tmp_path: Path) -> None:
    image = wf.render(scene(), 1, camera=CAMERAS[0], aovs="flow_back", flow_times=(0.5, 1), progress=False)
    image.save_flow(tmp_path / "a.flo", "flow_back")
    assert (tmp_path / "a.flo").stat().st_size == 12 + 8 * 24 * 18
    for call, message in (
        (lambda: image.save_flow(tmp_path / "a.png"), r"no layer 'flow'; render it with aovs=\('flow',\)"),
        (
            lambda: image.save_flow(tmp_path / "a.png", "flow_back", hidden=False),
            "no layer 'flow_back_occluded'",
        ),
        (
            lambda: image.save_flow(tmp_path / "a.png", "depth"),
            "name is 'depth'; it must be one of flow, flow_back",
        ),
        (lambda: image.save_flow(tmp_path / "a.png", "flow_back", hidden=3), "hidden is 3"),
        (
            lambda: image.save_flow(tmp_path / "a.jpg", "flow_back"),
            r"flow is written as \.flo or \.png, not as '\.jpg'",
        ),
    ):
        with pytest.raises(wf.SceneError, match=message):
            call()

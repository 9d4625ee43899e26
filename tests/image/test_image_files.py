"""Pictures with all their layers: to files and back, in other programs, and what damaged files do."""

import io
import json
import math
import os
import signal
import struct
import subprocess
import sys
import time
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from inside import AOVS, from_named, png_jpeg, raster
from pictures import HEIGHT, WIDTH, with_everything
from PIL import Image as PillowImage

import wavefront as wf


def arrays_of(image):
    """Every array of an image by name."""
    fields = {name: getattr(image, name) for name in ("rgb", "counts", "variance", "standard_error")}
    errors = {f"error.{name}": values for name, values in image.errors.items()}
    return {name: a for name, a in {**fields, **image.layers, **errors}.items() if a is not None}


def assert_same(found, expected):
    """The arrays are the same bit for bit, and metadata and names are equal."""
    a, b = arrays_of(found), arrays_of(expected)
    assert a.keys() == b.keys()
    assert found.layers.keys() == expected.layers.keys()
    for name in a:
        assert (a[name].dtype, a[name].shape) == (b[name].dtype, b[name].shape), name
        assert a[name].tobytes() == b[name].tobytes(), name
    assert repr(found.metadata) == repr(expected.metadata)  # NaN equals itself there
    assert (found.spp, found.names, found.errors.keys()) == (
        expected.spp,
        expected.names,
        expected.errors.keys(),
    )


# --- Back again --------------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", ["exr", "npz"])
@pytest.mark.parametrize("background", ["transparent", None])
def test_all_of_an_image_comes_back(tmp_path, extension, background):
    image = with_everything(background)
    image.save(tmp_path / f"a.{extension}")
    assert_same(wf.Image.load(tmp_path / f"a.{extension}"), image)
    first = (tmp_path / f"a.{extension}").read_bytes()
    image.save(tmp_path / f"a.{extension}")
    assert (tmp_path / f"a.{extension}").read_bytes() == first


@pytest.mark.parametrize("extension", ["exr", "npz"])
@pytest.mark.parametrize("background", ["transparent", (0.1, 0.2, 0.3)])
def test_a_rendered_image_comes_back(tmp_path, extension, background):
    ball = wf.Sphere((0, 0, 0), 1, name="ball")
    scene = wf.Scene([ball], [wf.Environment(1, group="sky"), wf.PointLight((2, 2, 2), 1)])
    image = wf.render(
        scene, 4, size=(9, 6), noise=0.5, aovs=("all", "light_groups"), background=background, progress=False
    )
    assert {*AOVS, "light_groups.sky"} <= image.layers.keys()
    image.save(tmp_path / f"a.{extension}")
    assert_same(wf.Image.load(tmp_path / f"a.{extension}"), image)
    image.save(tmp_path / "a.png")
    with PillowImage.open(tmp_path / "a.png") as file:
        assert file.mode == ("RGBA" if background == "transparent" else "RGB")
    if background == "transparent":
        codes = np.round(255 * image.alpha)
        assert np.array_equal(np.round(255 * wf.Image.load(tmp_path / "a.png").alpha), codes)


@pytest.mark.parametrize("kind", [np.float64, np.int64, np.uint64, np.uint32])
@pytest.mark.parametrize("shape", [(), (2,), (2, 3)])
@pytest.mark.parametrize("extension", ["exr", "npz"])
def test_arrays_of_other_types_come_back(tmp_path, extension, kind, shape):
    """Also those that an exr has no type for, with the extremes of the type."""
    values = np.random.default_rng(0).integers(0, 2**63, (4, 5, *shape)).astype(kind)
    values[0, 0] = np.iinfo(kind).min if values.dtype.kind in "iu" else -np.inf
    values[1, 1] = np.iinfo(kind).max if values.dtype.kind in "iu" else np.nan
    small = np.full((4, 5, *shape), -1).astype(kind)
    image = wf.Image(np.ones((4, 5, 3), np.float32), layers={"sums": values, "small": small})
    image.save(tmp_path / f"a.{extension}")
    assert_same(wf.Image.load(tmp_path / f"a.{extension}"), image)


def test_nan_keeps_its_bits(tmp_path):
    rgb = np.zeros((2, 2, 3), np.float32)
    rgb.view(np.uint32)[:] = [0x7FC12345, 0xFFC00001, 0x80000000]
    for extension in ("exr", "npz"):
        wf.Image(rgb).save(tmp_path / f"a.{extension}")
        assert (wf.Image.load(tmp_path / f"a.{extension}").rgb.view(np.uint32) == rgb.view(np.uint32)).all()


@pytest.mark.parametrize("extension", ["exr", "npz"])
def test_adjusted_colors_come_without_what_belongs_to_the_old_ones(tmp_path, extension):
    image = with_everything()
    image.save(tmp_path / f"a.{extension}", exposure=1)
    found = wf.Image.load(tmp_path / f"a.{extension}")
    assert (found.rgb == 2 * image.rgb).all()
    assert found.layers.keys() == {"alpha"}
    assert (found.variance, found.errors, found.spp) == (None, {}, 16)


# --- Other programs ----------------------------------------------------------------------------------


def test_an_exr_in_the_api_of_openexr(tmp_path):
    """The names of channels, ids, and metadata that need no knowledge of this package."""
    import OpenEXR

    image = with_everything()
    image.save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels, header = {name: c.pixels for name, c in file.channels().items()}, dict(file.header())
    for k, letter in enumerate("RGB"):
        assert (channels[letter] == image.rgb[..., k]).all()
        assert (
            channels[f"light_groups.kéy light.{letter}"] == image.layers["light_groups.kéy light"][..., k]
        ).all()
    for k, letter in enumerate("XYZ"):
        assert (channels[f"normal.{letter}"] == image.normal[..., k]).all()
    assert (channels["A"] == image.alpha).all()
    assert np.array_equal(channels["depth.Z"], image.depth, equal_nan=True)
    assert (channels["uv.V"] == image.uv[..., 1]).all()
    assert channels["shape_id.X"].dtype == np.uint32
    missed = image.shape_id == -1
    assert missed.any()
    assert (channels["shape_id.X"][missed] == 0xFFFFFFFF).all()
    assert (channels["shape_id.X"][~missed] == image.shape_id[~missed]).all()
    assert (channels["counts.X"] == image.counts).all()
    assert (channels["error.alpha.A"] == image.errors["alpha"]).all()
    assert header["wavefront.seed"] == 7
    assert header["wavefront.sampler"] == "sobol"
    assert header["wavefront.seconds"] == np.float32(0.1)
    assert json.loads(header["wavefront"])["names"]["shape"]["1"] == "floor ü"
    assert json.loads(header["wavefront"])["metadata"]["sizes"] == [1, {"width": 2.5}]


def test_an_exr_without_a_transparent_background_has_no_plain_alpha(tmp_path):
    import OpenEXR

    with_everything("white").save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert "alpha.A" in file.channels()
        assert "A" not in file.channels()


def second_reader(path):
    """Return the channels of a file by name, as OpenImageIO reads them, and its attributes."""
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(str(path))
    spec = file.spec()
    kinds = [str(spec.channelformat(k)) for k in range(spec.nchannels)]
    channels = {
        name: file.read_image(0, 0, k, k + 1, kinds[k])[..., 0] for k, name in enumerate(spec.channelnames)
    }
    attributes = {each.name: each.value for each in spec.extra_attribs}
    file.close()
    return channels, attributes


def test_an_exr_in_a_second_reader(tmp_path):
    image = with_everything()
    image.save(tmp_path / "a.exr")
    channels, attributes = second_reader(tmp_path / "a.exr")
    assert [*channels][:4] == ["R", "G", "B", "A"]
    assert (np.stack([channels[c] for c in "RGB"], -1) == image.rgb).all()
    assert (np.stack([channels[f"normal.{c}"] for c in "XYZ"], -1) == image.normal).all()
    assert np.array_equal(channels["depth.Z"], image.depth, equal_nan=True)
    assert channels["shape_id.X"].dtype == np.uint32
    assert (channels["shape_id.X"].view(np.int32) == image.shape_id).all()
    assert (attributes["wavefront.seed"], attributes["wavefront.background"]) == (7, "transparent")


def second_reader_of_pngs(path):
    """Return the codes (H, W, C) of a file as they are stored, not multiplied by alpha."""
    import OpenImageIO

    settings = OpenImageIO.ImageSpec()
    settings["oiio:UnassociatedAlpha"] = 1
    file = OpenImageIO.ImageInput.open(str(path), settings)
    codes = file.read_image(0, 0, 0, file.spec().nchannels, str(file.spec().format))
    file.close()
    return codes


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("background", ["transparent", None])
def test_a_png_in_pillow_and_in_a_second_reader(tmp_path, bits, background):
    """Pillow gives 8 bits of 16; the second reader gives all."""
    image = with_everything(background)
    image.save(tmp_path / "a.png", bits=bits)
    codes = image.to_uint16() if bits == 16 else image.to_uint8()
    assert codes.shape == (HEIGHT, WIDTH, 4 if background == "transparent" else 3)
    with PillowImage.open(tmp_path / "a.png") as file:
        file.load()
        assert file.mode == ("RGBA" if background == "transparent" else "RGB")
        assert file.info["gamma"] == 0.45455
        seen = np.asarray(file)
    assert (seen == (codes >> 8 if bits == 16 else codes)).all()
    stored = second_reader_of_pngs(tmp_path / "a.png")
    assert (stored == codes).all()
    assert stored.dtype == codes.dtype


def test_an_npz_in_plain_numpy(tmp_path):
    image = with_everything()
    image.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        for name, values in arrays_of(image).items():
            assert np.array_equal(file[name], values, equal_nan=values.dtype.kind == "f"), name
        text = json.loads(str(file["metadata"]))
    assert text["spp"] == 16
    assert text["metadata"]["samples"] == 2**40
    assert text["names"]["shape"] == {"0": "ball", "1": "floor ü", "2": "c"}


def test_an_npz_of_plain_numpy_is_read(tmp_path):
    rgb, depth = np.ones((3, 4, 3), np.float32), np.zeros((3, 4))
    np.savez(tmp_path / "a.npz", rgb=rgb, depth=depth)
    found = wf.Image.load(tmp_path / "a.npz")
    assert (found.rgb == rgb).all()
    assert found.depth.dtype == np.float64
    assert (found.spp, found.metadata, found.names) == (0, {}, {})
    assert (wf.Environment(tmp_path / "a.npz").radiance == wf.Environment(rgb).radiance).all()


# --- Alpha of a png ----------------------------------------------------------------------------------


def test_a_png_holds_colors_that_alpha_has_not_weakened(tmp_path):
    """Half of a pixel covered by gray 0.5 is (0.25, alpha 0.5) in memory, and gray 0.5 in the file."""
    rgb, alpha = np.full((2, 3, 3), 0.25, np.float32), np.full((2, 3), 0.5, np.float32)
    rgb[0, 0], alpha[0, 0] = 0, 0
    image = wf.Image(rgb, metadata={"background": "transparent"}, layers={"alpha": alpha})
    codes = image.to_uint8(gamma=1)
    assert (codes[1, 1] == [128, 128, 128, 128]).all()
    assert (codes[0, 0] == 0).all()
    image.save(tmp_path / "a.png", bits=16)
    found = wf.Image.load(tmp_path / "a.png")
    assert found.rgb == pytest.approx(rgb, abs=2e-5)
    assert found.alpha == pytest.approx(alpha, abs=1e-5)
    found.save(tmp_path / "b.png", bits=16)
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    assert np.asarray(image.to_pil()).shape == (2, 3, 4)
    assert image._repr_png_()[25] == 6  # the color type of RGBA


def test_a_jpg_has_no_alpha(tmp_path):
    with_everything().save(tmp_path / "a.jpg")
    assert wf.Image.load(tmp_path / "a.jpg").layers == {}


# --- Png of 16 bits ----------------------------------------------------------------------------------


def filtered(rows, kinds):
    """Filter the rows (H, W, b) of a png byte by byte, as the standard defines it."""
    padded = np.zeros((rows.shape[0] + 1, rows.shape[1] + 1, rows.shape[2]), int)
    padded[1:, 1:] = rows
    out = []
    for y, kind in enumerate(kinds):
        line = [kind]
        for x in range(rows.shape[1]):
            for k in range(rows.shape[2]):
                a, b, c = padded[y + 1, x, k], padded[y, x + 1, k], padded[y, x, k]
                near = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
                predicted = (0, a, b, (a + b) // 2, near)[kind]
                line.append((padded[y + 1, x + 1, k] - predicted) % 256)
        out.append(bytes(int(value) for value in line))
    return b"".join(out)


def png(codes, pixels, interlaced=0):
    """Return a png of codes (H, W, 3 or 4), whose filtered rows are `pixels`, in two pieces."""
    height, width, channels = codes.shape
    header = struct.pack(">IIBBBBB", width, height, 16, {3: 2, 4: 6}[channels], 0, 0, interlaced)
    packed = zlib.compress(pixels)
    pieces = (b"IHDR", header), (b"IDAT", packed[:50]), (b"IDAT", packed[50:]), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in pieces
    )


@pytest.mark.parametrize("channels", [3, 4])
def test_every_filter_of_a_png_is_read(channels):
    codes = np.random.default_rng(0).integers(0, 65536, (12, 9, channels), np.uint16)
    codes[4:8] = codes[3] // 2 + 7  # smooth parts, so that predictions meet
    rows = codes.astype(">u2").view(np.uint8).reshape(12, 9, -1)
    other = png(codes, filtered(rows, [4, 3, 2, 1, 0, 4, 4, 3, 1, 2, 3, 4]))
    for each in (png_jpeg.encode(codes, ".png", "srgb"), other):
        assert (raster.decode(each) == codes).all()


def test_an_interlaced_png_of_16_bits_is_read():
    codes = np.random.default_rng(0).integers(0, 65536, (13, 9, 3), np.uint16)
    steps = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    rows = (row for x, y, dx, dy in steps for row in codes[y::dy, x::dx])
    pixels = b"".join(b"\0" + row.astype(">u2").tobytes() for row in rows)
    assert (raster.decode(png(codes, pixels, interlaced=1)) == codes).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 8), (8, 1), (33, 20)])
@pytest.mark.parametrize("gamma", [2.2, "srgb"])
def test_16_bits_come_back(tmp_path, shape, gamma):
    image = wf.Image(np.random.default_rng(1).random((*shape, 3), np.float32))
    image.save(tmp_path / "a.png", gamma, bits=16)
    found = wf.Image.load(tmp_path / "a.png")
    assert (found.to_uint16(gamma) == image.to_uint16(gamma)).all()
    assert found.rgb == pytest.approx(image.rgb, abs=5e-5)


def test_damaged_pngs_of_16_bits_are_named(tmp_path):
    path = tmp_path / "a.png"
    wf.Image(np.random.default_rng(1).random((9, 9, 3), np.float32)).save(path, bits=16)
    data = path.read_bytes()
    at = data.index(b"IDAT")
    path.write_bytes(data[: at + 9] + bytes([data[at + 9] ^ 1]) + data[at + 10 :])
    with pytest.raises(wf.SceneError, match=r"a\.png: "):
        wf.Image.load(path)
    end = data.index(b"IEND") - 8  # the checksum of the pixels
    path.write_bytes(data[:end] + bytes([data[end] ^ 1]) + data[end + 1 :])
    with pytest.raises(wf.SceneError, match=r"a\.png: the checksum of a chunk b'IDAT' is wrong"):
        wf.Image.load(path)
    path.write_bytes(data[: at + 60])
    with pytest.raises(wf.SceneError, match=r"a\.png: ends early"):
        wf.Image.load(path)


def test_bits_and_tones_that_a_format_cannot_hold(tmp_path):
    image = with_everything()
    for bits, name, message in (
        (16, "a.jpg", r"a\.jpg: bits=16 is for \.png; \.jpg has another precision"),
        (16, "a.exr", r"a\.exr: bits=16 is for \.png"),
        (12, "a.png", r"a\.png: bits is 12; it must be 8 or 16"),
    ):
        with pytest.raises(wf.SaveError, match=message):
            image.save(tmp_path / name, bits=bits)
    for extension in ("exr", "hdr", "npy", "npz"):
        with pytest.raises(wf.SaveError, match=rf"a\.{extension}: tone='agx' is for \.png"):
            image.save(tmp_path / f"a.{extension}", tone="agx")
    assert not list(tmp_path.iterdir())


# --- Damaged and hostile files -----------------------------------------------------------------------


def members(path):
    """The members of an archive by name."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def archive(path, content):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in content.items():
            file.writestr(name, data)


def npy(values, **options):
    buffer = io.BytesIO()
    np.save(buffer, values, **options)
    return buffer.getvalue()


def header(shape, descr="<f4"):
    """An npy of no data whose header claims a shape."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": descr, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


HOSTILE = [
    ({"a.npy": npy(np.array([{}]), allow_pickle=True)}, "only numbers and text"),
    ({"a.npy": header((2**40,))}, "only numbers and text of their own size"),
    ({"a.npy": header((3, 4), "|O")}, "only numbers and text"),
    ({"a.npy": header((-1, -48))}, ""),
    ({"a.npy": b"no array"}, "magic"),
    ({"a.npy": npy(np.zeros((5, 5)))}, "it must hold numbers of 4 × 3 pixels"),
    ({"a.npy": npy(np.full((3, 4), "text"))}, "it must hold numbers"),
    ({"alpha.npy": npy(np.zeros((3, 4, 1)))}, "array 'alpha' has shape"),
    ({"rgb.npy": npy(np.zeros((3, 4, 3)))}, "array 'rgb' is float64"),
    ({"rgb.npy": npy(np.zeros((0, 4, 3), np.float32))}, "must have at least one"),
    ({"metadata.npy": npy(np.array(7))}, "it must be one text"),
    ({"metadata.npy": npy(np.array("{"))}, "metadata are damaged"),
    ({"metadata.npy": npy(np.array("[" * 100_000))}, "metadata are damaged"),
    ({"metadata.npy": npy(np.array('{"spp": "many"}'))}, "metadata are damaged"),
    ({"metadata.npy": npy(np.array('{"names": {"shape": {"x": "ball"}}}'))}, "metadata are damaged"),
    ({"metadata.npy": npy(np.array('{"metadata": [1]}'))}, "metadata are damaged"),
]


@pytest.mark.parametrize(("change", "message"), HOSTILE)
def test_hostile_archives_are_named(tmp_path, change, message):
    sound = {"rgb.npy": npy(np.zeros((3, 4, 3), np.float32))}
    archive(tmp_path / "a.npz", sound)
    assert wf.Image.load(tmp_path / "a.npz").shape == (3, 4, 3)
    archive(tmp_path / "a.npz", {**sound, **change})
    with pytest.raises(wf.SceneError, match=rf"a\.npz: .*{message}"):
        wf.Image.load(tmp_path / "a.npz")


def claiming(path, sizes):
    """Write an npz file whose headers and directory claim float32 arrays of these shapes, without content."""
    out = {}
    for name, shape in sizes.items():
        buffer = io.BytesIO()
        header = {"descr": "<f4", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(buffer, header)
        out[f"{name}.npy"] = buffer.getvalue()
    archive(path, out)
    data = path.read_bytes()
    for name, shape in sizes.items():
        entry = data.rindex(b"PK\x01\x02", 0, data.rindex(f"{name}.npy".encode()))
        claimed = len(out[f"{name}.npy"]) + 4 * math.prod(shape)
        data = data[: entry + 24] + struct.pack("<I", claimed) + data[entry + 28 :]
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"rgb": (16384, 8193, 3)}, r"image has 8193 × 16384 pixels; the limit is 134217728"),
        (
            {"rgb": (8192, 8192, 3), "a": (8192, 8192, 3), "b": (8192, 8192, 3)},
            r"the content of 3 arrays takes 2415919\d+ bytes of memory; the limit is 2147\d+ ",
        ),
    ],
)
def test_an_archive_that_claims_too_much_is_refused_before_it_is_read(tmp_path, fails, sizes, message):
    fails("wavefront.codecs.npz._read", AssertionError("is read"))
    claiming(tmp_path / "a.npz", sizes)
    with pytest.raises(wf.SceneError, match=rf"a\.npz: {message}"):
        wf.Image.load(tmp_path / "a.npz")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_archives_of_other_methods_are_refused(tmp_path, method):
    """Python unpacks a block of bzip2 at once, whatever its size."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as file:
        file.writestr("rgb.npy", npy(np.zeros((3, 4, 3), np.float32)))
    with pytest.raises(wf.SceneError, match=r"a\.npz: its member 'rgb\.npy' is compressed by (bzip2|lzma)"):
        wf.Image.load(tmp_path / "a.npz")


def test_a_member_that_inflates_to_more_than_it_claims_is_refused(tmp_path):
    """And is not inflated beyond its claim."""
    content = npy(np.zeros((300, 400, 3), np.float32))
    archive(tmp_path / "a.npz", {"rgb.npy": content + bytes(2**26)})
    path = tmp_path / "a.npz"
    data = path.read_bytes()
    entry = data.rindex(b"PK\x01\x02")
    path.write_bytes(data[: entry + 24] + struct.pack("<I", len(content)) + data[entry + 28 :])
    tracemalloc.start()
    with pytest.raises(wf.SceneError, match=r"a\.npz: not a readable npz file: Bad CRC"):
        wf.Image.load(path)
    assert tracemalloc.get_traced_memory()[1] < 2**23
    tracemalloc.stop()


def test_missing_rgb_and_no_archive(tmp_path):
    archive(tmp_path / "a.npz", {"depth.npy": npy(np.zeros((3, 4)))})
    with pytest.raises(wf.SceneError, match=r"a\.npz: the array 'rgb' is missing"):
        wf.Image.load(tmp_path / "a.npz")
    (tmp_path / "a.npz").write_bytes(b"hello")
    with pytest.raises(wf.SceneError, match=r"a\.npz: not a readable npz file"):
        wf.Image.load(tmp_path / "a.npz")
    with pytest.raises(wf.SceneError, match=r"a\.npz: there is no such file|the array 'rgb' is missing"):
        from_named({}, {})


@pytest.mark.parametrize(
    "attribute",
    [
        "{",
        '{"arrays": {"rgb": {}}}',
        '{"arrays": {"rgb": {"channels": ["R", "G", "nothing"], "type": "f4", "shape": [3]}}}',
        '{"arrays": {"rgb": {"channels": ["R", "G", "B"], "type": "O", "shape": [3]}}}',
        '{"arrays": {"rgb": {"channels": ["R", "G", "B"], "type": "f4", "shape": [9999999999]}}}',
        '{"arrays": {"rgb": {"channels": [], "type": "f4", "shape": [3]}}}',
        '{"arrays": 3}',
        "{}",
    ],
)
def test_attributes_that_do_not_fit_an_exr_are_named(tmp_path, attribute):
    import OpenEXR

    pixels = {name: np.ones((3, 4), np.float32) for name in "RGB"}
    head = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File({**head, "wavefront": attribute}, pixels).write(str(tmp_path / "a.exr"))
    with pytest.raises(wf.SceneError, match=r"a\.exr: .*(damaged|does not fit|missing)"):
        wf.Image.load(tmp_path / "a.exr")
    OpenEXR.File({**head, "wavefront.seed": 3}, pixels).write(str(tmp_path / "a.exr"))
    assert wf.Image.load(tmp_path / "a.exr").shape == (3, 4, 3)


@pytest.mark.parametrize("extension", ["exr", "npz"])
def test_names_of_any_characters(tmp_path, extension):
    """Those of shapes and the metadata come from files. Those of layers must be printable."""
    rgb, path = np.ones((2, 2, 3), np.float32), tmp_path / f"a.{extension}"
    names = {"shape": {0: "\udcff", 1: "a\0b", 2: "\n", 3: "図", 4: ""}}
    image = wf.Image(rgb, metadata={"lighting": "a\0b", "sampler": "\udcff\n"}, names=names)
    image.save(path)
    assert_same(wf.Image.load(path), image)
    for name in ("", "light_groups.a\0b", "\n"):
        with pytest.raises(wf.SaveError, match=rf"a\.{extension}: an array is called"):
            wf.Image(rgb, layers={name: rgb}).save(path)


def test_arrays_that_an_exr_cannot_hold_are_errors(tmp_path):
    rgb = np.ones((2, 2, 3), np.float32)
    similar = {"a": rgb, "a.R": rgb[..., 0], "a.R.X": rgb[..., 1], "R": rgb[..., 2]}
    wf.Image(rgb, layers=similar).save(tmp_path / "a.exr")
    assert_same(wf.Image.load(tmp_path / "a.exr"), wf.Image(rgb, layers=similar))
    with pytest.raises(wf.SaveError, match=r"the array 'm' is bool; an exr holds f4, u4"):
        wf.Image(rgb, layers={"m": np.ones((2, 2), bool)}).save(tmp_path / "b.exr")


# --- Faults ------------------------------------------------------------------------------------------

posix = pytest.mark.skipif(sys.platform == "win32", reason="limits and signals of POSIX")
SAVE = """
import resource, sys
sys.path.insert(0, {folder!r})
from pictures import with_everything
import wavefront as wf
image = wf.Image(with_everything().rgb.repeat(40, 0).repeat(40, 1))
"""
FULL = (
    SAVE
    + """
resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
try:
    image.save(sys.argv[1])
except wf.SaveError as error:
    print(error)
"""
)
FOREVER = (
    SAVE
    + """
print(flush=True)
while True:
    image.save(sys.argv[1])
"""
)


def test_errors_of_writing_name_no_file_but_the_users(tmp_path, fails):
    fails("os.replace", PermissionError(13, "Permission denied", "scratch", None, "a.png"))
    with pytest.raises(wf.SaveError, match=r"a\.png: cannot be written: Permission denied$"):
        with_everything().save(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@posix
@pytest.mark.parametrize("extension", ["png", "npz"])
@pytest.mark.first(1)
def test_a_full_disk_leaves_the_old_file(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    with_everything().save(path)
    before = path.read_bytes()
    script = FULL.format(folder=os.path.dirname(__file__))
    done = subprocess.run([sys.executable, "-c", script, path], check=True, capture_output=True, text=True)
    assert f"a.{extension}: cannot be written: " in done.stdout
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@posix
@pytest.mark.parametrize(("extension", "pause"), [("exr", 0.07), ("npz", 0.15)])
@pytest.mark.first(1)
def test_a_killed_process_leaves_a_whole_file(tmp_path, extension, pause):
    path = tmp_path / f"a.{extension}"
    script = FOREVER.format(folder=os.path.dirname(__file__))
    with subprocess.Popen([sys.executable, "-c", script, path], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        while not path.exists() and process.poll() is None:
            time.sleep(0.01)
        time.sleep(pause)
        process.send_signal(signal.SIGKILL)
    expected = with_everything().rgb.repeat(40, 0).repeat(40, 1)
    assert (wf.Image.load(path).rgb == expected).all()

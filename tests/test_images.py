"""Images: every format out and in, and every error message."""

import os
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wavefront.errors import SceneError
from wavefront.io import files, png, rgbe
from wavefront.io.images import (
    check_writable,
    linear_to_srgb,
    read_image,
    srgb_to_linear,
    to_8bit,
    write_channels,
    write_image,
)


@pytest.fixture
def picture():
    """A (6, 11, 3) picture with smooth and flat parts, darker than 1 and brighter."""
    rng = np.random.default_rng(1)
    rgb = rng.random((6, 11, 3), np.float32) * 2
    rgb[2:4, 1:9] = 0.25
    return rgb


@pytest.mark.parametrize("extension", ["exr", "npy"])
def test_float_formats_are_exact(tmp_path, picture, extension):
    path = tmp_path / f"a.{extension}"
    write_image(path, picture)
    assert np.array_equal(read_image(path), picture)
    assert read_image(path).dtype == np.float32


def test_hdr_is_within_its_precision(tmp_path, picture):
    write_image(tmp_path / "a.hdr", picture)
    found = read_image(tmp_path / "a.hdr")
    assert found.shape == picture.shape
    # half a step of an 8-bit mantissa of the largest channel, which is at least 128 steps
    assert (np.abs(found - picture) <= picture.max(axis=2, keepdims=True) / 255).all()


@pytest.mark.parametrize("gamma", [2.2, 1.0, "srgb"])
def test_png_decodes_to_what_was_written(tmp_path, picture, gamma):
    write_image(tmp_path / "a.png", picture, gamma=gamma)
    coded = read_image(tmp_path / "a.png")
    linear = srgb_to_linear(coded) if gamma == "srgb" else coded**gamma
    clipped = np.minimum(picture, 1)
    again = linear_to_srgb(clipped) if gamma == "srgb" else clipped ** (1 / gamma)
    assert np.abs(coded - again).max() <= 0.5001 / 255
    assert np.abs(linear - clipped).max() < 0.01


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (40, 31)])
def test_png_keeps_every_code(shape):
    """In rows of any length; noise grows by little, and an even picture is small."""
    import imageio.v3 as iio

    noise = np.random.default_rng(3).integers(0, 256, (*shape, 3), np.uint8)
    data = png.encode(noise)
    assert np.array_equal(iio.imread(data, extension=".png"), noise)
    assert len(data) < noise.size * 1.05 + 100
    even = np.full((*shape, 3), 200, np.uint8)
    assert np.array_equal(iio.imread(png.encode(even), extension=".png"), even)
    assert len(png.encode(even)) < 100 + noise.size / 50


def test_jpg_is_close(tmp_path):
    flat = np.full((16, 16, 3), [0.8, 0.4, 0.1], np.float32)
    for extension in ("jpg", "jpeg"):
        write_image(tmp_path / f"a.{extension}", flat, gamma=1)
        assert np.abs(read_image(tmp_path / f"a.{extension}") - flat).max() < 3 / 255


def test_exposure_counts_stops_in_every_format(tmp_path, picture):
    for extension in ("exr", "npy"):
        write_image(tmp_path / f"a.{extension}", picture, exposure=-2)
        assert np.array_equal(read_image(tmp_path / f"a.{extension}"), picture / 4)
    write_image(tmp_path / "a.png", picture / 4, exposure=1, gamma=1)
    assert np.abs(read_image(tmp_path / "a.png") - picture / 2).max() <= 0.5001 / 255


def test_srgb_curve_is_the_standard_one():
    # IEC 61966-2-1: the two pieces meet, and 0.5 encodes to 188/255
    assert linear_to_srgb(np.float32([0, 0.0031308, 0.5, 1])) == pytest.approx(
        [0, 0.04045, 0.735357, 1], abs=1e-5
    )
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    assert np.abs(srgb_to_linear(linear_to_srgb(values)) - values).max() < 1e-6


def test_every_8bit_value_survives_srgb():
    values = np.arange(256, dtype=np.uint8)
    assert np.array_equal(to_8bit(srgb_to_linear(values / np.float32(255)), "srgb"), values)


def test_exr_keeps_attributes_and_channels(tmp_path, picture):
    import OpenEXR

    ids = np.arange(66, dtype=np.uint32).reshape(6, 11) + np.uint32(2**31)
    path = tmp_path / "a.exr"
    write_channels(path, {"RGB": picture, "Z": picture[..., 0], "id": ids}, {"spp": 12, "note": "hi"})
    file = OpenEXR.File(str(path))
    assert np.array_equal(file.channels()["id"].pixels, ids)
    assert np.array_equal(file.channels()["Z"].pixels, picture[..., 0])
    assert (file.header()["spp"], file.header()["note"]) == (12, "hi")
    assert np.array_equal(read_image(path), picture)


def test_grey_alpha_and_16_bit(tmp_path):
    import imageio.v3 as iio

    ramp = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    iio.imwrite(tmp_path / "deep.png", ramp)
    assert np.array_equal(read_image(tmp_path / "deep.png")[..., 0], (ramp / np.float32(65535)).astype("f4"))
    for channels in (2, 4):
        values = np.arange(12 * channels, dtype=np.uint8).reshape(3, 4, channels)
        iio.imwrite(tmp_path / "c.png", values)
        assert np.array_equal(read_image(tmp_path / "c.png"), values / np.float32(255))


@pytest.mark.parametrize("extension", ["png", "jpg", "hdr"])
def test_not_finite_is_announced(tmp_path, picture, extension):
    picture[0, :3] = np.nan
    picture[1, 1, 0] = np.inf
    with pytest.warns(UserWarning, match=r"4 pixels are not finite"):
        write_image(tmp_path / f"a.{extension}", picture)
    assert np.isfinite(read_image(tmp_path / f"a.{extension}")).all()


def test_float_formats_keep_nan(tmp_path, picture):
    picture[0, 0] = np.nan
    for extension in ("exr", "npy"):
        write_image(tmp_path / f"a.{extension}", picture)
        assert np.isnan(read_image(tmp_path / f"a.{extension}")[0, 0]).all()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.tga", r"a\.tga: extension '\.tga' is not one of \.png, \.jpg, \.jpeg, \.exr, \.hdr, \.npy"),
        ("a", r"extension '' is not one of"),
        ("missing/a.png", r"a\.png: the folder .*missing does not exist"),
        ("folder.png", r"folder\.png: is a folder"),
    ],
)
def test_refuses_to_write(tmp_path, picture, name, message):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(SceneError, match=message):
        check_writable(tmp_path / name)
    with pytest.raises(ValueError, match=message):
        write_image(tmp_path / name, picture)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.png"]


def test_check_writable_leaves_no_trace(tmp_path):
    check_writable(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_refuses_a_folder_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(SceneError, match="not writable"):
        check_writable(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gamma": 0}, "gamma is 0; it must be above 0"),
        ({"gamma": "rec709"}, "gamma is 'rec709'"),
        ({"gamma": float("nan")}, "gamma is nan"),
        ({"exposure": float("inf")}, "exposure is inf"),
    ],
)
def test_refuses_arguments(tmp_path, picture, arguments, message):
    with pytest.raises(SceneError, match=message):
        write_image(tmp_path / "a.png", picture, **arguments)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (0, 4, 3)])
def test_refuses_shapes(tmp_path, shape):
    with pytest.raises(SceneError, match="must have shape"):
        write_image(tmp_path / "a.png", np.zeros(shape))


def test_a_failed_write_keeps_the_old_file(tmp_path, picture, monkeypatch):
    path = tmp_path / "a.npy"
    write_image(path, picture)
    before = path.read_bytes()

    def no_space(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", no_space)
    with pytest.raises(SceneError, match=r"a\.npy: cannot be written: .*No space left"):
        write_image(path, picture * 2)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
def test_a_written_file_has_ordinary_permissions(tmp_path, picture):
    mask = os.umask(0)
    os.umask(mask)
    write_image(tmp_path / "a.png", picture)
    assert stat.S_IMODE((tmp_path / "a.png").stat().st_mode) == 0o666 & ~mask


@pytest.mark.parametrize("extension", ["png", "jpg", "exr", "hdr", "npy"])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.9])
def test_damaged_images_are_named(tmp_path, picture, extension, part, capfd):
    path = tmp_path / f"a.{extension}"
    write_image(path, picture.repeat(20, 0).repeat(20, 1))
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * part)])
    with pytest.raises(SceneError, match=rf"a\.{extension}: "):
        read_image(path)


def test_missing_folder_and_other_kinds(tmp_path):
    with pytest.raises(SceneError, match=r"no\.png: there is no such file"):
        read_image(tmp_path / "no.png")
    with pytest.raises(SceneError, match=r"extension '\.gif' is not one of"):
        read_image(tmp_path / "no.gif")
    (tmp_path / "d.png").mkdir()
    with pytest.raises(SceneError, match=r"d\.png: is a folder"):
        read_image(tmp_path / "d.png")
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(SceneError, match=r"text\.png: not a readable png or jpg image"):
        read_image(tmp_path / "text.png")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "p.png")
    with pytest.raises(SceneError, match=r"p\.png: is a device or pipe"):
        read_image(tmp_path / "p.png")


def _bomb_png(width, height):
    import struct
    import zlib

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


@pytest.mark.parametrize("width", [30000, 12000])
def test_a_bomb_is_refused_before_decoding(tmp_path, width):
    (tmp_path / "b.png").write_bytes(_bomb_png(width, width))
    with pytest.raises(SceneError, match=rf"b\.png: image has {width} × {width} pixels; the limit is"):
        read_image(tmp_path / "b.png")
    (tmp_path / "b.hdr").write_bytes(f"#?RADIANCE\n\n-Y {width} +X {width}\n".encode())
    with pytest.raises(SceneError, match=rf"b\.hdr: image has {width} × {width} pixels; the limit is"):
        read_image(tmp_path / "b.hdr")


def test_npy_with_objects_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[{}]]), allow_pickle=True)
    with pytest.raises(SceneError, match=r"a\.npy: not a readable npy image"):
        read_image(tmp_path / "a.npy")


@pytest.mark.parametrize("width", [1, 7, 8, 127, 128, 129, 300])
def test_hdr_round_trip_at_every_width(width):
    values = np.random.default_rng(width).integers(0, 3, (3, width, 4), np.uint8)
    values[..., 3] = 128
    values[1, :, :3] = 7  # one long run
    pixels = rgbe.from_rgbe(values)
    assert np.array_equal(rgbe.decode(rgbe.encode(pixels)), pixels)


@settings(max_examples=50, deadline=None)
@given(st.integers(8, 400), st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_hdr_coding_loses_nothing(width, seed, run):
    rng = np.random.default_rng(seed)
    mantissa = rng.integers(128, 256, (2, -(-width // run), 4), np.uint8).repeat(run, 1)[:, :width]
    pixels = rgbe.from_rgbe(mantissa)
    assert np.array_equal(rgbe.decode(rgbe.encode(pixels)), pixels)


def test_hdr_of_other_orders_and_spaces_is_refused():
    for header, message in (
        (b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "XYZ"),
        (b"#?RADIANCE\n\n+Y 1 +X 1\n", "only -Y"),
        (b"P6 1 1 255\n", "header is damaged"),
    ):
        with pytest.raises(SceneError, match=message):
            rgbe.decode(header + bytes(4))


def test_hdr_range():
    # the format holds about 1e-38 to 1e38; smaller is black
    pixels = np.array([[[1e-30, 0, 0], [1e30, 1, 0], [1e-36, 0, 0], [3e38, 0, 0]]], np.float32)
    found = rgbe.decode(rgbe.encode(pixels))
    assert found[0, 0, 0] == pytest.approx(1e-30, rel=0.01)
    assert found[0, 1, 0] == pytest.approx(1e30, rel=0.01)
    assert found[0, 2, 0] == 0
    assert np.isfinite(found).all()


def test_paths_may_be_strings_or_not_ascii(tmp_path, picture):
    path = str(tmp_path / "ünïcode 図.png")
    write_image(path, picture)
    assert read_image(path).shape == picture.shape
    assert Path(path).exists()

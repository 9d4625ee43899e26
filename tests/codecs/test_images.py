"""Images: every format out and in, and every error message."""

import os
import stat
import struct
import subprocess
import sys
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    Display,
    SaveError,
    SceneError,
    check_writable,
    files,
    linear_to_srgb,
    read_image,
    srgb_to_linear,
    to_codes,
    write_image,
)
from inside import hdr as rgbe
from inside import png_jpeg as coded


@pytest.fixture
def picture():
    """A (6, 11, 3) picture with smooth and flat parts, darker than 1 and brighter."""
    rng = np.random.default_rng(1)
    rgb = rng.random((6, 11, 3), np.float32) * 2
    rgb[2:4, 1:9] = 0.25
    return rgb


def test_hdr_is_within_its_precision(tmp_path, picture):
    write_image(tmp_path / "a.hdr", picture)
    found = read_image(tmp_path / "a.hdr")
    assert found.shape == picture.shape
    # half a step of an 8-bit mantissa of the largest channel, which is at least 128 steps
    assert (np.abs(found - picture) <= picture.max(axis=2, keepdims=True) / 255).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (40, 31)])
def test_png_keeps_every_code(shape):
    """In rows of any length; noise grows by little, and an even picture is small."""
    import imageio.v3 as iio

    noise = np.random.default_rng(3).integers(0, 256, (*shape, 3), np.uint8)
    data = coded.encode(noise, ".png", 2.2)
    assert np.array_equal(iio.imread(data, extension=".png"), noise)
    assert len(data) < noise.size * 1.05 + 100
    even = np.full((*shape, 3), 200, np.uint8)
    flat = coded.encode(even, ".png", 2.2)
    assert np.array_equal(iio.imread(flat, extension=".png"), even)
    assert len(flat) < 120 + noise.size / 50


def test_srgb_curve_is_the_standard_one():
    # IEC 61966-2-1: the two pieces meet, and 0.5 encodes to 188/255
    assert linear_to_srgb(np.float32([0, 0.0031308, 0.5, 1])) == pytest.approx(
        [0, 0.04045, 0.735357, 1], abs=1e-5
    )
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    assert np.abs(srgb_to_linear(linear_to_srgb(values)) - values).max() < 1e-6


def test_every_8bit_value_survives_srgb():
    values = np.arange(256, dtype=np.uint8)
    assert np.array_equal(to_codes(srgb_to_linear(values / np.float32(255)), "srgb"), values)


def test_gray_alpha_and_16_bit(tmp_path):
    import imageio.v3 as iio

    ramp = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    iio.imwrite(tmp_path / "deep.png", ramp)
    assert np.array_equal(read_image(tmp_path / "deep.png")[..., 0], (ramp / np.float32(65535)).astype("f4"))
    for channels in (2, 4):
        values = np.arange(12 * channels, dtype=np.uint8).reshape(3, 4, channels)
        iio.imwrite(tmp_path / "c.png", values)
        assert np.array_equal(read_image(tmp_path / "c.png"), values / np.float32(255))


def test_bmp_is_read_and_checked(tmp_path):
    import imageio.v3 as iio

    path, codes = tmp_path / "a.bmp", np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    iio.imwrite(path, codes)
    assert np.array_equal(read_image(path), codes / np.float32(255))
    data = path.read_bytes()
    for damaged, message in (
        (data[:-1], "ends early: 4 × 3 pixels take 36 bytes; 35 are there"),
        (data[:40], "header is damaged"),
        (data[:18] + struct.pack("<ii", 2**30, 2**30) + data[26:], "the limit is"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(SceneError, match=message):
            read_image(path)
    with pytest.raises(SaveError, match="extension"):
        write_image(path, codes / 255)


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
        (
            "a.tga",
            r"a\.tga: extension is '\.tga'; it must be one of "
            r"\.png, \.jpg, \.jpeg, \.exr, \.hdr, \.npy, \.npz",
        ),
        ("", r": is a folder, not a file"),
        ("a", r"a: has no extension; it must be one of .png"),
        ("missing/a.png", r"a\.png: the folder .*missing does not exist"),
        ("folder.png", r"folder\.png: is a folder"),
    ],
)
def test_refuses_to_write(tmp_path, picture, name, message):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(SaveError, match=message):
        check_writable(tmp_path / name)
    with pytest.raises(SaveError, match=message):
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
        ({"gamma": 0}, "gamma is 0; it must be from 0.01 to 100"),
        ({"gamma": 1e6}, "gamma is 1000000.0; it must be from 0.01 to 100"),
        ({"gamma": "rec709"}, "gamma is 'rec709'"),
        ({"gamma": float("nan")}, "gamma is nan"),
        ({"exposure": float("inf")}, "exposure is inf"),
        ({"exposure": 5000}, "exposure is 5000; it must be from -100 to 100"),
    ],
)
def test_refuses_arguments(tmp_path, picture, arguments, message):
    with pytest.raises(SceneError, match=message):
        write_image(tmp_path / "a.png", picture, Display(**arguments))


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (0, 4, 3)])
def test_refuses_shapes(tmp_path, shape):
    with pytest.raises(SceneError, match="must have shape"):
        write_image(tmp_path / "a.png", np.zeros(shape))


def test_a_failed_write_keeps_the_old_file(tmp_path, picture, full_disk, scratch):
    path = tmp_path / "a.npy"
    write_image(path, picture)
    before = path.read_bytes()
    full_disk()
    with pytest.raises(SaveError, match=r"a\.npy: cannot be written: .*No space left"):
        write_image(path, picture * 2)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]


# --- Saving ------------------------------------------------------------------------------------------

posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions, links and pipes")


@pytest.fixture(params=["nameless", "named"])
def scratch(request, monkeypatch):
    """Write with scratch files of both kinds."""
    if request.param == "named":
        monkeypatch.setattr(files, "OPEN_FILES", "/no/such/folder")
    return request.param


@pytest.mark.parametrize("extension", ["png", "jpg", "exr", "hdr", "npy"])
def test_no_other_folder_is_needed(tmp_path, picture, monkeypatch, extension, scratch):
    """Least of all the system's folder for temporary files."""
    import tempfile

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    write_image(tmp_path / f"a.{extension}", picture)
    assert read_image(tmp_path / f"a.{extension}").shape == picture.shape
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{extension}"]


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444])
def test_a_replaced_file_keeps_its_permissions(tmp_path, picture, scratch, mode):
    path = tmp_path / "a.npy"
    write_image(path, picture)
    path.chmod(mode)
    write_image(path, picture * 2)
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert np.array_equal(read_image(path), picture * 2)


@posix
def test_a_symbolic_link_is_followed(tmp_path, picture, scratch):
    (tmp_path / "there").mkdir()
    (tmp_path / "link.npy").symlink_to(tmp_path / "there" / "a.npy")
    for factor in (1, 2):
        write_image(tmp_path / "link.npy", picture * factor)
        assert (tmp_path / "link.npy").is_symlink()
        assert np.array_equal(read_image(tmp_path / "there" / "a.npy"), picture * factor)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_is_not_replaced(tmp_path, picture):
    os.mkfifo(tmp_path / "p.png")
    for write in (check_writable, lambda path: write_image(path, picture)):
        with pytest.raises(SaveError, match=r"p\.png: is a device or pipe; only regular files are written"):
            write(tmp_path / "p.png")
    assert stat.S_ISFIFO((tmp_path / "p.png").stat().st_mode)


@posix
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("x" * 252 + ".png", "File name too long"),
        ("图" * 90 + ".png", "File name too long"),
        ("a\0b.png", "null"),
        ("loop.png", "[Ss]ymbolic links"),
        ("file/a.png", "the folder .*file does not exist"),
    ],
)
def test_names_that_cannot_be(tmp_path, picture, name, message):
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    (tmp_path / "file").write_text("")
    path = f"{tmp_path}/{name}"
    for write in (check_writable, lambda path: write_image(path, picture)):
        with pytest.raises(SaveError, match=message):
            write(path)


def test_a_name_of_255_bytes_is_written(tmp_path, picture, scratch):
    name = "图" * 83 + "xx.png"
    assert len(name.encode()) == 255
    write_image(tmp_path / name, picture)
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("path", [5, b"a.png", None, 2.5])
def test_what_is_no_path_is_refused(picture, path):
    for write in (check_writable, lambda path: write_image(path, picture)):
        with pytest.raises(SaveError, match=f"path is {path!r}; it must be text or a path"):
            write(path)
    with pytest.raises(SceneError, match=f"path is {path!r}; it must be text or a path"):
        read_image(path)


@posix
def test_a_folder_that_cannot_be_read_is_written_to(tmp_path, picture, fails):
    denied = PermissionError(13, "Permission denied")
    fails("os.open", denied, lambda path, flags, *args, **named: flags == os.O_RDONLY)
    write_image(tmp_path / "a.npy", picture)
    assert np.array_equal(np.load(tmp_path / "a.npy"), picture)


def test_a_read_only_file_system_is_a_save_error(tmp_path, picture, fails):
    """Also one that becomes so after the check."""
    fails("os.open", OSError(30, "Read-only file system"))
    with pytest.raises(SaveError, match=r"a\.png: cannot be written: .*Read-only file system"):
        write_image(tmp_path / "a.png", picture)


@posix
def test_files_without_names_that_cannot_be_named_do_not_matter(tmp_path, picture, fails):
    fails("os.link", PermissionError(1, "Operation not permitted"))
    write_image(tmp_path / "a.npy", picture)
    assert np.array_equal(np.load(tmp_path / "a.npy"), picture)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]


def test_what_encoders_refuse_is_a_save_error(tmp_path):
    with pytest.raises(SaveError, match=r"a\.jpg: cannot be encoded: a jpg has at most 65500 rows"):
        write_image(tmp_path / "a.jpg", np.zeros((1, 65501, 3)))
    assert not list(tmp_path.iterdir())


@posix
def test_a_killed_process_leaves_nothing_behind(tmp_path):
    """Where the system has files without names."""
    try:
        os.close(os.open(tmp_path, os.O_WRONLY | os.O_TMPFILE))
    except (AttributeError, OSError):
        pytest.skip("no files without names here")
    code = (
        "import os, signal, sys, numpy as np\n"
        "from wavefront.core import files\n"
        "from wavefront.codecs.images import write_image\n"
        "files.os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)\n"
        "write_image(sys.argv[1], np.ones((4, 4, 3)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "a.npy"], check=False, timeout=60)
    assert done.returncode < 0
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
def test_a_written_file_has_ordinary_permissions(tmp_path, picture, scratch):
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
    with pytest.raises(SceneError, match=r"extension is '\.psd'; it must be one of"):
        read_image(tmp_path / "no.psd")
    (tmp_path / "d.png").mkdir()
    with pytest.raises(SceneError, match=r"d\.png: is a folder"):
        read_image(tmp_path / "d.png")
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(SceneError, match=r"text\.png: not a readable image: its header is damaged"):
        read_image(tmp_path / "text.png")


def test_a_png_whose_text_is_a_bomb(tmp_path):
    """64 MB in 64 kB: refused without unpacking them, and the message says why."""

    def chunk(name, content):
        return (
            struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        )

    header = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    bomb = chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(1 << 26)))
    pixels = chunk(b"IDAT", zlib.compress(bytes(4))) + chunk(b"IEND", b"")
    (tmp_path / "t.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + bomb + pixels)
    tracemalloc.start()
    try:
        with pytest.raises(
            SceneError, match=r"t\.png: not a readable png image: Decompressed data too large"
        ):
            read_image(tmp_path / "t.png")
        assert tracemalloc.get_traced_memory()[1] < 1 << 25
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "p.png")
    with pytest.raises(SceneError, match=r"p\.png: is a device or pipe"):
        read_image(tmp_path / "p.png")


def _png(width, height, rows, bits=8, kind=0, interlaced=0):
    """A png whose header claims `width` × `height` pixels; `rows` are its bytes before deflate."""

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, interlaced))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("width", [30000, 12000])
def test_a_bomb_is_refused_before_decoding(tmp_path, width):
    (tmp_path / "b.png").write_bytes(_png(width, width, bytes(1000)))
    with pytest.raises(SceneError, match=rf"b\.png: image has {width} × {width} pixels; the limit is"):
        read_image(tmp_path / "b.png")
    (tmp_path / "b.hdr").write_bytes(f"#?RADIANCE\n\n-Y {width} +X {width}\n".encode())
    with pytest.raises(SceneError, match=rf"b\.hdr: image has {width} × {width} pixels; the limit is"):
        read_image(tmp_path / "b.hdr")


def test_npy_with_objects_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[{}]]), allow_pickle=True)
    with pytest.raises(SceneError, match=r"a\.npy: the array 'array' is object of shape"):
        read_image(tmp_path / "a.npy")


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 400), st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_hdr_coding_loses_nothing(width, seed, run):
    rng = np.random.default_rng(seed)
    mantissa = rng.integers(128, 256, (2, -(-width // run), 4), np.uint8).repeat(run, 1)[:, :width]
    pixels = rgbe.from_rgbe(mantissa)
    assert np.array_equal(rgbe.decode(rgbe.encode(pixels)), pixels)


def test_hdr_of_other_spaces_is_refused():
    for header, message in (
        (b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "XYZ"),
        (b"#?RADIANCE\n\n-Y 1 +Y 1\n", "header is damaged"),
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


# --- Files that claim more than they hold ------------------------------------------------------------


@pytest.mark.parametrize(("bits", "kind", "channels"), [(8, 0, 1), (8, 2, 3), (16, 6, 4), (1, 0, 1)])
def test_a_png_with_too_few_rows_is_an_error(tmp_path, bits, kind, channels):
    width, height = 13, 24
    row = b"\0" + bytes(range(1, 1 + (width * bits * channels + 7) // 8))
    path = tmp_path / "a.png"
    path.write_bytes(_png(width, height, row * height, bits, kind))
    assert read_image(path).shape[:2] == (height, width)
    for rows in (0, 8, height - 1):
        path.write_bytes(_png(width, height, row * rows, bits, kind))
        with pytest.raises(SceneError, match=rf"a\.png: ends early: 13 × 24 pixels take {height * len(row)}"):
            read_image(path)


@pytest.mark.parametrize(("width", "height"), [(8, 8), (13, 5), (1, 1), (3, 9)])
def test_the_passes_of_an_interlaced_png_are_counted(tmp_path, width, height):
    steps = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    size = sum(
        len(range(y, height, dy)) * (1 + len(range(x, width, dx))) if x < width else 0
        for x, y, dx, dy in steps
    )
    path = tmp_path / "a.png"
    path.write_bytes(_png(width, height, bytes(size), interlaced=1))
    assert read_image(path).shape == (height, width, 1)
    path.write_bytes(_png(width, height, bytes(size - 1), interlaced=1))
    with pytest.raises(SceneError, match=rf"take {size} bytes; {size - 1} are there"):
        read_image(path)


def test_a_small_png_that_claims_much_costs_little(tmp_path):
    """Neither by its header, nor by bytes that deflate to much more than the picture."""
    path = tmp_path / "a.png"
    for name, content in (
        ("few bytes", _png(9, 8_323_079, bytes(300_000))),
        ("many bytes", _png(8000, 4000, bytes(20_000_000))),
        ("too many bytes", _png(4, 4, bytes(30_000_000))),
    ):
        path.write_bytes(content)
        tracemalloc.start()
        if name == "too many bytes":
            assert not read_image(path).any()
        else:
            with pytest.raises(SceneError, match=r"a\.png: ends early"):
                read_image(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 4_000_000


def _jpg(height, width=40):
    """A jpg of noise."""
    noise = np.random.default_rng(5).integers(0, 256, (height, width, 3), np.uint8)
    return coded.encode(noise, ".jpg", 2.2)


def _claims_rows(jpg, rows):
    at = jpg.index(b"\xff\xc0") + 5
    return jpg[:at] + struct.pack(">H", rows) + jpg[at + 2 :]


def test_a_jpg_with_too_few_rows_is_an_error(tmp_path):
    """And not a picture that is gray below; nor is a large one of a few bytes."""
    path = tmp_path / "a.jpg"
    for rows, message in ((40, "its last pixels"), (56, "its last pixels"), (65000, "bytes cannot hold")):
        path.write_bytes(_claims_rows(_jpg(32), rows))
        with pytest.raises(SceneError, match=rf"a\.jpg: ends early: .*{message}"):
            read_image(path)
    path.write_bytes(_jpg(32)[:-400] + b"\xff\xd9")
    with pytest.raises(SceneError, match=r"a\.jpg: ends early"):
        read_image(path)


def test_a_gray_jpg_is_read(tmp_path):
    """Its last pixel is what the decoder leaves where data are missing."""
    path = tmp_path / "a.jpg"
    for values in (128, 127, 129):
        path.write_bytes(coded.encode(np.full((21, 35, 3), values, np.uint8), ".jpg", 2.2))
        assert np.abs(read_image(path) * 255 - values).max() <= 1


def _exr(parts, path):
    """Write an exr of (name, channels) per part."""
    import OpenEXR

    window = np.array([0, 0], np.int32), np.array([399, 299], np.int32)
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": window}
    OpenEXR.File([OpenEXR.Part(dict(header), channels, name) for name, channels in parts]).write(str(path))


def test_all_parts_and_channels_of_an_exr_count(tmp_path, monkeypatch):
    path = tmp_path / "a.exr"
    small, flat = np.ones((4, 4), "f4"), np.zeros((300, 400), "f4")
    monkeypatch.setattr("wavefront.codecs.exr.MAX_VALUES", 1_000_000)
    _exr([("a", {"Y": small}), ("b", {"Y": flat})], path)
    assert read_image(path).shape == (4, 4, 1)
    _exr([("a", {"Y": small}), *((f"b{k}", {"Y": flat}) for k in range(9))], path)
    with pytest.raises(SceneError, match=r"a\.exr: claims 1080016 values in 10 parts; the limit is 1000000"):
        read_image(path)
    _exr([("a", {f"c{k}": flat for k in range(9)})], path)
    with pytest.raises(SceneError, match=r"a\.exr: claims 1080000 values in 1 part"):
        read_image(path)


def test_no_part_of_an_exr_stands_in_for_another(tmp_path, capfd):
    """The library leaves out what it cannot decode, so the second part would become the first."""
    path = tmp_path / "a.exr"
    noise = np.random.default_rng(0).random((16, 16, 3)).astype("f4")
    _exr([("a", {"RGB": noise}), ("b", {"RGB": np.full((16, 16, 3), 7, "f4")})], path)
    data = path.read_bytes()
    outcomes = set()
    for at in range(700, 900):  # the offsets of chunks, and what leads the first chunk
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        try:
            assert read_image(path).mean() < 1
        except SceneError as error:
            outcomes.add(str(error).partition("a.exr: ")[2])
    assert "part 0 ('a') of 2 is damaged" in outcomes


def test_an_exr_with_channels_of_no_step_is_an_error(tmp_path):
    path = tmp_path / "a.exr"
    _exr([("a", {"Y": np.ones((4, 2), "f4")})], path)
    data = path.read_bytes()
    before = b"Y\0" + struct.pack("<IIII", 2, 0, 1, 1)
    assert data.count(before) == 1
    path.write_bytes(data.replace(before, b"Y\0" + struct.pack("<IIII", 2, 0, 0, 1)))  # the step of x
    with pytest.raises(SceneError, match=r"a\.exr: "):
        read_image(path)


def test_deep_pixels_are_refused(tmp_path):
    """Their number is not in the header, so no limit can be kept."""
    import OpenEXR

    samples = np.empty((2, 3), object)
    for y, x in np.ndindex(2, 3):
        samples[y, x] = np.ones(y + x, "f4")
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(header, {"Z": samples}).write(str(tmp_path / "a.exr"))
    with pytest.raises(SceneError, match=r"a\.exr: part 0 holds deep pixels; only flat pictures are read"):
        read_image(tmp_path / "a.exr")

"""Pictures of all kinds of each format that is read; all files are written here."""

import io
import struct
import zipfile
import zlib

import numpy as np
import pytest
from inside import REC_709, decode_codes, hdr, npz, rgb_to_xyz, to_srgb
from inside import codecs_Budget as Budget
from PIL import Image as Pil

import wavefront as wf

RNG = np.random.default_rng(0)
SIZE = 13, 9  # rows, columns
STEPS = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def encoded(image, kind, **options):
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def decoded(data, name="a.png"):
    return decode_codes(data, name, Budget())


# --- png ----------------------------------------------------------------------------------------------


def png(samples, bits, kind, *, interlaced=False, **chunks):
    """A png of samples (H, W, C) of any number of bits, without filters."""
    height, width, _ = samples.shape
    steps = STEPS if interlaced else [(0, 0, 1, 1)]
    rows = [row for x, y, dx, dy in steps for row in samples[y::dy, x::dx] if row.size]
    if bits == 16:
        packed = [row.astype(">u2").tobytes() for row in rows]
    else:
        flat = [((row.reshape(-1, 1) >> np.arange(bits)[::-1]) & 1).astype(np.uint8) for row in rows]
        packed = [np.packbits(each.ravel()).tobytes() for each in flat]
    header = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, interlaced)
    parts = {
        "IHDR": header,
        **chunks,
        "IDAT": zlib.compress(b"".join(b"\0" + row for row in packed)),
        "IEND": b"",
    }
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body))
        + name.encode()
        + body
        + struct.pack(">I", zlib.crc32(name.encode() + body))
        for name, body in parts.items()
    )


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("clear", [False, True])
@pytest.mark.parametrize(
    ("kind", "bits"),
    [(0, 1), (0, 2), (0, 4), (0, 8), (0, 16), (2, 8), (2, 16), (4, 8), (4, 16), (6, 8), (6, 16)],
)
def test_every_kind_of_png(kind, bits, clear, interlaced):
    """Gray and colors of all bits, with alpha or with a transparent color, whose low bytes count."""
    most, channels = 2**bits - 1, {0: 1, 2: 3, 4: 2, 6: 4}[kind]
    samples = RNG.integers(0, most + 1, (*SIZE, channels))
    color, chunks = samples[3, 4].copy(), {}
    if bits == 16:
        samples[5, 5] = color ^ 1  # another color
    if clear:
        chunks["tRNS"] = color.astype(">u2").tobytes()
    found = decoded(png(samples, bits, kind, interlaced=interlaced, **chunks))
    full = 65535 if bits == 16 else 255
    wanted = samples * (full // most)
    if clear and kind in (0, 2):
        alpha = full * ~(samples == color).all(-1, keepdims=True)
        wanted = np.concatenate([wanted, alpha], 2)
        assert set(alpha.ravel()) == {0, full}
    assert found.dtype == (np.uint16 if bits == 16 else np.uint8)
    assert np.array_equal(found, wanted)


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("clear", [0, 1, 3])
@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_palettes_of_png(bits, clear, interlaced):
    """Colors beyond the end of tRNS are opaque."""
    count = 2**bits
    palette = RNG.integers(0, 256, (count, 3), np.uint8)
    alphas = RNG.integers(0, 255, min(clear, count), np.uint8)
    chunks = {"PLTE": palette.tobytes()} | ({"tRNS": alphas.tobytes()} if clear else {})
    samples = RNG.integers(0, count, (*SIZE, 1))
    found = decoded(png(samples, bits, 3, interlaced=interlaced, **chunks))
    table = np.concatenate([alphas, np.full(count - len(alphas), 255, np.uint8)])
    wanted = np.concatenate([palette, table[:, None]], 1)[samples[..., 0]]
    assert np.array_equal(found, wanted if clear else wanted[..., :3])


def test_a_transparent_color_that_is_cut_off_does_not_count():
    samples = RNG.integers(0, 256, (*SIZE, 3))
    assert np.array_equal(decoded(png(samples, 8, 2, tRNS=b"\0\1")), samples)


def test_an_image_with_a_transparent_color_is_loaded_with_alpha(tmp_path):
    """`Image.load` multiplies colors by alpha."""
    samples = np.full((2, 2, 3), 255)
    samples[0, 0] = 7
    (tmp_path / "a.png").write_bytes(png(samples, 8, 2, tRNS=np.full(3, 7, ">u2").tobytes()))
    image = wf.Image.load(tmp_path / "a.png")
    assert image.alpha.tolist() == [[0, 1], [1, 1]]
    assert image.rgb[0, 0].tolist() == [0, 0, 0]


# --- jpg ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ink", [(0, 255, 255, 0), (255, 0, 255, 0), (0, 0, 0, 255), (0, 0, 0, 127)])
def test_inks_of_jpg_become_colors(ink, tmp_path):
    data = encoded(Pil.new("CMYK", (16, 16), ink), "JPEG", quality=95)
    wanted = (255 - np.array(ink[:3])) * (255 - ink[3]) / 255
    assert decoded(data)[5, 5] == pytest.approx(wanted, abs=3)
    at = data.index(b"Adobe") + 11
    ycck = data[:at] + b"\2" + data[at + 1 :]  # the same numbers, as luma, chroma and black
    y, cb, cr, k = 255 - np.array(ink, float)  # Adobe inverts
    red, green, blue = (
        y + 1.402 * (cr - 128),
        y - 0.344 * (cb - 128) - 0.714 * (cr - 128),
        y + 1.772 * (cb - 128),
    )
    wanted = (255 - np.clip([red, green, blue], 0, 255)) * k / 255
    assert decoded(ycck)[5, 5] == pytest.approx(wanted, abs=4)
    (tmp_path / "a.jpg").write_bytes(data)
    assert not hasattr(wf.Image.load(tmp_path / "a.jpg"), "alpha")


def test_a_jpg_of_inks_that_ends_early_is_an_error():
    data = encoded(Pil.fromarray(RNG.integers(0, 256, (64, 64, 4), np.uint8), "CMYK"), "JPEG", quality=95)
    with pytest.raises(wf.SceneError, match="ends early"):
        decoded(data[: len(data) // 2] + b"\xff\xd9")


def test_gray_jpg_and_orientation():
    """A gray picture has one channel. Exif may say that it is turned, which does not count."""
    exif = Pil.Exif()
    exif[0x0112] = 6
    codes = np.repeat(np.arange(0, 240, 5, np.uint8)[None], 16, 0)
    found = decoded(encoded(Pil.fromarray(codes), "JPEG", quality=95, exif=exif.tobytes()))
    assert found.shape == (16, 48, 1)
    assert np.abs(found[..., 0].astype(int) - codes).max() <= 2


# --- other formats of Pillow --------------------------------------------------------------------------

RGBA = RNG.integers(0, 256, (*SIZE, 4), np.uint8)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("TGA", {}),
        ("TGA", {"compression": "tga_rle"}),
        ("TGA", {"orientation": 1}),
        ("TIFF", {}),
        ("TIFF", {"compression": "tiff_lzw"}),
        ("TIFF", {"compression": "tiff_adobe_deflate"}),
        ("TIFF", {"compression": "packbits"}),
        ("WEBP", {"lossless": True, "exact": True}),
        ("PNG", {}),
    ],
)
@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P"])
def test_other_formats(kind, options, mode, tmp_path):
    image = Pil.fromarray(RGBA[..., :3] if mode == "P" else RGBA).convert(mode)
    name = f"a.{kind.lower()}"
    if kind == "TIFF" and mode == "LA" and options:
        options = {}
    found = decoded(encoded(image, kind, **options), name)
    wanted = np.asarray(image.convert("RGB") if mode == "P" else image)
    if kind == "WEBP" and mode in ("L", "LA"):
        wanted = np.asarray(image.convert("RGB" if mode == "L" else "RGBA"))
    assert np.array_equal(found, np.atleast_3d(wanted))
    (tmp_path / name).write_bytes(encoded(image, kind, **options))
    texture = wf.Texture(tmp_path / name, filter="nearest", channel=3)
    assert texture.mean() == pytest.approx(RGBA[..., 3].mean() / 255 if mode.endswith("A") else 1)


@pytest.mark.parametrize("kind", ["GIF", "PNG", "TIFF"])
def test_transparency_of_palettes(kind):
    index = RNG.integers(0, 4, SIZE, np.uint8)
    image = Pil.fromarray(index).convert("P")
    image.putdata(index.ravel().tolist())
    image.putpalette(RNG.integers(0, 256, 12, np.uint8).tolist())
    options = {} if kind == "TIFF" else {"transparency": 2}
    found = decoded(encoded(image, kind, **options), "a.gif")
    assert found.shape == (*SIZE, 3 if kind == "TIFF" else 4)
    if kind != "TIFF":
        assert np.array_equal(found[..., 3] == 0, index == 2)


def test_the_first_frame_is_read():
    frames = [Pil.new("RGB", (4, 4), color) for color in ("red", "blue")]
    for kind in ("GIF", "WEBP", "PNG", "TIFF"):
        data = encoded(frames[0], kind, save_all=True, append_images=frames[1:])
        assert decoded(data)[0, 0, :3].astype(int) == pytest.approx([255, 0, 0], abs=2)


def test_the_first_bytes_say_what_a_file_is(tmp_path):
    """Whatever it is called; what has no signature, and what users add, goes by its name."""
    image = Pil.fromarray(RGBA[..., :3])
    for kind, name in (
        ("PNG", "a.jpg"),
        ("BMP", "a.png"),
        ("TIFF", "a.exr"),
        ("WEBP", "a.tga"),
        ("PPM", "a.png"),
    ):
        (tmp_path / name).write_bytes(encoded(image, kind, **({"lossless": True} if kind == "WEBP" else {})))
        assert np.array_equal(wf.Texture(tmp_path / name)._texels.reshape(*SIZE, 3), RGBA[..., :3])
    for name in ("no_extension", "a.jfif"):
        (tmp_path / name).write_bytes(encoded(image, "PNG"))
        assert wf.Texture(tmp_path / name).size == wf.Image.load(tmp_path / name).shape[1::-1] == SIZE[::-1]
    (tmp_path / "a.psd").write_bytes(b"8BPS" + bytes(100))
    with pytest.raises(wf.SceneError, match=r"extension is '\.psd'; it must be one of"):
        wf.Texture(tmp_path / "a.psd")
    (tmp_path / "a.tga").write_bytes(b"hello")
    with pytest.raises(wf.SceneError, match=r"a\.tga: not a readable tga image"):
        wf.Texture(tmp_path / "a.tga")


@pytest.mark.parametrize("kind", ["TGA", "TIFF", "GIF", "WEBP", "PPM"])
def test_pictures_that_end_early_or_claim_much_are_errors(kind):
    data = encoded(Pil.fromarray(RNG.integers(0, 256, (64, 64, 3), np.uint8)), kind)
    for part in (0.3, 0.9):
        with pytest.raises(wf.SceneError, match=r"a\."):
            decoded(data[: int(len(data) * part)], f"a.{kind.lower()}")
    with pytest.raises(wf.SceneError, match="64 × 64 pixels; the limit is 4000"):
        decode_codes(data, f"a.{kind.lower()}", Budget(pixels=4000))
    with pytest.raises(wf.SceneError, match="bytes of memory; the limit"):
        decode_codes(data, f"a.{kind.lower()}", Budget(memory_bytes=1000))


def test_small_files_that_claim_large_pictures_are_refused_before_they_are_decoded(fails):
    fails("PIL.ImageFile.ImageFile.load", AssertionError("is decoded"))
    wide = struct.pack("<HH", 65535, 65535)
    tga = struct.pack("<BBBHHBHH", 0, 0, 2, 0, 0, 0, 0, 0) + wide + bytes([24, 0])
    gif = b"GIF89a" + wide + bytes(3) + b"," + bytes(4) + wide + b"\0\2\2\x44\1\0;"
    webp = b"RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\x10\0\0\0" + b"\xff\xff\xff" * 2 + bytes(20)
    lossless = b"RIFF\x20\0\0\0WEBPVP8L\x0a\0\0\0\x2f" + b"\xff\xff\xff\x0f" + bytes(20)
    for data, name in ((tga, "a.tga"), (gif, "a.gif"), (webp, "a.webp"), (lossless, "a.webp")):
        with pytest.raises(wf.SceneError, match=r"pixels.*limit of 178956970|pixels; the limit is 134217728"):
            decoded(data, name)


def test_the_size_of_a_webp_is_checked_before_the_library_takes_memory_for_it(fails):
    small = [encoded(Pil.new("RGB", (40, 30)), "WEBP", lossless=lossless) for lossless in (True, False)]
    small.append(encoded(Pil.new("RGBA", (40, 30), (9, 9, 9, 99)), "WEBP"))
    assert {data[12:16] for data in small} == {b"VP8 ", b"VP8L", b"VP8X"}
    fails("PIL.Image.open", AssertionError("is opened"))
    for data in small:
        with pytest.raises(wf.SceneError, match="image has 40 × 30 pixels; the limit is 1199"):
            decode_codes(data, "a.webp", Budget(pixels=1199))


def test_modes_that_are_not_read_are_named():
    with pytest.raises(wf.SceneError, match="mode 'LAB' of Pillow"):
        decoded(encoded(Pil.new("LAB", (4, 4)), "TIFF"))


# --- tif of 16 bits and more --------------------------------------------------------------------------


def tif(values, order="<", *, predictor=1, deflate=True, tile=None, planar=1, big=False, **extra):
    """A tif of numbers (H, W, C) of any type."""
    height, width, samples = values.shape
    item, kind = values.dtype.itemsize, 3 if values.dtype.kind == "f" else 1
    planes = [values] if planar == 1 else [values[..., k : k + 1] for k in range(samples)]
    rows, columns = tile or (5, width)
    pieces = []
    for plane in planes:
        for y in range(0, height, rows):
            for x in range(0, width, columns):
                part = plane[y : y + rows, x : x + columns]
                if tile:
                    part = np.pad(part, ((0, rows - part.shape[0]), (0, columns - part.shape[1]), (0, 0)))
                pieces.append(_piece(part, order, predictor))
    if deflate:
        pieces = [zlib.compress(each) for each in pieces]
    head = 16 if big else 8
    starts = head + np.cumsum([0, *map(len, pieces)])
    names = (324, 325) if tile else (273, 279)
    tags = {256: [width], 257: [height], 258: [item * 8] * samples, 259: [8 if deflate else 1]}
    tags |= {262: [2 if samples > 2 else 1], names[0]: starts[:-1].tolist(), 277: [samples]}
    tags |= {names[1]: list(map(len, pieces)), 284: [planar], 317: [predictor], 339: [kind] * samples}
    tags |= {322: [columns], 323: [rows]} if tile else {278: [rows]}
    tags |= {338: [2]} if samples in (2, 4) else {}
    tags |= {int(key[1:]): value for key, value in extra.items()}
    at, body, entries = int(starts[-1]), b"", b""
    for tag, numbers in sorted(tags.items()):
        packed = struct.pack(f"{order}{len(numbers)}I", *numbers)
        inside = 8 if big else 4
        if len(packed) > inside:
            entries += struct.pack(f"{order}HH{'QQ' if big else 'II'}", tag, 4, len(numbers), at + len(body))
            body += packed
        else:
            entries += struct.pack(f"{order}HH{'Q' if big else 'I'}", tag, 4, len(numbers)) + packed.ljust(
                inside, b"\0"
            )
    mark = b"II" if order == "<" else b"MM"
    place = at + len(body)
    start = struct.pack(f"{order}HHHQ", 43, 8, 0, place) if big else struct.pack(f"{order}HI", 42, place)
    count = struct.pack(f"{order}{'Q' if big else 'H'}", len(tags))
    return mark + start + b"".join(pieces) + body + count + entries + bytes(8)


def _piece(part, order, predictor):
    item, each = part.dtype.itemsize, part.shape[2]
    if predictor == 3:
        flat = part.astype(f">f{item}").reshape(len(part), -1)
        planes = flat.view(np.uint8).reshape(len(part), -1, item).transpose(0, 2, 1).reshape(len(part), -1)
        out = planes.copy()
        out[:, each:] = planes[:, each:] - planes[:, :-each]
        return out.tobytes()
    words = np.ascontiguousarray(part).view(f"u{item}")
    if predictor == 2:
        words = np.concatenate([words[:, :1], words[:, 1:] - words[:, :-1]], 1)
    return words.astype(f"{order}u{item}").tobytes()


@pytest.mark.parametrize("kind", ["u2", "u4", "f2", "f4", "f8"])
@pytest.mark.parametrize("samples", [1, 2, 3, 4])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"order": ">", "deflate": False},
        {"predictor": 2, "order": ">"},
        {"predictor": 2, "tile": (16, 16)},
        {"predictor": 3},
        {"predictor": 3, "tile": (16, 16), "order": ">"},
        {"planar": 2, "predictor": 2},
        {"big": True},
    ],
)
def test_tif_of_wide_numbers(kind, samples, options):
    """As tifffile writes them, too; it is no dependency of the tests."""
    if options.get("predictor") == 3 and kind[0] == "u":
        options = {**options, "predictor": 2}
    values = RNG.random((*SIZE, samples))
    values = (values * np.iinfo(kind).max).astype(kind) if kind[0] == "u" else values.astype(kind)
    wanted = values.astype(np.float32) if kind[0] == "f" else values
    if kind == "u4":
        wanted = (values / (2**32 - 1) * 65535).round().astype(np.uint16)
    found = decoded(tif(values, **options), "a.tif")
    assert found.dtype == wanted.dtype
    assert np.array_equal(found, wanted)


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits", None])
def test_tif_of_pillow(compression):
    for values in (RNG.random(SIZE, np.float32), RNG.integers(0, 65536, SIZE, np.uint16)):
        options = {} if compression is None else {"compression": compression}
        found = decoded(encoded(Pil.fromarray(values), "TIFF", **options), "a.tif")
        assert found.dtype == values.dtype
        assert np.array_equal(found[..., 0], values)


def test_alpha_and_white_of_wide_tif():
    values = RNG.integers(0, 30000, (*SIZE, 4)).astype(np.uint16)
    values[..., 3] += 30000
    straight = (values[..., :3] / values[..., 3:] * 65535).round()
    assert np.array_equal(decoded(tif(values, t338=[1]))[..., :3], straight)
    assert decoded(tif(values, t338=[0])).shape == (*SIZE, 3)
    gray = values[..., :1]
    assert np.array_equal(decoded(tif(gray, t262=[0])), 65535 - gray)


def test_wide_tif_that_is_damaged_or_of_other_numbers_is_named():
    values = RNG.integers(0, 65536, (*SIZE, 3)).astype(np.uint16)
    for options, message in (
        ({"t339": [2, 2, 2]}, "16, 16, 16 bits of the sample format 2"),
        ({"t258": [16, 32, 16]}, "16, 32, 16 bits"),
        ({"t256": [2**31], "t257": [2**31]}, "the limit is 134217728"),
        ({"t277": [1]}, "has 1 samples"),
        ({"t273": [], "t279": []}, "has no pixels"),
        ({"t259": [9999]}, "compressed by method 9999"),
    ):
        with pytest.raises(wf.SceneError, match=rf"a\.tif: .*{message}"):
            decoded(tif(values, **options), "a.tif")
    for part in (5, 9, 100, 300):
        with pytest.raises(wf.SceneError, match=r"a\.tif: "):
            decoded(tif(values)[:part], "a.tif")


# --- Netpbm -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("most", [1, 100, 255, 1023, 65535])
@pytest.mark.parametrize("kind", ["P2", "P3", "P5", "P6", "P7"])
def test_netpbm(kind, most):
    channels = {"P2": 1, "P3": 3, "P5": 1, "P6": 3, "P7": 4}[kind]
    values = RNG.integers(0, most + 1, (*SIZE, channels))
    height, width = SIZE
    head = f"{kind}\n# a comment\n{width} {height} # another\n{most}\n"
    if kind == "P7":
        head = f"P7\nWIDTH {width}\nHEIGHT {height}\nDEPTH 4\nMAXVAL {most}\nTUPLTYPE RGB_ALPHA\nENDHDR\n"
    binary = values.astype(">u2" if most > 255 else "u1").tobytes()
    text = " ".join(map(str, values.ravel())).encode()
    found = decoded(head.encode() + (text if kind in ("P2", "P3") else binary), "a.ppm")
    full = 65535 if most > 255 else 255
    assert found.dtype == (np.uint16 if most > 255 else np.uint8)
    assert np.array_equal(found, np.round(values * (full / most)))
    with pytest.raises(wf.SceneError, match=r"a\.ppm: ends early"):
        decoded(head.encode() + (text[:20] if kind in ("P2", "P3") else binary[:-1]), "a.ppm")


def test_bits_and_floats_of_netpbm():
    bits = RNG.integers(0, 2, SIZE, np.uint8)
    height, width = SIZE
    packed = np.packbits(bits, axis=1).tobytes()
    text = "\n".join("".join(map(str, row)) for row in bits).encode()  # without spaces
    for data in (f"P4 {width} {height}\n".encode() + packed, f"P1 {width} {height}\n".encode() + text):
        assert np.array_equal(decoded(data, "a.pbm")[..., 0], 255 * (1 - bits))
    values = RNG.random((*SIZE, 3), np.float32)
    for order, scale in (("<", "-1.0"), (">", "1.0")):
        data = f"PF\n{width} {height}\n{scale}\n".encode() + values[::-1].astype(f"{order}f4").tobytes()
        assert np.array_equal(decoded(data, "a.pfm"), values)
    for data in (
        b"P6",
        b"P6 3 x 255\n",
        b"P7\nWIDTH 3\n",
        b"P6 3 3 70000\n",
        b"P7\nWIDTH 1\nHEIGHT 1\nDEPTH 9\nMAXVAL 1\nENDHDR\n",
    ):
        with pytest.raises(wf.SceneError, match=r"a\.ppm: "):
            decoded(data, "a.ppm")


# --- exr ----------------------------------------------------------------------------------------------


def exr(path, *parts, **header):
    """Write an exr of (name, {channel: values}) for each part."""
    import OpenEXR

    made = []
    for name, channels in parts:
        out = {}
        for key, values in channels.items():
            out[key] = OpenEXR.Channel(key, values)
        head = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **header}
        if len(parts) > 1:
            window = np.array([0, 0], np.int32), np.array([SIZE[1] - 1, SIZE[0] - 1], np.int32)
            head |= {"displayWindow": window}
        made.append(OpenEXR.Part(head, out, name) if len(parts) > 1 else OpenEXR.Part(head, out))
    OpenEXR.File(made).write(str(path))
    return path


def layer(name, values, letters="RGBA"):
    return {
        f"{name}{letter}": np.full(SIZE, value, np.float32)
        for letter, value in zip(letters, values, strict=False)
    }


COLOR, OTHER = (1, 0.5, 0.25), (7, 7, 7)
NORMAL = layer("ViewLayer.Normal.", OTHER, "XYZ") | layer("ViewLayer.Depth.", (9,), "Z")
LAYERS = {  # of a file whose picture is COLOR
    "blender": [("", layer("ViewLayer.Combined.", (*COLOR, 1)) | NORMAL)],
    "views": [("", layer("Combined.left.", COLOR) | layer("Combined.right.", OTHER))],
    "default view": [("", layer("", COLOR) | layer("right.", OTHER))],
    "one layer": [("", layer("diffuse.", COLOR))],
    "lower case": [("", layer("a.", COLOR, "rgb"))],
    "words": [
        (
            "",
            {
                f"a.{word}": np.full(SIZE, v, np.float32)
                for word, v in zip(("red", "green", "blue"), COLOR, strict=True)
            },
        )
    ],
    "beauty": [("", layer("beauty.", COLOR) | layer("albedo.", OTHER))],
    "beside data": [("", layer("", COLOR) | layer("albedo.", OTHER) | NORMAL)],
    "parts": [("ViewLayer.Depth", layer("", (9,), "Z")), ("ViewLayer.Combined", layer("", COLOR))],
    "part and layer": [("albedo", layer("albedo.", OTHER)), ("rgba", layer("rgba.", COLOR))],
    "first part": [("a", layer("", COLOR)), ("b", layer("", OTHER))],
}


@pytest.mark.parametrize("name", LAYERS)
def test_layers_of_exr(tmp_path, name):
    image = wf.Image.load(exr(tmp_path / "a.exr", *LAYERS[name]))
    assert image.rgb[3, 3] == pytest.approx(COLOR)
    assert hasattr(image, "alpha") == (name == "blender")


def test_a_guess_among_layers_is_announced(tmp_path):
    exr(tmp_path / "a.exr", ("", layer("diffuse.", COLOR) | layer("emission.", OTHER)))
    with pytest.warns(UserWarning, match=r"a\.exr: has 2 layers, none called .*; 'diffuse' is shown"):
        assert wf.Image.load(tmp_path / "a.exr").rgb[0, 0] == pytest.approx(COLOR)
    exr(tmp_path / "a.exr", ("", layer("N.", (0.5, 7, 7), "XYZ") | layer("N.", (1,), "A")))
    with pytest.warns(UserWarning, match=r"a\.exr: has no channels of colors; 'N\.X' is shown as gray"):
        assert wf.Image.load(tmp_path / "a.exr").rgb[0, 0] == pytest.approx((0.5, 0.5, 0.5))


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.uint32])
def test_numbers_of_exr(tmp_path, kind):
    values = RNG.integers(0, 2000, SIZE).astype(kind)
    exr(tmp_path / "a.exr", ("", dict.fromkeys("RGB", values)))
    assert np.array_equal(wf.Image.load(tmp_path / "a.exr").rgb[..., 1], values.astype(np.float32))
    exr(tmp_path / "a.exr", ("", {"Y": values}))
    assert np.array_equal(wf.Image.load(tmp_path / "a.exr").rgb[..., 2], values.astype(np.float32))


EVEN = 14, 10  # rows, columns that are whole multiples of the step


def subsampled(channels, primaries=None):
    """An exr, not compressed, of {channel: (values, step)}; the library writes no channels with steps."""
    height, width = EVEN
    attribute = lambda name, kind, body: f"{name}\0{kind}\0".encode() + struct.pack("<I", len(body)) + body  # noqa: E731
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<IIII", 2, 0, step, step)
        for name, (_, step) in sorted(channels.items())
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = attribute("channels", "chlist", listed + b"\0") + attribute("compression", "compression", b"\0")
    header += attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window)
    header += attribute("lineOrder", "lineOrder", b"\0") + attribute(
        "pixelAspectRatio", "float", struct.pack("<f", 1)
    )
    header += attribute("screenWindowCenter", "v2f", bytes(8)) + attribute(
        "screenWindowWidth", "float", struct.pack("<f", 1)
    )
    if primaries:
        header += attribute("chromaticities", "chromaticities", struct.pack("<8f", *primaries))
    lines = []
    for y in range(height):
        parts = [
            values[y // step].astype("<f4").tobytes()
            for _, (values, step) in sorted(channels.items())
            if y % step == 0
        ]
        lines.append(struct.pack("<iI", y, sum(map(len, parts))) + b"".join(parts))
    start = b"\x76\x2f\x31\x01\2\0\0\0" + header + b"\0"
    offsets = len(start) + 8 * height + np.cumsum([0, *map(len, lines)])[:-1]
    return start + offsets.astype("<u8").tobytes() + b"".join(lines)


@pytest.mark.parametrize("primaries", [None, (0.7, 0.3, 0.2, 0.7, 0.1, 0.05, 0.31, 0.33)])
def test_luminance_and_chroma_of_exr(primaries):
    """Chroma of every second pixel; between them it is interpolated. Weights are those of the primaries."""
    ramp = np.linspace(1, 2, EVEN[0] * EVEN[1], dtype="f4").reshape(*EVEN, 1)
    rgb = np.array([0.8, 0.3, 0.1], np.float32) * ramp
    y = (rgb @ rgb_to_xyz(REC_709 if primaries is None else primaries)[1]).astype(np.float32)
    red, blue = (rgb[..., k] / y - 1 for k in (0, 2))
    steps = {"Y": (y, 1), "RY": (red[::2, ::2], 2), "BY": (blue[::2, ::2], 2)}
    assert decoded(subsampled(steps, primaries)) == pytest.approx(rgb, rel=1e-4)
    red = np.linspace(0, 1, EVEN[0], dtype="f4")[:, None] * np.linspace(1, 2, EVEN[1], dtype="f4")
    steps = {"Y": (np.ones(EVEN, "f4"), 1), "RY": (red[::2, ::2], 2), "BY": (blue[::2, ::2], 2)}
    assert decoded(subsampled(steps))[:-1, :-1, 0] == pytest.approx(
        red[:-1, :-1] + 1, rel=1e-5
    )  # linear in both directions


# --- Radiance .hdr ------------------------------------------------------------------------------------


def radiance(lines, pixels, order="-Y 4 +X 16"):
    return (
        "\n".join(["#?RADIANCE", *lines, "FORMAT=32-bit_rle_rgbe", "", order, ""]).encode()
        + hdr.to_rgbe(pixels).tobytes()
    )


@pytest.mark.parametrize(
    ("lines", "factor"),
    [
        ([], (1, 1, 1)),
        (["EXPOSURE=4"], (0.25, 0.25, 0.25)),
        (["pfilt -e 2", "EXPOSURE= 2.0", "pcomb", "EXPOSURE=0.25"], (2, 2, 2)),
        (["COLORCORR=1 2 4"], (1, 0.5, 0.25)),
        (["EXPOSURE=2", "COLORCORR= 1 .5 2", "COLORCORR=2 1 1"], (0.25, 1, 0.25)),
        (["PRIMARIES=0.640 0.330 0.290 0.600 0.150 0.060 0.3333 0.3333"], (1, 1, 1)),
        (["PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329"], (1, 1, 1)),
        (
            ["\tEXPOSURE=8", "VIEW= -vtv EXPOSURE=3", "GAMMA=2"],
            (1, 1, 1),
        ),  # a command, not a line of the header
    ],
)
def test_lines_of_hdr(lines, factor):
    pixels = np.broadcast_to(np.float32([0.5, 1, 0.25]), (4, 16, 3))
    assert hdr.decode(radiance(lines, pixels)) == pytest.approx(pixels * np.float32(factor), rel=1e-6)


def test_primaries_of_hdr():
    """White stays white, and what is stored as pure Rec. 2020 green becomes one that sRGB cannot show."""
    primaries = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
    line = "PRIMARIES=" + " ".join(map(str, primaries))
    gray = np.full((4, 16, 3), 0.5, np.float32)
    assert hdr.decode(radiance([line], gray)) == pytest.approx(gray, rel=1e-5)
    color = np.broadcast_to(np.float32([0.5, 0.25, 0.125]), (4, 16, 3))
    assert hdr.decode(radiance([line], color))[0, 0] == pytest.approx(
        to_srgb(primaries) @ (0.5, 0.25, 0.125), rel=1e-6
    )
    # ITU-R BT.2087, table 4
    assert to_srgb(primaries)[0] == pytest.approx([1.6605, -0.5876, -0.0728], abs=2e-4)


@pytest.mark.parametrize(
    "line",
    [
        "EXPOSURE=0",
        "EXPOSURE=x",
        "EXPOSURE=1 2",
        "COLORCORR=1 2",
        "EXPOSURE=nan",
        "PRIMARIES=0 0 0 0 0 0 0 0",
        "EXPOSURE=-2",
    ],
)
def test_lines_of_hdr_that_are_damaged_do_not_count(tmp_path, line):
    pixels = np.full((4, 16, 3), 0.5, np.float32)
    (tmp_path / "a.hdr").write_bytes(radiance([line], pixels))
    with pytest.warns(UserWarning, match=r"a\.hdr: the line .* does not count"):
        assert np.array_equal(wf.Image.load(tmp_path / "a.hdr").rgb, pixels)


@pytest.mark.parametrize(
    "order", ["-Y 4 +X 6", "+Y 4 +X 6", "-Y 4 -X 6", "+Y 4 -X 6", "+X 6 -Y 4", "-X 6 +Y 4"]
)
def test_orders_of_hdr(order):
    pixels = np.exp2(RNG.integers(-3, 3, (4, 6, 3))).astype(np.float32)
    stored = pixels[::-1] if "+Y" in order else pixels
    stored = stored[:, ::-1] if "-X" in order else stored
    stored = stored.transpose(1, 0, 2) if order[1] == "X" else stored
    assert hdr.decode(radiance([], stored, order)) == pytest.approx(pixels, rel=1e-2)


# --- Arrays of NumPy ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 2 ",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 2)",
        b'"""',
        b"{'descr': '" + b"(" * 200,
    ],
)
def test_headers_that_are_no_python(header):
    """NumPy's parser raises errors of its tokenizer."""
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 11) + header + b" " * 10 + b"\n" + bytes(32)
    with pytest.raises(wf.SceneError, match="not a readable npy file"):
        npz.read_array(data, Budget())
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("a.npy", data)
    with pytest.raises(wf.SceneError, match="not a readable npz file"):
        npz.read_arrays(out.getvalue(), Budget())


def test_damaged_arrays_are_typed_errors(tmp_path):
    """By the one reader of pictures and of grids: headers that are no Python, versions, damaged deflate."""
    grid = np.ones((3, 4, 3), np.float32)
    buffer = io.BytesIO()
    np.save(buffer, grid)
    plain = buffer.getvalue()
    headers = [
        plain.replace(b"(3, 4, 3)", b"(3, 4, 3 "),
        plain.replace(b"}", b"("),
        plain[:6] + b"\7" + plain[7:],
    ]
    headers += [
        plain[:8] + b"\xff\xff" + plain[10:],
        plain[:9],
        plain.replace(b"'<f4'", b"'<f\0'"),
        plain[:-1],
    ]
    for k, data in enumerate(headers):
        (tmp_path / f"{k}.npy").write_bytes(data)
    np.savez_compressed(tmp_path / "a.npz", rgb=grid)
    packed = (tmp_path / "a.npz").read_bytes()
    at = packed.index(b"rgb.npy") + 27
    for k, data in enumerate(
        (packed[:at] + b"\xff" * 9 + packed[at + 9 :], packed[:-9], b"", packed.replace(b"\x14\0", b"\xff\0"))
    ):
        (tmp_path / f"{k}.npz").write_bytes(data)
    for path in sorted(tmp_path.glob("[0-9].np?")):
        for read in (wf.Image.load, wf.load_grid):
            with pytest.raises(wf.SceneError, match=rf"{path.name}: "):
                read(path)

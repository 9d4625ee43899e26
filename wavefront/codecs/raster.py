"""Pictures of codes in memory, read by Pillow: png, jpg, bmp, gif, tga, tif and webp.

Pictures are read as gray or RGB, with or without alpha, whatever the file holds: palettes, bits, transparent
colors (tRNS) and inks (CMYK) are resolved. Color profiles are not applied, nor is the orientation in Exif
data, which Blender and most loaders of textures ignore. Of several frames the first one is read.

Pillow has no pictures of 16 bits for each of several channels. Of png, it decodes one byte of each number at
a time; tiff.py reads those of tif. Source of the format: W3C, Portable Network Graphics (third edition),
2025.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from . import tiff
from .budget import Budget
from .size_check import BITS, BMP, COLOR_TYPE, JPG, PNG, check_header, png_chunks

if TYPE_CHECKING:
    from PIL.Image import Image

# names of formats in Pillow, by first bytes
FORMATS = {PNG: "PNG", JPG: "JPEG", BMP: "BMP", b"GIF8": "GIF", b"RIFF": "WEBP"}
FORMATS |= dict.fromkeys(tiff.SIGNATURES, "TIFF")
CHECKED = ("PNG", "JPEG", "BMP")  # those that `check_header` compares with the size of the file
TGA_END = b"TRUEVISION-XFILE.\0"  # of most files
GRAY, RGB, GRAY_ALPHA, RGB_ALPHA = 0, 2, 4, 6  # color types of a png
AS_STORED = ("L", "LA", "RGB", "RGBA", "F")  # modes of Pillow that are not converted
WITHOUT_ALPHA = ("1", "P", "CMYK", "YCbCr", "RGBX", "HSV")
WITH_ALPHA = {"PA": "RGBA", "RGBa": "RGBA", "La": "LA"}
FILLER = bytes([0x5A]) * 64  # entropy-coded bytes that decode to pixels
FILLED = 128  # libjpeg's value of each component where data ends early
ROUNDING = 2  # largest error of a gray after color interpolation, in codes
PIXEL_BYTES = 12  # of memory for each pixel of other formats: as decoded, converted, and copied


def decode(data: bytes, budget: Budget | None = None) -> NDArray[Any]:
    """Return the codes (H, W, C) of a picture, uint8 or uint16, or the values of a tif of floats.

    One channel is gray, two are gray and alpha, three are RGB, and four are RGB and alpha.

    Raises
    ------
    SceneError
        If the file claims more than it holds, ends early, or holds other kinds of numbers.
    """
    budget, kind = budget or Budget.of(data), _kind(data)
    if kind in CHECKED:
        check_header(data, budget)
    with quiet():
        if kind == "PNG":
            return _png(data)
        if kind == "JPEG":
            return _jpg(data)
        if kind == "TIFF" and (wide := tiff.decode(data, budget)) is not None:
            return wide
        return _other(data, kind, budget)


def decode_tga(data: bytes, budget: Budget | None = None) -> NDArray[Any]:
    """Return the codes (H, W, C) of a tga, whose first bytes do not say what it is."""
    with quiet():
        return _other(data, "TGA", budget or Budget.of(data))


def _kind(data: bytes) -> str:
    """Return Pillow's name of the format."""
    for start, kind in FORMATS.items():
        if data.startswith(start):
            return kind
    if not data.endswith(TGA_END):
        raise SceneError("not a readable image: its header is damaged, or of no format that is read")
    return "TGA"


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress the decoder's warnings of large images, which have another limit here, and of Exif data."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def codes_of(image: Image) -> NDArray[Any]:
    """Return the codes (H, W, C) of an image of Pillow.

    Raises
    ------
    SceneError
        If it has a mode that cannot be shown, such as whole numbers of 32 bits.
    """
    mode = image.mode
    if mode.startswith("I"):  # 16 bits, also where Pillow has them in 32
        return np.clip(np.asarray(image), 0, 65535).astype(np.uint16)[..., None]
    if mode not in AS_STORED:
        image = image.convert(_target(image))
    elif mode in ("L", "RGB") and "transparency" in image.info:
        image = image.convert(f"{mode}A")
    return np.atleast_3d(np.asarray(image))


def _target(image: Image) -> str:
    """Return the mode to which an image is converted."""
    mode = image.mode
    if mode in WITH_ALPHA:
        return WITH_ALPHA[mode]
    if mode not in WITHOUT_ALPHA:
        raise SceneError(f"holds pixels of the mode {mode!r} of Pillow, which are not read")
    if mode == "1":
        return "LA" if "transparency" in image.info else "L"
    return "RGBA" if image.has_transparency_data else "RGB"


def _opened(data: bytes, kind: str) -> Image:
    from PIL import Image, UnidentifiedImageError  # imported here to keep `import wavefront` quick

    try:
        return Image.open(BytesIO(data), formats=[kind])
    except Image.DecompressionBombError as error:
        raise SceneError(str(error)) from error
    except UnidentifiedImageError as error:
        raise SceneError(f"not a readable {kind.lower()} image: its header is damaged") from error


def _png(data: bytes) -> NDArray[Any]:
    bits, color_type = data[BITS], data[COLOR_TYPE]
    data, clear = _without_clear_color(data) if color_type in (GRAY, RGB) else (data, None)
    if bits == 16 and color_type == GRAY_ALPHA:
        return np.ascontiguousarray(_as_bytes(data)).view(">u2").astype(np.uint16)
    if bits == 16 and color_type in (RGB, RGB_ALPHA):
        codes: NDArray[Any] = _two_halves(data)
    else:
        with _opened(data, "PNG") as image:
            codes = codes_of(image)
    return codes if clear is None else _with_clear_color(codes, clear, bits)


def _without_clear_color(data: bytes) -> tuple[bytes, bytes | None]:
    """Return a png without its chunk tRNS, and the content of that.

    Pillow would compare it with colors that it has rounded.
    """
    clear = next((bytes(content) for name, content, _ in png_chunks(data) if name == b"tRNS"), None)
    if clear is None:
        return data, None
    before, _, after = data.partition(b"tRNS" + clear)
    return before[:-4] + after[4:], clear  # without its length and its checksum


def _with_clear_color(codes: NDArray[Any], clear: bytes, bits: int) -> NDArray[Any]:
    """Return codes with alpha, which is 0 where they are the color of a chunk tRNS."""
    channels = codes.shape[2]
    if len(clear) < 2 * channels:
        return codes
    color = np.frombuffer(clear, ">u2", channels).astype(np.int64) & (2**bits - 1)
    most = np.iinfo(codes.dtype).max
    color = color * most // (2**bits - 1)
    alpha = np.where((codes == color).all(axis=2), 0, most).astype(codes.dtype)
    return np.concatenate([codes, alpha[..., None]], axis=2)


def _as_bytes(data: bytes) -> NDArray[np.uint8]:
    """Return the bytes (H, W, 4) of a png of gray and alpha with 16 bits; filters see them as RGBA."""
    header = b"IHDR" + data[16:BITS] + bytes([8, RGB_ALPHA]) + data[COLOR_TYPE + 1 : 29]
    checked = header + struct.pack(">I", zlib.crc32(header))
    with _opened(data[:12] + checked + data[33:], "PNG") as image:
        return np.asarray(image)


def _two_halves(data: bytes) -> NDArray[np.uint16]:
    """Return the codes (H, W, 3 or 4) of a png of 16 bits."""
    halves: list[NDArray[np.uint16]] = []
    for order in "BL":  # the high byte of each number, then the low one
        with _opened(data, "PNG") as image:
            *tile, mode = image.tile[0]  # type: ignore[attr-defined]
            image.tile = [(*tile, f"{mode}"[:-1] + order)]  # type: ignore[attr-defined]
            halves.append(np.asarray(image).astype(np.uint16))
    return halves[0] * np.uint16(256) + halves[1]


def _jpg(data: bytes) -> NDArray[Any]:
    """Return gray or RGB. Inks are inverted, as Adobe's programs store them, which all readers assume."""
    with _opened(data, "JPEG") as image:
        codes = codes_of(image)
        stored = codes if image.mode in ("L", "RGB") else np.atleast_3d(np.asarray(image))
    if _ends_early(data, stored):
        raise SceneError("ends early: its last pixels are missing")
    return codes


def _ends_early(data: bytes, codes: NDArray[Any]) -> bool:
    """Return whether the pixels of a jpg end before its picture does.

    The decoder fills missing pixels with gray. If the last pixel is gray, data is appended and decoded again:
    pixels that change were missing.
    """
    last = codes[-1, -1].astype(np.float64)
    luma = last @ (0.299, 0.587, 0.114) if last.shape == (3,) else last.mean()
    end = data.rfind(b"\xff\xd9")
    if abs(luma - FILLED) > ROUNDING or end < 0:
        return False
    with _opened(data[:end] + FILLER + data[end:], "JPEG") as image:
        return not np.array_equal(np.atleast_3d(np.asarray(image)), codes)


def _other(data: bytes, kind: str, budget: Budget) -> NDArray[Any]:
    """Return the codes of a bmp, gif, tga, tif or webp."""
    if kind == "WEBP":
        _check_size(_webp_size(data), budget)
    with _opened(data, kind) as image:
        if kind != "BMP":
            _check_size(image.size, budget)
        return codes_of(image)


def _check_size(size: tuple[int, int], budget: Budget) -> None:
    width, height = size
    budget.check_size(height, width)
    budget.charge(f"a picture of {width} × {height} pixels", height * width * PIXEL_BYTES)


def _webp_size(data: bytes) -> tuple[int, int]:
    """Return the size of a webp, as the library takes memory for it when it opens a file."""
    kind, head = data[12:16], data[20:30].ljust(10, b"\0")
    if kind == b"VP8X":
        return int.from_bytes(head[4:7], "little") + 1, int.from_bytes(head[7:10], "little") + 1
    if kind == b"VP8L":
        packed = int.from_bytes(head[1:5], "little")
        return (packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1
    if kind == b"VP8 ":
        width, height = struct.unpack("<HH", head[6:10])
        return width & 0x3FFF, height & 0x3FFF
    raise SceneError("not a readable webp image: its header is damaged")

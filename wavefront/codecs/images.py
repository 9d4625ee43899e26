"""Reading and writing of image files by extension: png, jpg, exr, hdr, npy.

Values in the package are linear. `write_image` encodes them for display, and `read_linear` decodes them. The
other readers do not decode: a texture may hold colors or data, which only the caller knows.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SaveError, SceneError
from ..files import check_size, check_target, path_name, read_bytes, write_bytes
from ..registry import Registry
from ..vec import Floats
from . import exr
from . import hdr as rgbe
from . import png_jpeg as coded
from .encoding import check_gamma, codes_to_linear, exposed, to_8bit
from .exr import HeaderValue
from .png_jpeg import Gamma

T = TypeVar("T")

Attributes: TypeAlias = Mapping[str, HeaderValue]
Decoder: TypeAlias = Callable[
    [bytes], NDArray[Any]
]  # returns uint8 or uint16 codes, or linear float32, (H, W, C)
# called with linear values (H, W, 3), the gamma and the attributes; returns the file
Encoder: TypeAlias = Callable[[Floats, Gamma, Attributes], bytes]


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that an image can be written to `path`, before a long render.

    Raises
    ------
    SaveError
        If the extension is unknown, the folder is missing or not writable, or something other than a
        regular file is there.
    """
    _find(IMAGE_WRITERS, path, SaveError)
    check_target(path)


def write_image(
    path: str | os.PathLike[str],
    rgb: ArrayLike,
    *,
    gamma: Gamma = 2.2,
    exposure: float = 0.0,
    attributes: Mapping[str, HeaderValue] | None = None,
) -> None:
    """Write a picture in the format of the extension of `path`.

    Parameters
    ----------
    path
        Ends in .png, .jpg, .jpeg (8 bits, encoded for display), .exr, .hdr or .npy (linear).
    rgb
        (H, W, 3) linear values.
    gamma
        Values are raised to 1/gamma in png and jpg; "srgb" applies the exact sRGB curve. The file
        says which.
    exposure
        Values are multiplied by 2**exposure first, in every format.
    attributes
        Text and numbers for the header of an exr.

    Raises
    ------
    SaveError
        If the file cannot be written. The old file stays intact.
    SceneError
        If an argument is malformed.
    """
    encode = _find(IMAGE_WRITERS, path, SaveError)
    pixels = exposed(_picture(rgb), exposure)
    check_gamma(gamma)
    if Path(path).suffix.lower() in FINITE:
        pixels = _finite(path, pixels)
    write_bytes(path, _encoded(path, lambda: encode(pixels, gamma, attributes or {})))


def write_channels(
    path: str | os.PathLike[str],
    channels: Mapping[str, ArrayLike],
    attributes: Mapping[str, HeaderValue] | None = None,
) -> None:
    """Write named (H, W) or (H, W, 3) arrays into one exr; float32 and uint32 are kept exactly.

    Raises
    ------
    SaveError
        If the extension is not .exr, or the file cannot be written.
    """
    _find(EXR_ONLY, path, SaveError)
    arrays = {}
    for name, values in channels.items():
        array = np.asarray(values)
        arrays[name] = np.ascontiguousarray(array, np.uint32 if array.dtype.kind in "ui" else np.float32)
    write_bytes(path, _encoded(path, lambda: exr.encode(arrays, attributes or {})))


def read_image(path: str | os.PathLike[str]) -> Floats:
    """Return the pixels of an image file, (H, W, C) float32, top row first.

    8- and 16-bit values are scaled to [0, 1] and not decoded from sRGB (pngs with 16 bits per
    color channel are read at 8). exr, hdr and npy values are returned unchanged.

    Raises
    ------
    SceneError
        With the name of the file, if it is missing, of another format, damaged, truncated, or larger than
        `files.MAX_PIXELS`.
    """
    codes = read_codes(path)
    if codes.dtype == np.float32:
        return codes
    return codes.astype(np.float32) / np.float32(np.iinfo(codes.dtype).max)


def read_codes(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Return the pixels of an image file as stored, uint8, uint16 or float32, (H, W, C)."""
    return _read(path)[0]


def read_linear(path: str | os.PathLike[str]) -> Floats:
    """Return the linear values of an image file, (H, W, C) float32, top row first.

    png and jpg are decoded by the gamma in the file (gAMA or sRGB of a png, Exif of a jpg), or by the
    sRGB curve if it has none. Alpha, the last of two or four channels, is linear.

    Raises
    ------
    SceneError
        As `read_image`.
    """
    codes, data = _read(path)
    if codes.dtype == np.float32:
        return codes
    return codes_to_linear(codes, coded.gamma_of(data))


def decode_codes(data: bytes, name: str) -> NDArray[Any]:
    """Return the stored values (H, W, C) of a png or jpg in memory; `name` is for messages."""
    return _decode(name, coded.decode, data, "png")


def _read(path: str | os.PathLike[str]) -> tuple[NDArray[Any], bytes]:
    """Return the stored values of an image file, and its bytes."""
    decode = _find(IMAGE_READERS, path)
    data = read_bytes(path)
    return _decode(os.fspath(path), decode, data, Path(path).suffix.lower()[1:]), data


def _decode(name: str, decode: Decoder, data: bytes, kind: str) -> NDArray[Any]:
    try:
        return decode(data)
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    except MemoryError as error:
        raise SceneError(f"{name}: does not fit in memory") from error
    # decoders raise exceptions of any type on damaged data
    except Exception as error:
        raise SceneError(f"{name}: not a readable {kind} image: {error}") from error


def encode_png(rgb: ArrayLike, gamma: Gamma = 2.2) -> bytes:
    """Return a png file of linear values (H, W, 3)."""
    return coded.encode(to_8bit(rgb, gamma), ".png", gamma)


def _find(table: Registry[T], path: str | os.PathLike[str], error: type[SceneError] = SceneError) -> T:
    """Return the entry of a table for the extension of a path."""
    name = path_name(path, error)
    try:
        return table.find(Path(name).suffix.lower(), f"{name}: extension")
    except SceneError as unknown:
        raise error(str(unknown)) from None


def _encoded(path: str | os.PathLike[str], encode: Callable[[], bytes]) -> bytes:
    """Return the result of `encode`; convert its exceptions to SaveError."""
    try:
        return encode()
    except Exception as error:
        raise SaveError(f"{os.fspath(path)}: cannot be encoded: {error or type(error).__name__}") from error


def _picture(rgb: ArrayLike) -> Floats:
    pixels = np.asarray(rgb, np.float32)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise SceneError(f"an image must have shape (height, width, 3), got {pixels.shape}")
    return pixels


def _finite(path: str | os.PathLike[str], pixels: Floats) -> Floats:
    """Replace NaN and infinities, with a warning, for a format that cannot hold them."""
    bad = int(np.count_nonzero(~np.isfinite(pixels).all(axis=2)))
    if not bad:
        return pixels
    warnings.warn(f"{os.fspath(path)}: {bad} pixels are not finite; NaN is written as 0", stacklevel=3)
    return np.nan_to_num(pixels, nan=0.0)


def _encode_npy(pixels: Floats) -> bytes:
    buffer = BytesIO()
    np.save(buffer, pixels, allow_pickle=False)
    return buffer.getvalue()


def _decode_npy(data: bytes) -> Floats:
    pixels = np.load(BytesIO(data), allow_pickle=False)
    if pixels.ndim not in (2, 3) or pixels.dtype.kind not in "fiub":
        raise SceneError(f"array is {pixels.dtype} of shape {pixels.shape}; an image is (H, W) or (H, W, C)")
    check_size(pixels.shape[0], pixels.shape[1])
    return np.atleast_3d(pixels).astype(np.float32)


def _encode_8bit(extension: str) -> Encoder:
    return lambda pixels, gamma, attributes: coded.encode(to_8bit(pixels, gamma), extension, gamma)


def _without_metadata(encode: Callable[[Floats], bytes]) -> Encoder:
    """Return an encoder that keeps linear values, and neither a gamma nor attributes."""
    return lambda pixels, gamma, attributes: encode(pixels)


def _checked_pixels(decode: Callable[[bytes], Any]) -> Decoder:
    """Return a decoder that checks what `decode`, a user's own function, returns."""

    def checked(data: bytes) -> NDArray[Any]:
        pixels = np.asarray(decode(data))
        if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or not pixels.size:
            raise SceneError(f"the reader returned the shape {pixels.shape}; an image is (H, W, 1 to 4)")
        return pixels if pixels.dtype in (np.uint8, np.uint16) else pixels.astype(np.float32)

    return checked


def _exr(pixels: Floats, gamma: Gamma, attributes: Attributes) -> bytes:
    return exr.encode({"RGB": pixels}, attributes)


IMAGE_READERS: Registry[Decoder] = Registry(
    "extension",
    "a function of bytes that returns pixels (H, W, C)",
    {
        **dict.fromkeys(coded.EXTENSIONS, coded.decode),
        ".exr": exr.decode,
        ".hdr": rgbe.decode,
        ".npy": _decode_npy,
    },
    adapt=_checked_pixels,
)
IMAGE_WRITERS: Registry[Encoder] = Registry(
    "extension",
    "a function of linear pixels (H, W, 3) that returns bytes",
    {
        **{extension: _encode_8bit(extension) for extension in coded.EXTENSIONS},
        ".exr": _exr,
        ".hdr": _without_metadata(rgbe.encode),
        ".npy": _without_metadata(_encode_npy),
    },
    adapt=_without_metadata,
)
EXR_ONLY = Registry("extension", "an encoder", {".exr": _exr})  # what holds named channels
FINITE = (*coded.EXTENSIONS, ".hdr")  # formats that hold neither NaN nor infinities

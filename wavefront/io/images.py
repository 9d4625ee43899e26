"""Images from files and to files, by extension: png, jpg, exr, hdr, npy.

Values are linear inside. Encoding for display happens here; decoding sRGB is left to the caller,
who knows whether an image holds colours or data.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, number
from ..vec import Floats
from . import png, rgbe
from .files import check_folder, check_size, read_bytes, write_bytes

READABLE = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy")
WRITABLE = READABLE
Attribute = str | int | float


def check_writable(path: str | os.PathLike[str]) -> None:
    """Make sure that an image can be written to `path`: call it before a long render.

    Raises
    ------
    SceneError
        If the extension is unknown, or the folder is missing or not writable.
    """
    _extension(path, WRITABLE)
    check_folder(path)


def write_image(
    path: str | os.PathLike[str],
    rgb: ArrayLike,
    *,
    gamma: float | str = 2.2,
    exposure: float = 0.0,
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write a picture in the format that the extension of `path` names.

    Parameters
    ----------
    path
        Ends in .png, .jpg, .jpeg (8 bits, encoded for display), .exr, .hdr or .npy (linear).
    rgb
        (H, W, 3) linear values.
    gamma
        Values are raised to 1/gamma in png and jpg; "srgb" applies the exact sRGB curve.
    exposure
        Stops: values are multiplied by 2**exposure first, in every format.
    attributes
        Text and numbers for the header of an exr.

    Raises
    ------
    SceneError
        If the extension, an argument or the folder is not usable. The old file stays intact.
    """
    extension = _extension(path, WRITABLE)
    pixels = _picture(rgb) * np.float32(2.0 ** number("exposure", exposure))
    if extension in (".png", ".jpg", ".jpeg"):
        data = _encode_8bit(path, pixels, gamma, extension)
    elif extension == ".exr":
        data = _encode_exr({"RGB": pixels}, attributes or {})
    elif extension == ".hdr":
        data = rgbe.encode(_finite(path, pixels))
    else:
        data = _encode_npy(pixels)
    write_bytes(path, data)


def write_channels(
    path: str | os.PathLike[str],
    channels: Mapping[str, ArrayLike],
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write named (H, W) or (H, W, 3) arrays into one exr; float32 and uint32 are kept exactly.

    Raises
    ------
    SceneError
        If the extension is not .exr, or the folder is not usable.
    """
    _extension(path, (".exr",))
    arrays = {}
    for name, values in channels.items():
        array = np.asarray(values)
        arrays[name] = np.ascontiguousarray(array, np.uint32 if array.dtype.kind in "ui" else np.float32)
    write_bytes(path, _encode_exr(arrays, attributes or {}))


def read_image(path: str | os.PathLike[str]) -> Floats:
    """Return the pixels of an image file, (H, W, C) float32, top row first.

    8- and 16-bit values are scaled to [0, 1] and not decoded from sRGB (pngs with 16 bits per
    colour channel are read at 8). exr, hdr and npy values come as they are.

    Raises
    ------
    SceneError
        Naming the file: missing, of another kind, corrupt, truncated, or larger than
        `files.MAX_PIXELS`.
    """
    codes = read_codes(path)
    if codes.dtype == np.float32:
        return codes
    return codes.astype(np.float32) / np.float32(np.iinfo(codes.dtype).max)


def read_codes(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Return what `read_image` does, but 8- and 16-bit values as they are stored, (H, W, C)."""
    extension = _extension(path, READABLE)
    return _decode(os.fspath(path), extension, read_bytes(path))


def decode_codes(data: bytes, name: str) -> NDArray[Any]:
    """Return the stored values (H, W, C) of a png or jpg in memory; `name` is for messages."""
    return _decode(name, ".png", data)


def _decode(name: str, extension: str, data: bytes) -> NDArray[Any]:
    readers = {".exr": _decode_exr, ".hdr": rgbe.decode, ".npy": _decode_npy}
    try:
        return readers.get(extension, _decode_8bit)(data)
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    except MemoryError as error:
        raise SceneError(f"{name}: does not fit in memory") from error
    # the decoders raise whatever comes to their mind on damaged bytes
    except Exception as error:
        raise SceneError(f"{name}: not a readable {extension[1:]} image: {error}") from error


def srgb_to_linear(values: Floats) -> Floats:
    """Decode sRGB values in [0, 1], any shape (IEC 61966-2-1)."""
    values = np.asarray(values, np.float32)
    low = values / np.float32(12.92)
    high = ((values + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(values <= 0.04045, low, high).astype(np.float32)


def linear_to_srgb(values: Floats) -> Floats:
    """Encode linear values in [0, 1] as sRGB, any shape (IEC 61966-2-1)."""
    values = np.asarray(values, np.float32)
    high = np.float32(1.055) * np.maximum(values, 0) ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(values <= 0.0031308, values * np.float32(12.92), high).astype(np.float32)


def to_8bit(rgb: ArrayLike, gamma: float | str = 2.2) -> NDArray[np.uint8]:
    """Return linear values as display values 0 to 255, any shape; NaN becomes 0.

    Raises
    ------
    SceneError
        If gamma is neither a number above 0 nor "srgb".
    """
    unit = np.clip(np.nan_to_num(np.asarray(rgb, np.float32), nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
    if gamma == "srgb":
        encoded = linear_to_srgb(unit)
    elif isinstance(gamma, str):
        raise SceneError(f"gamma is {gamma!r}; it must be a number above 0 or 'srgb'")
    else:
        encoded = unit ** np.float32(1 / number("gamma", gamma, lambda x: x > 0, "above 0"))
    return np.round(encoded * 255).astype(np.uint8)


def _extension(path: str | os.PathLike[str], allowed: tuple[str, ...]) -> str:
    extension = Path(path).suffix.lower()
    if extension not in allowed:
        raise SceneError(f"{os.fspath(path)}: extension {extension!r} is not one of {', '.join(allowed)}")
    return extension


def _picture(rgb: ArrayLike) -> Floats:
    pixels = np.asarray(rgb, np.float32)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise SceneError(f"an image must have shape (height, width, 3), got {pixels.shape}")
    return pixels


def _finite(path: str | os.PathLike[str], pixels: Floats) -> Floats:
    """Replace what a format cannot hold, and say so."""
    bad = int(np.count_nonzero(~np.isfinite(pixels).all(axis=2)))
    if not bad:
        return pixels
    warnings.warn(f"{os.fspath(path)}: {bad} pixels are not finite; NaN is written as 0", stacklevel=3)
    return np.nan_to_num(pixels, nan=0.0)


def _encode_8bit(path: str | os.PathLike[str], pixels: Floats, gamma: float | str, extension: str) -> bytes:
    coded = to_8bit(_finite(path, pixels), gamma)
    if extension == ".png":
        return png.encode(coded)
    import imageio.v3 as iio  # here, so that starting up does not pay for it

    return bytes(iio.imwrite("<bytes>", coded, extension=".jpg", plugin="pillow", quality=95, subsampling=0))


def _decode_8bit(data: bytes) -> NDArray[Any]:
    import imageio.v3 as iio

    check_size(*_size_8bit(data))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the decoder warns of large images; the limit here is our own
        pixels = iio.imread(data, plugin="pillow", index=0)
    if pixels.dtype == np.bool_:
        pixels = pixels * np.uint8(255)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise SceneError(f"holds {pixels.dtype} values; only 8 and 16 bits are read")
    return np.atleast_3d(pixels)


def _size_8bit(data: bytes) -> tuple[int, int]:
    """Return (height, width) from the header of a png or jpg, before anything is decoded."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return int.from_bytes(data[20:24], "big"), int.from_bytes(data[16:20], "big")
    at = 2 if data.startswith(b"\xff\xd8") else len(data)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # a start of frame
            return int.from_bytes(data[at + 5 : at + 7], "big"), int.from_bytes(data[at + 7 : at + 9], "big")
        at += 1 if marker == 0xFF else 2 + length
    raise SceneError("not a readable png or jpg image: its header is damaged")


def _encode_exr(channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, Attribute]) -> bytes:
    import tempfile

    import OpenEXR

    header = {**attributes, "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    # the library writes by file name only
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder) / "image.exr"
        OpenEXR.File(header, {k: np.ascontiguousarray(v) for k, v in channels.items()}).write(str(scratch))
        return scratch.read_bytes()


def _decode_exr(data: bytes) -> Floats:
    import OpenEXR

    header = OpenEXR.File(BytesIO(data), header_only=True).header()
    low, high = header["dataWindow"]
    check_size(int(high[1]) - int(low[1]) + 1, int(high[0]) - int(low[0]) + 1)
    channels = OpenEXR.File(BytesIO(data), separate_channels=True).channels()
    names = [n for n in ("R", "G", "B", "A") if n in channels] or sorted(channels)[:1]
    return np.stack([channels[n].pixels for n in names], axis=-1).astype(np.float32)


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

"""Pictures of 8 and 16 bits in memory: png and jpg, written by imageio; and the gamma of those that are read.

Pillow has no pictures of 16 bits for each of several channels; what is written is filtered here.
Source of the format: W3C, Portable Network Graphics (third edition), 2025.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SaveError
from .raster import quiet
from .size_check import JPG, PNG

Gamma = float | str  # an exponent, or "srgb" for the exact sRGB curve

GAMMAS = (0.01, 100.0)  # the least and the largest exponent
PNG_DEFLATE = zlib.Z_RLE  # run lengths only: for renders 3 % larger files in a fourth of the time
COLOR_TYPES = {3: 2, 4: 6}  # of a png, by channels
FILTER_UP = 2  # filter of a row of a png: differences from the row above
EXTENSIONS = (".png", ".jpg", ".jpeg")
MAX_JPG = 65500  # pixels in a row or a column, by libjpeg
SRGB_GAMA = 45455  # gAMA of an sRGB png, for readers that do not know the sRGB chunk
EXIF_IFD, COLOR_SPACE, EXIF_GAMMA = 0x8769, 0xA001, 0xA500  # tags of CIPA DC-008 (Exif 2.32)
SRGB_SPACE, UNCALIBRATED = 1, 0xFFFF  # values of ColorSpace


def encode(codes: NDArray[Any], extension: str, gamma: Gamma) -> bytes:
    """Return a png or jpg file of codes (H, W, 3), with metadata of their encoding.

    A png gets the chunk gAMA, or sRGB as well; a jpg gets the Exif tags ColorSpace and Gamma. A png may
    have alpha (H, W, 4), and codes of uint16.
    """
    import imageio.v3 as iio  # imported here to keep `import wavefront` quick

    if extension == ".png" and codes.dtype == np.uint16:
        return _encode_16(codes, gamma)
    if extension == ".png":
        options: dict[str, Any] = {"compress_type": PNG_DEFLATE, "pnginfo": _png_info(gamma)}
        return bytes(iio.imwrite("<bytes>", codes, extension=".png", plugin="pillow", **options))
    if max(codes.shape[:2]) > MAX_JPG:
        raise SaveError(
            f"a jpg has at most {MAX_JPG} rows and columns, got {codes.shape[1]} × {codes.shape[0]}"
        )
    options = {"quality": 95, "subsampling": 0, "exif": _exif(gamma)}
    return bytes(iio.imwrite("<bytes>", codes, extension=".jpg", plugin="pillow", **options))


def gamma_of(data: bytes) -> Gamma:
    """Return the gamma of a png or jpg, "srgb" for files that have none, or of another format."""
    if not data.startswith((PNG, JPG)):
        return "srgb"
    try:
        with quiet():
            exponent = _exponent(data)
    # the reader raises exceptions of any type on damaged Exif data, which some cameras and editors write
    except Exception:
        return "srgb"
    return exponent if exponent is not None and GAMMAS[0] <= exponent <= GAMMAS[1] else "srgb"


def _exponent(data: bytes) -> float | None:
    """Return the exponent in the metadata of a png or jpg, None if there is none or it is sRGB."""
    import imageio.v3 as iio
    from PIL.Image import Exif

    with iio.imopen(data, "r", plugin="pillow") as file:
        info = file.metadata(index=0)
    if "srgb" in info:
        return None
    if "gamma" in info:  # of a png: the exponent of encoding
        return 1 / info["gamma"]
    exif = Exif()
    exif.load(info.get("exif", b""))
    tags = exif.get_ifd(EXIF_IFD)
    named = tags.get(COLOR_SPACE) != SRGB_SPACE and EXIF_GAMMA in tags
    return float(tags[EXIF_GAMMA]) if named else None


def _png_chunks(gamma: Gamma) -> list[tuple[bytes, bytes]]:
    """Return the chunks (name, content) that say how a png is encoded."""
    gama = SRGB_GAMA if gamma == "srgb" else round(100000 / float(gamma))
    chunks = [(b"gAMA", gama.to_bytes(4, "big"))]
    return [(b"sRGB", b"\0"), *chunks] if gamma == "srgb" else chunks  # rendering intent: perceptual


def _png_info(gamma: Gamma) -> Any:
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    for name, content in _png_chunks(gamma):
        info.add(name, content)
    return info


def _encode_16(codes: NDArray[np.uint16], gamma: Gamma) -> bytes:
    """Return a png of codes (H, W, 3 or 4)."""
    return png_of_codes(codes, _png_chunks(gamma))


def png_of_codes(codes: NDArray[Any], about: Sequence[tuple[bytes, bytes]] = ()) -> bytes:
    """Return a png of codes (H, W, 3 or 4), uint8 or uint16, with chunks (name, content) that say more."""
    height, width, channels = codes.shape
    rows = codes.astype(codes.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    differences = rows.copy()
    differences[1:] -= rows[:-1]
    filtered = np.concatenate([np.full((height, 1), FILTER_UP, np.uint8), differences], axis=1)
    deflate = zlib.compressobj(strategy=PNG_DEFLATE)
    header = b"".join(n.to_bytes(4, "big") for n in (width, height)) + bytes(
        [8 * codes.itemsize, COLOR_TYPES[channels], 0, 0, 0]
    )
    pixels = deflate.compress(filtered.tobytes()) + deflate.flush()
    chunks = ((b"IHDR", header), *about, (b"IDAT", pixels), (b"IEND", b""))
    return PNG + b"".join(
        len(content).to_bytes(4, "big") + name + content + zlib.crc32(name + content).to_bytes(4, "big")
        for name, content in chunks
    )


def _exif(gamma: Gamma) -> bytes:
    from PIL.Image import Exif
    from PIL.TiffImagePlugin import IFDRational

    exif = Exif()
    tags = exif.get_ifd(EXIF_IFD)
    tags[COLOR_SPACE] = SRGB_SPACE if gamma == "srgb" else UNCALIBRATED
    if gamma != "srgb":
        tags[EXIF_GAMMA] = IFDRational(round(float(gamma) * 100000), 100000)
    return exif.tobytes()

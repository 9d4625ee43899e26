"""Png of 16 bits for each of three or four channels, which Pillow writes not at all and reads at 8 bits.

Source of the format: W3C, Portable Network Graphics (third edition), 2025; filters in section 9.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bytes, Ints
from ..core.errors import SceneError
from .claims import PNG, PNG_CHANNELS, png_chunks

COLOR_TYPES = {3: 2, 4: 6}  # by channels
UP, PAETH = 2, 4  # filters of rows: differences from the row above, and the last one
BITS, COLOR_TYPE, INTERLACE = 24, 25, 28  # where the header has them


def encode(codes: NDArray[np.uint16], chunks: Iterable[tuple[bytes, bytes]]) -> bytes:
    """Return a png of codes (H, W, 3 or 4); `chunks` (name, content) stand before the pixels."""
    height, width, channels = codes.shape
    rows = codes.astype(">u2").view(np.uint8).reshape(height, -1)
    differences = rows.copy()
    differences[1:] -= rows[:-1]
    filtered = np.concatenate([np.full((height, 1), UP, np.uint8), differences], axis=1)
    deflate = zlib.compressobj(strategy=zlib.Z_RLE)
    header = b"".join(n.to_bytes(4, "big") for n in (width, height)) + bytes(
        [16, COLOR_TYPES[channels], 0, 0, 0]
    )
    pixels = deflate.compress(filtered.tobytes()) + deflate.flush()
    return PNG + b"".join(
        _chunk(name, content)
        for name, content in ((b"IHDR", header), *chunks, (b"IDAT", pixels), (b"IEND", b""))
    )


def _chunk(name: bytes, content: bytes) -> bytes:
    check = zlib.crc32(name + content)
    return len(content).to_bytes(4, "big") + name + content + check.to_bytes(4, "big")


def reads(data: bytes) -> bool:
    """Return whether `decode` reads a png: one of 16 bits, with three or four channels, not interlaced."""
    return (
        data.startswith(PNG)
        and data[BITS] == 16
        and data[COLOR_TYPE] in COLOR_TYPES.values()
        and not data[INTERLACE]
    )


def decode(data: bytes) -> NDArray[np.uint16]:
    """Return the codes (H, W, 3 or 4) of a png whose header has been checked by `check_claims`.

    Raises
    ------
    SceneError
        If a checksum is wrong, or a row has an unknown filter.
    """
    width, height = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
    channels = PNG_CHANNELS[data[COLOR_TYPE]]
    size = height * (1 + 2 * channels * width)
    pieces = []
    for name, content, check in png_chunks(data):
        if zlib.crc32(content, zlib.crc32(name)) != check:
            raise SceneError(f"the checksum of a chunk {name!r} is wrong")
        if name == b"IDAT":
            pieces.append(content)
    rows = zlib.decompressobj().decompress(b"".join(pieces), size)
    filtered = np.frombuffer(rows, np.uint8).reshape(height, -1)
    if filtered[:, 0].max() > PAETH:
        raise SceneError(f"a row has the filter {filtered[:, 0].max()}; png has {PAETH} at most")
    unfiltered = _unfiltered(filtered[:, 0], filtered[:, 1:].reshape(height, width, 2 * channels))
    return unfiltered.reshape(height, width, channels, 2).view(">u2")[..., 0].astype(np.uint16)


def _unfiltered(kinds: Bytes, differences: Bytes) -> Bytes:
    """Return the bytes (H, W, b) of pixels from their differences by the filter (H,) of each row.

    A pixel follows from those at its left, above, and above at the left. So all pixels of a diagonal are
    computed together.
    """
    height, width, _ = differences.shape
    out = np.zeros((height + 1, width + 1, differences.shape[2]), np.int16)  # with a border of zeros
    for diagonal in range(height + width - 1):
        y = np.arange(max(0, diagonal - width + 1), min(height - 1, diagonal) + 1)
        x = diagonal - y
        left, up, corner = out[y + 1, x], out[y, x + 1], out[y, x]
        out[y + 1, x + 1] = (differences[y, x] + _predicted(kinds[y], left, up, corner)) & 255
    return out[1:, 1:].astype(np.uint8)


def _predicted(kinds: Bytes, left: Ints, up: Ints, corner: Ints) -> Ints:
    """Return what each filter (k,) predicts of pixels (k, b)."""
    to_left, to_up, to_corner = (np.abs(left + up - corner - near) for near in (left, up, corner))
    paeth = np.where(
        (to_left <= to_up) & (to_left <= to_corner), left, np.where(to_up <= to_corner, up, corner)
    )
    choices = [np.zeros_like(left), left, up, (left + up) >> 1, paeth]
    return np.choose(kinds[:, None].astype(np.intp), choices)

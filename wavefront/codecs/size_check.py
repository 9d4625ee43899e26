"""Checks of the header of a png, jpg or bmp against the size of its data.

Decoders silently pad a picture that ends early, so a damaged file would be accepted.
Source of the formats: W3C, Portable Network Graphics (third edition), 2025, and ITU-T T.81.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator

from ..core.errors import SceneError
from .budget import Budget

PNG = b"\x89PNG\r\n\x1a\n"
JPG = b"\xff\xd8"
BMP = b"BM"
PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by color type
BITS, COLOR_TYPE = 24, 25  # where the header of a png has them
PALETTE = 3  # the color type of indices, which become up to four channels
ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
JPG_PIXELS_PER_BYTE = 512  # at most: a block of 8 × 8 pixels takes at least a bit
CHUNK = 2**18  # bytes that are inflated at once


def check_header(data: bytes, budget: Budget) -> None:
    """Check that a png, jpg or bmp can hold the picture that its header claims, before it is decoded.

    The memory for this check does not depend on the size that the header claims.

    Raises
    ------
    SceneError
        If the header is damaged, or claims too many pixels or more than the file can hold.
    """
    if data.startswith(PNG):
        _check_png(data, budget)
    elif data.startswith(JPG):
        _check_jpg(data, budget)
    else:
        _check_bmp(data, budget)


def _check_bmp(data: bytes, budget: Budget) -> None:
    if len(data) < 54:
        raise SceneError("not a readable bmp image: its header is damaged")
    width, height, _, bits, packed = struct.unpack_from("<iiHHI", data, 18)
    width, height = abs(width), abs(height)
    budget.check_size(height, width)
    need = height * ((width * bits + 31) // 32 * 4)
    if packed in (0, 3) and len(data) - 54 < need:
        raise SceneError(
            f"ends early: {width} × {height} pixels take {need} bytes; {len(data) - 54} are there"
        )
    budget.charge(f"a picture of {width} × {height} pixels", height * width * 4 * 2)


def _check_png(data: bytes, budget: Budget) -> None:
    header = data[16:29]
    if len(header) < 13 or header[9] not in PNG_CHANNELS:
        raise SceneError("not a readable png image: its header is damaged")
    width, height = int.from_bytes(header[:4], "big"), int.from_bytes(header[4:8], "big")
    budget.check_size(height, width)
    octets = 2 if header[8] == 16 else 1  # of a sample
    channels = max(PNG_CHANNELS[header[9]], 4 * (header[9] == PALETTE))
    channels += any(name == b"tRNS" for name, _, _ in png_chunks(data)) and channels in (1, 3)  # alpha
    copies = 4 if octets == 2 and channels > 1 else 2  # 16 bits of several channels are decoded in two halves
    budget.charge(f"a picture of {width} × {height} pixels", height * width * channels * octets * copies)
    bits, interlaced = header[8] * PNG_CHANNELS[header[9]], header[12] == 1
    need = sum(rows * (1 + (columns * bits + 7) // 8) for columns, rows in _passes(width, height, interlaced))
    pixels = [(content, check) for name, content, check in png_chunks(data) if name == b"IDAT"]
    available = _inflated((content for content, _ in pixels), need)
    if available < need:
        raise SceneError(f"ends early: {width} × {height} pixels take {need} bytes; {available} are there")
    if octets == 2 and any(zlib.crc32(content, zlib.crc32(b"IDAT")) != check for content, check in pixels):
        raise SceneError("the checksum of a chunk b'IDAT' is wrong")


def _passes(width: int, height: int, interlaced: bool) -> Iterator[tuple[int, int]]:
    """Yield the (columns, rows) of each pass of a png."""
    for x, y, dx, dy in ADAM7 if interlaced else ((0, 0, 1, 1),):
        columns, rows = -(-(width - x) // dx), -(-(height - y) // dy)
        if columns > 0 and rows > 0:
            yield columns, rows


def png_chunks(data: bytes) -> Iterator[tuple[bytes, memoryview, int]]:
    """Yield the name, the content and the checksum of each chunk of a png."""
    view, at = memoryview(data), len(PNG)
    while at + 8 <= len(data):
        length, name = int.from_bytes(view[at : at + 4], "big"), bytes(view[at + 4 : at + 8])
        end = at + 8 + length
        yield name, view[at + 8 : end], int.from_bytes(view[end : end + 4], "big")
        at = end + 4


def _inflated(pieces: Iterable[memoryview], need: int) -> int:
    """Return the inflated size of `pieces`, counted up to about `need` bytes."""
    inflate, count = zlib.decompressobj(), 0
    for piece in pieces:
        rest: bytes | memoryview = piece
        while len(rest) and count < need:
            count += len(inflate.decompress(rest, CHUNK))
            rest = inflate.unconsumed_tail
    return count


def _check_jpg(data: bytes, budget: Budget) -> None:
    at = len(JPG)
    while at + 10 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # a start of frame
            height, width = (int.from_bytes(data[at + k : at + k + 2], "big") for k in (5, 7))
            budget.check_size(height, width)
            if height * width > JPG_PIXELS_PER_BYTE * (len(data) - at):
                raise SceneError(f"ends early: {len(data) - at} bytes cannot hold {width} × {height} pixels")
            budget.charge(
                f"a picture of {width} × {height} pixels", height * width * max(3, data[at + 9]) * 2
            )
            return
        at += 1 if marker == 0xFF else 2 + length
    raise SceneError("not a readable jpg image: its header is damaged")

"""PNG pictures, written with nothing but zlib: loading an imaging library takes longer than this.

Source: ISO/IEC 15948 (Portable Network Graphics), sections 5, 7.3 and 9.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
BITS, RGB = 8, 2  # per channel; colour type
SUB = 1  # filter of a row: what is stored is the difference from the pixel to the left


def encode(codes: NDArray[np.uint8]) -> bytes:
    """Return a .png file of display values (H, W, 3).

    Deflate looks for runs only: the grain of a rendered picture repeats nothing longer. Files are
    as small as with a full search, which takes three to ten times as long (docs/performance.md).
    """
    height, width = codes.shape[:2]
    values = codes.reshape(height, 3 * width)
    rows = np.empty((height, 1 + 3 * width), np.uint8)
    rows[:, 0] = SUB
    rows[:, 1:] = values
    rows[:, 4:] -= values[:, :-3]
    deflate = zlib.compressobj(strategy=zlib.Z_RLE)
    packed = deflate.compress(rows.tobytes()) + deflate.flush()
    header = struct.pack(">IIBBBBB", width, height, BITS, RGB, 0, 0, 0)
    return SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", packed) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

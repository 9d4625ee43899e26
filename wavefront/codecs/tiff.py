"""Tif pictures of 16 bits and more, and of floats, which Pillow reads as 8 bits or not at all.

Pillow decompresses them: it is shown a gray picture of 8 bits whose rows are the bytes of the real ones.
Numbers and predictors are read here.
Source of the format: Adobe, TIFF Revision 6.0, 1992; TIFF Technical Note 3, 2005 (predictors of floats).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from .budget import Budget

SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
BIG = 43  # the version of BigTIFF
TYPES = {1: "B", 3: "H", 4: "I", 16: "Q"}  # of tags that are read here
WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC = 256, 257, 258, 259, 262
OFFSETS, SAMPLES, ROWS, COUNTS, PLANAR, PREDICTOR = 273, 277, 278, 279, 284, 317
TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS, TILE_COUNTS, EXTRA, FORMAT = 322, 323, 324, 325, 338, 339
UNSIGNED, FLOAT = 1, 3  # values of FORMAT
UNPACKED = (1, 5, 8, 32773, 32946, 34925, 50000)  # stored, lzw, deflate, packbits, deflate, lzma, zstd
WHITE_IS_ZERO, COLORS = 0, {0: 1, 1: 1, 2: 3}  # values of PHOTOMETRIC, and the channels of each
PREMULTIPLIED = 1  # a value of EXTRA; 0 is no alpha
COPIES = 6  # of the bytes of the picture, while it is decoded
LARGEST = 2**16  # entries of a directory


def decode(data: bytes, budget: Budget) -> NDArray[Any] | None:
    """Return the values (H, W, C), uint16 or float32; None for a picture that Pillow reads well.

    Raises
    ------
    SceneError
        If it claims too much, or holds numbers of another kind.
    """
    tags = _tags(data)
    bits = tags.get(BITS, (1,))
    if max(bits) <= 8 or _first(tags, PHOTOMETRIC, 1) not in COLORS or _first(tags, COMPRESSION, 1) == 7:
        return None
    layout = _layout(data, tags)
    budget.check_size(layout.height, layout.width)
    size = layout.height * layout.width * layout.samples * layout.kind.itemsize
    budget.charge(f"a picture of {layout.width} × {layout.height} pixels", COPIES * size)
    return _converted(_values(data, layout), tags, layout)


@dataclass(frozen=True)
class _Layout:
    """How the numbers of a picture are stored."""

    tags: dict[int, tuple[int, ...]]
    height: int
    width: int
    samples: int  # of a pixel
    kind: np.dtype[Any]  # of a number, with the order of its bytes
    planes: int  # 1, or one for each sample
    across: int  # pixels in a row of a tile; a strip is as wide as the picture


def _layout(data: bytes, tags: dict[int, tuple[int, ...]]) -> _Layout:
    bits, form = tags.get(BITS, (1,)), tags.get(FORMAT, (UNSIGNED,))
    samples, compression = _first(tags, SAMPLES, 1), _first(tags, COMPRESSION, 1)
    widths = {UNSIGNED: (16, 32), FLOAT: (16, 32, 64)}.get(form[0], ())
    if len(set(bits)) > 1 or len(set(form)) > 1 or bits[0] not in widths:
        listed = ", ".join(map(str, bits))
        raise SceneError(f"holds numbers of {listed} bits of the sample format {form[0]}, which are not read")
    if compression not in UNPACKED:
        raise SceneError(f"is compressed by method {compression}, which is not read with {bits[0]} bits")
    order = "<" if data[:2] == b"II" else ">"
    kind = np.dtype(f"{order}{'f' if form[0] == FLOAT else 'u'}{bits[0] // 8}")
    width, height = _first(tags, WIDTH, 0), _first(tags, HEIGHT, 0)
    colors = COLORS[_first(tags, PHOTOMETRIC, 1)]
    if not colors <= samples <= LARGEST:
        raise SceneError(f"has {samples} samples for each pixel; it must have at least {colors}")
    planes = samples if _first(tags, PLANAR, 1) == 2 else 1
    across = _first(tags, TILE_WIDTH, 0) or width
    return _Layout(tags, height, width, samples, kind, planes, across)


def _tags(data: bytes) -> dict[int, tuple[int, ...]]:
    """Return the whole numbers of the first directory, by tag."""
    order = "<" if data[:2] == b"II" else ">"
    big = struct.unpack_from(f"{order}H", data, 2)[0] == BIG
    at = struct.unpack_from(f"{order}{'Q' if big else 'I'}", data, 8 if big else 4)[0]
    count = struct.unpack_from(f"{order}{'Q' if big else 'H'}", data, at)[0]
    if count > LARGEST:
        raise SceneError(f"has a directory of {count} entries")
    at += 8 if big else 2
    entry, inside = struct.Struct(f"{order}HH{'Q8s' if big else 'I4s'}"), 8 if big else 4
    tags = {}
    for tag, kind, length, value in entry.iter_unpack(data[at : at + count * entry.size]):
        size = length * struct.calcsize(f"={TYPES[kind]}") if kind in TYPES else 0
        if not 0 < size <= len(data):
            continue
        start = 0 if size <= inside else struct.unpack(f"{order}{'Q' if big else 'I'}", value)[0]
        tags[tag] = struct.unpack_from(
            f"{order}{length}{TYPES[kind]}", value if size <= inside else data, start
        )
    return tags


def _first(tags: dict[int, tuple[int, ...]], tag: int, default: int) -> int:
    return tags.get(tag, (default,))[0]


def _values(data: bytes, layout: _Layout) -> NDArray[Any]:
    """Return the numbers as stored, (H, W, samples)."""
    samples = layout.samples // layout.planes
    padded = math.ceil(layout.width / layout.across) * layout.across
    planes = []
    for offsets, counts in _pieces(layout):
        raw = _rows(data, layout, offsets, counts, padded * samples * layout.kind.itemsize)
        tiles = [
            _predicted(np.ascontiguousarray(tile), layout, samples)
            for tile in np.split(raw, padded // layout.across, axis=1)
        ]
        planes.append(np.concatenate(tiles, axis=1))
    return np.concatenate(planes, axis=2)[:, : layout.width]


def _pieces(layout: _Layout) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Yield the offsets and sizes of the strips or tiles of each plane."""
    tiled = TILE_OFFSETS in layout.tags
    names = (TILE_OFFSETS, TILE_COUNTS) if tiled else (OFFSETS, COUNTS)
    offsets, counts = (layout.tags.get(name, ()) for name in names)
    number = len(offsets) // layout.planes
    if not number or len(counts) != len(offsets):
        raise SceneError("has no pixels: the directory is damaged")
    for k in range(layout.planes):
        plane = slice(k * number, (k + 1) * number)
        yield offsets[plane], counts[plane]


def _rows(
    data: bytes, layout: _Layout, offsets: tuple[int, ...], counts: tuple[int, ...], size: int
) -> NDArray[np.uint8]:
    """Return the decompressed rows of a plane, (H, size), with the columns that fill the last tiles."""
    from PIL import Image  # imported here to keep `import wavefront` quick

    tags, tile_bytes = (
        layout.tags,
        size * layout.across // (math.ceil(layout.width / layout.across) * layout.across),
    )
    shown: dict[int, tuple[int, ...]] = {
        WIDTH: (size,),
        HEIGHT: (layout.height,),
        BITS: (8,),
        COMPRESSION: (_first(tags, COMPRESSION, 1),),
        PHOTOMETRIC: (1,),
        SAMPLES: (1,),
    }
    if TILE_OFFSETS in tags:
        shown |= {TILE_WIDTH: (tile_bytes,), TILE_HEIGHT: tags[TILE_HEIGHT]}
        shown |= {TILE_OFFSETS: offsets, TILE_COUNTS: counts}
    else:
        shown |= {
            OFFSETS: offsets,
            ROWS: (min(_first(tags, ROWS, layout.height), layout.height),),
            COUNTS: counts,
        }
    with Image.open(BytesIO(_file(data, shown)), formats=["TIFF"]) as image:
        return np.asarray(image)


def _file(data: bytes, tags: dict[int, tuple[int, ...]]) -> bytes:
    """Return a file with another directory, at its end."""
    order = "<" if data[:2] == b"II" else ">"
    out = bytearray(data)
    out += bytes(-len(out) % 2)
    places = {}
    for tag, values in tags.items():
        if len(values) > 1:
            places[tag] = len(out)
            out += struct.pack(f"{order}{len(values)}I", *values)
    out[:8] = data[:2] + struct.pack(f"{order}HI", 42, len(out))
    out += struct.pack(f"{order}H", len(tags))
    for tag in sorted(tags):
        values = tags[tag]
        out += struct.pack(f"{order}HHII", tag, 4, len(values), places.get(tag, values[0]))
    return bytes(out + bytes(4))


def _predicted(raw: NDArray[np.uint8], layout: _Layout, samples: int) -> NDArray[Any]:
    """Return the numbers (H, columns, samples) of decompressed bytes (H, n)."""
    height, octets = len(raw), layout.kind.itemsize
    predictor = _first(layout.tags, PREDICTOR, 1)
    if predictor == 3:
        sums = np.cumsum(raw.reshape(height, -1, samples), axis=1, dtype=np.uint8)
        split = sums.reshape(height, octets, -1).transpose(0, 2, 1)  # the highest bytes come first
        return np.ascontiguousarray(split).view(f">f{octets}").reshape(height, -1, samples)
    values = raw.view(layout.kind).reshape(height, -1, samples)
    if predictor != 2:
        return values
    whole = np.dtype(f"u{octets}")
    words = raw.view(np.dtype(f"{layout.kind.str[0]}u{octets}")).reshape(height, -1, samples).astype(whole)
    sums = np.cumsum(words, axis=1, dtype=whole)
    return sums if layout.kind.kind == "u" else sums.view(f"f{octets}")


def _converted(values: NDArray[Any], tags: dict[int, tuple[int, ...]], layout: _Layout) -> NDArray[Any]:
    """Return gray or RGB, with alpha where there is one: uint16, or float32 of other numbers."""
    photometric, extra = _first(tags, PHOTOMETRIC, 1), tags.get(EXTRA)
    colors = COLORS[photometric]
    has_alpha = layout.samples > colors and (extra is None or extra[0] != 0)
    values = values[..., : colors + has_alpha]
    if layout.kind.kind == "f":
        with np.errstate(over="ignore"):  # beyond float32 is infinite, and is reported where it matters
            return values.astype(np.float32)
    most = np.iinfo(layout.kind).max
    if photometric == WHITE_IS_ZERO:
        values = np.concatenate([most - values[..., :colors], values[..., colors:]], axis=2)
    if layout.kind.itemsize == 4:
        values = (values / most * 65535).round()
    codes = values.astype(np.uint16)
    return _straight(codes) if has_alpha and extra == (PREMULTIPLIED,) else codes


def _straight(codes: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return colors that alpha has not weakened."""
    alpha = np.maximum(codes[..., -1:], 1).astype(np.float64)
    colors = np.minimum((codes[..., :-1] * (65535 / alpha)).round(), 65535).astype(np.uint16)
    return np.concatenate([colors, codes[..., -1:]], axis=2)

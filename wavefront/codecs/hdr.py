"""Radiance .hdr pictures: shared-exponent RGBE with run-length coding.

Neither imageio nor Pillow has this format without a library that it downloads. OpenImageIO (a wheel of 8 MB)
reads files by name alone, not those within an archive or a glb, and rounds what it writes down.
Source: G. Ward, "Real Pixels", Graphics Gems II, 1991; the Radiance file-format notes.
"""

from __future__ import annotations

import re

import numpy as np

from ..arrays.vec import Bytes, Doubles, Floats
from ..colors.primaries import REC_709, to_srgb
from ..core.errors import SceneError, warn_caller
from .budget import Budget

SIGNATURES = (b"#?RADIANCE", b"#?RGBE")
PIXEL_BYTES = 48  # of memory for each pixel, until it is float32
LENGTHS = {"EXPOSURE": 1, "COLORCORR": 3, "PRIMARIES": 8}  # numbers in lines of the header
DEFAULT = (
    0.64,
    0.33,
    0.29,
    0.6,
    0.15,
    0.06,
    0.3333,
    0.3333,
)  # Radiance's primaries, also those of files that name none
SAME = 1e-3
MIN_RUN = 4  # shorter runs take more bytes than literals


def encode(pixels: Floats) -> bytes:
    """Return a .hdr file of linear pixels (H, W, 3); negative values become 0."""
    height, width = pixels.shape[:2]
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    rgbe = to_rgbe(pixels)
    if not 8 <= width < 32768:  # the run-length form exists only for these widths
        return header + rgbe.tobytes()
    start = bytes([2, 2, width >> 8, width & 255])
    rows = (start + b"".join(_pack(row[:, k]) for k in range(4)) for row in rgbe)
    return header + b"".join(rows)


def decode(data: bytes, budget: Budget | None = None) -> Floats:
    """Return the radiance (H, W, 3) of a .hdr file in linear sRGB, top row first.

    Stored values are divided by those of all lines EXPOSURE= and COLORCORR=, and converted from PRIMARIES= to
    those of sRGB.

    Raises
    ------
    SceneError
        If the file is not RGBE, is damaged or ends early.
    """
    head = re.match(rb"(#\?[^\n]*)\n(?:[^\n]+\n)*?\n([-+])([XY]) (\d+) ([-+])([XY]) (\d+)\n", data)
    if not head or not head[1].startswith(SIGNATURES) or head[3] == head[6]:
        raise SceneError("not a Radiance .hdr picture: its header is damaged")
    if b"FORMAT=32-bit_rle_xyze" in head[0]:
        raise SceneError("holds XYZ colors (32-bit_rle_xyze); only RGB (32-bit_rle_rgbe) is read")
    rows, columns = int(head[4]), int(head[7])  # as they are stored
    budget = budget or Budget.of(data)
    budget.check_size(rows, columns)
    stored = np.frombuffer(data, np.uint8, offset=head.end())
    is_flat = _check_header(stored, rows, columns)
    budget.charge(f"a picture of {columns} × {rows} pixels", PIXEL_BYTES * rows * columns)
    pixels = from_rgbe(stored.reshape(rows, columns, 4) if is_flat else _scanlines(stored, rows, columns))
    flipped = pixels[:: _step(head[2], head[3]), :: _step(head[5], head[6])]
    upright = flipped if head[3] == b"Y" else flipped.transpose(1, 0, 2)
    return _original(np.ascontiguousarray(upright), head[0].decode("latin-1"))


def _step(sign: bytes, axis: bytes) -> int:
    """Return -1 where the first row is the lowest, or the first column the rightmost."""
    return 1 if (sign, axis) in ((b"-", b"Y"), (b"+", b"X")) else -1


def _original(pixels: Floats, header: str) -> Floats:
    """Return the radiance before the changes that lines of the header tell of."""
    factors = np.ones(3)
    for name, value in re.findall(r"^(EXPOSURE|COLORCORR|PRIMARIES)\s*=\s*(.*)$", header, re.M):
        numbers = _numbers(value, LENGTHS[name])
        if numbers is None or (name != "PRIMARIES" and not (numbers > 0).all()):
            warn_caller(f"the line {name}={value[:40]} has no sound values and does not count")
        elif name == "PRIMARIES":
            pixels = _from_primaries(pixels, numbers)
        else:
            factors *= numbers
    if (factors == 1).all():
        return pixels
    with np.errstate(
        over="ignore", divide="ignore", invalid="ignore"
    ):  # values that are not finite are reported where they matter
        return (pixels / factors).astype(np.float32)


def _numbers(text: str, length: int) -> Doubles | None:
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        return None
    return numbers if len(numbers) == length and np.isfinite(numbers).all() else None


def _from_primaries(pixels: Floats, primaries: Doubles) -> Floats:
    """Return linear sRGB; white stays white, as Radiance's own programs keep it."""
    if np.abs(primaries - REC_709).max() < SAME or np.abs(primaries - DEFAULT).max() < SAME:
        return pixels
    try:
        with np.errstate(all="ignore"):
            matrix = to_srgb(primaries)
    except np.linalg.LinAlgError:
        matrix = np.full((3, 3), np.nan)
    if not np.isfinite(matrix).all():
        warn_caller(f"the line PRIMARIES={primaries.tolist()} has no sound values and does not count")
        return pixels
    red, green, blue = (pixels[..., k].astype(np.float64) for k in range(3))
    rows = [row[0] * red + row[1] * green + row[2] * blue for row in matrix]
    return np.maximum(np.stack(rows, axis=-1), 0).astype(np.float32)


def _check_header(data: Bytes, height: int, width: int) -> bool:
    """Check that rows of pixels can be there; return whether they are stored without run-length coding."""
    if not 8 <= width < 32768 or len(data) < 4 or tuple(data[:2]) != (2, 2) or data[2] & 128:
        if len(data) != 4 * height * width:
            raise SceneError(
                f"holds {len(data)} bytes of pixels; {width} × {height} pixels need {4 * height * width}"
            )
        return True
    if len(data) < height * (4 + 4 * 2 * -(-width // 127)):
        raise SceneError(f"ends early: {len(data)} bytes cannot hold {width} × {height} pixels")
    return False


def to_rgbe(pixels: Floats) -> Bytes:
    """Return (H, W, 4) bytes: three mantissas and the exponent of the largest channel plus 128."""
    color = np.maximum(pixels, 0).astype(np.float64)
    peak = np.minimum(color.max(axis=-1), 2.0**127 * 0.99)
    exponent = np.frexp(peak)[1]
    dark = peak < 1e-32
    mantissa = np.minimum(np.round(np.ldexp(color, (8 - exponent)[..., None])), 255)
    rgbe = np.concatenate([mantissa, (exponent + 128)[..., None]], axis=-1)
    rgbe[dark] = 0
    return rgbe.astype(np.uint8)


def from_rgbe(rgbe: Bytes) -> Floats:
    """Return linear pixels (H, W, 3) of (H, W, 4) bytes."""
    exponent = rgbe[..., 3].astype(np.int32)
    values = np.ldexp(rgbe[..., :3].astype(np.float32), (exponent - 136)[..., None])
    return np.where(exponent[..., None] > 0, values, 0).astype(np.float32)


def _pack(values: Bytes) -> bytes:
    """Return the run-length code of one channel of one row."""
    edges = np.flatnonzero(np.diff(values)) + 1
    starts, stops = np.r_[0, edges], np.r_[edges, len(values)]
    long = stops - starts >= MIN_RUN
    out, done = bytearray(), 0
    for start, stop in zip(starts[long].tolist(), stops[long].tolist(), strict=True):
        _pack_literal(out, values[done:start])
        for at in range(start, stop, 127):
            out += bytes([128 + min(127, stop - at), values[at]])
        done = stop
    _pack_literal(out, values[done:])
    return bytes(out)


def _pack_literal(out: bytearray, values: Bytes) -> None:
    for at in range(0, len(values), 128):
        piece = values[at : at + 128]
        out.append(len(piece))
        out += piece.tobytes()


def _scanlines(data: Bytes, height: int, width: int) -> Bytes:
    """Return pixels (H, W, 4) whose rows are stored by run lengths."""
    raw, at = data.tobytes(), 0
    image = np.empty((height, 4, width), np.uint8)
    for y in range(height):
        if raw[at : at + 4] != bytes([2, 2, width >> 8, width & 255]):
            raise SceneError(f"row {y} is damaged or missing")
        row, at = _unpack(raw, at + 4, 4 * width, y)
        image[y] = np.frombuffer(row, np.uint8).reshape(4, width)
    return image.transpose(0, 2, 1)


def _unpack(raw: bytes, at: int, size: int, y: int) -> tuple[bytes, int]:
    """Return `size` bytes expanded from the runs at raw[at:], and the index after the last run."""
    out = bytearray()
    try:
        while len(out) < size:
            count = raw[at]
            if count > 128:
                out += raw[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                out += raw[at + 1 : at + 1 + count]
                at += 1 + count
            if not count or at > len(raw):
                break
    except IndexError:
        pass
    if len(out) != size:
        raise SceneError(f"row {y} is damaged or cut off")
    return bytes(out), at

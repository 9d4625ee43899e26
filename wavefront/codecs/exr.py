"""OpenEXR pictures in memory. Headers are checked before pixels are decoded."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..files import check_size
from ..vec import Floats

HeaderValue = str | int | float

MAX_VALUES = 2**27  # of all channels of all parts: 512 MB as float32
VALUES_PER_BYTE = 16  # for larger files, the limit is this number of values per byte of the file


def encode(channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, HeaderValue]) -> bytes:
    """Return an exr file of channels (H, W) or (H, W, 3), float32 or uint32, by name."""
    import OpenEXR  # imported here to keep `import wavefront` quick

    header = {**attributes, "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    buffer = BytesIO()
    OpenEXR.File(header, {k: np.ascontiguousarray(v) for k, v in channels.items()}).write(buffer)
    return buffer.getvalue()


def decode(data: bytes) -> Floats:
    """Return the pixels of the first part of an exr file, (H, W, C) float32, top row first.

    The channels C are R, G, B and A if they exist, else the first channel by name.

    Raises
    ------
    SceneError
        If the file claims too much, holds deep pixels, or a part of it cannot be decoded.
    """
    import OpenEXR

    claimed = OpenEXR.File(BytesIO(data), header_only=True).parts
    height, width = _check_claims(claimed, len(data))
    # OpenEXR decodes all parts, and leaves out those that it cannot decode.
    parts = OpenEXR.File(BytesIO(data), separate_channels=True).parts
    read = {(part.part_index, part.name()) for part in parts}
    for part in claimed:
        if (part.part_index, part.name()) not in read:
            raise SceneError(f"part {part.part_index} ({part.name()!r}) of {len(claimed)} is damaged")
    channels = parts[0].channels
    names = [n for n in ("R", "G", "B", "A") if n in channels] or sorted(channels)[:1]
    pixels = np.empty((height, width, len(names)), np.float32)
    for k, name in enumerate(names):
        values = channels[name].pixels
        if values.shape != (height, width):
            raise SceneError(
                f"channel {name!r} has {values.shape[1]} × {values.shape[0]} values; "
                f"the picture has {width} × {height} pixels"
            )
        pixels[..., k] = values
    return pixels


def _check_claims(parts: list[Any], size: int) -> tuple[int, int]:
    """Check the headers of all parts, and return (height, width) of the first one."""
    import OpenEXR

    if not parts:
        raise SceneError("has no picture: its header is damaged")
    values, most = 0, max(MAX_VALUES, VALUES_PER_BYTE * size)
    for part in parts:
        if part.type() in (OpenEXR.deepscanline, OpenEXR.deeptile):
            raise SceneError(f"part {part.part_index} holds deep pixels; only flat pictures are read")
        height, width = _window(part)
        check_size(height, width)
        values += height * width * len(part.header["channels"])
    if values > most:
        raise SceneError(
            f"claims {values} values in {len(parts)} parts; the limit is {most} for a file of {size} bytes"
        )
    return _window(parts[0])


def _window(part: Any) -> tuple[int, int]:
    """Return (height, width) of the pixels that a part holds."""
    low, high = part.header["dataWindow"]
    return int(high[1]) - int(low[1]) + 1, int(high[0]) - int(low[0]) + 1

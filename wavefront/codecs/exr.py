"""OpenEXR pictures in memory. Headers are checked before pixels are decoded."""

from __future__ import annotations

import math
import sys
import threading
from contextlib import redirect_stdout
from functools import partial
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Floats
from ..core.errors import LimitError, SaveError, SceneError
from ..core.files import MAX_PIXELS
from ..film.aov_names import components
from .budget import Budget
from .exr_layers import chosen
from .image_data import ERROR, ImageData, from_json, from_named, to_json

SIGNATURE = b"\x76\x2f\x31\x01"
ATTRIBUTE = "wavefront"  # the attribute that describes all arrays
TYPES = ("f4", "u4", "i4", "f8", "i8", "u8")  # of arrays, as NumPy writes them

_LOCK = threading.Lock()  # standard output is restored in the order in which it was replaced
MAX_VALUES = 2**27  # of all channels of all parts: 512 MB as float32
VALUE_BYTES = 8  # of memory for each
VALUES_PER_BYTE = 16  # for larger files, the limit is this number of values per byte of the file


def encode(picture: ImageData) -> bytes:
    """Return an exr file of all arrays of a picture, its metadata and names.

    The channels of rgb are R, G and B, those of a transparent picture's alpha A, and all others NAME.X with a
    letter for each component. Arrays other than float32 and uint32 are stored as words of uint32, so -1 of
    int32 is 0xFFFFFFFF. The attribute "wavefront" is JSON: spp, metadata, names, and the channels of each
    array. Numbers and texts of the metadata are attributes "wavefront.NAME" as well.
    """
    import OpenEXR  # imported here to keep `import wavefront` quick

    channels: dict[str, NDArray[Any]] = {}
    layout = {}
    for name, values in picture.named().items():
        words = _words(name, values)
        plain = name == "rgb" or values is picture.alpha
        labels = _labels(name, words.shape[2], plain)
        channels |= {label: np.ascontiguousarray(words[..., k]) for k, label in enumerate(labels)}
        layout[name] = {"channels": labels, "type": values.dtype.str[1:], "shape": values.shape[2:]}
    header = {f"{ATTRIBUTE}.{key}": value for key, value in picture.metadata.items() if _fits(value)}
    header |= {ATTRIBUTE: to_json({**picture.info, "arrays": layout})}
    header |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    buffer = BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return buffer.getvalue()


def _words(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Return an array (H, W, ...) as (H, W, k) float32 or uint32."""
    kind = values.dtype.str[1:]
    if kind not in TYPES:
        raise SaveError(f"the array {name!r} is {values.dtype}; an exr holds {', '.join(TYPES)}")
    flat = values.reshape(*values.shape[:2], -1)
    if kind == "i8" and flat.size and flat.min() >= 0 and flat.max() < 2**32:  # as counts are
        return flat.astype(np.uint32)
    return np.ascontiguousarray(flat).view(np.float32 if kind == "f4" else np.uint32)


def _labels(name: str, count: int, plain: bool) -> list[str]:
    """Return the names of the `count` channels of an array: NAME.X, or X alone with `plain`."""
    letters = components(name.removeprefix(ERROR), count)
    return letters if plain else [f"{name}.{letter}" for letter in letters]


def _fits(value: Any) -> bool:
    """Return whether an attribute can hold a value of the metadata."""
    if isinstance(value, bool) or (isinstance(value, int) and abs(value) >= 2**31):
        return False
    return isinstance(value, int | float) or (isinstance(value, str) and value.isprintable())


def decode(data: bytes, budget: Budget | None = None) -> Floats:
    """Return the pixels of one layer of an exr file, (H, W, C) float32, top row first.

    The layer is the picture itself (`exr_layers.chosen`). The channels C are red, green, blue and alpha, or
    gray and alpha, as far as they exist.

    Raises
    ------
    SceneError
        If the file claims too much, holds deep pixels, or a part of it cannot be decoded.
    """
    parts = _parts(data, budget or Budget.of(data))
    layer = chosen([(part.name() or "", list(part.channels), dict(part.header)) for part in parts])
    part = parts[layer.part]
    size = _window(part)
    channels = {name: _pixels(part.channels[name], size) for name in layer.channels.values()}
    return layer.picture(channels, part.header.get("chromaticities"))


def decode_all(data: bytes, budget: Budget | None = None) -> ImageData | None:
    """Return the picture that `encode` wrote; None for an exr file of another origin.

    Raises
    ------
    SceneError
        As `decode`, or if the attributes do not fit the channels.
    """
    import OpenEXR

    text = OpenEXR.File(BytesIO(data), header_only=True).header().get(ATTRIBUTE)
    if not isinstance(text, str):
        return None
    info, first = from_json(text), _parts(data, budget or Budget.of(data))[0]
    size = _window(first)
    channels = {name: partial(_pixels, channel, size) for name, channel in first.channels.items()}
    layout = info.pop("arrays", {})
    try:
        arrays = {
            name: _array([channels[label]() for label in field["channels"]], field)
            for name, field in layout.items()
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SceneError(f"its attribute {ATTRIBUTE!r} does not fit its channels: {error!r}") from error
    return from_named(arrays, info)


def _array(words: list[NDArray[Any]], field: dict[str, Any]) -> NDArray[Any]:
    """Return the array of some channels (H, W) as the layout in the attributes describes it."""
    if field["type"] not in TYPES:
        raise ValueError(f"type {field['type']!r}")
    kind, stacked = np.dtype(field["type"]), np.stack(words, axis=-1)
    whole = math.prod(field["shape"]) == len(words)
    values = stacked.astype(kind) if whole and kind.itemsize == 8 else stacked.view(kind)
    return values.reshape(*stacked.shape[:2], *field["shape"])


def _parts(data: bytes, budget: Budget) -> list[Any]:
    """Return the parts of an exr file, with the pixels of each channel."""
    import OpenEXR

    claimed = OpenEXR.File(BytesIO(data), header_only=True).parts
    _check_header(claimed, len(data), budget)
    # OpenEXR decodes all parts, and leaves out those that it cannot decode.
    with _LOCK, redirect_stdout(_OneThread(sys.stdout)):  # it prints warnings of parts
        parts = OpenEXR.File(BytesIO(data), separate_channels=True).parts
    read = {(part.part_index, part.name()) for part in parts}
    for part in claimed:
        if (part.part_index, part.name()) not in read:
            raise SceneError(f"part {part.part_index} ({part.name()!r}) of {len(claimed)} is damaged")
    return list(parts)


class _OneThread:
    """Standard output that drops what this thread writes, and nothing of others."""

    def __init__(self, out: Any) -> None:
        self._out, self._thread = out, threading.get_ident()

    def write(self, text: str) -> int:
        """Write, or drop, a text."""
        return len(text) if threading.get_ident() == self._thread else int(self._out.write(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._out, name)


def _pixels(channel: Any, size: tuple[int, int]) -> NDArray[Any]:
    """Return the values of a channel for every pixel; some have values for every second one."""
    values, steps = channel.pixels, (int(channel.ySampling), int(channel.xSampling))
    expected = tuple(-(-length // step) for length, step in zip(size, steps, strict=True))
    if min(steps) < 1 or values.shape != expected or min(expected) < 1:
        raise SceneError(
            f"channel {channel.name!r} has {values.shape[1]} × {values.shape[0]} values; "
            f"the picture has {size[1]} × {size[0]} pixels"
        )
    for axis in range(2):
        if steps[axis] > 1:
            values = _spread(values, axis, steps[axis], size[axis])
    return values


def _spread(values: NDArray[Any], axis: int, step: int, length: int) -> Floats:
    """Return values at all pixels along an axis, between those at every `step`-th one."""
    at = np.arange(length) / np.float32(step)
    low = at.astype(np.intp)
    high = np.minimum(low + 1, values.shape[axis] - 1)
    weight = (at - low).astype(np.float32).reshape((-1, 1) if axis == 0 else (1, -1))
    lower, upper = (values.take(places, axis).astype(np.float32) for places in (low, high))
    return lower + (upper - lower) * weight


def _check_header(parts: list[Any], size: int, budget: Budget) -> None:
    """Check the headers of all parts."""
    import OpenEXR

    if not parts:
        raise SceneError("has no picture: its header is damaged")
    values, most = 0, max(MAX_VALUES * max(1, budget.pixels // MAX_PIXELS), VALUES_PER_BYTE * size)
    for part in parts:
        if part.type() in (OpenEXR.deepscanline, OpenEXR.deeptile):
            raise SceneError(f"part {part.part_index} holds deep pixels; only flat pictures are read")
        height, width = _window(part)
        budget.check_size(height, width)
        values += height * width * len(part.header["channels"])
    if values > most:
        raise LimitError(
            f"claims {values} values in {len(parts)} parts; the limit is {most} for a file of {size} bytes"
        )
    height, width = _window(parts[0])
    budget.charge(f"the channels of {width} × {height} pixels", VALUE_BYTES * values)


def _window(part: Any) -> tuple[int, int]:
    """Return (height, width) of the pixels that a part holds."""
    low, high = part.header["dataWindow"]
    return int(high[1]) - int(low[1]) + 1, int(high[0]) - int(low[0]) + 1

"""Pictures of Netpbm in memory: bits, gray and colors of 8 or 16 bits (pbm, pgm, ppm, pam), and floats (pfm).

Pillow reads colors of 16 bits as 8, and no floats of three channels.
Source: the manuals of Netpbm, https://netpbm.sourceforge.net/doc/; P. Debevec's format pfm.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from .budget import Budget

SIGNATURES = tuple(b"P%c" % letter for letter in b"1234567fF")
CHANNELS = {b"1": 1, b"2": 1, b"3": 3, b"4": 1, b"5": 1, b"6": 3, b"f": 1, b"F": 3}
BITS, TEXT = (b"1", b"4"), (b"1", b"2", b"3")
WORD = re.compile(rb"(?:\s|#[^\n]*\n)*([^\s#]+)")
COPIES, WORD_BYTES = 6, 96  # bytes of memory for each number, and for each one in a text
LARGEST = 65535


def decode(data: bytes, budget: Budget | None = None) -> NDArray[Any]:
    """Return the codes (H, W, C), uint8 or uint16, or float32 of a pfm; top row first.

    Raises
    ------
    SceneError
        If the header is damaged, or claims more than the file holds.
    """
    budget = budget or Budget.of(data)
    kind = data[1:2]
    header = _pam(data) if kind == b"7" else _plain(data, kind)
    if header is None:
        raise SceneError("not a readable picture of Netpbm: its header is damaged")
    width, height, channels, most, at = header
    budget.check_size(height, width)
    numbers = width * height * channels
    budget.charge(
        f"a picture of {width} × {height} pixels", numbers * (WORD_BYTES if kind in TEXT else COPIES)
    )
    if kind in b"fF":
        return _floats(data[at:], (height, width, channels), most)
    if not 1 <= most <= LARGEST:
        raise SceneError(f"has a largest value of {most:g}; it must be from 1 to {LARGEST}")
    values = (
        _text(data[at:], kind, numbers) if kind in TEXT else _binary(data[at:], kind, header[:3], int(most))
    )
    return _scaled(values.reshape(height, width, channels), int(most), kind in BITS)


def _plain(data: bytes, kind: bytes) -> tuple[int, int, int, float, int] | None:
    """Return width, height, channels, the largest value, and where the pixels begin."""
    words, at = [], 2
    for _ in range(2 if kind in BITS else 3):
        word = WORD.match(data, at)
        if word is None:
            return None
        words.append(word[1])
        at = word.end()
    try:
        most = 1.0 if kind in BITS else float(words[2])
        return int(words[0]), int(words[1]), CHANNELS[kind], most, at + 1
    except ValueError:
        return None


def _pam(data: bytes) -> tuple[int, int, int, float, int] | None:
    end = re.match(rb"P7\n(?:[^\n]*\n)*?ENDHDR\n", data)
    lines = {} if end is None else dict(re.findall(rb"^(WIDTH|HEIGHT|DEPTH|MAXVAL) +(\d+)", end[0], re.M))
    if end is None or len(lines) != 4:
        return None
    depth = int(lines[b"DEPTH"])
    if not 1 <= depth <= 4:
        raise SceneError(f"has {depth} channels; an image has 1 to 4")
    return int(lines[b"WIDTH"]), int(lines[b"HEIGHT"]), depth, float(lines[b"MAXVAL"]), end.end()


def _binary(data: bytes, kind: bytes, size: tuple[int, int, int], most: int) -> NDArray[Any]:
    width, height, channels = size
    if kind == b"4":
        row = (width + 7) // 8
        _check_there(data, row * height)
        packed = np.frombuffer(data, np.uint8, row * height).reshape(height, row)
        return np.unpackbits(packed, axis=1)[:, :width]
    sample = np.dtype(np.uint8 if most < 256 else ">u2")
    _check_there(data, width * height * channels * sample.itemsize)
    return np.frombuffer(data, sample, width * height * channels)


def _check_there(data: bytes, need: int) -> None:
    if len(data) < need:
        raise SceneError(f"ends early: its pixels take {need} bytes; {len(data)} are there")


def _text(data: bytes, kind: bytes, numbers: int) -> NDArray[Any]:
    plain = re.sub(rb"#[^\n]*", b"", data)
    if kind == b"1":  # digits without spaces between them are allowed
        words: Any = np.frombuffer(plain, np.uint8)
        words = words[(words == ord("0")) | (words == ord("1"))][:numbers] - ord("0")
    else:
        words = np.array(plain.split(None, numbers)[:numbers], np.int64)
    if len(words) < numbers:
        raise SceneError(f"ends early: its pixels are {numbers} numbers; {len(words)} are there")
    return words


def _floats(data: bytes, shape: tuple[int, int, int], scale: float) -> NDArray[np.float32]:
    """Return values, whose last row comes first; a negative scale says that their low bytes do."""
    need = shape[0] * shape[1] * shape[2]
    _check_there(data, 4 * need)
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", need).reshape(shape)
    return values[::-1].astype(np.float32)


def _scaled(values: NDArray[Any], most: int, bits: bool) -> NDArray[Any]:
    """Return numbers up to `most` as codes; a bit of 1 is black."""
    if bits:
        return (255 * (1 - values)).astype(np.uint8)
    full = 255 if most < 256 else LARGEST
    kind = np.uint8 if most < 256 else np.uint16
    clipped = np.minimum(values, most)
    return clipped.astype(kind) if most == full else (clipped * (full / most)).round().astype(kind)

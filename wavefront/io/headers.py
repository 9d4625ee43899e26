"""Refuse archives, and PLY and STL files whose headers promise more than the file holds."""

from __future__ import annotations

import re

from ..errors import SceneError

SIZES = {
    b"char": 1, b"uchar": 1, b"int8": 1, b"uint8": 1,
    b"short": 2, b"ushort": 2, b"int16": 2, b"uint16": 2,
    b"int": 4, b"uint": 4, b"int32": 4, b"uint32": 4, b"float": 4, b"float32": 4,
    b"double": 8, b"float64": 8,
}  # fmt: skip


def check(name: str, extension: str, data: bytes) -> None:
    """Look at the first bytes of a file, before anything is allocated.

    Raises
    ------
    SceneError
        If the file is empty or an archive, or if a .ply or .stl claims more than it holds.
    """
    if not data:
        raise SceneError(f"{name}: is empty")
    if data[:4] in (b"PK\x03\x04", b"PK\x05\x06") or data[:2] == b"\x1f\x8b":
        raise SceneError(f"{name}: is an archive; unpack it first")
    if extension == ".ply":
        _check_ply(name, data)
    elif extension == ".stl":
        _check_stl(name, data)


def _check_stl(name: str, data: bytes) -> None:
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return
    if data.lstrip()[:5].lower() == b"solid":
        if not re.search(rb"endsolid", data[-1000:], re.IGNORECASE):
            raise SceneError(f"{name}: ends early: the text has no endsolid")
        return
    if len(data) < 84:
        raise SceneError(f"{name}: has {len(data)} bytes; a binary STL has at least 84")
    count = int.from_bytes(data[80:84], "little")
    raise SceneError(f"{name}: claims {count} faces, {84 + 50 * count} bytes; it has {len(data)}")


def _check_ply(name: str, data: bytes) -> None:
    end = re.search(rb"end_header[^\n]*\n", data[: 1 << 20])
    if not data.startswith(b"ply") or end is None:
        raise SceneError(f"{name}: not a PLY file: its header is damaged")
    text = b"format ascii" in data[: end.start()]
    need = 0
    for element, count, size, words in _elements(name, data[: end.start()]):
        need += count * (2 * words if text else size)
        there = len(data) - end.end()
        if need > there + 1:
            raise SceneError(f"{name}: claims {count} of {element}, at least {need} bytes; {there} are there")


def _elements(name: str, header: bytes) -> list[tuple[str, int, int, int]]:
    """Return (element, how many, least bytes of one, least words of one) from a PLY header."""
    out: list[tuple[str, int, int, int]] = []
    for number, line in enumerate(header.split(b"\n"), 1):
        words = line.split()
        if words[:1] == [b"element"]:
            if len(words) != 3 or not words[2].isdigit():
                raise SceneError(
                    f"{name} line {number}: {line.decode('latin-1').strip()!r} is not an element"
                )
            out.append((words[1].decode("latin-1"), int(words[2]), 0, 0))
        elif words[:1] == [b"property"] and out:
            kind = (
                words[2]
                if words[1:2] == [b"list"] and len(words) > 2
                else words[1]
                if len(words) > 1
                else b""
            )
            if kind not in SIZES:
                raise SceneError(
                    f"{name} line {number}: {line.decode('latin-1').strip()!r} is not a property"
                )
            element, count, size, total = out[-1]
            out[-1] = (element, count, size + SIZES[kind], total + 1)
    return out

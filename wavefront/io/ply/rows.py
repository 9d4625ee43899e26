"""The rows of a PLY file as whole columns, from text or bytes.

Rows of a text that are damaged are marked. A binary file that ends early, or has an impossible length of a
list, ends before that row.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import Ints
from ..rows import Element, Property, Rows, ranges, rows_of_lines
from .header import Header

BYTE_ORDERS: dict[str, Literal["little", "big"]] = {"<": "little", ">": "big"}


def read_rows(header: Header, data: bytes) -> dict[str, Rows]:
    """Return the rows of each element, by its name."""
    found = (_binary if header.order else _text)(header, data)
    return {rows.element.name: rows for rows in found}


def _text(header: Header, data: bytes) -> list[Rows]:
    lines = data[header.end :].decode("latin-1").rstrip("\x1a\0").split("\n")
    used = np.array([number for number, line in enumerate(lines) if line and not line.isspace()], np.intp)
    out, at = [], 0
    for element in header.elements:
        own = used[at : at + element.count]
        at += len(own)
        rows = rows_of_lines(element, [lines[number].split() for number in own.tolist()])
        rows.lines = own + header.lines + 1
        out.append(rows)
    return out


def _binary(header: Header, data: bytes) -> list[Rows]:
    out, at = [], header.end
    for element in header.elements:
        rows, at = _alike(element, data, at, header.order) or _unlike(element, data, at, header.order)
        out.append(rows)
    return out


def _alike(element: Element, data: bytes, at: int, order: str) -> tuple[Rows, int] | None:
    """Return rows whose lists are as long as those of the first, and where they end; None if not all are."""
    kinds: list[Any] = []
    size = 0
    for number, each in enumerate(element.properties):
        count = 1
        if each.length:
            place = slice(at + size, at + size + int(each.length[1]))
            count = _length(data[place], each, order)
            if not 0 <= count * each.size <= len(data):
                return None
            kinds.append((f"length {number}", order + each.length))
        kinds.append((str(number), order + each.kind, (count,)))
        size = np.dtype(kinds).itemsize
    count = min(element.count, (len(data) - at) // size) if size else 0
    table = np.frombuffer(data, np.dtype(kinds), count, at)
    rows = Rows(element, count)
    for number, each in enumerate(element.properties):
        values = table[str(number)]
        if each.length:
            lengths = table[f"length {number}"]
            if count < element.count or (lengths != lengths[:1]).any():
                return None
            rows.lists[each.name] = lengths.astype(np.intp), values.ravel()
        else:
            rows.columns[each.name] = values[:, 0]
    return rows, at + count * size


def _length(field: bytes, each: Property, order: str) -> int:
    """Return the length of a list from its bytes."""
    return int.from_bytes(field, BYTE_ORDERS[order], signed=each.length[0] == "i")


def _unlike(element: Element, data: bytes, at: int, order: str) -> tuple[Rows, int]:
    """Return rows with lists of any lengths, and where they end."""
    lists = [each for each in element.properties if each.length]
    gaps, byteorder, end = _gaps(element.properties), BYTE_ORDERS[order], len(data)
    steps = [
        (gap, int(each.length[1]), each.size, each.length[0] == "i")
        for gap, each in zip(gaps, lists, strict=False)
    ]
    found: list[list[int]] = [[] for _ in lists]  # where the values of each list begin
    starts: list[int] = []
    while len(starts) < element.count:
        begins, place = [], at
        for gap, width, size, signed in steps:
            place += gap + width
            begins.append(place)
            length = int.from_bytes(data[place - width : place], byteorder, signed=signed)
            place = place + length * size if length >= 0 else end + 1
        place += gaps[-1]
        if place > end:
            break
        starts.append(at)
        for each_found, begin in zip(found, begins, strict=True):
            each_found.append(begin)
        at = place
    lists_at = [np.array(each, np.intp) for each in found]
    return _gathered(element, data, order, np.array(starts, np.intp), lists_at), at


def _gaps(properties: list[Property]) -> list[int]:
    """Return the bytes of the numbers before each list, and of those after the last."""
    gaps = [0]
    for each in properties:
        if each.length:
            gaps.append(0)
        else:
            gaps[-1] += each.size
    return gaps


def _gathered(element: Element, data: bytes, order: str, at: Ints, lists: list[Ints]) -> Rows:
    """Return rows that begin at bytes `at`, whose lists have their values from bytes `lists` on."""
    rows, octets, left = Rows(element, len(at)), np.frombuffer(data, np.uint8), iter(lists)

    def values(begin: Ints, kind: str) -> NDArray[Any]:
        parts = octets[begin[:, None] + np.arange(int(kind[1]))]
        return parts.view(order + kind).ravel()

    for each in element.properties:
        if each.length:
            begin = next(left)
            counts = values(begin - int(each.length[1]), each.length).astype(np.intp)
            at = begin + counts * each.size
            places = np.repeat(begin, counts) + each.size * ranges(np.zeros_like(counts), counts)
            rows.lists[each.name] = counts, values(places, each.kind)
        else:
            rows.columns[each.name] = values(at, each.kind)
            at = at + each.size
    return rows

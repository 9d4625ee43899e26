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
    elements = (_binary if header.order else _text)(header, data)
    return {rows.element.name: rows for rows in elements}


def _text(header: Header, data: bytes) -> list[Rows]:
    lines = data[header.end :].decode("latin-1").rstrip("\x1a\0").split("\n")
    used = np.array([number for number, line in enumerate(lines) if line and not line.isspace()], np.intp)
    out, at = [], 0
    for element in header.elements:
        numbers = used[at : at + element.count]
        at += len(numbers)
        rows = rows_of_lines(element, [lines[number].split() for number in numbers.tolist()])
        rows.lines = numbers + header.lines + 1
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
    for number, prop in enumerate(element.properties):
        count = 1
        if prop.length:
            place = slice(at + size, at + size + int(prop.length[1]))
            count = _length(data[place], prop, order)
            if not 0 <= count * prop.size <= len(data):
                return None
            kinds.append((f"length {number}", order + prop.length))
        kinds.append((str(number), order + prop.kind, (count,)))
        size = np.dtype(kinds).itemsize
    count = min(element.count, (len(data) - at) // size) if size else 0
    table = np.frombuffer(data, np.dtype(kinds), count, at)
    rows = Rows(element, count)
    for number, prop in enumerate(element.properties):
        values = table[str(number)]
        if prop.length:
            lengths = table[f"length {number}"]
            if count < element.count or (lengths != lengths[:1]).any():
                return None
            rows.lists[prop.name] = lengths.astype(np.intp), values.ravel()
        else:
            rows.columns[prop.name] = values[:, 0]
    return rows, at + count * size


def _length(field: bytes, prop: Property, order: str) -> int:
    """Return the length of a list from its bytes."""
    return int.from_bytes(field, BYTE_ORDERS[order], signed=prop.length[0] == "i")


def _unlike(element: Element, data: bytes, at: int, order: str) -> tuple[Rows, int]:
    """Return rows with lists of any lengths, and where they end."""
    lists = [prop for prop in element.properties if prop.length]
    gaps, byteorder, end = _gaps(element.properties), BYTE_ORDERS[order], len(data)
    steps = [
        (gap, int(prop.length[1]), prop.size, prop.length[0] == "i")
        for gap, prop in zip(gaps, lists, strict=False)
    ]
    list_begins: list[list[int]] = [[] for _ in lists]  # where the values of each list begin
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
        for list_begin, begin in zip(list_begins, begins, strict=True):
            list_begin.append(begin)
        at = place
    lists_at = [np.array(begins, np.intp) for begins in list_begins]
    return _gathered(element, data, order, np.array(starts, np.intp), lists_at), at


def _gaps(properties: list[Property]) -> list[int]:
    """Return the bytes of the numbers before each list, and of those after the last."""
    gaps = [0]
    for prop in properties:
        if prop.length:
            gaps.append(0)
        else:
            gaps[-1] += prop.size
    return gaps


def _gathered(element: Element, data: bytes, order: str, at: Ints, lists: list[Ints]) -> Rows:
    """Return rows that begin at bytes `at`, whose lists have their values from bytes `lists` on."""
    rows, octets, left = Rows(element, len(at)), np.frombuffer(data, np.uint8), iter(lists)

    def values(begin: Ints, kind: str) -> NDArray[Any]:
        octet_rows = octets[begin[:, None] + np.arange(int(kind[1]))]
        return octet_rows.view(order + kind).ravel()

    for prop in element.properties:
        if prop.length:
            begin = next(left)
            counts = values(begin - int(prop.length[1]), prop.length).astype(np.intp)
            at = begin + counts * prop.size
            places = np.repeat(begin, counts) + prop.size * ranges(np.zeros_like(counts), counts)
            rows.lists[prop.name] = counts, values(places, prop.kind)
        else:
            rows.columns[prop.name] = values(at, prop.kind)
            at = at + prop.size
    return rows

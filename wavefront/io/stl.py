"""STL, binary and text -> triangles."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .files import decode
from .repair import Raw, warn, wide

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
COLOURS = (b"COLOR=", b"MATERIAL=")  # what Materialise Magics writes into the header
OTHER_LINES = re.compile(r"(facet|outer|endloop|endfacet|solid|endsolid)\b", re.IGNORECASE)


def parse(name: str, data: bytes, strict: bool = False) -> list[Raw]:
    """Read the solids of an STL file; the normals in it are those of the facets and are left out.

    Some programs hide colours in a binary file. There are two ways, which contradict each other, so
    these are left out with a warning.

    Raises
    ------
    SceneError
        Naming the file, and the line of a text; or if `strict` and there are colours.
    """
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        facets = np.frombuffer(data, RECORD, offset=84)
        _warn_of_colours(name, data[:80], facets["extra"], strict)
        corners = facets["corners"]
        return [Raw("", wide(corners.reshape(-1, 3)), np.arange(3 * len(corners)).reshape(-1, 3))]
    if data.lstrip()[:5].lower() == b"solid":
        return _text(name, decode(data))
    if len(data) < 84:
        raise SceneError(f"{name}: has {len(data)} bytes; a binary STL has at least 84")
    count = int.from_bytes(data[80:84], "little")
    raise SceneError(f"{name}: claims {count} faces, {84 + 50 * count} bytes; it has {len(data)}")


def _warn_of_colours(name: str, header: bytes, extra: NDArray[np.uint16], strict: bool) -> None:
    found = [f"{word.decode()} in the header" for word in COLOURS if word in header]
    if extra.any():
        found.append(f"colours of facets (facet {int((extra != 0).argmax())})")
    if found:
        warn(f"{name}: not honoured: {', '.join(found)}", strict)


def _text(name: str, text: str) -> list[Raw]:
    solids: list[tuple[str, list[int], list[str]]] = []
    closed = True
    for number, line in enumerate(text.split("\n"), 1):
        keyword, _, rest = line.strip().partition(" ")
        match keyword.lower():
            case "vertex" if not closed:
                solids[-1][1].append(number)
                solids[-1][2].append(rest)
            case "solid":
                solids.append((rest.strip(), [], []))
                closed = False
            case "endsolid":
                closed = True
            case "":
                pass
            case _ if not OTHER_LINES.match(keyword):
                raise SceneError(f"{name} line {number}: {line.strip()[:40]!r} is not STL")
    if not closed:
        raise SceneError(f"{name}: ends early: the text has no endsolid")
    return [_solid(name, *solid) for solid in solids if solid[2]]


def _solid(name: str, solid: str, numbers: list[int], rows: list[str]) -> Raw:
    if len(rows) % 3:
        raise SceneError(f"{name}: solid {solid!r} has {len(rows)} vertices; facets need a multiple of 3")
    lines = np.array(numbers, np.intp).reshape(-1, 3)[:, 0]
    return Raw(solid, _table(name, numbers, rows), np.arange(len(rows)).reshape(-1, 3), lines=lines)


def _table(name: str, numbers: list[int], rows: list[str]) -> NDArray[np.float64]:
    words = [row.split() for row in rows]
    try:
        if any(len(row) != 3 for row in words):
            raise ValueError
        return np.array(words, np.float64)
    except ValueError:
        for number, row in zip(numbers, words, strict=True):
            if len(row) != 3 or not all(map(_is_number, row)):
                raise SceneError(
                    f"{name} line {number}: vertex is {' '.join(row)!r}; it must be 3 numbers"
                ) from None
        raise


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True

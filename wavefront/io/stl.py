"""STL: binary files and texts, read by trimesh after a check of their counts."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..files import decode
from .repair import RawMesh, warn, wide
from .trimesh_loading import typed_errors
from .words import sort_lines

COLORS = (b"COLOR=", b"MATERIAL=")  # keywords that Materialize Magics writes into the header
FACET = ("facet", "outer", "endloop", "endfacet")  # keywords of a text without further information


def parse(name: str, data: bytes, strict: bool = False) -> list[RawMesh]:
    """Read the solids of an STL file. Its normals are those of the facets and are not read.

    Some programs store colors in a binary file. There are two conventions, which contradict each other, so
    colors are left out with a warning.

    Raises
    ------
    SceneError
        If the file is malformed, or `strict` and it has colors. The message names the file, and the line of a
        text.
    """
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        return [RawMesh("", *mesh) for mesh in _binary(name, data, strict)]
    if data.lstrip()[:5].lower() == b"solid":
        return _text(name, decode(data))
    if len(data) < 84:
        raise SceneError(f"{name}: has {len(data)} bytes; a binary STL has at least 84")
    raise SceneError(f"{name}: claims {count} faces, {84 + 50 * count} bytes; it has {len(data)}")


def _read(name: str, data: bytes) -> list[dict[str, Any]]:
    from trimesh.exchange.stl import load_stl

    with typed_errors(name, "stl"):
        found = load_stl(BytesIO(data))
    return list(found["geometry"].values()) if "geometry" in found else [found]


def _binary(name: str, data: bytes, strict: bool) -> list[tuple[Any, Any]]:
    colored = [f"{word.decode()} in the header" for word in COLORS if word in data[:80]]
    meshes = _read(name, data)
    extra = [mesh["face_attributes"]["stl"] for mesh in meshes]
    if extra and extra[0].any():
        colored.append(f"colors of facets (facet {int((extra[0] != 0).argmax())})")
    if colored:
        warn(f"{name}: not honored: {', '.join(colored)}", strict)
    return [(wide(mesh["vertices"]), mesh["faces"]) for mesh in meshes]


def _text(name: str, text: str) -> list[RawMesh]:
    """Check a text, and read its vertices by trimesh, which must not see the names of solids."""
    lines = [line.strip() for line in text.replace("\t", " ").split("\n")]
    (vertices, starts, ends, *_), others = sort_lines(
        [line.lower() for line in lines], "vertex", "solid", "endsolid", *FACET
    )
    solid = np.searchsorted(starts.numbers, vertices.numbers) - 1  # index of each vertex's solid
    closed = (
        np.searchsorted(ends.numbers, vertices.numbers) > np.searchsorted(ends.numbers, starts.numbers)[solid]
    )
    bad = np.sort(np.r_[others + 1, vertices.numbers[closed]])
    if len(bad):
        raise SceneError(f"{name} line {bad[0]}: {lines[bad[0] - 1][:40]!r} is not STL")
    if len(ends.numbers) == 0 or ends.numbers[-1] < starts.numbers[-1]:
        raise SceneError(f"{name}: ends early: the text has no endsolid")
    wrong = vertices.numbers[vertices.widths != 3][:1].tolist() or vertices.not_a_number()
    if wrong:
        rest = lines[wrong[0] - 1].partition(" ")[2]
        raise SceneError(f"{name} line {wrong[0]}: vertex is {rest!r}; it must be 3 numbers")
    solids: list[tuple[str, NDArray[np.intp]]] = []  # name, line of each facet's first vertex
    written: list[str] = []
    for chosen in np.split(np.arange(len(solid)), np.flatnonzero(np.diff(solid)) + 1) if len(solid) else []:
        title = lines[starts.numbers[solid[chosen[0]]] - 1][5:].strip()
        if len(chosen) % 3:
            raise SceneError(
                f"{name}: solid {title!r} has {len(chosen)} vertices; facets need a multiple of 3"
            )
        written += [f"solid {len(solids)}", *("vertex" + vertices.texts[i] for i in chosen), "endsolid"]
        solids.append((title, vertices.numbers[chosen[::3]]))
    meshes = _read(name, "\n".join(written).encode()) if solids else []
    return [
        RawMesh(title, mesh["vertices"], mesh["faces"], lines=numbers)
        for (title, numbers), mesh in zip(solids, meshes, strict=True)
    ]

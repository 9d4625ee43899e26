"""Meshes of glTF: attributes and lists, strips and fans of triangles.

Source: Khronos Group, glTF 2.0 specification, chapter 3.7.2, and KHR_mesh_quantization.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from ..core.plural import plural
from .gltf_document import Document
from .repair import Faces, RawMesh, Table, wide

READ = ("TEXCOORD_0", "TEXCOORD_1", "COLOR_0")  # attributes of a mesh with a number in their name
TRIANGLES, STRIP, FAN = 4, 5, 6


def primitives(document: Document, index: Any) -> list[tuple[RawMesh, int | None]]:
    """Return the parts of a mesh with the numbers of their materials.

    Raises
    ------
    SceneError
        If an element is missing or malformed.
    """
    mesh = document.get("meshes", index)
    with document.inside(f"meshes[{index}]"):
        name = str(mesh.get("name", f"mesh{index}"))
        parts = mesh.get("primitives", [])
        if "weights" in mesh or any("targets" in part for part in parts):
            document.lose("morph targets", f"mesh {name!r}")
        out = []
        for number, part in enumerate(parts):
            mode = part.get("mode", TRIANGLES)
            if mode not in (TRIANGLES, STRIP, FAN):
                document.lose("points and lines", f"mesh {name!r}")
                continue
            label = name if len(parts) == 1 else f"{name}_{number}"
            out.append((_primitive(document, part, mode, label), part.get("material")))
        return out


def _primitive(document: Document, part: dict[str, Any], mode: int, name: str) -> RawMesh:
    where = f"{document.name}: {name!r}"
    attributes = part.get("attributes", {})
    if "KHR_draco_mesh_compression" in part.get("extensions", {}) or "POSITION" not in attributes:
        raise SceneError(f"{where} has no POSITION that can be read")
    vertices = attribute(document, attributes, "POSITION", 3, where)
    assert vertices is not None
    if "indices" in part:
        indices = document.accessor(part["indices"])[:, 0]
        if indices.dtype.kind != "u":
            raise SceneError(f"{where} has indices of type {indices.dtype}; they must be unsigned")
    else:
        indices = np.arange(len(vertices))
    for extra in attributes:
        if extra.startswith(("COLOR_", "TEXCOORD_")) and extra not in READ:
            document.lose(extra, f"mesh {name!r}")

    def read(key: str, widths: int | tuple[int, ...]) -> Table | None:
        values = attribute(document, attributes, key, widths, where, len(vertices))
        return None if values is None else wide(values)

    return RawMesh(
        name,
        wide(vertices),
        _triangles(where, indices, mode, len(vertices)),
        normals=read("NORMAL", 3),
        uvs=_flip_v(read("TEXCOORD_0", 2)),
        uvs1=_flip_v(read("TEXCOORD_1", 2)),
        tangents=read("TANGENT", 4),
        colors=read("COLOR_0", (3, 4)),
    )


def _flip_v(coordinates: Table | None) -> Table | None:
    """Return texture coordinates (n, 2) with v upwards, rounded to float32; glTF counts v downwards."""
    if coordinates is None:
        return None
    with np.errstate(invalid="ignore"):
        flipped = coordinates.astype(np.float32)
        flipped[:, 1] = 1 - flipped[:, 1]
    return wide(flipped)


def attribute(
    document: Document,
    attributes: dict[str, Any],
    key: str,
    widths: int | tuple[int, ...],
    where: str,
    count: int | None = None,
) -> NDArray[Any] | None:
    """Return the elements of a named accessor, None if there is none; check their width and number."""
    if key not in attributes:
        return None
    values = document.accessor(attributes[key])
    allowed = (widths,) if isinstance(widths, int) else widths
    if values.shape[1] not in allowed:
        listed = " or ".join(map(str, allowed))
        raise SceneError(f"{where} has {key} with {values.shape[1]} components; it must have {listed}")
    if count is not None and len(values) != count:
        raise SceneError(f"{where} has {len(values)} of {key}; it has {plural(count, 'vertex', 'vertices')}")
    return values


def _triangles(where: str, indices: NDArray[Any], mode: int, count: int) -> Faces:
    """Return faces (m, 3) of a list, strip or fan of triangles over `count` vertices."""
    there = plural(len(indices), "index", "indices")
    if mode == TRIANGLES:
        if len(indices) % 3:
            raise SceneError(f"{where} has {there}; triangles need a multiple of 3")
        return indices.astype(np.intp).reshape(-1, 3)
    if len(indices) < 3:
        raise SceneError(f"{where} has {there}; a strip or fan needs at least 3")
    # glTF forbids the largest index; where it occurs, it begins a new strip, as in graphics hardware
    largest = np.iinfo(indices.dtype).max
    restart = (indices == largest) & (largest >= count)
    indices = indices.astype(np.intp)
    place = np.arange(len(indices))
    begin = np.maximum.accumulate(np.where(restart, place + 1, 0))[:-2]  # of the strip or fan of a triangle
    second, third = indices[1:-1], indices[2:]
    first = indices[:-2] if mode == STRIP else indices[begin]
    faces = np.stack([first, second, third], axis=1)
    odd = (place[:-2] - begin) % 2 == 1
    if mode == STRIP:
        faces[odd] = faces[odd][:, [1, 0, 2]]  # every second triangle of a strip has the opposite orientation
    apart = (first != second) & (second != third) & (third != first)  # degenerate triangles join strips
    return faces[apart & ~restart[:-2] & ~restart[1:-1] & ~restart[2:]]

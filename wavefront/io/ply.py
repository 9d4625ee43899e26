"""PLY, read by trimesh after a check of its header.

Triangle strips, and polygons of several sizes in a binary file, are first rewritten as triangles: trimesh
ignores strips and refuses such polygons.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..core.errors import SceneError
from ..core.plural import plural
from .ply_header import SIZES, TYPES, Element, check_ply, ply_textures, unread
from .sources import SceneFiles
from .trimesh_import import import_trimesh
from .trimesh_loading import Images, by_trimesh

FACES = ("face", "tristrips")
ORDERS: dict[str, Literal["little", "big"]] = {"<": "little", ">": "big"}


def parse(files: SceneFiles, data: bytes, materials: bool) -> tuple[Any, int]:
    """Return the trimesh object of a PLY file, and the number of its faces by the header.

    Raises
    ------
    SceneError
        If the file is malformed. The message names the file, and the line of a text.
    """
    name = files.name
    elements = check_ply(name, data)
    lost = unread(elements)
    data, faces = _with_triangles(name, data, elements)
    if faces is not None:
        lost += [f"{what} of {faces.name}" for what in faces.properties if not what.startswith("vertex_ind")]
        elements = [faces]
    for each in lost if materials else ():
        files.losses.note(each)
    textures = ply_textures(data)
    if len(textures) > 1 and materials:
        files.losses.note("several textures", done=f"{textures[-1]!r} is taken for all faces")
    images = Images(files)
    found = by_trimesh(name, data, "ply", images, skip_materials=not (textures and materials))
    images.report()
    return found, sum(element.count for element in elements if element.name == "face")


def _with_triangles(name: str, data: bytes, elements: list[Element]) -> tuple[bytes, Element | None]:
    """Return a file that trimesh can read, and the element that was rewritten, with its new count."""
    found = [i for i, element in enumerate(elements) if element.name in FACES and element.count]
    if not found or any(element.lists for element in elements[: found[0]]):
        return data, None
    if len(found) > 1:
        raise SceneError(f"{name}: has faces and triangle strips; only one of them can be read")
    element = elements[found[0]]
    end = re.search(rb"end_header[^\n]*\n", data)
    assert end is not None
    header, body = data[: end.end()], data[end.end() :]
    text, order = b"format ascii" in header, ">" if b"big_endian" in header else "<"
    if element.lists != 1 or (text and element.name == "face"):
        return data, None
    before = elements[: found[0]]
    if text:
        lines = [line + b"\n" for line in body.split(b"\n") if line.strip()]
        start = sum(part.count for part in before)
        kept = b"".join(lines[:start])
        lists = [np.array(line.split()[1:], np.int64) for line in lines[start : start + element.count]]
    else:
        start = sum(part.count * part.size for part in before)
        kept = body[:start]
        if element.name == "face" and _are_alike(body[start:], element, order):
            return data, None
        lists = list(_lists(name, body[start:], element, order))
    faces = _unrolled(lists) if element.name == "tristrips" else _split(name, lists)
    opening = header[: header.index(b"element " + element.name.encode())]
    opening += b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(faces)
    return opening + kept + _rows(faces, text, order), replace(element, name="face", count=len(faces))


def _rows(faces: NDArray[np.int64], text: bool, order: str) -> bytes:
    if text:
        return b"".join(b"3 %d %d %d\n" % tuple(face) for face in faces.tolist())
    out = np.zeros(len(faces), [("count", "u1"), ("index", order + "i4", 3)])
    out["count"], out["index"] = 3, faces
    return out.tobytes()


def _layout(element: Element) -> tuple[int, int, int, int]:
    """Return the bytes of a row before its list, of the list's length, of one entry, and after the list."""
    at = next(i for i, kinds in enumerate(element.kinds) if len(kinds) == 2)
    length, entry = (SIZES[kind] for kind in element.kinds[at])
    sizes = [SIZES[kinds[0]] for kinds in element.kinds]
    return sum(sizes[:at]), length, entry, sum(sizes[at + 1 :])


def _are_alike(body: bytes, element: Element, order: str) -> bool:
    """Return whether the lists of all rows are as long as the first one, as trimesh assumes."""
    before, length, entry, after = _layout(element)
    first = body[before : before + length]
    size = before + length + int.from_bytes(first, ORDERS[order]) * entry + after
    if size * element.count > len(body):
        return False
    rows = np.frombuffer(body, np.uint8, size * element.count).reshape(element.count, size)
    return bool((rows[:, before : before + length] == np.frombuffer(first, np.uint8)).all())


def _lists(name: str, body: bytes, element: Element, order: str) -> Iterator[NDArray[np.int64]]:
    """Read the list of every row."""
    before, length, entry, after = _layout(element)
    kind = order + next(TYPES[kinds[1]] for kinds in element.kinds if len(kinds) == 2)
    at = 0
    for row in range(element.count):
        at += before + length
        count = int.from_bytes(body[at - length : at], ORDERS[order])
        if at + count * entry + after > len(body):
            raise SceneError(f"{name}: {element.name} {row} has a list of {count}; the file ends before that")
        yield np.frombuffer(body, kind, count, at).astype(np.int64)
        at += count * entry + after


def _split(name: str, lists: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return the triangles (m, 3) of polygons."""
    short = next((i for i, corners in enumerate(lists) if len(corners) < 3), None)
    if short is not None:
        raise SceneError(
            f"{name}: face {short} has {plural(len(lists[short]), 'corner')}; it needs at least 3"
        )
    return np.asarray(import_trimesh().geometry.triangulate_quads(lists), np.int64)


def _unrolled(strips: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return the triangles (m, 3) of strips. -1 begins a new one. Degenerate ones are dropped."""
    parts = [np.zeros((0, 3), np.int64)]
    for strip in strips:
        for run in np.split(strip, np.flatnonzero(strip == -1)):
            run = run[run != -1]
            if len(run) >= 3:
                faces = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
                faces[1::2] = faces[1::2, [1, 0, 2]]
                parts.append(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
    return np.concatenate(parts)

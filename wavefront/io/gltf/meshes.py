"""Meshes of glTF: attributes and lists, strips and fans of triangles.

Source: Khronos Group, glTF 2.0 specification, chapter 3.7.2, KHR_mesh_quantization and
KHR_draco_mesh_compression.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SceneError
from ...core.plural import plural
from ..repair import Faces, RawMesh, Table, wide
from .compression import DRACO, DracoMesh
from .document import Document, normalized
from .posing import MORPHED, Bend

READ = ("TEXCOORD_0", "TEXCOORD_1", "COLOR_0")  # attributes of a mesh with a number in their name
TRIANGLES, STRIP, FAN = 4, 5, 6
INFLUENCES = 4  # joints of a vertex in one attribute


@dataclass
class Primitive:
    """A part of a mesh."""

    raw: RawMesh
    material: Any  # number in the file; None without one
    bend: Bend
    place: str  # for messages


def primitives(document: Document, index: Any) -> list[Primitive]:
    """Return the parts of a mesh; those that are damaged are noted.

    Raises
    ------
    SceneError
        If the mesh is missing or malformed.
    """
    mesh = document.get("meshes", index)
    with document.inside(f"meshes[{index}]"):
        name = str(mesh.get("name", f"mesh{index}"))
        json_primitives = mesh.get("primitives", [])
        out = []
        for number, primitive in enumerate(json_primitives):
            place = f"meshes[{index}].primitives[{number}]"
            with document.part(place):
                mode = primitive.get("mode", TRIANGLES)
                if mode not in (TRIANGLES, STRIP, FAN):
                    document.lose("points and lines", f"mesh {name!r}")
                    continue
                label = name if len(json_primitives) == 1 else f"{name}_{number}"
                out.append(_Reader(document, primitive, label, place).primitive(mode))
        return out


class _Reader:
    """Reads one primitive."""

    def __init__(self, document: Document, primitive: dict[str, Any], name: str, place: str) -> None:
        self._document, self._json, self._name, self._place = document, primitive, name, place
        self._where = f"{document.name}: {name!r}"
        self._attributes = primitive.get("attributes", {})
        self._draco = self._unpacked()
        self._count: int | None = None  # of vertices

    def primitive(self, mode: int) -> Primitive:
        """Return the primitive.

        Raises
        ------
        SceneError
            If its positions or indices are missing or malformed.
        """
        vertices = self._values("POSITION", 3)
        if vertices is None:
            raise SceneError(f"{self._where} has no POSITION that can be read")
        self._count = len(vertices)
        faces = self._faces(mode)
        for extra in self._attributes:
            if extra.startswith(("COLOR_", "TEXCOORD_")) and extra not in READ:
                self._document.lose(extra, f"mesh {self._name!r}")
        raw = RawMesh(
            self._name,
            wide(vertices),
            faces,
            normals=self._read("NORMAL", 3),
            uvs=_flip_v(self._read("TEXCOORD_0", 2)),
            uvs1=_flip_v(self._read("TEXCOORD_1", 2)),
            tangents=self._read("TANGENT", 4),
            colors=self._read("COLOR_0", (3, 4)),
        )
        return Primitive(raw, self._json.get("material"), self._bend(), self._place)

    def _unpacked(self) -> DracoMesh | None:
        """Return the mesh that Draco compressed; None without one, or if it is there uncompressed, too."""
        packed, document = self._json.get("extensions", {}).get(DRACO), self._document
        if packed is None:
            return None
        plain = all("bufferView" in document.get("accessors", i) for i in self._attributes.values())
        if plain and find_spec("DracoPy") is None:
            return None
        data, start, end, _ = document.view(packed["bufferView"])
        return DracoMesh(data[start:end], packed, document.files.budget, f"{document.name}: {self._place}")

    def _faces(self, mode: int) -> Faces:
        """Return the triangles."""
        document, where = self._document, self._where
        if self._draco is not None:
            indices, mode = self._draco.indices, TRIANGLES
        elif "indices" in self._json:
            indices = document.accessor(self._json["indices"])[:, 0]
            if indices.dtype.kind != "u":
                raise SceneError(f"{where} has indices of type {indices.dtype}; they must be unsigned")
        else:
            indices = np.arange(self._count or 0)
        beyond = len(indices) % 3 if mode == TRIANGLES else 0
        if beyond:
            amount = f"has {plural(len(indices), 'index', 'indices')}; triangles need a multiple of 3"
            document.files.losses.note(amount, f"{self._name!r}", done="the last ones are left out")
        return _triangles(where, indices[: len(indices) - beyond], mode, self._count or 0)

    def _values(self, key: str, widths: int | tuple[int, ...]) -> NDArray[Any] | None:
        """Return an attribute of the primitive, None if there is none."""
        if self._draco is not None and key in self._draco and key in self._attributes:
            accessor = self._document.get("accessors", self._attributes[key])
            values = self._draco.values(key)
            values = normalized(values) if accessor.get("normalized") else values
            return checked(key, values, widths, self._where, self._count)
        return attribute(self._document, self._attributes, key, widths, self._where, self._count)

    def _read(self, key: str, widths: int | tuple[int, ...]) -> Table | None:
        """Return an attribute that is left out, which is noted, if it is damaged."""
        if key not in self._attributes:
            return None
        with self._document.part(f"{self._place}.{key}"):
            values = self._values(key, widths)
            return None if values is None else wide(values)
        return None

    def _bend(self) -> Bend:
        """Return the morph targets and the joints; damaged ones are noted, and have no effect."""
        bend, document = Bend(), self._document
        if "targets" not in self._json and "JOINTS_0" not in self._attributes:
            return bend
        with document.part(f"{self._place}.targets"):
            bend.targets = [self._target(*numbered) for numbered in enumerate(self._json.get("targets", []))]
        with document.part(f"{self._place}.JOINTS"):
            sets = [i for i in range(len(self._attributes)) if f"JOINTS_{i}" in self._attributes]
            joints = [self._values(f"JOINTS_{i}", INFLUENCES) for i in sets]
            weights = [self._values(f"WEIGHTS_{i}", INFLUENCES) for i in sets]
            if any(values is None for values in weights):
                raise SceneError("has no WEIGHTS for all of its JOINTS")
            if sets:
                bend.joints = np.hstack(joints).astype(np.intp)  # type: ignore[arg-type]
                bend.weights = wide(np.hstack(weights))  # type: ignore[arg-type]
        return bend

    def _target(self, number: int, target: dict[str, Any]) -> dict[str, Table]:
        """Return the differences of a morph target, by attribute."""
        where, differences = f"{self._where}: target {number}", {}
        for key in target:
            if key not in MORPHED:
                self._document.lose(f"{key} of morph targets", f"mesh {self._name!r}")
                continue
            values = attribute(self._document, target, key, 3, where, self._count)
            assert values is not None
            differences[key] = wide(values)
        return differences


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
    return (
        checked(key, document.accessor(attributes[key]), widths, where, count) if key in attributes else None
    )


def checked(
    key: str, values: NDArray[Any], widths: int | tuple[int, ...], where: str, count: int | None
) -> NDArray[Any]:
    """Return the values (n, k) of an attribute, or raise a SceneError if they are too few or too narrow."""
    allowed = (widths,) if isinstance(widths, int) else widths
    if values.shape[1] not in allowed:
        listed = " or ".join(map(str, allowed))
        raise SceneError(f"{where} has {key} with {values.shape[1]} components; it must have {listed}")
    if count is not None and len(values) != count:
        raise SceneError(f"{where} has {len(values)} of {key}; it has {plural(count, 'vertex', 'vertices')}")
    return values


def _triangles(where: str, indices: NDArray[Any], mode: int, count: int) -> Faces:
    """Return faces (m, 3) of a list, strip or fan of triangles over `count` vertices."""
    if mode == TRIANGLES:
        return indices.astype(np.intp).reshape(-1, 3)
    if len(indices) < 3:
        amount = plural(len(indices), "index", "indices")
        raise SceneError(f"{where} has {amount}; a strip or fan needs at least 3")
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
    distinct = (first != second) & (second != third) & (third != first)  # degenerate triangles join strips
    return faces[distinct & ~restart[:-2] & ~restart[1:-1] & ~restart[2:]]

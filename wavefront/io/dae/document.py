"""COLLADA (.dae), read by pycollada after a check of its references, and materials by trimesh.

Positions become meters by the `unit` of the file. Its `up_axis` is the up axis of the scene.
"""

from __future__ import annotations

import re
import warnings
import zipfile
from io import BytesIO
from typing import Any

from ...core.errors import SceneError
from ..description.contents import Contents
from ..description.placing import meters
from ..sources import SceneFiles
from ..trimesh_library import typed_errors
from ..xml_checks import check_expanded, look_through, total
from .mending import is_doubtful, mended
from .meshes import DaeMeshes

LOST = ("instance_controller", "instance_light", "instance_camera", "lines", "linestrips", "animation")
PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
UP_AXIS = re.compile(rb"[^<>]*>\s*([XYZ])_UP")  # after the bytes "<" of an element up_axis
PLACES = ("node", "visual_scene", "scene")  # elements that hold nodes, or refer to them


def parse(files: SceneFiles, data: bytes, materials: bool) -> Contents:
    """Return the meshes of a COLLADA file, in meters, and the axis that is up.

    Raises
    ------
    SceneError
        If the file is malformed; the message names the file and the error.
    """
    name = files.name
    if zipfile.is_zipfile(BytesIO(data)):  # an archive may begin after other bytes
        raise SceneError(f"{name}: is an archive; unpack it first")
    document = _Document(name, data)
    check_expanded(name, document.children, document.sizes, "scene")
    for tag, line in document.lost.items() if materials else ():
        files.losses.note(tag, f"line {line}")
    read = _read(files, data)
    meshes = DaeMeshes(files, read, materials)
    contents = meshes.contents()
    # pycollada drops damaged parts without a warning
    expected = total(name, document.children, lambda node: document.primitives.get(node, 0), "scene")
    if meshes.count < expected:
        damaged = f"{expected - meshes.count} of {expected} parts of its geometry"
        files.losses.note(damaged, value="damaged", done="left out")
    contents.places.scale(meters(files.losses, "unit", read.assetInfo.unitmeter, 1.0))
    contents.up = document.up
    return contents


def _read(files: SceneFiles, data: bytes) -> Any:
    """Return the document that pycollada reads; of mended data if it cannot read all of the file."""
    read, error = None, None
    if not is_doubtful(data):
        try:
            read = _collada(files.name, data)
        except SceneError as refusal:
            error = refusal
    if read is None or read.errors:
        with typed_errors(files.name, "dae"):
            better = mended(data)
        if better is not None:
            files.losses.note("a number or index", value="damaged", done="what has it is left out")
            return _collada(files.name, better)
    if error is not None:
        raise error
    return _collada(files.name, data) if read is None else read


def _collada(name: str, data: bytes) -> Any:
    with typed_errors(name, "dae"), warnings.catch_warnings():
        import collada

        warnings.simplefilter("ignore", DeprecationWarning)  # of texts with other things than numbers
        read = collada.Collada(BytesIO(data), ignore=[collada.common.DaeError])
    if read.scene is None:
        raise SceneError(f"{name}: not a readable dae file: it has no scene")
    return read


class _Document:
    """The contents and references of a file's nodes, and the elements that are not read."""

    def __init__(self, name: str, data: bytes) -> None:
        self.children: dict[str, list[str]] = {}
        self.sizes: dict[str, int] = {}  # bytes of the geometries
        self.primitives: dict[str, int] = {}  # their number in each geometry
        self.lost: dict[str, int] = {}  # tag -> first line
        self.up = "y"  # by the standard, where the file does not say
        self._inside: list[str] = []
        self._geometry = ("", 0)
        self._data = data
        look_through(name, data, self._begin, self._end)

    def _begin(self, tag: str, attributes: dict[str, str], at: int) -> None:
        if tag in LOST:
            self.lost.setdefault(tag, self._data.count(b"\n", 0, at) + 1)
        if tag == "up_axis" and (axis := UP_AXIS.match(self._data, at + 1)) is not None:
            self.up = axis[1].decode().lower()
        if tag in PLACES:
            key = "scene" if tag == "scene" else "#" + attributes.get("id", f" {at}")
            if self._inside:
                self.children.setdefault(self._inside[-1], []).append(key)
            self._inside.append(key)
        elif tag.startswith("instance_") and self._inside:
            self.children.setdefault(self._inside[-1], []).append(attributes.get("url", ""))
        elif tag == "geometry":
            self._geometry = "#" + attributes.get("id", ""), at
        elif tag in PRIMITIVES and attributes.get("count") != "0":
            self.primitives[self._geometry[0]] = self.primitives.get(self._geometry[0], 0) + 1

    def _end(self, tag: str, at: int) -> None:
        if tag in PLACES:
            self._inside.pop()
        elif tag == "geometry":
            key, begin = self._geometry
            self.sizes[key] = max(self.sizes.get(key, 0), at - begin)

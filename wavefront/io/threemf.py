"""3MF, read by trimesh after a check of its unpacked size and its references. No other archive is opened.

Positions are those of the file, mostly in millimeters with z up. Colors and materials are not read.
"""

from __future__ import annotations

import os
import zipfile
from io import BytesIO
from typing import Any

from ..errors import SceneError
from .markup import check_expanded, look_through, need
from .repair import warn
from .sources import SceneFiles
from .trimesh_loading import by_trimesh

MAX_MEMBERS = 2**12
LOST = (
    "basematerials",
    "colorgroup",
    "texture2dgroup",
    "compositematerials",
    "multiproperties",
    "beamlattice",
)


def parse(files: SceneFiles, data: bytes, strict: bool, materials: bool) -> Any:
    """Return the trimesh scene of a 3MF file.

    Raises
    ------
    SceneError
        If lxml or networkx is missing, or the file is malformed; the message names the file and the error.
    """
    name = os.fspath(files.scene)
    need(name, ".3mf", ("lxml", "lxml"), ("networkx", "networkx"))
    package = _Package(name, _models(name, data, files.limits.unpacked_bytes))
    check_expanded(name, package.children, {}, "build")
    if package.lost and materials:
        warn(f"{name}: not honored: {', '.join(package.lost)}", strict)
    return by_trimesh(name, data, "3mf")


def _models(name: str, data: bytes, most: int) -> dict[str, bytes]:
    """Return the members of the archive that contain geometry."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if len(members) > MAX_MEMBERS:
                raise SceneError(f"{name}: has {len(members)} members; the limit is {MAX_MEMBERS}")
            if size > most:
                raise SceneError(
                    f"{name}: unpacks to {size} bytes; the limit is {most} (LoadLimits.unpacked_bytes)"
                )
            models = [member for member in members if member.filename.lower().endswith(".model")]
            return {member.filename: archive.read(member) for member in models}
    except (MemoryError, SceneError):
        raise
    except Exception as error:  # damaged archives raise errors of many kinds
        raise SceneError(f"{name}: not a readable 3mf file: {error!r}") from error


class _Package:
    """The references of a package's objects, and the elements that are not read."""

    def __init__(self, name: str, models: dict[str, bytes]) -> None:
        self.children: dict[str, list[str]] = {}
        self.lost: dict[str, None] = {}
        self._object = ""
        meshes: dict[str, int] = {}
        referred: set[str] = set()
        for member, content in models.items():

            def begin(tag: str, attributes: dict[str, str], at: int, member: str = member) -> None:
                if tag == "object":
                    self._object = attributes.get("id", "")
                elif tag == "mesh":
                    meshes[member] = meshes.get(member, 0) + 1
                elif tag in LOST:
                    self.lost[tag] = None
                elif tag in ("component", "item"):
                    above = "build" if tag == "item" else self._object
                    self.children.setdefault(above, []).append(attributes.get("objectid", ""))
                    referred.add(attributes.get("path", "").strip("/"))

            look_through(f"{name}: {member}", content, begin)
        for member in sorted(referred):
            if meshes.get(member, 0) > 1:  # trimesh uses all of them for each reference
                raise SceneError(
                    f"{name}: refers to {member}, which holds {meshes[member]} meshes; only one is read"
                )

"""3MF, read by trimesh after a check of its unpacked size and its references. No other archive is opened.

Positions are those of the file, mostly in millimeters with z up. Colors and materials are not read.
"""

from __future__ import annotations

import os
import zipfile
from io import BytesIO
from typing import Any

from ..codecs.archive import checked_members, unpacked
from ..errors import SceneError
from .markup import check_expanded, look_through, need
from .repair import warn
from .sources import SceneFiles
from .trimesh_loading import by_trimesh

MAX_MEMBERS = 2**12
XML_BYTES = 4  # of memory for each byte of a member
ROOT = "3d/3dmodel.model"  # trimesh reads the first member whose name contains this, in any case
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
    models = _models(files, data)
    package = _Package(name, models)
    check_expanded(name, package.children, {}, "build")
    if package.lost and materials:
        warn(f"{name}: not honored: {', '.join(package.lost)}", strict)
    return by_trimesh(name, _archive(models), "3mf")


def _models(files: SceneFiles, data: bytes) -> dict[str, bytearray]:
    """Return the members of the archive that are read: the model, and those that it refers to."""
    name, most = os.fspath(files.scene), files.limits.unpacked_bytes
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            members = checked_members(archive, MAX_MEMBERS)
            size = sum(member.file_size for member in members)
            if size > most:
                raise SceneError(f"unpacks to {size} bytes; the limit is {most} (LoadLimits.unpacked_bytes)")
            root = next((each for each in members if ROOT in each.filename.lower()), None)
            if root is None:
                raise SceneError(f"has no member {ROOT!r}")
            read = [root, *(each for each in members if each is not root and _is_model(each.filename))]
            for member in read:
                files.budget.charge(f"its member {member.filename!r}", XML_BYTES * member.file_size)
            return {member.filename: unpacked(archive, member) for member in read}
    except MemoryError:
        raise
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    except Exception as error:  # damaged archives raise errors of many kinds
        raise SceneError(f"{name}: not a readable 3mf file: {error!r}") from error


def _is_model(name: str) -> bool:
    return ROOT in name.lower() or name.lower().endswith(".model")


def _archive(models: dict[str, bytearray]) -> bytes:
    """Return an archive of the members that have been checked, and of no others: all that trimesh gets."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in models.items():
            archive.writestr(name, content)
    return buffer.getvalue()


class _Package:
    """The references of a package's objects, and the elements that are not read."""

    def __init__(self, name: str, models: dict[str, bytearray]) -> None:
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
            if member and member not in models:
                raise SceneError(f"{name}: refers to {member!r}, which is no model of the package")
            if meshes.get(member, 0) > 1:  # trimesh uses all of them for each reference
                raise SceneError(
                    f"{name}: refers to {member}, which holds {meshes[member]} meshes; only one is read"
                )

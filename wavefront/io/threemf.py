"""3MF: meshes, their colors, and where they are placed. No other archive is opened.

Positions are those of the file, mostly in millimeters with z up.
"""

from __future__ import annotations

import zipfile
from array import array
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np

from ..arrays.vec import Ints
from ..bsdfs import Diffuse
from ..codecs.archive import checked_members, unpacked
from ..colors import srgb
from ..core.errors import LimitError, SceneError
from ..materials import Material
from ..shapes.transform import IDENTITY, Matrix
from .appearance import MaterialSpec, assign_material
from .contents import Contents
from .placing import Places
from .repair import RawMesh, Table
from .sources import SceneFiles
from .xml_checks import check_expanded, look_through

MAX_MEMBERS = 2**12
XML_BYTES = 4  # of memory for each byte of a member
ROOT = "3d/3dmodel.model"  # the first member whose name contains this, in any case, is read
LOST = ("texture2dgroup", "compositematerials", "multiproperties", "beamlattice")
GROUPS = {"basematerials": ("base", "displaycolor"), "colorgroup": ("color", "color")}
NO_COLOR = (0.5, 0.5, 0.5)  # of triangles without one beside others that have one; linear


def parse(files: SceneFiles, data: bytes, materials: bool) -> Contents:
    """Return the meshes of a 3MF file and their placements.

    Raises
    ------
    SceneError
        If the file is malformed; the message names the file and the error.
    """
    name = files.name
    models = _models(files, data)
    package = _Package(name, models)
    check_expanded(name, package.children, {}, "build")
    numbers: dict[str, int] = {}
    matrices: list[Matrix] = []
    of: list[int] = []
    for key, matrix in package.placed():
        of.append(numbers.setdefault(key, len(numbers)))
        matrices.append(matrix)
    raws = [package.raw(key, materials) for key in numbers]
    for each in package.lost if materials else ():
        files.losses.note(each)
    return Contents(raws, Places(np.array(of, np.intp), np.array(matrices).reshape(-1, 4, 4)))


def _models(files: SceneFiles, data: bytes) -> dict[str, bytearray]:
    """Return the members of the archive that are read: the model, and those that it refers to."""
    name, most = files.name, files.limits.unpacked_bytes
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            members = checked_members(archive, MAX_MEMBERS)
            size = sum(member.file_size for member in members)
            if size > most:
                raise LimitError(f"unpacks to {size} bytes; the limit is {most} (LoadLimits.unpacked_bytes)")
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


@dataclass
class _Object:
    """An object of a model: a mesh with its colors, or components."""

    name: str
    color: tuple[str, int] | None  # group and number of its own color
    vertices: array[float] = field(default_factory=lambda: array("d"))  # 3 for each
    corners: array[int] = field(default_factory=lambda: array("q"))  # 3 for each triangle
    groups: dict[str, int] = field(default_factory=dict)  # of colors -> their numbers in `paint`
    paint: array[int] = field(default_factory=lambda: array("q"))  # triangle, group, 3 numbers of colors
    components: list[tuple[str, Matrix]] = field(default_factory=list)


class _Package:
    """The objects of a package, by the member that holds them and their id."""

    def __init__(self, name: str, models: dict[str, bytearray]) -> None:
        self._name = name
        self._members = {member.lower().strip("/"): member for member in models}
        self._objects: dict[str, _Object] = {}
        self._items: list[tuple[str, Matrix]] = []
        self._groups: dict[str, list[str]] = {}  # colors of the groups
        self.lost: dict[str, None] = {}
        root = next(iter(models))
        for member, content in models.items():
            _Model(self, member, member == root).read(content)
        for key, each in self._objects.items():
            for child, _ in each.components:
                self._find(child, key)
        for child, _ in self._items:
            self._find(child, "build")

    @property
    def children(self) -> dict[str, list[str]]:
        """The objects that each object holds, and "build" the items."""
        out = {key: [child for child, _ in each.components] for key, each in self._objects.items()}
        return {**out, "build": [child for child, _ in self._items]}

    def key(self, member: str, attributes: dict[str, str]) -> str:
        """Return the key of the object that an element of a member refers to."""
        path = attributes.get("path", "").strip("/")
        if path and path.lower() not in self._members:
            raise SceneError(f"{self._name}: refers to {path!r}, which is no model of the package")
        return f"{self._members[path.lower()] if path else member}#{attributes.get('objectid', '')}"

    def placed(self) -> list[tuple[str, Matrix]]:
        """Return the meshes that are built, with their matrices to the scene."""
        out = []
        waiting = [(key, matrix) for key, matrix in reversed(self._items)]
        with np.errstate(all="ignore"):  # a matrix that is not finite is reported where it is used
            while waiting:
                key, matrix = waiting.pop()
                each = self._objects[key]
                if each.corners:
                    out.append((key, matrix))
                waiting += [(child, matrix @ inner) for child, inner in reversed(each.components)]
        return out

    def raw(self, key: str, materials: bool) -> RawMesh:
        """Return the mesh of an object; corners of several colors become vertices of their own."""
        each = self._objects[key]
        raw = RawMesh(
            each.name, np.array(each.vertices).reshape(-1, 3), np.array(each.corners, np.intp).reshape(-1, 3)
        )
        member = key.partition("#")[0]
        if not materials or not (each.paint or each.color):
            return raw
        group, index = each.color or ("", 0)
        own = self._colors(member, group, np.array(index))
        if not each.paint:
            assign_material(raw, MaterialSpec(Material(Diffuse(own))))
            return raw
        colors = np.tile(own, (len(raw.faces), 3, 1))
        paint = np.array(each.paint).reshape(-1, 5)
        for group, number in each.groups.items():
            rows = paint[paint[:, 1] == number]
            colors[rows[:, 0]] = self._colors(member, group, rows[:, 2:])
        used = raw.faces.ravel()
        if used.size and (used.min() < 0 or used.max() >= len(raw.vertices)):
            return raw  # which is refused where it is built
        raw.vertices, raw.faces = raw.vertices[used], np.arange(used.size).reshape(-1, 3)
        raw.colors = np.column_stack([colors.reshape(-1, 3), np.ones(used.size)])
        assign_material(raw, None)
        return raw

    def _find(self, key: str, parent: str) -> None:
        if key not in self._objects:
            raise SceneError(f"{self._name}: {parent} refers to object {key}, which does not exist")

    def _colors(self, member: str, group: str, numbers: Ints) -> Table:
        """Return the linear colors (..., 3) of numbers (...,) of a group; `NO_COLOR` if it holds none."""
        codes = self._groups.get(f"{member}#{group}")
        if codes is None:
            return np.broadcast_to(NO_COLOR, (*numbers.shape, 3))
        bad = numbers[(numbers < 0) | (numbers >= len(codes))]
        if bad.size:
            raise SceneError(f"{self._name}: group {group} has {len(codes)} colors, not number {bad.flat[0]}")
        if any(len(code) == 9 and code[7:].lower() != "ff" for code in codes):
            self.lost["opacity of colors"] = None
        try:
            return srgb([code[:7] for code in codes]).astype(np.float64)[numbers]
        except SceneError as error:
            raise SceneError(f"{self._name}: group {group}: {error}") from None


class _Model:
    """The reader of one member of a package."""

    def __init__(self, package: _Package, member: str, root: bool) -> None:
        self._package, self._member, self._root = package, member, root
        self._object: _Object | None = None
        self._group: list[str] | None = None

    def read(self, content: bytearray) -> None:
        """Add the objects, colors and items of the member to the package."""
        begins = {
            "object": self._begin_object,
            "vertex": self._vertex,
            "triangle": self._triangle,
            "component": self._component,
            "item": self._item,
        }

        def begin(tag: str, attributes: dict[str, str], at: int) -> None:
            if tag in begins:
                begins[tag](attributes)
            elif tag in GROUPS:
                self._group = self._package._groups.setdefault(self._key(attributes.get("id", "")), [])
            elif self._group is not None and tag in ("base", "color"):
                self._group.append(attributes.get(dict(GROUPS.values())[tag], ""))
            elif tag in LOST:
                self._package.lost[tag] = None
                self._group = None

        look_through(f"{self._package._name}: {self._member}", content, begin)

    def _key(self, identity: str) -> str:
        return f"{self._member}#{identity}"

    def _begin_object(self, attributes: dict[str, str]) -> None:
        pid = attributes.get("pid")
        color = None if pid is None else (pid, int(self._number(attributes, "pindex", int, "0")))
        self._object = _Object(attributes.get("name", ""), color)
        self._package._objects[self._key(attributes.get("id", ""))] = self._object

    def _vertex(self, attributes: dict[str, str]) -> None:
        if self._object is not None:
            self._object.vertices.extend(self._number(attributes, axis, float) for axis in "xyz")

    def _triangle(self, attributes: dict[str, str]) -> None:
        each = self._object
        if each is None:
            return
        if "p1" in attributes:
            pid = attributes.get("pid", "" if each.color is None else each.color[0])
            group = each.groups.setdefault(pid, len(each.groups))
            first = attributes["p1"]
            numbers = [int(self._number(attributes, name, int, first)) for name in ("p1", "p2", "p3")]
            each.paint.extend((len(each.corners) // 3, group, *numbers))
        each.corners.extend(int(self._number(attributes, name, int)) for name in ("v1", "v2", "v3"))

    def _component(self, attributes: dict[str, str]) -> None:
        if self._object is not None:
            child = self._package.key(self._member, attributes)
            self._object.components.append((child, self._matrix(attributes)))

    def _item(self, attributes: dict[str, str]) -> None:
        if self._root:
            self._package._items.append(
                (self._package.key(self._member, attributes), self._matrix(attributes))
            )

    def _number(
        self, attributes: dict[str, str], name: str, kind: type[int] | type[float], usual: str | None = None
    ) -> float:
        text = attributes.get(name, usual)
        try:
            if text is None:
                raise ValueError
            value = kind(text)
            if kind is int and not abs(value) < 2**62:
                raise ValueError
        except ValueError:
            found = "is missing" if text is None else f"is {text[:40]!r}"
            raise SceneError(
                f"{self._package._name}: {self._member}: {name} {found}; it must be a number"
            ) from None
        return value

    def _matrix(self, attributes: dict[str, str]) -> Matrix:
        """Return the matrix (4, 4), for column vectors, of twelve numbers for rows."""
        text = attributes.get("transform")
        if text is None:
            return IDENTITY
        words = text.split()
        if len(words) != 12:
            raise SceneError(
                f"{self._package._name}: {self._member}: transform has {len(words)} numbers; it must have 12"
            )
        rows = np.array([self._number({"transform": word}, "transform", float) for word in words])
        matrix = IDENTITY.copy()
        matrix[:3] = rows.reshape(4, 3).T
        return matrix

"""3MF: meshes, their colors, and where they are placed. No other archive is opened.

Positions become meters by the `unit` of the model, by default millimeters; z is up. What is damaged is left
out: triangles of vertices that do not exist, and references to objects that do not.
"""

from __future__ import annotations

import zipfile
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np

from ..arrays.vec import Ints
from ..bsdfs import Diffuse
from ..codecs.archive import checked_members, unpacked
from ..colors import srgb
from ..core.errors import LimitError, SceneError
from ..core.plural import plural
from ..materials import Material
from ..shapes.transform import IDENTITY, Matrix
from .description.appearance import MaterialSpec, assign_material
from .description.contents import Contents
from .description.placing import Places, in_range
from .losses import Losses
from .repair import RawMesh, Table, with_split_corners
from .sources import SceneFiles
from .xml_checks import check_expanded, look_through

MAX_MEMBERS = 2**12
XML_BYTES = 4  # of memory for each byte of a member
ROOT = "3d/3dmodel.model"  # the first member whose name contains this, in any case, is read
CODES = {"base": "displaycolor", "color": "color"}  # elements of groups, and their attributes with a color
UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
NO_COLOR = (0.5, 0.5, 0.5)  # of triangles without one beside others that have one; linear


def parse(files: SceneFiles, data: bytes, materials: bool) -> Contents:
    """Return the meshes of a 3MF file and their placements.

    Raises
    ------
    SceneError
        If the file is malformed; the message names the file and the error.
    """
    name = files.name
    package = _Package(files.losses, _models(files, data))
    check_expanded(name, package.children, {}, "build")
    numbers: dict[str, int] = {}
    matrices: list[Matrix] = []
    of: list[int] = []
    for key, matrix in package.placed():
        of.append(numbers.setdefault(key, len(numbers)))
        matrices.append(matrix)
    raws = [package.raw(key, materials) for key in numbers]
    for unread in package.lost if materials else ():
        files.losses.note(unread)
    places = Places(np.array(of, np.intp), np.array(matrices).reshape(-1, 4, 4))
    places.scale(package.unit)
    return Contents(raws, places, up="z")


def _models(files: SceneFiles, data: bytes) -> dict[str, bytearray]:
    """Return the members of the archive that are read: the model, and those that it refers to."""
    name, most = files.name, files.limits.unpacked_bytes
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            members = checked_members(archive, MAX_MEMBERS)
            size = sum(member.file_size for member in members)
            if size > most:
                raise LimitError(f"unpacks to {size} bytes; the limit is {most} (LoadLimits.unpacked_bytes)")
            root = next((member for member in members if ROOT in member.filename.lower()), None)
            if root is None:
                raise SceneError(f"has no member {ROOT!r}")
            read = [
                root,
                *(member for member in members if member is not root and _is_model(member.filename)),
            ]
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

    def __init__(self, losses: Losses, models: dict[str, bytearray]) -> None:
        self.losses = losses
        self.unit = UNITS["millimeter"]  # meters; that of the first model
        self._members = {member.lower().strip("/"): member for member in models}
        self._objects: dict[str, _Object] = {}
        self._items: list[tuple[str, Matrix]] = []
        self._groups: dict[str, list[str]] = {}  # colors of the groups
        self.lost: dict[str, None] = {}
        root = next(iter(models))
        for member, content in models.items():
            _Model(self, member, member == root).read(content)
        for key, body in self._objects.items():
            body.components = [component for component in body.components if self._exists(component[0], key)]
        self._items = [item for item in self._items if self._exists(item[0], "build")]

    @property
    def children(self) -> dict[str, list[str]]:
        """The objects that each object holds, and "build" the items."""
        out = {key: [child for child, _ in body.components] for key, body in self._objects.items()}
        return {**out, "build": [child for child, _ in self._items]}

    def key(self, member: str, attributes: dict[str, str]) -> str:
        """Return the key of the object that an element of a member refers to."""
        path = attributes.get("path", "").strip("/")
        target = self._members.get(path.lower(), path) if path else member
        return f"{target}#{attributes.get('objectid', '')}"

    def placed(self) -> list[tuple[str, Matrix]]:
        """Return the meshes that are built, with their matrices to the scene."""
        out = []
        waiting = [(key, matrix) for key, matrix in reversed(self._items)]
        with np.errstate(all="ignore"):  # a matrix that is not finite is reported where it is used
            while waiting:
                key, matrix = waiting.pop()
                body = self._objects[key]
                if not in_range(matrix[None]).all():
                    self.losses.note(
                        f"the matrix of object {key}", value="beyond all limits", done="left out"
                    )
                    continue
                if body.corners:
                    out.append((key, matrix))
                waiting += [(child, matrix @ inner) for child, inner in reversed(body.components)]
        return out

    def raw(self, key: str, materials: bool) -> RawMesh:
        """Return the mesh of an object; corners of several colors become vertices of their own."""
        body = self._objects[key]
        vertices, corners = np.array(body.vertices).reshape(-1, 3), np.array(body.corners, np.intp)
        faces = corners.reshape(-1, 3)
        sound = ((faces >= 0) & (faces < len(vertices))).all(1)
        raw = RawMesh(body.name, vertices, faces[sound])
        if not sound.all():
            lost = plural(int((~sound).sum()), "triangle")
            what = f"{lost} with a vertex beyond the {len(vertices)}, first: triangle {sound.argmin()}"
            self.losses.note(what, f"object {key}", done="left out")
        member = key.partition("#")[0]
        if not materials or not (body.paint or body.color):
            return raw
        group, index = body.color or ("", 0)
        base_colors = self._colors(member, group, np.array(index))
        if not body.paint:
            assign_material(raw, MaterialSpec(Material(Diffuse(base_colors))))
            return raw
        colors = np.tile(base_colors, (len(faces), 3, 1))
        paint = np.array(body.paint).reshape(-1, 5)
        for group, number in body.groups.items():
            rows = paint[paint[:, 1] == number]
            colors[rows[:, 0]] = self._colors(member, group, rows[:, 2:])
        raw = with_split_corners(raw)
        raw.colors = np.column_stack([colors[sound].reshape(-1, 3), np.ones(raw.faces.size)])
        assign_material(raw, None)
        return raw

    def _exists(self, key: str, parent: str) -> bool:
        if key not in self._objects:
            self.losses.note(f"{parent} refers to object {key}, which does not exist", done="left out")
        return key in self._objects

    def _colors(self, member: str, group: str, numbers: Ints) -> Table:
        """Return the linear colors (..., 3) of numbers (...,) of a group; `NO_COLOR` where it has none."""
        codes = self._groups.get(f"{member}#{group}")
        if codes is None:
            return np.broadcast_to(NO_COLOR, (*numbers.shape, 3))
        if any(len(code) == 9 and code[7:].lower() != "ff" for code in codes):
            self.lost["opacity of colors"] = None
        table = np.array([*(self._color(group, code) for code in codes), NO_COLOR])
        bad = (numbers < 0) | (numbers >= len(codes))
        if bad.any():
            what = f"group {group} has {len(codes)} colors, not number {numbers[bad].flat[0]}"
            self.losses.note(what, done="gray in its place")
        return table[np.where(bad, len(codes), numbers)]

    def _color(self, group: str, code: str) -> Table:
        try:
            return srgb(code[:7]).astype(np.float64)
        except SceneError:
            self.losses.note(f"group {group} has {code[:20]!r}, which is no color", done="gray in its place")
            return np.array(NO_COLOR)


class _Model:
    """The reader of one member of a package."""

    def __init__(self, package: _Package, member: str, root: bool) -> None:
        self._package, self._member, self._root = package, member, root
        self._object: _Object | None = None
        self._group: list[str] | None = None

    def read(self, content: bytearray) -> None:
        """Add the objects, colors and items of the member to the package."""

        def begin(tag: str, attributes: dict[str, str], at: int) -> None:
            if tag in ELEMENTS:
                ELEMENTS[tag](self, tag, attributes)

        look_through(f"{self._package.losses.name}: {self._member}", content, begin)

    def _unit(self, tag: str, attributes: dict[str, str]) -> None:
        if not self._root:
            return
        unit = attributes.get("unit", "millimeter")
        if unit not in UNITS:
            self._note("unit", repr(unit[:40]), "millimeter in its place")
        self._package.unit = UNITS.get(unit, UNITS["millimeter"])

    def _begin_group(self, tag: str, attributes: dict[str, str]) -> None:
        self._group = self._package._groups.setdefault(self._key(attributes.get("id", "")), [])

    def _code(self, tag: str, attributes: dict[str, str]) -> None:
        if self._group is not None:
            self._group.append(attributes.get(CODES[tag], ""))

    def _lost(self, tag: str, attributes: dict[str, str]) -> None:
        self._package.lost[tag] = None
        self._group = None

    def _note(self, part: str, value: str, done: str) -> None:
        self._package.losses.note(part, self._member, value, done)

    def _key(self, identity: str) -> str:
        return f"{self._member}#{identity}"

    def _begin_object(self, tag: str, attributes: dict[str, str]) -> None:
        pid = attributes.get("pid")
        color = None if pid is None else (pid, self._whole(attributes, "pindex", 0))
        self._object = _Object(attributes.get("name", ""), color)
        self._package._objects[self._key(attributes.get("id", ""))] = self._object

    def _vertex(self, tag: str, attributes: dict[str, str]) -> None:
        if self._object is not None:
            self._object.vertices.extend(self._number(attributes, axis) for axis in "xyz")

    def _triangle(self, tag: str, attributes: dict[str, str]) -> None:
        body = self._object
        if body is None:
            return
        if "p1" in attributes:
            pid = attributes.get("pid", "" if body.color is None else body.color[0])
            group = body.groups.setdefault(pid, len(body.groups))
            first = self._whole(attributes, "p1", -1)
            numbers = [first, *(self._whole(attributes, name, first) for name in ("p2", "p3"))]
            body.paint.extend((len(body.corners) // 3, group, *numbers))
        body.corners.extend(self._whole(attributes, name) for name in ("v1", "v2", "v3"))

    def _component(self, tag: str, attributes: dict[str, str]) -> None:
        if self._object is not None:
            child = self._package.key(self._member, attributes)
            self._object.components.append((child, self._matrix(attributes)))

    def _item(self, tag: str, attributes: dict[str, str]) -> None:
        if self._root:
            self._package._items.append(
                (self._package.key(self._member, attributes), self._matrix(attributes))
            )

    def _number(self, attributes: dict[str, str], name: str) -> float:
        """Return a number of an element; NaN, which is noted, where it has none."""
        try:
            return float(attributes[name])
        except (KeyError, ValueError):
            return float(self._missing(attributes, name, np.nan))

    def _whole(self, attributes: dict[str, str], name: str, usual: int | None = None) -> int:
        """Return a whole number of an element; -1, which is noted, where it has none."""
        if usual is not None and name not in attributes:
            return usual
        try:
            value = int(attributes[name])
            return value if abs(value) < 2**62 else -1
        except (KeyError, ValueError):
            return int(self._missing(attributes, name, -1))

    def _missing(self, attributes: dict[str, str], name: str, value: float) -> float:
        self._note(name, repr(attributes[name][:40]) if name in attributes else "missing", "left out")
        return value

    def _matrix(self, attributes: dict[str, str]) -> Matrix:
        """Return the matrix (4, 4), for column vectors, of twelve numbers for rows."""
        text = attributes.get("transform")
        if text is None:
            return IDENTITY
        try:
            rows = np.array([float(word) for word in text.split()]).reshape(4, 3)
        except ValueError:
            self._note("transform", repr(text[:40]), "left out, as it must be 12 numbers")
            return IDENTITY
        matrix = IDENTITY.copy()
        matrix[:3] = rows.T
        return matrix


# the readers of elements, at their beginnings
ELEMENTS: dict[str, Callable[[_Model, str, dict[str, str]], None]] = {
    "model": _Model._unit,
    "basematerials": _Model._begin_group,
    "colorgroup": _Model._begin_group,
    "base": _Model._code,
    "color": _Model._code,
    "object": _Model._begin_object,
    "vertex": _Model._vertex,
    "triangle": _Model._triangle,
    "component": _Model._component,
    "item": _Model._item,
    # these are noted
    "texture2dgroup": _Model._lost,
    "compositematerials": _Model._lost,
    "multiproperties": _Model._lost,
    "beamlattice": _Model._lost,
}

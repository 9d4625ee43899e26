"""Scene files of Mitsuba (.xml) as the dictionaries of `mi.load_dict`.

Source: the documentation of Mitsuba 3, "Scene XML file format".
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers.expat import ExpatError

import numpy as np

from ...codecs.budget import PER_BYTE
from ...core.errors import LimitError, SceneError, one_of
from ...core.suggestions import did_you_mean
from ...motion import Keyframes
from ...shapes.transform import Matrix
from ..description.conversion import check_included, placed
from ..losses import Losses
from ..sources import SceneFiles
from ..text_lines import numbers
from ..xml_checks import MAX_DEPTH, look_through
from .transforms import OPERATIONS, product, vector

_OBJECTS = (
    "scene shape bsdf emitter sensor film rfilter sampler integrator texture medium phase volume spectrum"
)
OBJECTS = _OBJECTS.split()
MOST_LETTERS = 256  # of the name of a parameter $name
UNNAMED = "_arg_"  # the names of parameters without one begin with this
OLD_TAGS = {"luminaire": "emitter", "camera": "sensor"}  # before version 0.5
TO_UV = {"uoffset": (0, 3), "voffset": (1, 3), "uscale": (0, 0), "vscale": (1, 1)}  # before version 2


class Element(dict[str, Any]):
    """A dictionary of `mi.load_dict` that knows where it was in a file."""

    place: str = ""
    tag: str = ""  # the name of its element
    unnamed: int = 0  # how many of its parameters have been given a name


@dataclass
class Tag:
    """An element of XML."""

    name: str
    attributes: dict[str, str]
    place: str  # file and line, for messages
    children: list[Tag] = field(default_factory=list)


class File(NamedTuple):
    """A file that is read."""

    path: Path
    depth: int = 0  # of files that include each other
    old: bool = False  # of a version before 2


class Child(NamedTuple):
    """An element that is no plugin, in one that is."""

    parent: Element
    tag: Tag
    attributes: dict[str, str]  # with the values of its parameters
    file: File

    @property
    def place(self) -> str:
        """File and line, for messages."""
        return self.tag.place

    def numbers(self, counts: tuple[int, ...]) -> list[float]:
        """Return the numbers of its value."""
        return numbers(self.place, self.attributes["name"], self.attributes["value"], counts)


class Document:
    """A file with all that it includes, as dictionaries.

    Parameters
    ----------
    files
        The files that it may read.
    data
        Its content.
    parameters
        Values of `$name`, in place of those of `<default>`.

    Attributes
    ----------
    scene
        The dictionary, without elements that are damaged or unknown, which are noted.
    version
        Words on the version of an old file, for messages about unknown names.

    Raises
    ------
    SceneError
        If it is no scene, a limit is passed, or it does not use a parameter. The message names file and line.
    """

    def __init__(self, files: SceneFiles, data: bytes, parameters: Mapping[str, Any]) -> None:
        self._files, self._included, self._aliases = files, 0, dict[str, str]()
        self._values = {name: _as_text(value) for name, value in parameters.items()}
        self._unused = set(self._values)
        self._losses, self.version = files.losses, ""
        self.folders = [Path(files.name).parent]
        self.scene = self._read(Path(files.name), data, 0)
        for name in sorted(self._unused):
            hint = did_you_mean(name, self._values.keys() - self._unused)
            raise SceneError(f"{files.name}: does not use the parameter {name!r}{hint}")

    def find(self, reference: str) -> Path:
        """Return the path of a file that the scene refers to: in its folder, or in one of a `<path>`."""
        try:
            return self._files.existing(reference, self.folders[::-1])
        except SceneError as error:
            raise SceneError(str(error).removeprefix(f"{self._files.name}: ")) from error

    def _read(self, path: Path, data: bytes, depth: int) -> Element:
        root = parsed(os.fspath(path), data, self._losses)
        version = root.attributes.get("version", "").strip()
        if not re.fullmatch(r"\d+\.\d+(\.\d+)?", version):
            what = f"version is {version!r}; it must be such as 3.0.0" if version else "has no version"
            self._losses.note(f"<{root.name}> {what}", root.place, done="read as of 3.0.0")
            version = "3.0.0"
        old = int(version.split(".")[0]) < 2
        if old and not depth:
            self.version = f" in Mitsuba 3; the file is of Mitsuba {version}"
        if root.name not in OBJECTS:
            raise SceneError(f"{root.place}: <{root.name}> cannot be the first element")
        return self._object(root, File(path, depth, old))

    def _object(self, tag: Tag, file: File) -> Element:
        """Return a plugin and all that it holds."""
        attributes = self._substituted(tag)
        element = _element(tag, type=attributes.get("type", "scene" if tag.name == "scene" else ""))
        if not element["type"]:
            raise SceneError(f"{tag.place}: <{tag.name}> has no type")
        self._ignore(tag, attributes.keys() - {"type", "id", "name", "version"})
        if "id" in attributes:
            element["id"] = attributes["id"]
        for child in tag.children:
            with self._losses.part(child.place):
                self._add(element, child, file)
        return _upgraded(element) if file.old else element

    def _ignore(self, tag: Tag, unknown: set[str]) -> None:
        """Note attributes that are unknown."""
        for name in sorted(unknown):
            self._losses.note(f"<{tag.name}> has the unknown attribute {name!r}", tag.place, done="left out")

    def _add(self, parent: Element, tag: Tag, file: File) -> None:
        """Add the value of a child to a plugin's dictionary."""
        name = OLD_TAGS.get(tag.name.lower(), tag.name.lower()) if file.old else tag.name
        if name in OBJECTS and (name != "spectrum" or "type" in tag.attributes):
            child = self._object(tag, file)
            _set(parent, self._substituted(tag).get("name", ""), child, tag, file.old)
            return
        if name not in OTHERS:
            raise SceneError(f"{tag.place}: {_unknown(name)}{self.version}")
        attributes, other = self._substituted(tag), OTHERS[name]
        for needed in other.needed:
            if needed not in attributes:
                raise SceneError(f"{tag.place}: <{name}> has no {needed}")
        self._ignore(tag, attributes.keys() - {*other.needed, *other.optional})
        for inner in tag.children if name not in ("transform", "animation") else ():
            self._losses.note(f"<{inner.name}> cannot be inside <{name}>", inner.place, done="left out")
        value = other.read(self, Child(parent, tag, attributes, file))
        if other.is_value:
            _set(parent, attributes.get("name", ""), value, tag, file.old)

    def _reference(self, child: Child) -> Element:
        name = child.attributes["id"]
        return _element(child.tag, type="ref", id=self._aliases.get(name, name))

    def _alias(self, child: Child) -> None:
        name = child.attributes["id"]
        self._aliases[child.attributes["as"]] = self._aliases.get(name, name)

    def _default(self, child: Child) -> None:
        name = child.attributes["name"]
        if len(name) > MOST_LETTERS:
            raise SceneError(f"{child.place}: the name of a parameter has more than {MOST_LETTERS} letters")
        self._values.setdefault(name, child.attributes["value"])

    def _transform(self, child: Child) -> Matrix:
        """Return the matrix of the operations that are sound."""
        steps = child.tag.children
        try:
            return product([(step.name, self._substituted(step), step.place) for step in steps])
        except SceneError:
            matrix = np.eye(4)
        for step in steps:
            with self._losses.part(step.place), np.errstate(over="ignore", invalid="ignore"):
                matrix = product([(step.name, self._substituted(step), step.place)]) @ matrix
        return matrix

    def _animation(self, child: Child) -> Keyframes | Matrix:
        """Return the motion by transforms that each have a time; what is damaged is left out."""
        keys: dict[float, Matrix] = {}
        for step in child.tag.children:
            with self._losses.part(step.place), placed(step.place):
                attributes = self._substituted(step)
                if step.name != "transform":
                    raise SceneError(f"<{step.name}> cannot be inside <animation>")
                (time,) = numbers(step.place, "time", attributes.get("time", ""), (1,))
                keys[time] = self._transform(Child(child.parent, step, attributes, child.file))
        if not keys:
            raise SceneError(f"{child.place}: <animation> has no transform with a time")
        times = sorted(keys)
        try:
            return Keyframes(times, [keys[time] for time in times])
        except SceneError as error:
            self._losses.note(str(error), child.place, done="the first transform in its place")
            return keys[times[0]]

    def _include(self, child: Child) -> None:
        """Add the content of another file."""
        parent, tag, attributes, (path, depth, _) = child
        self._included += 1
        check_included(tag.place, self._files, self._included, depth)
        self.folders.append(path.parent)
        try:
            with placed(tag.place):
                file = self.find(attributes["filename"])
        finally:
            self.folders.pop()
        included = self._read(file, self._files.read(file), depth + 1)
        if included["type"] != "scene":
            _set(parent, attributes.get("name", ""), included, tag)
            return
        for key, value in included.items():
            if key not in ("type", "id"):
                _set(parent, "" if key.startswith(UNNAMED) else key, value, tag)

    def _add_folder(self, child: Child) -> None:
        """Add a folder in which files are looked for; whether they may be read is checked then."""
        name = child.attributes["value"]
        folders = (child.file.path.parent, *reversed(self.folders))
        places = [base / name.replace("\\", "/") for base in folders]
        folder = next((place for place in places if os.path.isdir(place)), None)
        if folder is None:
            raise SceneError(f"{child.place}: path is {name!r}; there is no such folder")
        self.folders.append(folder)

    def _substituted(self, tag: Tag) -> dict[str, str]:
        """Return the attributes of an element, each `$name` replaced by its value."""
        return {key: self._replaced(text, tag) for key, text in tag.attributes.items()}

    def _replaced(self, text: str, tag: Tag) -> str:
        """Return a text with the values of its parameters, which are charged to the budget of the load."""
        first, *rest = text.split("$")
        parts = [first]
        for piece in rest:
            if parts[-1].endswith("\\"):  # \\$ is a dollar sign
                parts[-1] = parts[-1][:-1]
                parts += ["$", piece]
                continue
            name = self._longest(piece, tag)
            value = self._values[name]
            self._files.budget.charge(f"{tag.place}: the value of ${name}", PER_BYTE * len(value))
            self._unused.discard(name)
            parts += [value, piece[len(name) :]]
        return "".join(parts)

    def _longest(self, text: str, tag: Tag) -> str:
        """Return the longest name of a parameter with which a text begins."""
        for length in range(min(len(text), MOST_LETTERS), 0, -1):
            if text[:length] in self._values:
                return text[:length]
        name = re.match(r"\w*", text)
        assert name is not None
        hint = did_you_mean(name[0], self._values)
        raise SceneError(f"{tag.place}: the parameter ${name[0]} has no value{hint}")


def parsed(name: str, data: bytes, losses: Losses) -> Tag:
    """Return the first element of an XML file, with all that is in it."""
    above: list[Tag] = []
    roots: list[Tag] = []
    at, line = 0, 1

    def begin(tag: str, attributes: dict[str, str], byte: int) -> None:
        nonlocal at, line
        line += data.count(b"\n", at, byte)
        at = byte
        element = Tag(tag, attributes, f"{name} line {line}")
        if len(above) >= MAX_DEPTH:
            raise LimitError(f"{element.place}: its elements are nested deeper than {MAX_DEPTH}")
        (above[-1].children if above else roots).append(element)
        above.append(element)

    def end(tag: str, byte: int) -> None:
        above.pop()

    try:
        look_through(name, data, begin, end)
    except SceneError as error:
        if not isinstance(error.__cause__, ExpatError) or not roots or not roots[0].children:
            raise
        losses.note(f"{error}".removeprefix(f"{name}: "), name, done="what follows is left out")
    return roots[0]


def _element(tag: Tag, **values: Any) -> Element:
    element = Element(values)
    element.place, element.tag = tag.place, OLD_TAGS.get(tag.name, tag.name)
    return element


def _as_text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool | np.bool_) else str(value)


def _unknown(name: str) -> str:
    where = "; it belongs in a <transform>" if name in OPERATIONS else did_you_mean(name, [*OBJECTS, *OTHERS])
    return f"<{name}> is no element of scenes{where}"


def _set(parent: Element, name: str, value: Any, tag: Tag, old: bool = False) -> None:
    """Set a parameter; without a name it gets one."""
    if not name:
        name = f"{UNNAMED}{parent.unnamed}"
        parent.unnamed += 1
    elif old:
        name = re.sub(r"(?<=[a-z])[A-Z]+", lambda match: "_" + match[0].lower(), name)
    if name in ("type", "id"):
        raise SceneError(f"{tag.place}: a parameter cannot be called {name!r}")
    if name in parent:
        raise SceneError(f"{tag.place}: {name} is given twice")
    parent[name] = value


def _upgraded(element: Element) -> Element:
    """Give a plugin of a version before 2 the parameters that it has now."""
    if element["type"] == "diffuse" and "diffuse_reflectance" in element:
        element["reflectance"] = element.pop("diffuse_reflectance")
    if element.keys() & TO_UV.keys():
        shift, scale = np.eye(4), np.eye(4)
        for key, at in TO_UV.items():
            if key in element:
                (shift if key.endswith("offset") else scale)[at] = element.pop(key)
        element["to_uv"] = scale @ shift
    return element


def _boolean(document: Document, child: Child) -> bool:
    text = child.attributes["value"].strip().lower()
    return one_of(f"{child.place}: {child.attributes['name']}", text, ("true", "false")) == "true"


def _integer(document: Document, child: Child) -> int:
    name, text = child.attributes["name"], child.attributes["value"]
    try:
        return int(text)
    except ValueError:
        raise SceneError(f"{child.place}: {name} is {text!r}; it must be an integer") from None


def _rgb(document: Document, child: Child) -> Element:
    values = child.numbers((1, 3))
    return _element(child.tag, type="rgb", value=values * (3 // len(values)))


def _spectrum(document: Document, child: Child) -> Element:
    attributes = {key: child.attributes[key] for key in ("value", "filename") if key in child.attributes}
    if len(attributes) != 1:
        raise SceneError(f"{child.place}: <spectrum> needs a value or a filename, and not both")
    return _element(child.tag, type="spectrum", **attributes)


def _vector(document: Document, child: Child) -> list[float]:
    return vector(child.place, child.attributes["name"], child.attributes, 0.0)


class Other(NamedTuple):
    """An element that is no plugin."""

    read: Callable[[Document, Child], Any]  # returns its value, or does what it says
    needed: tuple[str, ...] = ("name", "value")  # attributes
    optional: tuple[str, ...] = ()
    is_value: bool = True


OTHERS = {
    "float": Other(lambda document, child: child.numbers((1,))[0]),
    "integer": Other(_integer),
    "boolean": Other(_boolean),
    "string": Other(lambda document, child: child.attributes["value"]),
    "rgb": Other(_rgb),
    "point": Other(_vector, ("name",), ("value", "x", "y", "z")),
    "vector": Other(_vector, ("name",), ("value", "x", "y", "z")),
    "spectrum": Other(_spectrum, ("name",), ("value", "filename")),
    "transform": Other(Document._transform, ("name",)),
    "animation": Other(Document._animation, ("name",)),
    "ref": Other(Document._reference, ("id",), ("name",)),
    "include": Other(Document._include, ("filename",), ("name",), is_value=False),
    "alias": Other(Document._alias, ("id", "as"), is_value=False),
    "default": Other(Document._default, is_value=False),
    "path": Other(Document._add_folder, ("value",), is_value=False),
}

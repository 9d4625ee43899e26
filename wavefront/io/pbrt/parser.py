"""The statements of scene files of pbrt-v4, with those of the files that they include.

Source: pbrt.org, "pbrt-v4 Input File Format".
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import SceneError, in_brief
from ...core.files import decode_text
from ...core.suggestions import did_you_mean
from ..description.conversion import PlacedError, check_included, placed
from ..losses import Losses
from ..sources import SceneFiles

MOST = 1e100  # size of a number: the squares of larger ones overflow


class Form(NamedTuple):
    """The arguments of a statement, and the places where it may stand."""

    follows: str  # s a string, w, v a word, n a number, m a matrix, p parameters; ? where it may be absent
    in_world: bool | None = None  # after WorldBegin, before it, or both


STATEMENTS = {
    **dict.fromkeys(("Camera", "Film", "Sampler", "Integrator", "PixelFilter"), Form("sp", False)),
    **dict.fromkeys(("AttributeBegin", "AttributeEnd", "TransformBegin", "TransformEnd"), Form("", True)),
    **dict.fromkeys(("Material", "LightSource", "AreaLightSource", "Shape", "Attribute"), Form("sp", True)),
    **dict.fromkeys(("NamedMaterial", "ObjectBegin", "ObjectInstance"), Form("s", True)),
    **dict.fromkeys(("ObjectEnd", "ReverseOrientation"), Form("", True)),
    **dict.fromkeys(("MakeNamedMaterial", "MakeNamedMedium"), Form("sp")),
    **dict.fromkeys(("CoordinateSystem", "CoordSysTransform", "ColorSpace", "Include", "Import"), Form("s")),
    **dict.fromkeys(("Transform", "ConcatTransform"), Form("m")),
    **dict.fromkeys(("Translate", "Scale"), Form("nnn")),
    "Accelerator": Form("sp", False),
    "WorldBegin": Form("", False),
    "Identity": Form(""),
    "Rotate": Form("nnnn"),
    "LookAt": Form("nnnnnnnnn"),
    "TransformTimes": Form("nn"),
    "ActiveTransform": Form("w"),
    "Texture": Form("sssp"),
    "MediumInterface": Form("s?"),
    "Option": Form("sv"),
}
V2 = ("SurfaceIntegrator", "VolumeIntegrator", "Renderer", "Volume", "VolumeRegion")
OLD = dict.fromkeys(V2, "; it is one of pbrt-v2, and this reads pbrt-v4")
OLD["WorldEnd"] = "; it is one of pbrt-v3, and this reads pbrt-v4"
BLANK = re.compile(r"(?:[ \t\r\n]++|#[^\r\n]*+)*+")
TOKEN = re.compile(r'"(?:[^"\\\n]|\\.)*+"|[\[\]]|[^\s"\[\]]++')
LIST = re.compile(r"\[([-+.\deE\s]*+)\]")  # of numbers alone, the common case of long ones
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
ESCAPES = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "\\": "\\", "'": "'", '"': '"'}
NUMBERS = {  # types of parameters that are numbers, and how many make a value
    **{"integer": 1, "float": 1, "blackbody": 1, "point2": 2, "vector2": 2, "point3": 3, "vector3": 3},
    **{"normal3": 3, "point": 3, "vector": 3, "normal": 3, "rgb": 3, "color": 3, "normal2": 2},
}
TYPES = (*NUMBERS, "spectrum", "bool", "string", "texture")


@dataclass(frozen=True)
class Parameter:
    """A value of a statement."""

    type: str
    values: Any  # (n,) float64 of numbers, or a list of strings
    place: str
    optional: bool = False  # of `Attribute`, which is for several statements


@dataclass(frozen=True)
class Statement:
    """A statement with all that follows it."""

    name: str
    place: str  # file and line, for messages
    words: list[str]
    numbers: list[float]
    parameters: dict[str, Parameter]


def statements(files: SceneFiles, path: Path, data: bytes) -> Iterator[Statement]:
    """Yield the statements of a file in their order, in place of each `Include` those of that file.

    Raises
    ------
    SceneError
        If there are too many files. What is malformed is left out, and noted with file and line.
    """
    return _Reader(files).read(path, data, 0)


class _Reader:
    """Counts the files that are included."""

    def __init__(self, files: SceneFiles) -> None:
        self._files, self._included = files, 0

    def read(self, path: Path, data: bytes, depth: int) -> Iterator[Statement]:
        text = _Text(os.fspath(path), decode_text(data), self._files.losses)
        while (statement := text.sound_statement()) is not None:
            if statement.name not in ("Include", "Import"):
                yield statement
                continue
            content = None
            with self._files.losses.part(statement.place), placed(statement.place):
                self._included += 1
                check_included(statement.place, self._files, self._included, depth)
                file = self._files.find(statement.words[0])
                content = self._files.read(file)
            if content is None:
                continue
            if statement.name == "Import":
                yield Statement("AttributeBegin", statement.place, [], [], {})
            yield from self.read(file, content, depth + 1)
            if statement.name == "Import":
                yield Statement("AttributeEnd", statement.place, [], [], {})


class _Text:
    """A text that is read from its beginning to its end."""

    def __init__(self, name: str, text: str, losses: Losses) -> None:
        self._name, self._text, self._losses = name, text, losses
        self._at, self._line, self._counted = 0, 1, 0

    @property
    def _place(self) -> str:
        self._line += self._text.count("\n", self._counted, self._at)
        self._counted = self._at
        return f"{self._name} line {self._line}"

    def _error(self, message: str) -> SceneError:
        return PlacedError(f"{self._place}: {message}")

    def _peek(self) -> str:
        """Return the token that is next, "" at the end."""
        blank = BLANK.match(self._text, self._at)
        assert blank is not None
        self._at = blank.end()
        token = TOKEN.match(self._text, self._at)
        if token is None and self._at < len(self._text):
            raise self._error("the string has no end in its line")
        return "" if token is None else token[0]

    def _next(self) -> str:
        token = self._peek()
        self._at += len(token)
        return token

    def _string(self, what: str) -> str:
        token = self._peek()
        if not token.startswith('"'):
            raise self._error(f"{what} needs a string in quotes here, not {in_brief(token)}")
        self._at += len(token)
        return self._unquoted(token)

    def _unquoted(self, token: str) -> str:
        def plain(match: re.Match[str]) -> str:
            if match[1] not in ESCAPES:
                raise self._error(f"the string {token} has the unknown escape {match[0]!r}")
            return ESCAPES[match[1]]

        return re.sub(r"\\(.)", plain, token[1:-1])

    def _number(self, what: str) -> float:
        token = self._peek()
        if not NUMBER.fullmatch(token) or abs(float(token)) > MOST:
            raise self._error(f"{what} needs a number here, of at most {MOST:g}, not {in_brief(token)}")
        self._at += len(token)
        return float(token)

    def sound_statement(self) -> Statement | None:
        """Return the next statement that is not malformed, None at the end; others are noted."""
        while True:
            with self._losses.part():
                return self.statement()
            self._skip()

    def _skip(self) -> None:
        """Go on to the next word that may be a statement."""
        while True:
            try:
                token = self._peek()
            except PlacedError:
                self._at = (self._text.find("\n", self._at) + 1) or len(self._text)
                continue
            if not token or token in STATEMENTS:
                return
            self._at += len(token)

    def statement(self) -> Statement | None:
        """Return the next statement, None at the end."""
        name = self._peek()
        if not name:
            return None
        place = self._place
        if name not in STATEMENTS:
            hint = OLD.get(name) or did_you_mean(name, STATEMENTS)
            raise self._error(f"there is no statement {in_brief(name)}{hint}")
        self._next()
        words: list[str] = []
        numbers: list[float] = []
        parameters: dict[str, Parameter] = {}
        for kind in STATEMENTS[name].follows:
            if kind == "s" or (kind == "?" and self._peek().startswith('"')):
                words.append(self._string(name))
            elif kind in "wv":
                words.append(self._next())
            elif kind == "n":
                numbers.append(self._number(name))
            elif kind == "m":
                numbers = self._values("float", name, *self._words(name, place), place).tolist()
                if len(numbers) != 16:
                    raise self._error(f"{name} needs 16 numbers in brackets, not {len(numbers)}")
            elif kind == "p":
                parameters = self._parameters(name)
        return Statement(name, place, words, numbers, parameters)

    def _parameters(self, statement: str) -> dict[str, Parameter]:
        parameters: dict[str, Parameter] = {}
        while self._peek().startswith('"'):
            place = self._place
            declared = self._string(statement).split()
            values, plain = self._words(" ".join(declared), place)
            with self._losses.part(place), placed(place):
                if len(declared) != 2 or declared[0] not in TYPES:
                    raise SceneError(
                        f"{in_brief(' '.join(declared))} declares no parameter; it must be a type, "
                        f"which are {', '.join(TYPES)}, and a name"
                    )
                kind, name = declared
                if name in parameters:
                    raise SceneError(f"{name} is given twice")
                parameters[name] = Parameter(kind, self._values(kind, name, values, plain, place), place)
        return parameters

    def _words(self, name: str, place: str) -> tuple[list[str], bool]:
        """Return the words of a value or a list, and whether they can be nothing but numbers."""
        token = self._peek()
        whole = LIST.match(self._text, self._at) if token == "[" else None
        if whole is not None:
            self._at = whole.end()
            return whole[1].split(), True
        if token != "[":
            return [self._next()], False
        self._next()
        values = []
        while (token := self._next()) != "]":
            if token in ("", "["):
                raise PlacedError(f"{place}: the list of {name} has no end")
            values.append(token)
        return values, False

    def _values(self, kind: str, name: str, values: list[str], plain: bool, place: str) -> Any:
        """Return the values of a parameter of a type, given as words."""
        texts = bool(values) and values[0].startswith('"')
        if kind in NUMBERS or (kind == "spectrum" and not texts):
            if not plain:  # Python's numbers may have underscores
                values = [value.replace("_", "?") for value in values]
            return _numbers(kind, name, values, place)
        if kind == "bool":
            values = [value.strip('"') for value in values]
            if any(value not in ("true", "false") for value in values):
                raise PlacedError(f"{place}: {name} is {in_brief(values)}; it must be true or false")
            return values
        if any(not value.startswith('"') for value in values):
            raise PlacedError(f"{place}: {name} is {in_brief(values)}; it must be a string in quotes")
        return [self._unquoted(value) for value in values]


def _numbers(kind: str, name: str, values: list[str], place: str) -> np.ndarray:
    """Return numbers (n,), of which several may make one value."""
    try:
        numbers = np.array(values, np.float64)
    except ValueError:
        numbers = np.full(1, np.nan)
    if not np.isfinite(numbers).all():
        bad = next((word for word in values if not np.isfinite(_number(word))), "")
        raise PlacedError(f"{place}: {name} has {in_brief(bad)} where a finite number must be")
    count = NUMBERS.get(kind, 1)
    if len(numbers) % count:
        raise PlacedError(f"{place}: {name} has {len(numbers)} numbers; a {kind} has {count}")
    if kind == "integer" and ((numbers != np.floor(numbers)) | (np.abs(numbers) > 2**31)).any():
        raise PlacedError(f"{place}: {name} is {in_brief(values)}; it must be an integer of 32 bits")
    return numbers


def _number(text: str) -> float:
    """Return a number, NaN for what is none."""
    return float(text) if NUMBER.fullmatch(text) else np.nan

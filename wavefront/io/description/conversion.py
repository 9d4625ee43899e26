"""Parts of scene files of other renderers, with typed parameters, and the conversion of a scene of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from ...arrays.vec import Doubles
from ...bsdfs import Diffuse, Measured, NullSurface
from ...core.errors import LimitError, SceneError, exact, finite_array, in_brief, number, one_of
from ...core.plural import plural
from ...lights import Environment, Light, Sky
from ...materials import Material
from ...media import Isotropic
from ...shapes import Shape, Sphere
from ...textures.base import BaseTexture
from ...textures.image import StoredImage
from ..losses import Losses
from ..repair import RawMesh
from ..sources import GRAY as GRAY_PIXEL
from ..sources import SceneFiles
from ..spectra import read_spectrum

MOST_INCLUDED = 15  # files inside each other
GRAY = Material(Diffuse(0.5))
# what stands for a part that is not supported, by its kind, and what the warning says of it
INSTEAD: dict[str, tuple[Any, str]] = {
    **dict.fromkeys(("bsdf", "material"), (GRAY, "a gray Diffuse in its place")),
    **dict.fromkeys(("rfilter", "filter"), ({}, "the default in its place")),
    "texture": (0.5, "0.5 in its place"),
    "integrator": ({}, "path tracing in its place"),
    "phase": (Isotropic(), "isotropic in its place"),
    "shape": ((), "left out"),
    "sampler": ({}, "the default in its place"),
}
DIGITS = 3  # to which a number by a hair beyond its limit is rounded
NUMBERS, VECTORS = ("float", "integer"), ("point3", "vector3", "point", "vector")
P = TypeVar("P", bound="Part")
T = TypeVar("T")


class PlacedError(SceneError):
    """An error whose message names its place in a file."""


@contextmanager
def placed(place: str, name: str = "") -> Iterator[None]:
    """Give errors a place, unless they have one; `name`, or the file, at their beginning is left out."""
    try:
        yield
    except PlacedError:
        raise
    except SceneError as error:
        message = str(error).removeprefix(f"{name}: ").removeprefix(f"{place.rpartition(' line ')[0]}: ")
        raise PlacedError(f"{place}: {message}") from error


def check_included(place: str, files: SceneFiles, count: int, depth: int) -> None:
    """Refuse a file that is included where there are too many, or too many inside each other."""
    most = files.limits.includes
    if count > most:
        error = LimitError(f"{place}: includes more than {most} files; the limit is LoadLimits.includes")
        raise PlacedError(str(error)) from error
    if depth == MOST_INCLUDED:
        raise PlacedError(f"{place}: files include each other; the limit is {MOST_INCLUDED} levels")


class Part:
    """A part of a scene, such as a shape or a light, with its parameters."""

    kind: str  # what it is: a shape, a light, ...
    lost: Losses  # of the load
    label: str  # where it is, and what, for messages

    def lose(self, what: str) -> None:
        """Note something that is not honored."""
        raise NotImplementedError

    def one(self, name: str, default: Any, *types: str) -> Any:
        """Return one value of a parameter of some types, where the format has types."""
        raise NotImplementedError

    def or_default(self, default: T, read: Callable[[], T]) -> T:
        """Return what `read` returns; where it fails, that is noted, and the default stands in its place.

        Raises
        ------
        SceneError
            If there is no default.
        """
        try:
            return read()
        except SceneError:
            if default is None:
                raise
            with self.lost.part(self.label, done=f"{_brief(default)} in its place"):
                raise
        return default

    def number(self, name: str, default: float, holds: Any = None, limit: str = "") -> float:
        """Return a number."""

        def read() -> float:
            value = self.one(name, default, *NUMBERS)
            if holds is None:
                return number(name, value)
            found = number(name, value)
            near = round(found, DIGITS) + 0.0
            if holds(found) or not holds(near):
                return number(name, value, holds, limit)
            self.lost.note(name, self.label, exact(found), f"taken as {exact(near)}")
            return near

        return self.or_default(default, read)

    def whole(self, name: str, default: int, least: int = 0, most: int = 2**31) -> int:
        """Return a whole number."""
        limit = f"a whole number from {least} to {most}"
        return int(self.number(name, default, lambda x: x == int(x) and least <= x <= most, limit))

    def flag(self, name: str, default: bool = False) -> bool:
        """Return True or False."""

        def read() -> bool:
            value = self.one(name, default, "bool")
            return bool(one_of(name, bool(value) if isinstance(value, np.bool_) else value, (True, False)))

        return self.or_default(default, read)

    def text(self, name: str, default: str | None = None) -> str:
        """Return a string."""

        def read() -> str:
            value = self.one(name, default, "string")
            if not isinstance(value, str):
                raise SceneError(f"{name} is {in_brief(value)}; it must be a string")
            return value

        return read() if default is None else self.or_default(default, read)

    def choice(self, name: str, default: str, choices: tuple[str, ...]) -> str:
        """Return one of some strings."""
        return self.or_default(default, lambda: str(one_of(name, self.text(name, default), choices)))

    def vector(self, name: str, default: Any) -> Doubles:
        """Return a point or vector, (3,)."""
        read = lambda: finite_array(name, self.one(name, default, *VECTORS), (3,))  # noqa: E731
        return read() if default is None else self.or_default(np.asarray(default, np.float64), read)


def _brief(value: Any) -> str:
    """Return what a message says of a default."""
    if np.shape(value) == (4, 4):
        return "no transform"
    return str(np.asarray(value).tolist()) if np.ndim(value) else repr(value) if value != "" else "nothing"


@dataclass
class Conversion(Generic[P]):
    """The conversion of one scene."""

    name: str  # for messages
    files: SceneFiles
    find: Callable[[str], Path]  # the path of a file that the scene names
    read_mesh: Callable[[Path], list[RawMesh]]
    made: dict[Any, Any] = field(default_factory=dict)  # what was converted already
    making: list[P] = field(default_factory=list)  # what refers to what is converted now
    triangles: int = 0
    instances: int = 0
    instead: dict[str, tuple[Any, str]] = field(default_factory=lambda: dict(INSTEAD))

    def convert(self, part: P) -> Any:
        """Return what becomes of a part; the same object for the same part."""
        if part not in self.made:
            if part in self.making:
                raise SceneError(f"{part.label}: refers to itself")
            self.making.append(part)
            try:
                self.made[part] = self._sound(part)
            finally:
                self.making.pop()
        return self.made[part]

    def _sound(self, part: P) -> Any:
        """Return what becomes of a part; where it is damaged, what stands for it, which is noted."""
        if part.kind == "scene":
            with placed(part.label, self.name):
                return self.converted(part)
        try:
            with placed(part.label, self.name):
                return self.converted(part)
        except SceneError:
            make, done = self.stand_in(part)
            with self.files.losses.part(part.label, done):
                raise
        return make()

    def stand_in(self, part: P) -> tuple[Callable[[], Any], str]:
        """Return what makes that which stands for a damaged part, and what is said of it."""
        made, done = self.instead.get(part.kind.rpartition(" ")[2], (None, "left out"))
        return lambda: made, done

    def converted(self, part: P) -> Any:
        """Return what becomes of a part."""
        raise NotImplementedError

    def replaced(self, part: P, kind: str) -> Any:
        """Return what stands for a part that is not supported, which is noted."""
        made, what = self.instead.get(kind, (None, "left out"))
        part.lose(what)
        return made

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return what is made for a key, the same object for the same key."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def changed(self, material: Material, **parts: Any) -> Material:
        """Return a material with other parts, the same for the same ones."""

        def make() -> tuple[Material, Any]:
            other = copy(material)
            for name, value in parts.items():
                setattr(other, name, value)
            other.derive()
            return other, (material, parts)  # these are kept, as the key has their ids

        values = (value if isinstance(value, float) else id(value) for value in parts.values())
        made: Material = self.once((id(material), *parts, *values), make)[0]
        return made

    def picture(self, part: P, reference: str, instead: StoredImage = GRAY_PIXEL) -> StoredImage:
        """Return the image whose file a part names; a gray one if it is missing or damaged."""
        read = lambda: self.files.stored(self.find(reference))  # noqa: E731
        return self.files.shown(reference, read, part.label, instead) or instead

    def measured(self, part: P) -> Measured:
        """Return the BSDF of the measured material whose file a part names."""
        path = self.find(part.text("filename", ""))
        made: Measured = self.once(
            ("measured", path), lambda: Measured.from_bytes(str(path), self.files.read(path))
        )
        return made

    def spectrum(self, reference: str) -> list[tuple[float, float]]:
        """Return the wavelengths and values of a file."""
        path = self.find(reference)
        return read_spectrum(path, self.files.read(path))

    def count(self, faces: Any) -> None:
        """Refuse triangles that are too many with those before."""
        self.triangles += len(faces)
        self.files.limits.check_triangles(self.name, self.triangles)

    def count_instances(self, count: int) -> None:
        """Refuse instances that are too many with those before."""
        self.instances += count
        most = self.files.limits.instances
        if self.instances > most:
            raise LimitError(f"there are more than {most} instances; the limit is LoadLimits.instances")


def only_one(lights: Sequence[Light], losses: Losses) -> list[Light]:
    """Return lights with the first `Environment` alone; others are noted."""
    around = [light for light in lights if isinstance(light, Environment)]
    if len(around) > 1:
        found = plural(len(around) - 1, "further light from all around", "further lights from all around")
        losses.note(found, done="left out")
    return [light for light in lights if light not in around[1:]]


def shown(shapes: list[Shape], lights: Sequence[Light], losses: Losses) -> list[Shape]:
    """Return the shapes of a scene; one that is not seen where there is nothing but light from far away.

    Raises
    ------
    SceneError
        If there is neither.
    """
    if shapes:
        return shapes
    if not any(isinstance(each, Environment | Sky) for each in lights):
        raise losses.nothing("has no shapes")
    return [Sphere((0, 0, 0), 1, material=Material(NullSurface()), name="nothing")]


def textures_in(thing: Any, kind: type[T] = BaseTexture) -> list[T]:  # type: ignore[assignment]
    """Return the textures of a kind in a material, in a part of one, or in several of these."""
    found: dict[int, Any] = {}
    waiting = [thing]
    while waiting:
        part = waiting.pop()
        if id(part) not in found and (isinstance(part, tuple) or hasattr(part, "__dict__")):
            found[id(part)] = part
            inside = (
                () if isinstance(part, kind) else part if isinstance(part, tuple) else vars(part).values()
            )
            waiting += inside
    return [part for part in found.values() if isinstance(part, kind)]
